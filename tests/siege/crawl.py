"""Everybody asks for everything: each identity by each route of the API, by own, others' and missing ids, then each
watch and command of /live. What belongs to others is answered byte for byte as what does not exist."""

import hashlib
import http.client
import os
import re
import shutil
import socket
import sqlite3
import time
import unittest

import yaml

from arthron import SOURCE
from hall import PASSWORD, Answer, Hall, some_address
from page import NOT_THERE, RECORDED, STATION, WALL, Page, piece
from siege import FULL, Siege

IDENTITIES = ("none", "code", "trainee", "technician", "instructor")
PATIENCE = 5  # times that a request is sent, a second apart, where the server says 429
STATIONS = "[station room-1]\ncase = healthy\ntrainee = ada\n[station room-2]\ncase = healthy\ntrainee = eve"

# What each identity is answered: for own/other/missing ids, where the path has one. A request that may change
# something has an empty object as its body, so 400 means that the identity may send it.
EXPECTED = """
POST   /sign-in                400  400          400          400          400
POST   /first                  400  400          400          400          400
GET    /sign-on                200  200          200          200          200
GET    /sign-on/start          404  404          404          404          404
GET    /sign-on/back           404  404          404          404          404
POST   /sign-out               204  204          204          204          204
GET    /me                     401  200          200          200          200
PATCH  /me                     401  400          400          400          400
POST   /me/sign-out            401  204          204          204          204
GET    /tokens                 401  200          200          200          200
POST   /tokens                 401  403          400          400          400
DELETE /tokens/*               401  204/404/404  204/404/404  204/404/404  204/404/404
GET    /accounts               401  403          403          200          200
POST   /accounts               401  403          403          400          400
PATCH  /accounts/*             401  403          403          400          400
DELETE /accounts/*             401  403          403          204/403/404  204/204/404
POST   /accounts/*/sign-out    401  403          403          204/403/404  204/204/404
GET    /trainees               401  403          403          403          200
POST   /trainees               401  403          403          403          400
PATCH  /trainees/*             401  403          403          403          400
DELETE /trainees/*             401  403          403          403          204/204/404
POST   /trainees/*/erase       401  403          403          403          200/200/404
POST   /trainees/*/sign-out    401  403          403          403          204/204/404
POST   /trainees/*/code        401  403          403          403          201/201/404
GET    /courses                401  403          403          403          200
POST   /courses                401  403          403          403          400
GET    /courses/*              401  403          403          403          200/200/404
PATCH  /courses/*              401  403          403          403          400
DELETE /courses/*              401  403          403          403          204/204/404
GET    /courses/*/export       401  403          403          403          200/200/404
GET    /courses/*/curriculum   401  200/404/404  200/404/404  403          200/200/404
PUT    /courses/*/curriculum   401  403          403          403          400
GET    /courses/*/progress     401  200/404/404  200/404/404  403          200/200/404
GET    /courses/*/agreement    401  403          403          403          200/200/404
POST   /courses/*/trainees     401  403          403          403          400
DELETE /courses/*/trainees/*   401  403          403          403          204/204/404
GET    /server                 401  200          200          200          200
GET    /servers                401  403          403          200          200
GET    /stations               401  403          403          200          200
POST   /stations/*/code        401  403          403          201/201/404  201/201/404
POST   /stations/*/revoke      401  403          403          409/409/404  409/409/404
POST   /stations/*/attempt     401  400          400          403          400
DELETE /stations/*/attempt     401  409          409          403          409/409/404
GET    /tasks                  401  200          200          200          200
GET    /tasks/*                401  404          404          404          404
GET    /tasks/*/mark           401  403          403          403          404
PUT    /tasks/*/mark           401  403          403          403          404
GET    /tasks/*/trials         401  403          403          403          404
GET    /tasks/*/contrast       401  403          403          403          404
GET    /tasks/*/expert         401  404          404          403          404
GET    /trainees/me/today      401  200          200          403          403
GET    /attempts               401  200          200          403          200
GET    /attempts/*/1           401  200/404/404  200/404/404  403          200/200/404
GET    /attempts/*/1/ratings   401  200/404/404  200/404/404  403          200/200/404
POST   /attempts/*/1/ratings   401  403          403          403          400
GET    /curve                  401  400          400          403          400
GET    /rate                   401  403          403          403          200
GET    /exams                  401  200          200          403          200
POST   /exams                  401  403          403          403          400
GET    /exams/*                401  200/404/404  200/404/404  403          200/200/404
DELETE /exams/*                401  403          403          403          204/204/404
POST   /exams/*/begin          401  403          403          403          400
POST   /exams/*/interventions  401  403          403          403          400
POST   /exams/*/release        401  403          403          403          409/409/404
GET    /cases                  401  200          200          200          200
GET    /cases/*                401  200/200/404  200/200/404  200/200/404  200/200/404
GET    /cases/*/case.json      401  200/200/404  200/200/404  200/200/404  200/200/404
GET    /cases/*/anatomy.glb    401  200/200/404  200/200/404  200/200/404  200/200/404
GET    /cases/*/check.json     401  404          404          404          404
GET    /peer/cases             401  403          403          403          403
GET    /peer/cases/*           401  403          403          403          403
POST   /peer/revocations       401  403          403          403          403
GET    /sessions               401  200          200          403          200
GET    /sessions/*             401  200/404/404  200/404/404  403          200/200/404
DELETE /sessions/*             401  403          403          403          204/204/404
GET    /sessions/*/trace       401  200/404/404  200/404/404  403          200/200/404
GET    /sessions/*/report      401  200/404/404  200/404/404  403          200/200/404
GET    /distributions          401  400          400          403          400
GET    /audit                  401  403          403          200          200
GET    /metrics                401  403          403          200          200
GET    /healthz                200  200          200          200          200
GET    /readyz                 200  200          200          200          200
GET    /openapi.json           200  200          200          200          200
"""


