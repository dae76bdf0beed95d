"""A course at a real server, by people who sign in: from the first attempt to the gate that opens, and an exam that is
withheld, released, and whose signature openssl verifies. Attempts are written into the records, as the recorder does."""

import hashlib
import json
import os
import sqlite3
import struct
import subprocess
import unittest

from arthron import call, call_json, wait_until
from asking import Asking

STATION = "[station room-1]\ncase = healthy\ntrainee = ada"
TASK = """
[task]
title = {title}
briefing = Look at the notch.
limit_s = 60
[pass]
time_s = 50
source = for a test
[goal notch]
see = notch
"""
SESSIONS = {"ada": "a" * 32, "eve": "e" * 32}


class Course(Asking):
    def setUp(self):
        super().setUp()
        os.mkdir(self.path("tasks"))
        for name in ("look", "probe"):
            self.write(f"tasks/{name}.ini", TASK.format(title=name.capitalize()))

    def serve(self):
        return self.serve_web(STATION, "tasks = tasks")

    def change(self, sql, *values):
        with sqlite3.connect(self.path("records.db"), timeout=20) as db:
            db.execute(sql, values)
        db.close()

    def make_sessions(self, case_hash):
        self.change("INSERT OR IGNORE INTO station (name) VALUES ('room-1')")
        self.change("INSERT OR IGNORE INTO knee_case (name, hash) VALUES ('healthy', ?)", case_hash)
        for who, uuid in SESSIONS.items():
            self.change("INSERT INTO session (uuid, station_id, trainee_id, case_id, start_utc_ns, end_utc_ns, state, "
                        "steps, missing, trace) SELECT ?, station.id, trainee.id, knee_case.id, 1, 2, 'closed', 9, 0, "
                        "'none' FROM station, trainee, knee_case WHERE trainee.name = ?", uuid, who)

    def attempt(self, number, task="look", hand="right", verdict="passed", who="ada"):
        self.change("INSERT INTO attempt (session_id, number, task, task_version, title, file_hash, purpose, hand, "
                    "first_step, last_step, begun_utc_ns, time_s, goals, goals_met, errors, sentinel, verdict, end, "
                    "pass_time_s, pass_errors, mark_version, figures, occurrences) SELECT id, ?, ?, 1, ?, ?, 'practice', "
                    "?, 1, 9, ?, 20, 1, 1, 0, 0, ?, 'done', 50, 0, 0, '{}', '[]' FROM session WHERE uuid = ?",
                    number, task, task, "0" * 64, hand, number * 10**9, verdict, SESSIONS[who])

    def join_exam(self, number, verdict="passed"):
        """An attempt of the exam, as the recorder writes it."""
        self.attempt(number, verdict=verdict)
        self.change("UPDATE attempt SET purpose = 'exam' WHERE number = ?", number)
        self.change("UPDATE exam_task SET attempt_id = (SELECT max(id) FROM attempt)")
        self.change("UPDATE exam SET state = 'done'")

    def people(self):
        grace = self.make_first(self.serve())
        for trainee in SESSIONS:
            if trainee not in [t["name"] for t in self.get("/trainees", grace)["trainees"]]:
                self.ask("POST", "/trainees", {"name": trainee}, grace, 201)
        self.ask("POST", "/courses", {"name": "autumn"}, grace, 201)
        self.ask("POST", "/courses/autumn/trainees", {"trainee": "ada"}, grace, 204)
        ada = self.sign_in(code=self.ask("POST", "/trainees/ada/code", {}, grace, 201).json["code"])
        return grace, ada

    def test_a_trainee_from_the_first_attempt_to_the_gate(self):
        grace, ada = self.people()
        self.make_sessions("0" * 16)
        self.assertEqual([t["name"] for t in self.get("/tasks", ada)["tasks"]], ["look", "probe"])
        self.assertEqual(self.get("/trainees/me/today", ada)["courses"], [])
        plan = {"version": 0, "state": "published", "tasks": [{"task": "look", "hands": "one"}, {"task": "probe"}]}
        self.ask("PUT", "/courses/autumn/curriculum", plan, ada, 403)
        self.ask("PUT", "/courses/autumn/curriculum", plan, grace)

        def next_task():
            today = self.get("/trainees/me/today", ada)["courses"][0]
            return today["next"]["task"], today["next"]["passes_done"], today["next"]["hand"]
        self.assertEqual(next_task(), ("look", 0, "either"))
        for number, verdict, then in ((1, "passed", ("look", 1, "either")), (2, "not yet", ("look", 0, "either")),
                                      (3, "passed", ("look", 1, "either")), (4, "passed", ("probe", 0, "right"))):
            self.attempt(number, verdict=verdict)
            self.assertEqual(next_task(), then)
        self.attempt(1, who="eve")
        self.assertEqual(len(self.get("/attempts", ada)["attempts"]), 4)
        self.assertEqual(len(self.get("/attempts", grace)["attempts"]), 5)
        self.ask("GET", f"/attempts/{SESSIONS['eve']}/1", who=ada, status=404)
        self.ask("GET", "/tasks/look/trials", who=ada, status=403)
        cells = self.get("/courses/autumn/progress", grace)["trainees"][0]["cells"]
        self.assertEqual([c["state"] for c in cells], ["passed", "empty"])
        self.ask("POST", "/trainees/ada/erase", {}, grace)
        listed = call_json("arthron-server", "records", "--file", self.path("records.db"), "list", "attempts", "--json")
        self.assertEqual([a["trainee"] for a in listed], ["eve"])

    def test_an_exam_is_withheld_and_released_with_a_signature_that_openssl_verifies(self):
        grace, ada = self.people()
        case = wait_until("the case", lambda: next(c for c in self.get("/cases", grace)["cases"]
                                                   if c["name"] == "healthy" and c["hash"]))
        self.make_sessions(case["hash"])
        exam = {"course": "autumn", "trainee": "ada", "title": "Final", "tasks": ["look"], "cases": ["healthy"], "seed": 5}
        self.ask("POST", "/exams", exam, ada, 403)
        at = f"/exams/{self.ask('POST', '/exams', exam, grace, 201).json['exam']['id']}"
        checklist = {"who": True, "station_check": True, "case_hash": True, "drift_mm": 0.3}
        self.ask("POST", at + "/begin", {**checklist, "drift_mm": 9}, grace, 400)
        begun = self.ask("POST", at + "/begin", checklist, grace).json["exam"]
        self.assertEqual(begun["items"][0]["case_hash"], case["hash"])
        self.join_exam(7)
        for what in (self.get(at, ada)["exam"]["items"][0], self.get("/attempts", ada)["attempts"][0]):
            self.assertIsNone(what["verdict"])
        self.ask("POST", at + "/release", {}, ada, 403)
        result = self.ask("POST", at + "/release", {}, grace).json["exam"]["result"]
        self.assertEqual(self.get(at, ada)["exam"]["verdict"], "passed")
        self.assertEqual(json.loads(result["text"])["items"][0]["attempt"]["number"], 7)
        self.assertEqual(hashlib.sha256(result["text"].encode()).hexdigest(), result["hash"])
        self.assert_is_signed(result, int(at.split("/")[2]))
        self.processes[0].end()  # the end signs the audit log
        verify = ("arthron-server", "records", "--file", self.path("records.db"), "verify", "--keys", self.keys)
        self.assertIn("the results of 1 exams are signed", call(*verify).stdout)
        self.change("UPDATE exam SET result = replace(result, 'passed', 'not yet')")
        self.assertIn("the result of exam 1 was changed", call(*verify, code=1).stderr)

    def assert_is_signed(self, result, number):
        def openssl(*arguments):
            return subprocess.run(("openssl",) + arguments, cwd=self.folder, capture_output=True, text=True)
        for name in ("certificate", "signature"):
            with open(self.path(name), "wb") as f:
                f.write(bytes.fromhex(result[name]))
        with open(self.path("message"), "wb") as f:
            f.write(b"arthron exams, end" + bytes.fromhex(result["hash"]) + struct.pack("<QQ", number, 0))
        openssl("x509", "-inform", "DER", "-in", "certificate", "-out", "certificate.pem")
        with open(self.path("public.pem"), "w") as f:
            f.write(openssl("x509", "-in", "certificate.pem", "-pubkey", "-noout").stdout)
        chain = openssl("verify", "-CAfile", os.path.join(self.keys, "authority.pem"), "certificate.pem")
        self.assertEqual(chain.returncode, 0, chain.stderr)
        check = ("dgst", "-sha256", "-verify", "public.pem", "-signature", "signature", "message")
        self.assertEqual(openssl(*check).returncode, 0)
        with open(self.path("message"), "ab") as f:
            f.write(b"!")
        self.assertEqual(openssl(*check).returncode, 1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
