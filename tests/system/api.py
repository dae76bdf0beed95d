"""/api/v1 of a real server: the first instructor, people, a station that is enrolled and runs, and what is left of its
session."""

import gzip
import os
import re
import signal
import sqlite3
import time
import unittest

from arthron import call, wait_until
from asking import Asking, PASSWORD

STATION = "[station room-1]\ncase = arthrosis\ntrainee = ada"


class Api(Asking):
    def serve(self):
        return self.serve_web(STATION)

    def test_a_hall_from_its_first_start_to_the_report_of_a_session(self):
        server = self.serve()
        grace = self.make_first(server)
        self.assertEqual(self.get("/me", grace)["account"], {"name": "grace", "role": "instructor", "trainee": ""})
        days = (self.get("/server", grace)["certificate_until_utc_s"] - time.time()) / 86400
        self.assertAlmostEqual(days, 730, delta=1)

        # People.
        for trainee in ("ada", "eve"):
            self.ask("POST", "/trainees", {"name": trainee}, grace, 201)
        self.ask("POST", "/courses", {"name": "autumn"}, grace, 201)
        self.ask("POST", "/courses/autumn/trainees", {"trainee": "ada"}, grace, 204)
        account = {"name": "tom", "role": "technician", "password": PASSWORD}
        self.ask("POST", "/accounts", account, grace, 201)
        tom = self.sign_in(name="tom", password=PASSWORD)
        ada, eve = [self.sign_in(code=self.ask("POST", f"/trainees/{who}/code", {}, grace, 201).json["code"])
                    for who in ("ada", "eve")]
        self.assertEqual(self.get("/me", ada)["courses"], ["autumn"])
        self.ask("GET", "/accounts", who=ada, status=403)

        # A station, enrolled by the code that the page shows, and its session.
        self.assertFalse(self.get("/stations", tom)["stations"][0]["enrolled"])
        code = self.ask("POST", "/stations/room-1/code", {}, tom, 201).json["code"]
        call("arthron-station", "enrol", f"127.0.0.1:{self.port}", code, "--name", "room-1", "--keys",
             self.path("keys-room-1"))
        self.assertTrue(self.get("/stations", tom)["stations"][0]["enrolled"])
        self.start_mockup()
        self.start_station()
        wait_until("a running session", lambda: self.session()["state"] == "running")
        self.wait_for_steps(100)
        self.session_command("stop", "room-1")
        closed = wait_until("the closed session with its results", lambda: next(
            (s for s in self.get("/sessions", ada)["sessions"] if s["state"] == "closed" and s["trace_xxh3"]), None))
        self.assertEqual((closed["trainee"], closed["station"], closed["case"]), ("ada", "room-1", "arthrosis"))

        # What is left of it, to whom.
        at = "/sessions/" + closed["id"]
        one = self.get(at, ada)
        self.assertEqual(one["session"], closed)
        self.assertIn("time", {r["metric"].split(".")[0] for r in one["results"]})
        self.assertEqual(self.get("/sessions", eve)["sessions"], [])
        for part in ("", "/trace", "/report"):
            self.ask("GET", at + part, who=eve, status=404)
            self.ask("GET", at + part, who=tom, status=403)
        distributions = self.get("/distributions?case=arthrosis&course=autumn", grace)["distributions"]
        self.assertEqual(len(distributions), sum(r["value"] is not None for r in one["results"]))
        self.assertEqual(self.get("/distributions?case=arthrosis&course=autumn", ada), {"distributions": []})
        self.check_files(at, ada)

        # It ends: the station's certificate, a token, a cookie.
        self.ask("POST", "/stations/room-1/revoke", {}, tom, 204)
        self.assertFalse(self.get("/stations", tom)["stations"][0]["enrolled"])
        made = self.ask("POST", "/tokens", {"name": "night"}, grace, 201).json
        self.get("/accounts", made["token"])
        self.ask("DELETE", f"/tokens/{made['id']}", None, grace, 204)
        self.ask("GET", "/accounts", who=made["token"], status=401)
        self.ask("POST", "/sign-out", {}, tom, 204)
        self.ask("GET", "/stations", who=tom, status=401)
        audit = [(row["actor"], row["action"], row["subject"]) for row in self.get("/audit?limit=1000", grace)["audit"]]
        self.assertIn(("tom", "revoke", "station room-1"), audit)
        self.assertIn(("trainee 1", "sign in"), [row[:2] for row in audit])
        self.assertNotIn(PASSWORD, server.log())

        # A session that was deleted does not come back from its trace.
        self.ask("DELETE", at, None, ada, 403)
        self.assertTrue(any(name.endswith(closed["id"][:8] + ".trace") for name in os.listdir(self.traces)))
        self.ask("DELETE", at, None, grace, 204)
        self.assertEqual([name for name in os.listdir(self.traces) if closed["id"][:8] in name], [])
        self.assertEqual(server.end(), 0)
        self.serve()
        self.ask("GET", at, who=grace, status=404)

        # Somebody signs out everywhere, and an instructor signs others out.
        self.ask("POST", "/trainees/ada/sign-out", {}, grace, 204)
        self.ask("GET", "/me", who=ada, status=401)
        self.ask("POST", "/me/sign-out", {}, eve, 204)
        self.ask("GET", "/me", who=eve, status=401)
        self.get("/me", grace)

    def check_files(self, at, who):
        """Trace with Range, the report as a page that stands alone, the case's files packed and with their tag."""
        whole = self.ask("GET", at + "/trace", who=who)
        self.assertIn("attachment", whole.headers["Content-Disposition"])
        with open(self.path("copy.trace"), "wb") as file:
            file.write(whole.bytes)
        call("arthron-trace", "verify", self.path("copy.trace"))
        part = self.ask("GET", at + "/trace", who=who, status=206, headers={"Range": "bytes=100-199"})
        self.assertEqual(part.bytes, whole.bytes[100:200])
        report = self.ask("GET", at + "/report", who=who)
        self.assertIn("style-src 'unsafe-inline'", report.headers["Content-Security-Policy"])
        self.assertNotIn("script-src 'self'", report.headers["Content-Security-Policy"])
        self.assertIn(at.rsplit("/", maxsplit=1)[1], report.bytes.decode())
        model = self.ask("GET", "/cases/arthrosis/anatomy.glb", who=who, headers={"Accept-Encoding": "gzip"})
        with open(os.path.join(self.cases, "arthrosis/anatomy.glb"), "rb") as file:
            self.assertEqual(gzip.decompress(model.bytes), file.read())
        self.ask("GET", "/cases/arthrosis/anatomy.glb", who=who, status=304,
                 headers={"If-None-Match": model.headers["ETag"]})
        self.assertEqual(self.get("/cases", who)["cases"][0]["grade"], "unchecked")

    def test_who_is_signed_in_stays_so_over_a_killed_server(self):
        server = self.serve()
        grace = self.make_first(server)
        self.ask("POST", "/courses", {"name": "autumn"}, grace, 403, {"Origin": "https://evil.example.org"})
        server.end(signal.SIGKILL)
        server = self.serve()
        self.assertNotIn("/#/first/", server.log())
        self.assertEqual(self.get("/courses", grace)["courses"], [])

    def test_records_that_are_put_back_are_those_that_are_asked(self):
        server = self.serve()
        grace = self.make_first(server)
        call("arthron-server", "backup", "--file", self.path("records.db"), "--out", self.path("backup.db"))
        self.ask("POST", "/courses", {"name": "autumn"}, grace, 201)
        call("arthron-server", "restore", self.path("backup.db"), "--file", self.path("records.db"))
        self.assertEqual(self.get("/courses", grace)["courses"], [])
        self.assertEqual(server.end(), 0)
        said = call("arthron-server", "records", "--file", self.path("records.db"), "verify", "--keys", self.keys).stdout
        entries = re.search("the audit log is whole: ([0-9]+) entries", said)[1]
        self.assertIn(f"it is signed up to entry {entries} by ", said)
        self.assertIn(f"the audit log is signed up to entry {entries}, ", server.log())
        with sqlite3.connect(self.path("records.db")) as db:  # by somebody who has no key
            db.executescript("DROP TRIGGER audit_is_not_cut; DELETE FROM audit_seal; DELETE FROM audit WHERE id > 1;"
                             "UPDATE sqlite_sequence SET seq = 1 WHERE name = 'audit'")
        db.close()
        missing = f"entry {entries} of the audit log, which the server signed, is missing or was changed"
        self.assertIn(missing, call("arthron-server", "records", "--file", self.path("records.db"), "verify", "--keys",
                                    self.keys, code=1).stderr)
        self.serve().wait_for_log(missing)


if __name__ == "__main__":
    unittest.main(verbosity=2)
