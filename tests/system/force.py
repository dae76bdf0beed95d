#!/usr/bin/env python3
"""A station sends the force of its probe and on the tibia: pages show it, the trace keeps it to the bit, and its figures
are those of the table, wherever they are."""

import csv
import io
import json
import math
import os
import struct
import subprocess
import sys
import threading
import time
import unittest

from arthron import SOURCE, SystemTest, call, call_json, free_port, wait_until
from page import STATION, Browser
from share import example, pb

PROBE, TIBIA = 4, 2
FREE, TOUCHING = 30, 60  # frames
HELD, LOST = range(70, 76), range(80, 84)


class Pressing(example.Station):
    """Its probe comes nearer by the distance that the server tells, so it ends on a surface."""

    def say(self, **message):
        if "hello" in message:
            message["hello"].capabilities.append("force")
        super().say(**message)

    def press(self, frames):
        self.sent, x = {}, 60.0
        for i in range(frames):
            force = 0.1 if i < FREE else 2 + 3 * math.sin(i / 7)
            validity = pb.HELD if i in HELD else pb.LOST if i in LOST else pb.OK
            now = time.monotonic_ns()
            self.send([pb.Sample(channel=0, time_ns=now, joint=pb.Joint(flexion_deg=20)),
                       pb.Sample(channel=PROBE, time_ns=now, pose=pb.Pose(qw=1, x=x)),
                       pb.Sample(channel=PROBE, validity=validity, time_ns=now, force_n=force),
                       pb.Sample(channel=TIBIA, time_ns=now, force_n=-i / 3)])
            self.sent[self.number] = (validity, force, -i / 3)
            nearest = [w.nearest_mm for reply in self.hear(0.02) for w in reply.instruments]
            if i >= FREE and nearest:
                x -= max(0, nearest[-1] - 0.05) if nearest[-1] >= 0 else 3  # so far away it is not told


class Figures(SystemTest):
    def table(self, trace):
        rows = call("arthron-trace", "export", trace, "--csv", "-", "--columns", "*").stdout
        return list(csv.DictReader(io.StringIO(rows)))

    @staticmethod
    def gauge(rows, channel):
        """What a gauge says at each step: (validity, force); a step without a frame repeats it as held, then loses it."""
        now, told_ns = None, 0
        for row in rows:
            validity, time_ns = row[f"measured_{channel}_force_validity"], int(row["time_ns"])
            if validity:
                now, told_ns = (validity, abs(float(row[f"measured_{channel}_force_n"]))), time_ns
            elif now:
                now = ("lost" if time_ns - told_ns > 100_000_000 or now[0] == "lost" else "held", now[1])
            yield now

    def expected(self, rows):
        """By (figure, subject): sums over the rows, each of which stands until the next one."""
        sums, touching = {}, False
        for row, after, probe, tibia in zip(rows, rows[1:], self.gauge(rows, "probe"), self.gauge(rows, "tibia")):
            distance = float(row["probe_nearest_mm"] or math.inf)
            touching = distance <= (0.4 if touching else 0.2)
            place = (f"probe {row['probe_nearest_group']}" if touching else "probe") if row["probe_valid"] == "1" else None
            passed = min(int(after["time_ns"]) - int(row["time_ns"]), 100_000_000)
            for subject, said in ((place, probe), ("tibia", tibia)):
                if subject and said and row["state"] == "running":
                    sums.setdefault(subject, {"ok": [], "held": [], "lost": []})[said[0]].append((passed, said[1]))
        figures = {}
        for subject, told in sums.items():
            time_of = {validity: sum(passed for passed, _ in parts) for validity, parts in told.items()}
            name = {"probe": "force_free", "tibia": "bone_force"}.get(subject, "force")
            figures[name + "_peak", subject] = max(force for _, force in told["ok"])
            if subject != "tibia":
                figures[name + "_mean", subject] = sum(passed * force for passed, force in told["ok"]) / time_of["ok"]
            for validity in {"tibia": ("ok",), "probe": ()}.get(subject, told):
                figures[f"{name}_{validity}", subject] = time_of[validity] / sum(time_of.values())
        return figures

    def assert_figures(self, rows, metrics):
        expected = self.expected(rows)
        found = {key[:2]: value[0] for key, value in metrics.items() if "force" in key[0]}
        self.assertEqual(set(found), set(expected))
        self.assertTrue(any(name == "force_mean" for name, _ in found), found)
        for key, value in expected.items():
            self.assertAlmostEqual(found[key], value, places=9, msg=key)
        return found


