"""For the test openapi: every operation of /api/v1 as it is meant, at a server with a station that runs, and what only
some operations refuse. A test with it has ask, grace and server (openapi.py)."""

import json
import os
import re
import shutil
import time

from arthron import CASES, SOURCE, call, wait_until
from hall import PASSWORD

STATIONS = "[station room-1]\ncase = healthy\ntrainee = ada\n[station room-2]\ncase = healthy\n"
LEVELS = dict.fromkeys(("safety", "field_of_view", "camera_dexterity", "instrument_dexterity", "bimanual_dexterity",
                        "flow", "quality", "autonomy"), 3)
CHECKLIST = {"who": True, "station_check": True, "case_hash": True, "drift_mm": 0.3}
DEEP = {"error": "deep", "tool": "probe", "step": 4, "time_s": 2.5}
LOST = 14  # tasks that nobody can do: on a slow machine the wait for the next one is over before it is asked for
TASK = """
[task]
title = A look
briefing = Look at it.
limit_s = 60
[pass]
time_s = 50
source = for a test
[goal it]
see = {place}
"""


def bearer(token):
    return {"Authorization": "Bearer " + token}


class Calls:
    def prepare_files(self):
        """Cases of its own, of which one was checked, a task that an expert can do, and some that nobody can."""
        shutil.copytree(CASES, self.path("cases"))
        self.cases = self.path("cases")
        with open(os.path.join(self.cases, "healthy/check.json"), "w") as file:
            json.dump({"grade": "fit"}, file)
        os.mkdir(self.path("tasks"))
        for name, place in (("look", "notch"), *((f"lost-{i}", "nowhere") for i in range(LOST))):
            self.write(f"tasks/{name}.ini", TASK.format(place=place))

    def call_all(self):
        self.enter()
        self.people()
        self.own_account()
        self.courses()
        self.hall()
        self.sessions_and_figures()
        self.teaching()
        self.exams()

    # ---- people

    def enter(self):
        for path in ("/healthz", "/readyz", "/openapi.json"):
            answer = self.ask("GET", path, status=200)
        self.assertEqual(answer.json, self.whole)
        self.ask("GET", "/sign-on", status=200)
        for path in ("/sign-on/start", "/sign-on/back"):
            answer = self.ask("GET", path, status=303)  # its provider is away
            self.assertTrue(answer.headers["Location"].startswith("/#/sign-in?sign-on="))
        self.change("INSERT INTO account (name, role, created_utc_ns) VALUES ('tim', 'technician', 1)")
        secret = re.search(r"/#/first/([0-9a-f]{64})", self.server.log())[1]
        first = {"secret": secret, "name": "tim", "password": PASSWORD}
        self.ask("POST", "/first", first, status=409, code="conflict")
        self.grace = self.make_first(self.server)
        self.ask("POST", "/first", first, status=401, code="wrong_secret")
        self.ask("POST", "/sign-in", {"name": "grace", "password": "wrong"}, status=401, code="wrong_password")
        self.ask("POST", "/sign-in", {"code": "ABCD EFGH"}, status=401, code="wrong_code")
        cookie = self.cookie(self.ask("POST", "/sign-in", {"name": "grace", "password": PASSWORD}, status=200))
        self.ask("POST", "/sign-out", {}, cookie, 204)

    def account(self, name, role, **more):
        """A token of a new account."""
        self.ask("POST", "/accounts", {"name": name, "role": role, "password": PASSWORD, **more}, self.grace, 201)
        cookie = self.cookie(self.ask("POST", "/sign-in", {"name": name, "password": PASSWORD}, status=200))
        return bearer(self.ask("POST", "/tokens", {"name": "day"}, cookie, 201).json["token"])

    def people(self):
        ask, grace = self.ask, self.grace
        ask("POST", "/trainees", {"name": "ada", "full_name": "Ada Lovelace"}, grace, 201)
        ask("POST", "/trainees", {"name": "eve"}, grace, 201)
        ask("POST", "/trainees", {"name": "eve"}, grace, 409, "conflict")
        ask("GET", "/trainees", who=grace, status=200)
        ask("PATCH", "/trainees/{name}", {"full_name": "Eve"}, grace, 204, name="eve")
        ask("PATCH", "/trainees/{name}", {"name": "ada"}, grace, 409, "conflict", name="eve")
        code = ask("POST", "/trainees/{name}/code", {}, grace, 201, name="ada").json["code"]
        self.ada = self.cookie(ask("POST", "/sign-in", {"code": code}, status=200))
        ask("DELETE", "/accounts/{name}", None, grace, 409, "conflict", name="grace")  # the last instructor
        self.tom, self.iris = self.account("tom", "technician"), self.account("iris", "instructor")
        more = {"role": "trainee", "password": PASSWORD}
        ask("POST", "/accounts", {"name": "al", **more}, grace, 400, "wrong_field")
        ask("POST", "/accounts", {"name": "al", "trainee": "nobody", **more}, grace, 404, "not_found")
        ask("POST", "/accounts", {"name": "tom", "trainee": "ada", **more}, grace, 409, "conflict")
        ask("GET", "/accounts", who=self.tom, status=200)
        ask("PATCH", "/accounts/{name}", {"name": "timothy"}, self.tom, 204, name="tim")
        ask("PATCH", "/accounts/{name}", {"name": "tom"}, self.tom, 409, "conflict", name="timothy")
        ask("POST", "/accounts/{name}/sign-out", {}, self.tom, 204, name="timothy")
        ask("DELETE", "/accounts/{name}", who=self.tom, status=204, name="timothy")

    def own_account(self):
        ask, grace = self.ask, self.grace
        for who in (grace, self.ada):
            ask("GET", "/me", who=who, status=200)
            ask("GET", "/tokens", who=who, status=200)
        token = ask("POST", "/tokens", {"name": "night"}, grace, 201).json
        ask("DELETE", "/tokens/{id}", who=grace, status=204, id=token["id"])
        ask("POST", "/tokens", {"name": "night"}, self.ada, 403, "not_allowed")
        ask("PATCH", "/me", {"password": PASSWORD, "new_password": PASSWORD}, self.ada, 403, "not_allowed")
        ulla = self.account("ulla", "technician")
        while ask("POST", "/tokens", {"name": "night"}, ulla).status == 201:
            pass
        ask("POST", "/tokens", {"name": "night"}, ulla, 409, "conflict")
        ask("PATCH", "/me", {"password": "wrong", "new_password": PASSWORD}, ulla, 401, "wrong_password")
        ask("PATCH", "/me", {"password": PASSWORD, "new_password": PASSWORD}, ulla, 204)
        ulf = self.account("ulf", "technician")
        ask("POST", "/me/sign-out", {}, ulf, 204)

    def courses(self):
        ask, grace = self.ask, self.grace
        for name in ("autumn", "winter", "spring"):
            ask("POST", "/courses", {"name": name}, grace, 201)
        ask("POST", "/courses", {"name": "spring"}, grace, 409, "conflict")
        ask("PATCH", "/courses/{name}", {"name": "winter"}, grace, 409, "conflict", name="spring")
        ask("PATCH", "/courses/{name}", {"name": "summer"}, grace, 204, name="spring")
        ask("DELETE", "/courses/{name}", who=grace, status=204, name="summer")
        for trainee in ("ada", "eve"):
            ask("POST", "/courses/{name}/trainees", {"trainee": trainee}, grace, 204, name="autumn")
        ask("POST", "/courses/{name}/trainees", {"trainee": "eve"}, grace, 204, name="winter")
        ask("DELETE", "/courses/{name}/trainees/{trainee}", who=grace, status=204, name="winter", trainee="eve")
        ask("GET", "/courses", who=grace, status=200)
        ask("GET", "/courses/{name}", who=grace, status=200, name="autumn")

    # ---- the hall

    def hall(self):
        ask, grace = self.ask, self.grace
        ask("GET", "/server", who=self.ada, status=200)
        ask("GET", "/servers", who=self.tom, status=200)
        ask("GET", "/metrics", who=self.tom, status=200)
        ask("GET", "/metrics", who=self.tom, status=200, headers={"Accept": "application/openmetrics-text"})
        ask("POST", "/stations/{name}/revoke", {}, self.tom, 409, "conflict", name="room-2")
        code = ask("POST", "/stations/{name}/code", {}, self.tom, 201, name="room-1").json["code"]
        call("arthron-station", "enrol", f"127.0.0.1:{self.port}", code, "--name", "room-1", "--keys",
             self.path("keys-room-1"))
        ask("GET", "/stations", who=self.tom, status=200)
        self.files_of_cases()
        self.an_attempt_at_a_station()
        ask("POST", "/stations/{name}/revoke", {}, grace, 204, name="room-1")

    def files_of_cases(self):
        ask, tom = self.ask, self.tom
        wait_until("the cases", lambda: all(case["hash"] for case in ask("GET", "/cases", who=tom).json["cases"]))
        ask("GET", "/cases/{name}", who=tom, status=200, name="healthy")
        for file in ("case.json", "anatomy.glb", "check.json"):
            answer = ask("GET", "/cases/{name}/" + file, who=tom, status=200, name="healthy")
            same = {"If-None-Match": answer.headers["ETag"]}
            ask("GET", "/cases/{name}/" + file, who=tom, status=304, headers=same, name="healthy")

    def an_attempt_at_a_station(self):
        at = "/stations/{name}/attempt"
        self.ask("POST", at, {"task": "look"}, self.grace, 409, "conflict", name="room-1")
        self.ask("DELETE", at, who=self.grace, status=409, code="conflict", name="room-1")
        self.start_mockup()
        self.start_station(statuses=(0, 1))
        wait_until("a session", lambda: self.sessions() and self.session()["steps"] > 20)
        self.ask("POST", at, {"task": "look", "hand": "left"}, self.ada, 204, name="room-1")
        self.ask("DELETE", at, who=self.ada, status=204, name="room-1")
        self.session_command("stop", "room-1")

    # ---- sessions

    def seed_session(self, trainee, state="closed"):
        """Its id: as the server would have recorded it, with a trace of an earlier server."""
        self.seeded = getattr(self, "seeded", 0) + 1
        name, now_ns = f"{self.seeded:032x}", time.time_ns()
        trace = shutil.copy(os.path.join(SOURCE, "tests/corpus/trace/version3-steps.trace"), self.path(name + ".trace"))
        row = self.change(
            "INSERT INTO session (uuid, station_id, trainee_id, case_id, start_utc_ns, end_utc_ns, state, steps, "
            "missing, trace) SELECT ?, (SELECT min(id) FROM station), trainee.id, (SELECT min(id) FROM knee_case), ?, "
            "?, ?, 10, 0, ? FROM trainee WHERE name = ?", name, now_ns, now_ns, state, trace, trainee)
        self.change("INSERT INTO result VALUES (?, 'time', '', 1, 's', 9, '{}')", row)
        return name

    def seed_attempt(self, session, number=1, purpose="practice"):
        return self.change(
            "INSERT INTO attempt (session_id, number, task, task_version, title, file_hash, purpose, hand, first_step, "
            "last_step, begun_utc_ns, time_s, goals, goals_met, errors, sentinel, verdict, end, pass_time_s, "
            "pass_errors, mark_version, figures, occurrences) SELECT id, ?, 'look', 1, 'A look', ?, ?, 'right', 1, 9, "
            "?, 20, 1, 1, 0, 0, 'passed', 'done', 50, 0, 0, '{}', ? FROM session WHERE uuid = ?", number, "0" * 64,
            purpose, time.time_ns(), json.dumps([DEEP]), session)

    def sessions_and_figures(self):
        ask, grace = self.ask, self.grace
        closed = wait_until("the closed session", lambda: next((s for s in ask("GET", "/sessions", who=self.ada).json[
            "sessions"] if s["state"] == "closed" and s["trace_xxh3"]), None))
        ask("GET", "/sessions/{id}", who=self.ada, status=200, id=closed["id"])
        trace = {"id": closed["id"], "who": grace}
        ask("GET", "/sessions/{id}/trace", status=200, **trace)
        ask("GET", "/sessions/{id}/trace", status=206, headers={"Range": "bytes=0-99"}, **trace)
        ask("GET", "/sessions/{id}/trace", status=416, headers={"Range": "bytes=999999999-"}, **trace)
        ask("GET", "/sessions/{id}/report", status=200, **trace)
        ask("DELETE", "/sessions/{id}", who=grace, status=409, code="conflict", id=self.seed_session("ada", "open"))
        ask("DELETE", "/sessions/{id}", who=grace, status=204, id=self.seed_session("ada"))
        ask("DELETE", "/trainees/{name}", who=grace, status=409, code="conflict", name="ada")
        ask("GET", "/distributions", who=grace, status=200, query="?case=healthy&course=autumn")
        ask("GET", "/distributions", who=self.ada, status=404, code="not_found", query="?case=healthy&course=winter")
        ask("GET", "/audit", who=self.tom, status=200, query="?limit=1000")

    # ---- tasks, courses and exams

    def teaching(self):
        ask, grace = self.ask, self.grace
        self.of_ada, self.of_eve = self.seed_session("ada"), self.seed_session("eve")
        self.seed_attempt(self.of_ada)
        ask("GET", "/tasks", who=self.ada, status=200)
        ask("GET", "/tasks/{name}", who=self.ada, status=200, name="look")
        mark = {"kind": "by hand", "source": "the faculty", "time_s": 40, "errors": 1, "version": 0}
        ask("PUT", "/tasks/{name}/mark", mark, grace, 200, name="look")
        ask("PUT", "/tasks/{name}/mark", mark, grace, 409, "conflict", name="look")
        ask("GET", "/tasks/{name}/mark", who=grace, status=200, name="look")
        ask("GET", "/tasks/{name}/trials", who=grace, status=200, query="?time_s=30&errors=1", name="look")
        ask("GET", "/tasks/{name}/contrast", who=grace, status=200, query="?upper=autumn&lower=winter", name="look")
        ask("GET", "/tasks/{name}/expert", who=grace, status=200, query="?case=healthy", name="look")
        plan = {"version": 0, "state": "published", "tasks": [{"task": "look", "hands": "one"}, {"task": "lost-1"}]}
        ask("GET", "/courses/{name}/curriculum", who=self.ada, status=200, name="autumn")
        ask("PUT", "/courses/{name}/curriculum", plan, grace, 200, name="autumn")
        ask("PUT", "/courses/{name}/curriculum", plan, grace, 409, "conflict", name="autumn")
        ask("PUT", "/courses/{name}/curriculum", {**plan, "version": 1, "state": "draft"}, grace, 200, name="autumn")
        ask("GET", "/courses/{name}/progress", who=grace, status=200, name="autumn")
        ask("GET", "/courses/{name}/export", who=grace, status=200, query="?task=look&from=1", name="autumn")
        ask("GET", "/trainees/me/today", who=self.ada, status=200)
        ask("GET", "/attempts", who=self.ada, status=200, query="?limit=1&task=look")
        attempt = {"session": self.of_ada, "number": 1}
        ask("GET", "/attempts/{session}/{number}", who=self.ada, status=200, **attempt)
        ask("POST", "/attempts/{session}/{number}/ratings", {**LEVELS, "remark": "calm"}, grace, 201, **attempt)
        ask("POST", "/attempts/{session}/{number}/ratings", LEVELS, self.iris, 201, **attempt)
        for who in (grace, self.ada):
            ask("GET", "/attempts/{session}/{number}/ratings", who=who, status=200, **attempt)
        ask("GET", "/curve", who=self.ada, status=200, query="?task=look&course=autumn")
        ask("GET", "/curve", who=self.ada, status=404, code="not_found", query="?task=none")

    def exams(self):
        ask, grace = self.ask, self.grace
        plan = {"course": "autumn", "trainee": "ada", "title": "Final", "tasks": ["look"], "cases": ["healthy"],
                "raters": ["iris"], "seed": 5}
        ask("POST", "/exams", {**plan, "course": "winter"}, grace, 404, "not_found")
        spare, exam = ({"id": ask("POST", "/exams", plan, grace, 201).json["exam"]["id"]} for _ in range(2))
        ask("DELETE", "/exams/{id}", who=grace, status=204, **spare)
        ask("POST", "/exams/{id}/interventions", {"reason": "a fall"}, grace, 409, "conflict", **exam)
        ask("POST", "/exams/{id}/release", {}, grace, 409, "conflict", **exam)
        ask("POST", "/exams/{id}/begin", CHECKLIST, grace, 200, **exam)
        ask("POST", "/exams/{id}/begin", CHECKLIST, grace, 409, "conflict", **exam)
        ask("DELETE", "/exams/{id}", who=grace, status=409, code="conflict", **exam)
        ask("POST", "/exams/{id}/interventions", {"reason": "a fall"}, grace, 200, **exam)
        ask("GET", "/tasks/{name}/expert", None, self.ada, 409, "conflict", "?case=healthy", name="look")
        ask("GET", "/trainees/me/today", who=self.ada, status=200)
        self.rate(exam)
        ask("POST", "/exams/{id}/release", {}, grace, 200, **exam)
        for who in (grace, self.iris, self.ada):
            ask("GET", "/exams/{id}", who=who, status=200, **exam)
            ask("GET", "/exams", who=who, status=200)
        ask("GET", "/courses/{name}/agreement", who=grace, status=200, name="autumn")
        ask("POST", "/trainees/{name}/sign-out", {}, grace, 204, name="eve")
        ask("POST", "/trainees/{name}/erase", {}, grace, 200, name="eve")
        ask("POST", "/trainees", {"name": "max"}, grace, 201)
        ask("DELETE", "/trainees/{name}", who=grace, status=204, name="max")

    def rate(self, exam):
        """An attempt joins the exam, as the recorder writes it, and its rater rates it."""
        session = self.seed_session("ada")
        attempt, names = self.seed_attempt(session, purpose="exam"), {"session": session, "number": 1}
        self.change("UPDATE exam_task SET attempt_id = ? WHERE exam_id = ?", attempt, exam["id"])
        self.change("UPDATE exam SET state = 'done' WHERE id = ?", exam["id"])
        for who in (self.ada, self.iris, self.grace):
            self.ask("GET", "/exams/{id}", who=who, status=200, **exam)
            self.ask("GET", "/attempts/{session}/{number}", who=who, status=200, **names)
            self.ask("GET", "/attempts/{session}/{number}/ratings", who=who, status=200, **names)
        for what in ("trace", "report"):
            self.ask("GET", "/sessions/{id}/" + what, who=self.ada, status=403, code="not_allowed", id=session)
        self.ask("GET", "/rate", who=self.iris, status=200)
        at = "/attempts/{session}/{number}/ratings"
        self.ask("POST", at, LEVELS, self.grace, 409, "conflict", **names)
        self.ask("POST", at, LEVELS, self.iris, 201, **names)
