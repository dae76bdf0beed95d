#!/usr/bin/env python3
"""Tasks on a case: an expert's hands pass, a novice's do not, and a session that real programs recorded is
judged as the hands were."""

import os
import unittest

from arthron import CASES, SOURCE, SystemTest, call, call_json, wait_until

# The bench `tasks` tries all.
TRIED = [os.path.join(SOURCE, f"cases/tasks/{name}.ini") for name in ("turning-70", "hands-swapped")]
HEALTHY = os.path.join(CASES, "healthy")
SHORT = """
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
"""


class Tasks(SystemTest):
    def check(self, path, *options, code):
        return call_json("arthron-case", "task", "check", path, "--case", HEALTHY, *options, code=code)

    def test_an_expert_passes(self):
        for path in TRIED:
            found = self.check(path, code=0)
            with self.subTest(task=found["task"]):
                self.assertEqual(found["verdict"], "passed")
                self.assertTrue(all(goal["met"] for goal in found["goals"]))

    def test_a_novice_does_not(self):
        for path in TRIED[:1]:
            found = self.check(path, "--novice", "2", code=1)
            with self.subTest(task=found["task"]):
                self.assertEqual(found["verdict"], "not yet")
                self.assertEqual(found["why"], "")

    def test_who_cannot_do_it_is_told_why(self):
        far = self.write("far.ini", SHORT + "within_mm = 8\nbeyond_mm = 5\nvarus_deg = 20\n")
        found = self.check(far, code=1)
        self.assertIn("[goal meniscus]", found["why"])
        lacks = self.write("lacks.ini", SHORT.replace("see = notch", "see = labrum"))
        done = call("arthron-case", "task", "check", lacks, "--case", HEALTHY, code=1)
        self.assertIn("task lacks: [goal notch]: the case has no landmark labrum", done.stderr)

    def test_a_recorded_session_is_judged(self):
        task, motion = self.write("short.ini", SHORT), self.path("short.csv")
        planned = self.check(task, "--motion", motion, code=0)
        self.motion = motion
        self.start_mockup()
        server = self.start_server(stations="[station room-1]\ncase = healthy\n")
        self.enrol("room-1")
        self.start_station()
        wait_until("a session", lambda: self.sessions() and self.session()["steps"] > 100)
        trace = self.session()["trace"]

        def judged():
            return call_json("arthron-trace", "judge", trace, "--task", task, code=None)
        wait_until("both goals", lambda: judged()["end"] == "done")
        self.session_command("stop", "room-1")
        server.end()
        found = call_json("arthron-trace", "judge", trace, "--task", task)
        self.assertEqual(found["verdict"], "passed")
        self.assertEqual([goal["name"] for goal in found["goals"]], [goal["name"] for goal in planned["goals"]])

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        path = super().station_config(name, datagrams, keys)
        with open(path) as f:
            text = f.read()
        return self.write(f"{name}.ini", text.replace("tool.probe = probe\ntool.punch = punch", "tool.scope = scope"))


if __name__ == "__main__":
    unittest.main()
