#!/usr/bin/env python3
"""What programs on the station's PC learn of an attempt while it runs: by the view, by OpenIGTLink, and by OpenIGTLink
from the recorded session. Of an exam: that it runs, and that it has ended."""

import json
import os
import re
import sqlite3
import time
import unittest
from contextlib import closing

from arthron import CASES, PATIENCE_S, Process, SystemTest, call, call_json, free_port, program, wait_until
from pyigtl_like import Client
from websocket import Viewer

TASK = """
[task]
title = Two looks
briefing = Look at the notch, then at the medial meniscus.
limit_s = 60
[pass]
time_s = 50
errors = 100
source = for a test
[goal notch]
see = notch
[goal meniscus]
see = body_medial
centre = 0.5
[error moved]
tool = scope
speed_mm_s = 2
near_mm = 30
"""


class ToldAttempts(SystemTest):
    def setUp(self):
        super().setUp()
        self.outlet, self.view_port = free_port(), free_port()
        os.mkdir(self.path("tasks"))
        task = self.write("tasks/two-looks.ini", TASK)
        self.motion = self.path("looks.csv")
        call("arthron-case", "task", "check", task, "--case", os.path.join(CASES, "healthy"), "--motion", self.motion)
        call("arthron-server", "records", "--file", self.path("records.db"), "add", "trainee", "ada")
        self.start_mockup()
        self.server = self.start_server(stations="[station room-1]\ncase = healthy\ntrainee = ada\n",
                                        extra="tasks = tasks\nrecords = records.db")
        self.enrol("room-1")
        self.start_station().wait_for_log("/view?token=")
        self.wait_for_steps(20)
        self.trace = self.session()["trace"]
        with open(self.path("keys-room-1/view.token")) as f:
            self.viewer = Viewer(self.view_port, f.read().strip())
        self.client = Client(self.outlet)

    def tearDown(self):
        self.viewer.close()
        super().tearDown()

    def station_config(self, *arguments, **named):
        path = super().station_config(*arguments, **named)
        with open(path) as f:
            text = f.read().replace("tool.probe = probe\ntool.punch = punch", "tool.scope = scope")
        return self.write(os.path.basename(path), f"{text}[view]\nport = {self.view_port}\n"
                                                  f"[openigtlink]\nport = {self.outlet}\n")

    def views_until(self, what, condition):
        """The attempts of all messages up to the first that is so."""
        end, seen = time.monotonic() + PATIENCE_S, []
        while time.monotonic() < end:
            seen.append(self.viewer.next()["attempt"])
            if condition(seen[-1]):
                return seen
        raise AssertionError(f"in vain: {what}; last {seen[-1]}")

    def judged(self):
        return call_json("arthron-trace", "judge", self.trace, code=None)

    @staticmethod
    def said(client, device):
        with client.lock:
            return [m.string for m in client.all if m.device == device]

    def test_what_happens_is_told_live_and_from_the_record_and_nothing_of_an_exam(self):
        self.views_until("a view without an attempt", lambda a: a is None)
        self.check_practice()
        self.check_exam()
        live = self.said(self.client, "attempt")
        self.session_command("stop", "room-1")
        self.session_command("start", "room-1")
        self.views_until("a new session without an attempt", lambda a: a is None)
        self.server.end()
        self.check_record(live)

    # ---- live

    def check_practice(self):
        self.session_command("begin", "room-1", "two-looks", "--left")
        seen = [a for a in self.views_until("the end", lambda a: a and a["end"]) if a]
        self.assertEqual({(a["number"], a["task"], a["title"], a["purpose"], a["hand"], a["limit_s"]) for a in seen},
                         {(1, "two-looks", "Two looks", 0, 1, 60)})
        met = [sum(a["goals"].values()) for a in seen]
        self.assertEqual((met, set(met)), (sorted(met), {0, 1, 2}))
        self.assertTrue(all(list(a["goals"]) == ["notch", "meniscus"] and a["verdict"] == 0 for a in seen[:-1]))
        self.assertGreater(len({a["time_ns"] for a in seen}), 50)  # it goes on between the server's words
        last = seen[-1]
        self.first = wait_until("the judged attempt", lambda: [a for a in self.judged() if a["end"] != "runs"])[0]
        self.assertEqual((last["end"], last["verdict"]), (1, 1))
        self.assertAlmostEqual(1e-9 * last["time_ns"], self.first["time_s"], delta=1e-4)
        self.assertEqual(last["errors"], {"moved": self.first["error_count"]})
        wait_until("its end by OpenIGTLink", lambda: "ended passed (done)" in self.said(self.client, "attempt"))
        self.check_words(self.said(self.client, "attempt"))
        figures = wait_until("its last figures", lambda: [f for f in map(json.loads, self.said(self.client, "progress"))
                                                          if f["ended"]])[0]
        self.assertAlmostEqual(figures.pop("time_s"), self.first["time_s"], delta=0.06)
        self.assertEqual(figures, {
            "number": 1, "task": "two-looks", "purpose": "practice", "hand": "left", "limit_s": 60, "ended": True,
            "goals": 2, "goals_met": 2, "errors": self.first["error_count"], "end": "done", "verdict": "passed"})

    def check_words(self, words):
        """Each once, in the order in which it happened. On a busy machine a count may be told with the next one."""
        self.assertEqual([w for w in words if not w.startswith("error")],
                         ["begun two-looks", "goal notch", "goal meniscus", "ended passed (done)"])
        counts = [int(re.fullmatch(r"error moved (\d+)", w)[1]) for w in words if w.startswith("error")]
        self.assertEqual((counts, counts[-1]), (sorted(set(counts)), self.first["error_count"]))
        self.assertGreater(counts[-1], 0)

    def check_exam(self):
        with closing(sqlite3.connect(self.path("records.db"), timeout=20)) as records, records:
            records.execute("INSERT INTO exam (id, trainee_id, title, state, seed, created_utc_ns) "
                            "SELECT 1, id, 'exam', 'begun', 1, 1 FROM trainee WHERE name = 'ada'")
            records.execute("INSERT INTO exam_task (exam_id, position, task, knee_case) VALUES (1, 1, 'two-looks', 'healthy')")
        before = len(self.said(self.client, "attempt")), len(self.said(self.client, "progress"))
        self.session_command("begin", "room-1", "two-looks", "--exam")
        seen = [a for a in self.views_until("the exam's end", lambda a: a and a["number"] == 2 and a["end"])
                if a["number"] == 2]
        exam = wait_until("the judged exam", lambda: [a for a in self.judged()[1:] if a["end"] != "runs"])[0]
        self.assertEqual((exam["purpose"], exam["end"], exam["verdict"]), ("exam", "done", "passed"))
        self.assertEqual({(a["purpose"], a["verdict"], len(a["goals"]), len(a["errors"])) for a in seen}, {(1, 0, 0, 0)})
        self.assertEqual({a["end"] for a in seen}, {0, 6})
        self.assertEqual(seen[-1]["time_ns"], 0)
        wait_until("its end by OpenIGTLink", lambda: self.said(self.client, "attempt")[-1] == "ended")
        self.assertEqual(self.said(self.client, "attempt")[before[0]:], ["begun two-looks", "ended"])
        wait_until("its last figures", lambda: json.loads(self.said(self.client, "progress")[-1])["ended"])
        self.check_withheld([f for f in map(json.loads, self.said(self.client, "progress")[before[1]:])
                             if f["number"] == 2])

    def check_withheld(self, figures):
        known = {"number", "task", "purpose", "hand", "limit_s", "ended"}
        self.assertEqual({frozenset(f) for f in figures}, {frozenset(known | {"time_s"}), frozenset(known)})
        self.assertTrue(all(f["ended"] != ("time_s" in f) for f in figures))

    # ---- recorded

    def check_record(self, live):
        serve = Process(self.folder, "serve", program("arthron-trace"), "serve", self.trace, "--port", "0", "--speed",
                        "10")
        self.processes.append(serve)
        serve.wait_for_log("waits for a client")
        client = Client(int(re.search(r"port (\d+)", serve.log())[1]))
        client.end()
        words = self.said(client, "attempt")
        self.check_words(words[:-2])
        self.assertEqual(words[-2:], ["begun two-looks", "ended"])
        self.assertEqual([w for w in words if not w.startswith("error")], [w for w in live if not w.startswith("error")])
        self.assertEqual(sum(w.startswith("error") for w in words), self.first["error_count"])
        self.check_withheld([f for f in map(json.loads, self.said(client, "progress")) if f["number"] == 2])


if __name__ == "__main__":
    unittest.main(verbosity=2)