def table():
    """{(method, path): {identity: [own, other, missing]}}"""
    rows = {}
    for line in EXPECTED.strip().splitlines():
        method, path, *cells = line.split()
        numbers = [[int(n) for n in cell.split("/")] for cell in cells]
        rows[method, path] = {who: n * 3 if len(n) == 1 else n for who, n in zip(IDENTITIES, numbers, strict=True)}
    return rows


def routes():
    """{(method, path): roles}, as the description has them."""
    with open(os.path.join(SOURCE, "server/api/openapi.yaml"), encoding="utf-8") as file:
        paths = yaml.safe_load(file)["paths"]
    return {(method.upper(), re.sub("{[a-z]+}", "*", path.replace("{number}", "1"))): operation["x-role"]
            for path, item in paths.items() for method, operation in item.items() if method != "parameters"}


class Walker:
    """Requests over one connection, from another address before the limit of one is reached."""

    def __init__(self, hall):
        self.hall, self.connection, self.left = hall, None, 0

    def ask(self, method, path, body, headers):
        if not self.left:
            self.close()
            self.connection = http.client.HTTPSConnection("127.0.0.1", self.hall.web_port, context=self.hall.trust,
                                                          timeout=60, source_address=(some_address(), 0))
            self.left = 150
        self.left -= 1
        self.connection.request(method, "/api/v1" + path, body, headers)
        return Answer(self.connection.getresponse())

    def close(self):
        if self.connection:
            self.connection.close()


