"""What becomes of sessions is in the records, whatever happens to server and database meanwhile."""

import json
import os
import pwd
import signal
import sqlite3
import time
import unittest

from arthron import SystemTest, call, call_json, wait_until

STATION = "[station room-1]\ncase = arthrosis\ntrainee = ada-lovelace"


class Records(SystemTest):
    def setUp(self):
        super().setUp()
        self.db = self.path("records.db")

    def records(self, *words, code=0):
        return call("arthron-server", "records", "--file", self.db, *words, code=code)

    def rows(self, what):
        """A server that is just writing may keep them locked for longer than a command waits."""
        def listed():
            done = self.records("list", what, "--json", code=None)
            return done if done.returncode == 0 or "locked" not in done.stderr else None
        return json.loads(wait_until("the records", listed).stdout)

    def start_room(self):
        server = self.start_server(STATION, "records = records.db\nwait_s = 2")
        if not os.path.exists(self.path("keys-room-1")):
            self.start_mockup()
            self.enrol("room-1")
            self.station = self.start_station()
        wait_until("a running session", lambda: self.session()["state"] == "running")
        self.wait_for_steps(20)
        return server

    def in_state(self, state, count=1):
        """Those sessions; where they have ended, once their traces were read."""
        def there():
            rows = [s for s in self.rows("sessions") if s["state"] == state]
            ready = all(s["trace_xxh3"] or state == "open" for s in rows)
            return rows if len(rows) == count and ready else None
        return wait_until(f"{count} {state} sessions in the records", there)

    def sane(self):
        with sqlite3.connect(self.db) as db:
            self.assertEqual(db.execute("PRAGMA integrity_check").fetchall(), [("ok",)])
            self.assertEqual(db.execute("PRAGMA foreign_key_check").fetchall(), [])
        db.close()

    def assert_is_of_trace(self, row):
        """Against what others say of the trace: arthron-trace, and its bytes."""
        info = call_json("arthron-trace", "info", row["trace"])
        self.assertEqual(row["id"], info["session"])
        self.assertEqual(row["steps"], info["steps"])
        self.assertEqual(row["station"], "room-1")
        self.assertEqual(row["trainee"], "ada-lovelace")
        self.assertEqual(row["case"], "arthrosis")
        self.assertRegex(row["trace_xxh3"], "^[0-9a-f]{16}$")
        with open(row["trace"], "rb") as f:
            record = f.read()
        if row["state"] == "closed":
            self.assertEqual(row["trace_hash"], record[-32:].hex())
        self.assertRegex(row["trace_hash"], "^[0-9a-f]{64}$")
        score = json.loads(call("arthron-trace", "score", row["trace"], "--json", code=None).stdout)
        if row["state"] == "interrupted":
            score["metrics"] = []  # nobody has signed it
        shown = json.loads(self.records("show", "session", row["id"], "--json").stdout)["results"]
        self.assertCountEqual([(r["metric"], r["version"], r["unit"], r["value"]) for r in shown],
                              [(m["name"], m["version"], m["unit"], m["value"]) for m in score["metrics"]])

    def test_a_session_is_there_from_its_begin_through_backup_kill_and_restore(self):
        server = self.start_room()
        opened = self.in_state("open")[0]
        self.assertEqual(opened["id"], self.session()["id"])

        self.session_command("stop", "room-1")
        closed = self.in_state("closed")[0]
        self.assertEqual(set(closed), set(opened))
        self.assertEqual(closed["id"], opened["id"])
        self.assert_is_of_trace(closed)
        self.assertGreater(closed["end_utc_ns"], closed["start_utc_ns"])

        # A backup and a restore while a session runs: it goes on, and is in the restored records.
        # What began or ended since the backup comes back.
        self.session_command("start", "room-1")
        self.in_state("open")
        self.wait_for_steps(20)
        call("arthron-server", "backup", "--file", self.db, "--out", self.path("backup.db"))
        self.session_command("stop", "room-1")
        self.in_state("closed", 2)
        self.session_command("start", "room-1")
        self.wait_for_steps(20)
        going_on = self.session()["id"]
        self.records("add", "course", "after the backup")
        restored = call("arthron-server", "restore", self.path("backup.db"), "--file", self.db)
        self.wait_for_steps(20)
        self.assertEqual(self.session()["id"], going_on)
        self.assertEqual(self.rows("courses"), [])
        self.in_state("closed", 2)
        self.assertEqual(self.in_state("open")[0]["id"], going_on)
        aside = restored.stdout.split(": ", 1)[1].strip()
        self.assertIn("after the backup", call("arthron-server", "records", "--file", aside, "list", "courses").stdout)
        self.session_command("stop", "room-1")
        for row in self.in_state("closed", 3):
            self.assert_is_of_trace(row)

        # Killed, and for longer than a session waits: the next server closes its trace and signs it.
        self.session_command("start", "room-1")
        self.in_state("open")
        self.wait_for_steps(20)
        server.end(signal.SIGKILL)
        self.sane()
        killed_ns = time.time_ns()
        killed = self.in_state("open")[0]
        os.utime(killed["trace"], (0, 0))
        # A piece of a trace is no session.
        half = call_json("arthron-trace", "info", closed["trace"])["seconds"] / 2
        call("arthron-trace", "cut", closed["trace"], "--from", str(half), "--out", os.path.join(self.traces, "piece.trace"))
        server = self.start_room()
        lost = next(s for s in self.in_state("closed", 4) if s["id"] == killed["id"])
        self.assert_is_of_trace(lost)
        self.assertGreater(lost["end_utc_ns"], lost["start_utc_ns"])
        self.assertLess(lost["end_utc_ns"], killed_ns)
        self.assertIn("The session could not go on: no server resumed it within 2 s",
                      call("arthron-trace", "info", lost["trace"]).stdout)
        self.assertIn(closed, self.rows("sessions"))
        self.assertEqual(server.end(), 0)
        self.assertEqual([s["state"] for s in self.rows("sessions")], 5 * ["closed"])
        self.sane()

    def test_records_that_are_locked_damaged_or_lost_stop_no_session_and_get_all_of_it(self):
        with open(self.db, "w") as f:
            f.write("this is no database" * 100)
        server = self.start_room()
        server.wait_for_log("restore BACKUP --file " + self.db)
        self.session_command("stop", "room-1")
        os.unlink(self.db)
        server.wait_for_log("accept sessions again")
        self.assert_is_of_trace(self.in_state("closed")[0])

        lock = sqlite3.connect(self.db, isolation_level=None)
        lock.execute("BEGIN IMMEDIATE")
        self.session_command("start", "room-1")
        server.wait_for_log("has locked the records")
        self.wait_for_steps(20)
        self.session_command("stop", "room-1")
        self.assertEqual(len(self.rows("sessions")), 1)
        lock.execute("ROLLBACK")
        lock.close()
        self.in_state("closed", 2)

        # Who goes for good leaves a session that says so.
        self.session_command("start", "room-1")
        self.in_state("open")
        self.station.end()
        self.assert_is_of_trace(self.in_state("deserted")[0])
        self.assertEqual(server.end(), 0)
        self.sane()

        # Who did what is there from the moment on at which there were records again.
        user = pwd.getpwuid(os.getuid()).pw_name
        first, second, third = (f"station room-1 session {row['id']}" for row in self.rows("sessions"))
        self.assertEqual([(a["actor"], a["action"], a["subject"]) for a in self.rows("audit")], [
            ("server", "open", first), (user, "stop", first),
            ("server", "open", second), (user, "start", second), (user, "stop", second),
            ("server", "open", third), (user, "start", third), ("server", "end", third)])

    def test_a_changed_case_and_a_refused_undo_are_in_the_audit_log_and_other_refused_commands_are_not(self):
        self.more_cases = ("healthy",)
        self.start_room()
        self.session_command("case", "room-1", "healthy")
        session = self.session()["id"]
        self.session_command("pause", "room-1")
        self.session_command("case", "room-1", "none", code=1)
        self.session_command("undo", "room-1", code=1)  # nothing was cut
        self.session_command("stop", "room-1")
        self.session_command("pause", "room-1", code=1)
        self.in_state("closed", 2)
        wait_until("the stop in the audit log", lambda: self.rows("audit")[-1]["action"] == "stop")
        said = [(a["action"], a["subject"]) for a in self.rows("audit")][-4:]
        of_it = f"session {session}"
        self.assertEqual(said, [("case", f"station room-1 case healthy {of_it}"),
                                ("pause", f"station room-1 {of_it}"),
                                ("undo refused", f"station room-1 {of_it}"), ("stop", f"station room-1 {of_it}")])

    def test_a_session_that_the_records_do_not_know_yet_goes_on_after_a_kill(self):
        first = self.start_server(STATION, "records = records.db")
        writing = sqlite3.connect(self.db, isolation_level=None)
        wait_until("the tables", lambda: writing.execute("SELECT 1 FROM sqlite_master WHERE name = 'session'").fetchone())
        first.end()
        server = self.start_server(STATION, "records = records.db")
        writing.execute("BEGIN IMMEDIATE")  # so the recorder waits
        self.start_mockup()
        self.enrol("room-1")
        self.start_station()
        self.wait_for_steps(20)
        session = self.session()
        server.end(signal.SIGKILL)
        self.assertEqual(writing.execute("SELECT count(*) FROM session").fetchone(), (0,))
        writing.execute("ROLLBACK")
        writing.close()
        server = self.start_server(STATION, "records = records.db")
        self.assertEqual(self.session()["id"], session["id"])
        server.end()
        self.assertEqual(call_json("arthron-trace", "info", session["trace"])["resumes"], 1)
        self.assertEqual(len(self.rows("sessions")), 1)

    def test_a_copied_session_has_a_row_of_its_own(self):
        self.start_room()
        first = self.session()["id"]
        self.session_command("copy", "room-1", "--from", first)
        second = self.session()["id"]
        self.session_command("stop", "room-1")
        self.in_state("closed", 2)
        self.assertEqual([row["id"] for row in self.rows("sessions")], [first, second])
        said = wait_until("the audit log", lambda: [(a["action"], a["subject"]) for a in self.rows("audit")][-3:])
        of_it = f"station room-1 session {second}"
        self.assertEqual(said, [("open", of_it), ("copy", of_it), ("stop", of_it)])


if __name__ == "__main__":
    unittest.main(verbosity=2)
