#!/usr/bin/env python3
"""A station describes a second probe, a basket punch and a curette: they touch and cut, are recorded, and all lists
have them by their names."""

import csv
import io
import unittest

import example_trace
from arthron import call, call_json, free_port, wait_until
from bites import Bites
from page import RECORDED, STATION, Browser

DESCRIBED = """
[instrument probe-2]
kind = tip
colour = 33aa55
[instrument basket]
kind = jaw
length_mm = 7
width_mm = 5
opening_deg = 40
[instrument curette]
kind = blade
length_mm = 5
width_mm = 4
thickness_mm = 1
"""
USUAL = {4: "probe", 5: "punch", 6: "shaver", 7: "knife", 8: "scope"}


class Instruments(Bites):
    described = DESCRIBED

    def server_config(self, stations="", extra=""):
        self.web_port = getattr(self, "web_port", None) or free_port()
        return super().server_config(stations, extra + f"records = records.db\n[web]\nport = {self.web_port}\n")

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        path = super().station_config(name, datagrams, keys)
        with open(path) as f:
            text = f.read()
        text = text.replace("punch.opening", "basket.opening").replace("tool.punch = punch", """
tool.probe-2 = punch
tool.basket = punch
tool.curette = punch
tip.curette = 0 0 -8 1 0 0 0""")
        return self.write(f"{name}.ini", self.described + text)

    def did(self, trace):
        table = call("arthron-trace", "export", trace, "--csv", "-", code=None).stdout  # 1 while it is written
        rows = list(csv.DictReader(io.StringIO(table)))
        touched = any(float(row["probe-2_nearest_mm"] or 9) < 0.2 for row in rows)
        return {row["job_blade"] for row in rows if row["job_blade"]} | ({"touch"} if touched else set())

    def test_they_touch_and_cut_and_the_record_replays(self):
        self.start_station()
        self.wait_for_cuts(1)
        recorded = self.session()["trace"]
        wait_until("all three", lambda: self.did(recorded) == {"basket", "curette", "touch"})
        browser = Browser(self.web_port, self.path("keys/authority.pem"))
        browser.first(self.server.log())
        page = browser.page()
        page.watch(STATION, station="room-1")
        page.read_until(lambda: page.moments and {9, 10, 11} <= set(page.moments[-1]["instruments"]))
        names = USUAL | {9: "probe-2", 10: "basket", 11: "curette"}
        self.assertEqual(page.sessions[-1]["instruments"], names)
        self.session_command("stop", "room-1")
        cuts = self.resection()["cuts"]
        session, metrics = self.session(), self.metrics()
        for name in ("probe-2", "basket", "curette"):
            self.assertGreater(metrics["present", name, 1][0], 0)
        page.watch(RECORDED, session=session["id"])
        page.read_until(lambda: page.sessions and page.moments)
        self.assertEqual(page.sessions[-1]["instruments"], names)
        page.close()
        self.server.end()
        self.assert_metrics_are_those_of(session["trace"], metrics)
        replay = call_json("arthron-trace", "replay", session["trace"])
        self.assertEqual(replay["verdict"], "identical")
        info = call_json("arthron-trace", "info", session["trace"])
        self.assertEqual(set(info["instruments"]), {"probe-2", "basket", "curette"})
        self.assertEqual(info["resections"][0]["cuts"], cuts)
        self.assertEqual(example_trace.figures_of(session["trace"]), example_trace.figures_of_info(session["trace"]))
        self.assertEqual(self.did(session["trace"]), {"basket", "curette", "touch"})
        report = self.path("report.html")
        call("arthron-trace", "report", session["trace"], "--out", report)
        with open(report) as f:
            self.assertIn("<h3>curette</h3>", f.read())

    def test_a_station_that_comes_back_with_others_gets_a_new_session(self):
        first = self.start_station()
        self.wait_for_cuts(1)
        before = self.session()
        first.end()
        self.described = DESCRIBED.replace("length_mm = 5", "length_mm = 6")
        self.start_station(label="again")
        wait_until("another session", lambda: self.session()["id"] != before["id"] and
                   self.session()["state"] == "running")
        self.wait_for_steps()
        self.assertEqual(call_json("arthron-trace", "info", before["trace"])["state"], "closed")
        copy = call("arthron-server", "session", "--socket", self.socket, "copy", "room-1", "--from", before["id"], code=1)
        self.assertIn("other instruments", copy.stderr)

    def test_a_bad_description_is_refused_with_its_reason(self):
        for change, reason in (("kind = tip", "[instrument probe-2] needs kind"),
                               ("length_mm = 7", "length_mm = 70: must be a number from 1 to 30"),
                               ("[instrument probe-2]", "the name is taken")):
            self.described = DESCRIBED.replace(change, {"kind = tip": "", "length_mm = 7": "length_mm = 70",
                                                        "[instrument probe-2]": "[instrument scope]"}[change])
            said = call("arthron-station", "check", "--config", self.station_config(), code=1)
            self.assertIn(reason, said.stdout + said.stderr)
        self.described = DESCRIBED
        said = call("arthron-station", "calibrate", "tip", "--config", self.station_config(), "--device", "nowhere",
                    "--channel", "curette", code=1)  # known by its name
        self.assertNotIn("unknown", said.stderr)


if __name__ == "__main__":
    unittest.main()
