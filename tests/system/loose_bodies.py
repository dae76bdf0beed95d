#!/usr/bin/env python3
"""A grasper that a station describes takes a loose body out of the knee, in real programs: what the server recorded is
judged, replays bit for bit, and pages are told where the loose bodies are."""

import csv
import io
import os
import unittest

from arthron import CASES, SystemTest, call, call_json, free_port, wait_until
from page import STATION, Browser

CASE = os.path.join(CASES, "loose-bodies")
TASK = """
[task]
title = One loose body
briefing = Take it out.
limit_s = 60
[pass]
time_s = 40
source = for a test
[goal out]
take_out = loose_1
[error dropped]
dropped = yes
"""
HANDS = """
[motion]
speed_mm_s = 150
joint_speed_deg_s = 60
[steps]
flex = 20
approach = grasper anterolateral
take = grasper loose_1
"""
GRASPER = """
[instrument grasper]
kind = jaw
cuts = no
length_mm = 10
width_mm = 4
opening_deg = 60
"""


class Loose(SystemTest):
    def server_config(self, stations="", extra=""):
        self.web_port = free_port()
        return super().server_config(stations, extra + f"records = records.db\n[web]\nport = {self.web_port}\n")

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        path = super().station_config(name, datagrams, keys)
        with open(path) as f:
            text = f.read()
        text = text.replace("punch.opening = 7", "grasper.opening = 46")
        text = text.replace("tool.probe = probe\ntool.punch = punch", "tool.grasper = grasper")
        return self.write(f"{name}.ini", GRASPER + text)

    def test_a_grasper_takes_a_loose_body_out(self):
        task, self.motion = self.write("one.ini", TASK), self.path("one.csv")
        call("arthron-case", "motion", self.write("hands.ini", HANDS), "--case", CASE, "--out", self.motion)
        self.start_mockup()
        server = self.start_server(stations=f"[case loose-bodies]\ndir = {CASE}\n[station room-1]\ncase = loose-bodies\n")
        self.enrol("room-1")
        self.start_station()
        browser = Browser(self.web_port, self.path("keys/authority.pem"))
        browser.first(server.log())
        page = browser.page()
        page.watch(STATION, station="room-1")
        wait_until("a session", lambda: self.sessions() and self.session()["steps"] > 100)
        trace = self.session()["trace"]

        def judged():
            return call_json("arthron-trace", "judge", trace, "--task", task, code=None)
        wait_until("it is out", lambda: judged()["end"] == "done")
        page.read_until(lambda: page.moments and page.moments[-1]["loose"][:1] == [2])
        self.assertEqual(page.sessions[-1]["loose"], ["loose_1", "loose_2", "loose_3"])
        self.assertEqual(page.moments[-1]["loose"], [2, 0, 0])
        page.close()
        self.session_command("stop", "room-1")
        server.end()
        found = judged()
        self.assertEqual((found["verdict"], found["error_count"]), ("passed", 0))
        self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")
        rows = list(csv.DictReader(io.StringIO(call("arthron-trace", "export", trace, "--csv", "-").stdout)))
        self.assertEqual([row["loose_1_state"] for row in (rows[0], rows[-1])], ["lying", "out"])
        self.assertEqual({row["loose_1_on"] for row in rows if row["loose_1_state"] == "held"}, {"grasper"})
        self.assertEqual({row["loose_2_state"] for row in rows}, {"lying"})


if __name__ == "__main__":
    unittest.main()