class FromAStationOfYourOwn(Figures):
    def setUp(self):
        super().setUp()
        self.web_port = free_port()
        self.server = self.start_server("[station room-1]\ncase = healthy",
                                        f"records = records.db\n[web]\nport = {self.web_port}\n")
        code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        example.enrol("127.0.0.1", self.port, code, "room-1", self.path("keys-room-1"))
        self.station = Pressing("127.0.0.1", self.port, "room-1", self.path("keys-room-1"))
        self.addCleanup(self.station.close)
        wait_until("a session", lambda: self.station.hear(0.01) or self.station.state == pb.RUNNING)

    def recording(self, trace):
        out = self.path("a.mcap")
        call("arthron-trace", "export", trace, "--mcap", out)
        done = subprocess.run([os.environ["ARTHRON_NODE"],
                               os.path.join(SOURCE, "web/test/read_mcap.mjs"), out], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)["topics"]

    def test_it_comes_from_the_station_into_all_that_a_session_leaves(self):
        self.assertIn("force", self.station.welcome.capabilities)
        browser = Browser(self.web_port, self.path("keys/authority.pem"))
        browser.first(self.server.log())
        page = browser.page()
        page.watch(STATION, station="room-1")
        hand = threading.Thread(target=self.station.press, args=(FREE + TOUCHING,))
        hand.start()
        page.read_until(lambda: not hand.is_alive())
        hand.join()
        self.session_command("stop", "room-1")
        session, metrics = self.session(), self.metrics()
        page.close()
        self.server.end()
        trace = session["trace"]

        rows = self.table(trace)
        told = {int(row["frame_number"]): row for row in rows if row["measured_probe_force_validity"]}
        self.assertEqual(set(told), set(self.station.sent))
        for number, (validity, probe, tibia) in self.station.sent.items():
            row = told[number]
            self.assertEqual((row["measured_probe_force_validity"], float(row["measured_probe_force_n"]),
                              float(row["measured_tibia_force_n"])), (("ok", "held", "lost")[validity], probe, tibia))

        found = self.assert_figures(rows, metrics)
        self.assert_metrics_are_those_of(trace, metrics)
        kept = json.loads(call("arthron-server", "records", "--file", self.path("records.db"), "show", "session",
                               session["id"], "--json").stdout)["results"]
        self.assertEqual({(r["metric"], r["subject"]): r["value"] for r in kept if "force" in r["metric"]}, found)

        sent = {struct.pack("<f", probe) for _, probe, _ in self.station.sent.values()}
        shown = [moment["instruments"][PROBE].get(13) for moment in page.moments if PROBE in moment["instruments"]]
        self.assertIn(None, shown)  # while it was lost
        self.assertGreater(len(set(shown)), 10)
        self.assertLessEqual(set(shown), sent | {None})

        self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")
        read = subprocess.run([sys.executable, "-I", os.path.join(SOURCE, "docs/examples/trace.py"), trace],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(json.loads(read.stdout)["steps"], call_json("arthron-trace", "info", trace)["steps"])
        report = self.path("report.html")
        call("arthron-trace", "report", trace, "--out", report)
        with open(report) as f:
            text = f.read()
        self.assertIn('<td title="force_peak">', text)
        self.assertEqual(text.count("As its gauge measured it"), 1)
        for name, channel in (("probe", 1), ("tibia", 2)) if "ARTHRON_NODE" in os.environ else ():
            force = self.recording(trace)[f"/force/{name}"]
            self.assertEqual(force["schema"], "arthron.session.Force")
            self.assertEqual([m.get("forceN") for _, m in force["messages"]],
                             [None if name == "probe" and one[0] == pb.LOST else one[channel]
                              for one in self.station.sent.values()])


class FromAMockup(Figures):
    """The probe's handle has a gauge on the serial line; a plate below the tibia tells the same by SENSOR, 1 N less."""

    def setUp(self):
        super().setUp()
        with open(self.motion) as f:
            rows = list(csv.DictReader(f))
        for row in rows:
            row["probe_force_n"] = f"{self.force_at(float(row['t_seconds'])):.6f}"
        self.motion = self.path("pressed.csv")
        with open(self.motion, "w", newline="") as f:
            out = csv.DictWriter(f, rows[0])
            out.writeheader()
            out.writerows(rows)
        self.start_mockup()
        self.server = self.start_server()
        self.enrol("room-1")

    @staticmethod
    def force_at(t_seconds):
        return 3 + 2.5 * math.sin(3 * t_seconds)

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        with open(super().station_config(name, datagrams, keys)) as f:
            text = f.read()
        return self.write(f"{name}.ini", text.replace("punch.opening", "probe.force = 38 0.01\npunch.opening") +
                          "force.tibia = probeForce\nzero.tibia = 1\n")

    def test_two_gauges_reach_the_figures(self):
        self.start_station()
        wait_until("a session", lambda: self.sessions() and self.session()["state"] == "running")
        wait_until("touches", lambda: any(name == "force_mean" and subject.startswith("probe ")
                                          for name, subject, _ in self.metrics()))
        self.wait_for_steps(100)
        self.session_command("stop", "room-1")
        session, metrics = self.session(), self.metrics()
        self.server.end()
        rows = self.table(session["trace"])
        self.assert_figures(rows, metrics)
        told = [(float(row["measured_probe_force_n"]), float(row["measured_tibia_force_n"])) for row in rows
                if row["measured_probe_force_validity"] == row["measured_tibia_force_validity"] == "ok"]
        self.assertGreater(len(told), 100)
        self.assertTrue(all(0.49 <= probe <= 5.51 and -0.51 <= tibia <= 4.51 for probe, tibia in told), told)
        apart = sorted(abs(probe - 1 - tibia) for probe, tibia in told)
        self.assertLess(apart[len(apart) // 2], 0.3)  # the one is some milliseconds older
        self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")

    def test_check_says_that_an_instrument_at_rest_is_pressed(self):
        said = call("arthron-station", "check", "--config", self.station_config(), "--seconds", "1.5", code=1).stdout
        line = next(line for line in said.splitlines() if "probe's force" in line)
        self.assertIn("BAD", line)
        self.assertNotIn("tibia's force", "".join(line for line in said.splitlines() if "BAD" in line))


if __name__ == "__main__":
    unittest.main(verbosity=2)
