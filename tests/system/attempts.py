#!/usr/bin/env python3
"""An attempt at a task, begun by command in a session that real programs play. The server is killed in the
middle; the attempt goes on, and its verdict is the one that the trace gives."""

import os
import signal
import sqlite3
import unittest
from contextlib import closing

from arthron import CASES, SystemTest, call, call_json, wait_until

TASK = """
[task]
title = Two looks
briefing = Look at the notch, then at the medial meniscus.
limit_s = 60
[pass]
time_s = 50
source = for a test
[goal notch]
see = notch
[goal meniscus]
see = body_medial
centre = 0.5
[error unseen]
tool = probe
unseen = yes
"""


class Attempts(SystemTest):
    def setUp(self):
        super().setUp()
        os.mkdir(self.path("tasks"))
        self.task = self.write("tasks/two-looks.ini", TASK)
        self.write("tasks/bad.ini", "[task]\ntitle = nothing\n")

    def run_programs(self):
        self.motion = self.path("looks.csv")
        call("arthron-case", "task", "check", self.task, "--case", os.path.join(CASES, "healthy"), "--motion",
             self.motion)
        self.start_mockup()
        self.restart()
        self.enrol("room-1")
        self.start_station()
        wait_until("a session", lambda: self.sessions() and self.session()["steps"] > 20)
        self.trace = self.session()["trace"]

    def restart(self):
        self.server = self.start_server(stations="[station room-1]\ncase = healthy\n", extra="tasks = tasks\nrecords = records.db")

    def judged(self):
        return call_json("arthron-trace", "judge", self.trace, code=None)

    def test_an_attempt_survives_a_kill_and_its_trace_gives_the_same_verdict(self):
        self.run_programs()
        self.assertIn("bad.ini", self.server.log())
        unknown = self.session_command("begin", "room-1", "none", code=1)
        self.assertEqual(unknown["text"], "there is no task none")
        self.session_command("begin", "room-1", "two-looks", "--left")
        again = self.session_command("begin", "room-1", "two-looks", code=1)
        self.assertEqual(again["text"], "station room-1: an attempt runs: two-looks")
        wait_until("the first goal", lambda: any(goal["met"] for one in self.judged() for goal in one["goals"]))
        self.server.end(signal.SIGKILL)
        self.restart()
        wait_until("its end", lambda: "attempt 1 at two-looks" in self.server.log(), 60)
        with closing(sqlite3.connect(self.path("records.db"))) as records, records:
            records.execute("INSERT INTO pass_mark VALUES ('two-looks', 1, 1, 'by hand', 'for a test', 40, 0, 0)")
            records.execute("INSERT INTO pass_mark VALUES ('two-looks', 2, 2, 'by hand', 'of another', 50, 0, 0)")
        exam = self.session_command("begin", "room-1", "two-looks", "--exam", code=1)
        self.assertIn("no exam that '' has begun asks for task 'two-looks' on case 'healthy'", exam["text"])
        self.session_command("begin", "room-1", "two-looks")
        self.session_command("leave", "room-1")
        self.session_command("begin", "room-1", "two-looks")
        self.session_command("stop", "room-1")
        self.server.end()
        first, second, third = call_json("arthron-trace", "judge", self.trace)
        self.assertEqual((first["end"], first["hand"], first["purpose"]), ("done", "left", "practice"))
        self.assertEqual(first["verdict"], first["recorded"])
        self.assertEqual((second["end"], second["purpose"]), ("stopped", "practice"))
        self.assertEqual((third["end"], third["number"]), ("stopped", 3))
        self.assertTrue(all(one["same"] for one in (first, second, third)))
        self.assertEqual((first["mark_version"], second["mark_version"]), (0, 1))
        with closing(sqlite3.connect(self.path("records.db"))) as records:
            rows = records.execute("SELECT number, task, verdict, errors, goals_met, mark_version, pass_time_s "
                                   "FROM attempt ORDER BY number").fetchall()
        self.assertEqual([row[2] for row in rows], [one["verdict"] for one in (first, second, third)])
        self.assertEqual(rows[0][:2] + rows[0][3:], (1, "two-looks", first["error_count"], 2, 0, 50))
        self.assertEqual(rows[1][5:], (1, 40))
        info = call_json("arthron-trace", "info", self.trace)
        self.assertEqual([one["verdict"] for one in info["attempts"]], [first["verdict"], "not yet", "not yet"])
        self.assertEqual(info["resumes"], 1)
        self.other_records_get_the_same_rows()

    def rows(self):
        try:
            with closing(sqlite3.connect(f"file:{self.path('records.db')}?mode=ro", uri=True)) as records:
                return records.execute("SELECT s.uuid, a.* FROM attempt a JOIN session s ON s.id = a.session_id "
                                       "ORDER BY number").fetchall()
        except sqlite3.OperationalError:  # they are just made
            return []

    def other_records_get_the_same_rows(self):
        before = self.rows()
        os.remove(self.path("records.db"))
        self.restart()
        wait_until("the rows", lambda: len(self.rows()) == len(before))
        self.assertEqual([row[:1] + row[3:] for row in self.rows()], [row[:1] + row[3:] for row in before])

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        path = super().station_config(name, datagrams, keys)
        with open(path) as f:
            text = f.read()
        return self.write(f"{name}.ini", text.replace("tool.probe = probe\ntool.punch = punch", "tool.scope = scope"))


if __name__ == "__main__":
    unittest.main()