class Crawl(Hall, Siege):
    more_cases = ("arthrosis",)

    def setUp(self):
        super().setUp()
        self.server = self.serve(STATIONS)
        self.grace = self.make_first(self.server)
        self.made = 0
        self.walker = Walker(self)
        self.addCleanup(self.walker.close)
        for trainee, course in (("ada", "autumn"), ("eve", "winter")):
            self.done("POST", "/trainees", {"name": trainee}, self.grace)
            self.done("POST", "/courses", {"name": course}, self.grace)
            self.done("POST", f"/courses/{course}/trainees", {"trainee": trainee}, self.grace)
        self.names = {"trainee": "ada.l", "technician": "tom", "instructor": "iris"}
        for role, name in self.names.items():
            more = {"trainee": "ada"} if role == "trainee" else {}
            self.done("POST", "/accounts", {"name": name, "role": role, "password": PASSWORD, **more}, self.grace)
        self.code = self.done("POST", "/trainees/ada/code", {}, self.grace).json["code"]
        self.cookies = {who: self.enter(who) for who in IDENTITIES}
        self.asked = 0

    def enter(self, who):
        if who == "none":
            return None
        if who == "code":
            return self.done("POST", "/sign-in", {"code": self.code}, source=some_address()).cookie
        return self.sign_in(self.names[who], source=some_address()).cookie

    # ---- what there is

    def seed_session(self, trainee):
        """A closed session, as the server would have recorded it, with the trace of an older server."""
        self.made += 1
        name = f"{self.made:032x}"
        trace = self.path(name + ".trace")
        shutil.copy(os.path.join(SOURCE, "tests/corpus/trace/version3-steps.trace"), trace)
        with sqlite3.connect(self.db, timeout=20) as db:
            db.execute("INSERT OR IGNORE INTO station (name) VALUES ('room-1')")
            db.execute("INSERT OR IGNORE INTO knee_case (name, hash) VALUES ('healthy', '00000000000000ff')")
            db.execute("INSERT INTO session (uuid, station_id, trainee_id, case_id, start_utc_ns, end_utc_ns, state, "
                       "steps, missing, trace) VALUES (?, 1, (SELECT id FROM trainee WHERE name = ?), 1, ?, ?, "
                       "'closed', 10, 0, ?)", (name, trainee, self.made * 10**9, self.made * 10**9 + 1, trace))
            db.execute("INSERT INTO attempt (session_id, number, task, task_version, title, file_hash, purpose, hand, "
                       "first_step, last_step, begun_utc_ns, time_s, goals, goals_met, errors, sentinel, verdict, end, "
                       "pass_time_s, pass_errors, mark_version, figures, occurrences) VALUES (last_insert_rowid(), 1, "
                       "'centring', 1, 'Centring', ?, 'practice', 'right', 1, 9, ?, 5, 1, 1, 0, 0, 'passed', 'done', "
                       "60, 1, 0, '{}', '[]')", ("0" * 64, self.made * 10**9))
        db.close()
        return name

    def seed_exam(self, trainee):
        with sqlite3.connect(self.db, timeout=20) as db:
            row = db.execute("INSERT INTO exam (trainee_id, title, state, seed, created_utc_ns) VALUES "
                             "((SELECT id FROM trainee WHERE name = ?), 'Knee', 'planned', 7, 1)", (trainee,))
        db.close()
        return str(row.lastrowid)

    def fresh(self, kind, make):
        self.made += 1
        name = f"{kind}-{self.made}"
        self.done("POST", make[0], {**make[1], "name": name}, self.grace, source=some_address())
        return name

    def fresh_account(self, role):
        self.made += 1
        name = f"account-{self.made}"
        with sqlite3.connect(self.db, timeout=20) as db:  # to encode passwords takes long
            db.execute("INSERT INTO account (name, role, created_utc_ns) VALUES (?, ?, 1)", (name, role))
        db.close()
        return name

    def enter_again(self, who):
        """Number and value of another cookie of this identity, as if it had signed in once more."""
        self.made += 1
        cookie, now_ns = f"{self.made:064x}", time.time_ns()
        owner = {"account_id": ("account", self.names.get(who)), "trainee_id": ("trainee", "ada")}
        column = "trainee_id" if who == "code" else "account_id"
        table, name = owner[column]
        with sqlite3.connect(self.db, timeout=20) as db:
            row = db.execute(f"INSERT INTO token (kind, hash, {column}, created_utc_ns, until_utc_ns) VALUES ('cookie', "
                             f"?, (SELECT id FROM {table} WHERE name = ?), ?, ?)",
                             (hashlib.sha256(cookie.encode()).hexdigest(), name, now_ns, now_ns + 3600 * 10**9))
        db.close()
        return str(row.lastrowid), cookie

    def ids(self, method, path, who):
        """Own, other and missing names for the first * of a path; the second is a trainee."""
        changes = method != "GET"
        kind = path.split("/")[1]
        if kind == "tokens":
            other = "instructor" if who != "instructor" else "technician"
            return self.enter_again(who)[0], self.enter_again(other)[0], "99999"
        if kind == "accounts":
            return self.fresh_account("technician"), self.fresh_account("instructor"), "nobody"
        if kind == "trainees":
            return [self.fresh("trainee", ("/trainees", {})) if changes else name for name in ("ada", "eve")] + ["nobody"]
        if kind == "courses":
            own = [self.fresh("course", ("/courses", {})) if changes else name for name in ("autumn", "winter")]
            return own + ["nothing"]
        if kind == "stations":
            return "room-1", "room-2", "room-9"
        if kind == "tasks":
            return ("nothing",) * 3
        if kind == "exams":
            return self.seed_exam("ada"), self.seed_exam("eve"), "99999"
        if kind == "cases":
            return "healthy", "arthrosis", "nothing"
        return self.seed_session("ada"), self.seed_session("eve"), "f" * 32

    # ---- asking

    def send(self, method, path, who, cookie=None, **headers):
        sent = {"Origin": self.origin, **headers}
        cookie = cookie or self.cookies[who]
        if cookie and "Authorization" not in headers:
            sent["Cookie"] = "arthron=" + cookie
        self.asked += 1
        body = None if method in ("GET", "DELETE") else "{}"
        sent = {k: v for k, v in sent.items() if v is not None}
        for _ in range(PATIENCE):
            answer = self.walker.ask(method, path, body, sent)
            if answer.status != 429:
                break
            time.sleep(int(answer.headers["Retry-After"]))  # a fast machine meets the server's rate limit
        return answer

    def filled(self, method, path, name):
        if path == "/courses/*/trainees/*":
            if name.startswith("course-"):
                self.done("POST", f"/courses/{name}/trainees", {"trainee": "ada"}, self.grace, source=some_address())
            return f"/courses/{name}/trainees/ada"
        return path.replace("*", name)

    def stripped(self, answer, name):
        """All that an answer tells but the name that was asked for, and the time."""
        headers = sorted((k, v) for k, v in answer.headers.items() if k not in ("Date",))
        return answer.status, headers, answer.bytes.replace(name.encode(), b"NAME")

    def check_route(self, method, path, who, expected):
        may = expected[0] not in (401, 403)
        names = self.ids(method, path, who) if "*" in path and (may or expected[1] != expected[0]) else ("x",) * 3
        if "*" not in path:
            names = ("",)
        told = []
        for name, status in zip(names, expected):
            answer = self.send(method, self.filled(method, path, name), who)
            self.assertEqual(answer.status, status, (who, method, path, name, answer.bytes[:200]))
            told.append(self.stripped(answer, name))
        if len(told) == 3 and expected[0] < 300 and expected[1:] == [404, 404]:
            same = list(map(self.same_length, told[1:], names[1:]))
            self.assertEqual(same[0], same[1], (who, method, path))
        if path.endswith("sign-out") and "*" not in path and who != "none":
            self.cookies[who] = self.enter_again(who)[1]

    def same_length(self, told, name):
        """The names that are put into an answer may be of different lengths."""
        status, headers, body = told
        return status, [(k, "" if k == "Content-Length" and b"NAME" in body else v) for k, v in headers], body

    # ---- the crawl

    def test_routes_and_live_answer_everybody_as_they_should(self):
        rows, there = table(), routes()
        self.assertEqual(set(rows), set(there), "the table of this test lacks a route, or has one that is gone")
        for (method, path), roles in there.items():
            self.assertEqual(rows[method, path]["none"][0] == 401, roles not in (["anyone"], ["always"]), (method, path))
        for (method, path), cells in rows.items():
            for who in IDENTITIES:
                self.check_route(method, path, who, cells[who])
        self.figure("routes", len(rows))
        self.check_queries()
        self.check_envelopes(rows)
        self.figure("requests", self.asked)
        self.check_live()

    def check_queries(self):
        """Names in the query, of others and of nobody."""
        for who in ("code", "trainee"):
            own, others, missing = self.seed_session("ada"), self.seed_session("eve"), "e" * 32
            self.seed_session("ada")
            for path, other, none in (("/sessions?trainee=", "eve", "nobody"), ("/sessions?course=", "winter", "nothing"),
                                      ("/sessions?before=", others, missing),
                                      ("/distributions?case=healthy&course=", "winter", "nothing"),
                                      (f"/sessions/{own}/report?course=", "winter", "nothing")):
                told = [self.same_length(self.stripped(self.send("GET", path + name, who), name), name)
                        for name in (other, none)]
                self.assertEqual(told[0], told[1], (who, path))
            listed = self.send("GET", "/sessions?limit=500", who).json["sessions"]
            self.assertEqual({session["trainee"] for session in listed}, {"ada"})

    def check_envelopes(self, rows):
        """The same requests with other headers; by missing names, so that nothing changes."""
        tokens = {who: self.done("POST", "/tokens", {"name": "crawl"}, self.cookies[who]).json["token"]
                  for who in self.names}
        for (method, path), cells in rows.items():
            if path.endswith("sign-out") and "*" not in path:
                continue  # they end what the next ones need
            nothing = "99999" if path.startswith("/exams") else "nothing"  # these have numbers
            target = self.filled(method, path, nothing) if "*" in path else path
            for who in IDENTITIES if FULL else ("none", "trainee", "instructor"):
                status = cells[who][2]
                changes = method != "GET"
                refused = 403 if changes else status
                self.expect(421, method, target, who, Host="evil.example.org")
                self.expect(refused, method, target, who, Origin="https://evil.example.org")
                self.expect(refused if self.cookies[who] else status, method, target, who, Origin=None)
                if who in tokens:
                    self.expect(status, method, target, who, Origin=None, Authorization="Bearer " + tokens[who])

    def expect(self, status, method, path, who, **headers):
        answer = self.send(method, path, who, **headers)
        self.assertEqual(answer.status, status, (who, method, path, headers, answer.bytes[:200]))

    # ---- /live

    def live(self, who, host=None, origin="own", cookie="own"):
        """A page's connection; ConnectionError with the status where it is not let in."""
        name = host or f"localhost:{self.web_port}"
        headers = [f"Origin: {f'https://{name}' if origin == 'own' else origin}"] if origin else []
        if cookie and self.cookies[who]:
            headers.append("Cookie: arthron=" + self.cookies[who])
        return LivePage(self, name, headers)

    def refused(self, who, **more):
        with self.assertRaises(ConnectionError) as found:
            self.live(who, **more).close()
        return re.search(r" (\d{3}) ?", str(found.exception))[1]

    def check_live(self):
        self.assertEqual(self.refused("none"), "401")
        self.assertEqual(self.refused("instructor", host="evil.example.org"), "421")
        self.assertEqual(self.refused("instructor", origin="https://evil.example.org"), "403")
        self.assertEqual(self.refused("instructor", origin=None), "403")
        own, others = self.seed_session("ada"), self.seed_session("eve")
        for who in IDENTITIES[1:]:
            page = self.live(who)
            self.addCleanup(page.close)
            self.check_watches(page, who, own, others)
            self.check_commands(page, who)

    def trouble(self, page, what, name=""):
        page.watch(what, station=name if what == STATION else "", session=name if what == RECORDED else "")
        page.read_until(lambda: page.troubles or page.places)
        return [(kind, text.replace(name, "NAME") if name else text)
                for kind, text in zip(page.trouble_kinds, page.troubles)]

    def check_watches(self, page, who, own, others):
        is_staff = who in ("technician", "instructor")
        wall = self.trouble(page, WALL)
        self.assertEqual(wall, [] if is_staff else [(NOT_THERE, "the wall is for instructors and technicians")])
        told = [self.trouble(page, STATION, name) for name in ("room-2", "room-9")]
        if is_staff:
            self.assertEqual((told[0], told[1][0][0]), ([], NOT_THERE))
        else:
            self.assertEqual(told[0], told[1])
            self.assertEqual(told[0][0][0], NOT_THERE)
        told = [self.recorded(page, name) for name in (own, others, "f" * 32)]
        if who == "instructor":
            self.assertNotIn(NOT_THERE, [kind for of_one in told[:2] for kind, _ in of_one])
        else:
            self.assertEqual(told[1], told[2])
            self.assertEqual(told[1][-1], (NOT_THERE, "there is no session NAME that you may see"))
            self.assertEqual(told[0] == told[1], who == "technician", "a trainee sees their own")
        readers = [self.names["instructor"]] if who == "instructor" else []
        self.assertEqual([self.readers(name) for name in (own, others)], [readers] * 2)

    def readers(self, session):
        """Who has played or read this session of somebody else's, as the audit log says."""
        with sqlite3.connect(self.db, timeout=20) as db:
            rows = db.execute("SELECT actor FROM audit WHERE action = 'read' AND subject = ?", ("session " + session,))
            found = [actor for actor, in rows]
        db.close()
        return found

    def recorded(self, page, name):
        page.watch(RECORDED, session=name)
        page.read_until(lambda: page.done)
        return [(kind, text.replace(name, "NAME")) for kind, text in zip(page.trouble_kinds, page.troubles)]

    def check_commands(self, page, who):
        kinds = ("list", "start", "pause", "stop", "case", "reset", "show", "undo", "copy", "note", "assign")
        for kind, name in enumerate(kinds):
            looks = name in ("list", "show")
            told = [page.command(kind, station, case="healthy", more=piece(12, "ada")) for station in ("room-2", "room-9")]
            told = [(reply["ok"], reply["text"].replace(station, "NAME"))
                    for reply, station in zip(told, ("room-2", "room-9"))]
            if name == "stop" and who in ("code", "trainee"):
                self.assertEqual(told, [(False, "station NAME: it has no session of yours")] * 2, who)
            elif who in ("code", "trainee") or (who == "technician" and not looks):
                text = "that is for instructors" + (" and technicians" if looks else "")
                self.assertEqual(told, [(False, text)] * 2, (who, name))
            else:
                self.assertNotIn("that is for", told[0][1], (who, name))
        self.figure(f"commands of {who}", len(kinds))


class LivePage(Page):
    def __init__(self, hall, host, headers):
        plain = socket.create_connection(("127.0.0.1", hall.web_port), timeout=20)
        secure = hall.trust.wrap_socket(plain, server_hostname="localhost")
        super(Page, self).__init__(secure, "/live", host, "arthron-live.1", headers)
        self.batches = 0
        self.forget()


if __name__ == "__main__":
    unittest.main(verbosity=2)
