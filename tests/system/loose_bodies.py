#!/usr/bin/env python3
"""A grasper that a station describes takes a loose body out of the knee, in real programs: what the server recorded is
judged, replays bit for bit, and pages, viewers at the station and a recording (MCAP) tell where the loose bodies are."""

import csv
import io
import math
import os
import time
import unittest

from arthron import CASES, PATIENCE_S, SOURCE, SystemTest, call, call_json, free_port, wait_until
from page import STATION, Browser
from websocket import Viewer

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


CHANNEL = 9  # of the grasper
BONES = ("femur", "tibia", "patella")


def between(a, b):
    return math.dist([a[axis] for axis in "xyz"], [b[axis] for axis in "xyz"])


class Loose(SystemTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.case = os.path.join(cls.shared.name, "loose-bodies")
        call("arthron-case", "generate", os.path.join(SOURCE, "cases/loose-bodies"), "--out", cls.case)

    def setUp(self):
        super().setUp()
        self.view_port = free_port()

    def server_config(self, stations="", extra=""):
        self.web_port = free_port()
        return super().server_config(stations, extra + f"records = records.db\n[web]\nport = {self.web_port}\n")

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        path = super().station_config(name, datagrams, keys)
        with open(path) as f:
            text = f.read()
        text = text.replace("punch.opening = 7", "grasper.opening = 46")
        text = text.replace("tool.probe = probe\ntool.punch = punch", "tool.grasper = grasper")
        return self.write(f"{name}.ini", GRASPER + text + f"[view]\nport = {self.view_port}\n")

    def seen_by_a_viewer(self):
        """The messages to a viewer, until the first loose body is out."""
        with open(self.path("keys-room-1/view.token")) as f:
            viewer = Viewer(self.view_port, f.read().strip())
        seen, end = [], time.monotonic() + PATIENCE_S
        while not seen or seen[-1]["loose"].get(0, {}).get("state") != "out":
            self.assertLess(time.monotonic(), end)
            seen.append(viewer.next())
        viewer.close()
        return [view for view in seen if len(view["loose"]) == 3]

    def check_view(self, seen, rows):
        held = [view for view in seen if view["loose"][0]["state"] == "held"]
        self.assertEqual({view["loose"][0]["on"] for view in held}, {CHANNEL})
        for view in held:
            warped = view["instruments"][CHANNEL]["warped"]
            self.assertEqual(bool(warped), bool(view["loose"][0]["pose"]))
            self.assertTrue(not warped or between(view["loose"][0]["pose"], warped) < 15)
        self.assertIsNone(seen[-1]["loose"][0]["pose"])
        last, second = rows[-1], seen[-1]["loose"][1]
        bone = last["loose_2_on"]
        self.assertEqual((second["state"], BONES[second["on"]]), ("lying", bone))
        at = [{axis: float(last[f"{name}_t{axis}_mm"]) for axis in "xyz"} for name in ("loose_2", f"virtual_{bone}")]
        self.assertAlmostEqual(between(second["pose"], seen[-1]["bodies"][second["on"]]["virtual"]), between(*at), 3)

    def check_recording(self, trace, rows):
        import mcap
        out = self.path("a.mcap")
        call("arthron-trace", "export", trace, "--mcap", out, "--case", self.case)
        topics = mcap.read_recording(out)["topics"]
        told = [m for _, m in topics["/loose/loose_1"]["messages"]]
        self.assertEqual(topics["/loose/loose_1"]["schema"], "arthron.session.Loose")
        self.assertEqual([m["state"] for m in told if m["on"] == "grasper"], ["held", "out"])
        self.assertEqual({m["name"] for m in told}, {"loose_1"})
        inside = [row for row in rows if row["loose_1_state"] != "out"]
        poses = topics["/pose/loose_1"]["messages"]
        self.assertEqual(len(poses), len(inside))
        for row, (_, m) in zip(inside[::50], poses[::50]):
            self.assertAlmostEqual(m["translation"]["x"], float(row["loose_1_tx_mm"]) / 1000, 9)
        came = [(len(m["entities"]), len(m["deletions"])) for _, m in topics["/mesh/loose/loose_1"]["messages"]]
        self.assertEqual(came, [(1, 0), (0, 1)])
        self.assertEqual(len(topics["/mesh/loose/loose_2"]["messages"]), 1)

    def test_a_grasper_takes_a_loose_body_out(self):
        task, self.motion = self.write("one.ini", TASK), self.path("one.csv")
        call("arthron-case", "motion", self.write("hands.ini", HANDS), "--case", self.case, "--out", self.motion)
        self.start_mockup()
        server = self.start_server(stations=f"[case loose-bodies]\ndir = {self.case}\n[station room-1]\ncase = loose-bodies\n")
        self.enrol("room-1")
        browser = Browser(self.web_port, self.path("keys/authority.pem"))
        browser.first(server.log())
        page = browser.page()
        page.watch(STATION, station="room-1")
        self.start_station("room-1").wait_for_log("/view?token=")
        seen = self.seen_by_a_viewer()
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
        other = call("arthron-trace", "judge", trace, "--case", os.path.join(CASES, "healthy"), code=1)
        self.assertIn("it is of a case with 3 loose bodies, and healthy has 0", other.stderr)
        rows = list(csv.DictReader(io.StringIO(call("arthron-trace", "export", trace, "--csv", "-").stdout)))
        self.assertEqual([row["loose_1_state"] for row in (rows[0], rows[-1])], ["lying", "out"])
        self.assertEqual({row["loose_1_on"] for row in rows if row["loose_1_state"] == "held"}, {"grasper"})
        self.assertEqual({row["loose_2_state"] for row in rows}, {"lying"})
        self.check_view(seen, rows)
        if "ARTHRON_NODE" in os.environ:
            self.check_recording(trace, rows)


if __name__ == "__main__":
    unittest.main()
