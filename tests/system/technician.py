"""What a technician does: probe, calibrate, check; what the server says of it; drift of touches."""

import csv
import json
import math
import os
import re
import subprocess
import time
import unittest

from arthron import SystemTest, call, call_json, free_port, program, wait_until

TIP = (3.0, -4.0, 120.0)  # of the probe in its tool's frame
T_TRACKER_MOCKUP = "200 -100 900 0.5 0.5 0.5 0.5"
GOOD_CALIBRATION = "[tip tracker probe]\ndate = {}T00:00:00Z\nresidual = 0.1\ntip_mm = 0 0 0\n"
POINTS = {"medial": (40, 0, 5), "lateral": (-40, 3, 5), "front": (0, 35, 10), "top": (2, 5, 60)}


def axis_angle(axis, angle):
    s = math.sin(angle / 2)
    return (math.cos(angle / 2), *(s * a for a in axis))


def multiply(a, b):
    w, x, y, z = a
    p, q, r, s = b
    return (w * p - x * q - y * r - z * s, w * q + x * p + y * s - z * r,
            w * r - x * s + y * p + z * q, w * s + x * r - y * q + z * p)


def motion(rows):
    """rows: (t, flexion, tip, quaternion) of a probe"""
    lines = ["t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,probe_tx_mm,probe_ty_mm,"
             "probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,probe_valid"]
    for t, flexion, tip, q in rows:
        lines.append(",".join(f"{v:.6f}" for v in (t, flexion, 0, 0, 0, 0, 0, *tip, *q)) + ",1")
    return "\n".join(lines) + "\n"


def still(flexion=0.0, tip=(0.0, 0.0, 0.0)):
    return motion([(i * 0.01, flexion, tip, (1, 0, 0, 0)) for i in range(100)])


def swinging(tilt=0.5):
    rows = []
    for i in range(400):
        x = axis_angle((1, 0, 0), tilt * math.sin(i * 2 * math.pi / 400))
        y = axis_angle((0, 1, 0), tilt * math.sin(i * 6 * math.pi / 400))
        rows.append((i * 0.01, 0, (10, 20, 30), multiply(x, y)))
    return motion(rows)


class Technician(SystemTest):
    def setUp(self):
        super().setUp()
        self.modbus_port, self.tracker_port = free_port(), free_port()
        self.modbus, self.tracker = f"127.0.0.1:{self.modbus_port}", f"127.0.0.1:{self.tracker_port}"
        self.mockup = None

    def play(self, text, *arguments):
        """A mock-up with this motion, always on the same ports; another one takes its place."""
        if self.mockup:
            self.mockup.end()
        path = self.write("motion.csv", text)
        self.mockup = self.start("mockup", "arthron-mockup", "--motion", path, "--modbus-tcp", self.modbus,
                                 "--tracker", self.tracker, *arguments)
        wait_until("the mock-up's ports", lambda: self.mockup.out().count("\n") >= 2)

    def config(self, extra=""):
        text = self.read(self.station_config())
        text = text.replace("tool.punch = punch\n", "").replace("[device encoders]", extra + "[device encoders]", 1)
        return self.write("station.ini", text)

    def calibrated(self):
        return self.config("calibration = calibration.ini\n")

    def calibrate(self, *arguments, code=0):
        return call_json("arthron-station", "calibrate", *arguments, "--config", self.calibrated(), code=code)

    def converse(self, *arguments, answers, code=0):
        """Runs a calibration that asks: before each Enter the mock-up plays the next motion."""
        command = [program("arthron-station"), "calibrate", *arguments, "--config", self.calibrated(), "--json"]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as process:
            try:
                for prepare in answers:
                    asked = ""
                    while not asked.endswith("press Enter: "):
                        character = process.stderr.read(1)
                        if not character:
                            break
                        asked += character
                    prepare()
                    process.stdin.write("\n")
                    process.stdin.flush()
                out, log = process.communicate(timeout=60)
            finally:
                if process.poll() is None:
                    process.kill()
        self.assertEqual(process.returncode, code, log)
        return json.loads(out) if out else None, log

    def read(self, name):
        with open(self.path(name)) as f:
            return f.read()

    def saved(self):
        return self.read("calibration.ini")

    # ---- probe

    def test_probe_lists_what_is_there_and_prints_a_config_that_runs(self):
        self.play(swinging())
        found = call_json("arthron-station", "probe", "--modbus", self.modbus, "--tracker", self.tracker)
        self.assertEqual(len(found["modbus"]), 1)
        self.assertEqual(found["modbus"][0]["sequence"], 0)
        self.assertGreaterEqual(len(found["modbus"][0]["registers"]), 9)
        [tool] = found["trackers"][0]["tools"]
        self.assertEqual(tool["name"], "probe")
        self.assertGreater(tool["rate_hz"], 20)
        self.start_server()
        self.enrol("room-1")
        text = found["config"].replace("server.example.org:4810", f"127.0.0.1:{self.port}")
        path = self.write("proposed.ini", text.replace("keys = keys", "keys = keys-room-1"))
        done = call("arthron-station", "run", "--config", path, "--seconds", "2", "--json")
        self.assertGreater(json.loads(done.stdout.splitlines()[-1])["poses_warped"], 50)

    def test_probe_says_what_does_not_answer(self):
        done = call("arthron-station", "probe", "--modbus", self.modbus, "--tracker", self.tracker, code=1)
        self.assertIn(self.modbus, done.stderr)
        self.assertIn(str(self.tracker_port), done.stderr)
        self.assertIn("[station]", done.stdout)

    # ---- calibrate

    def test_a_tip_is_found_kept_and_used(self):
        tip = " ".join(map(str, TIP)) + " 1 0 0 0"
        self.play(swinging(), "--T-tracker-mockup", T_TRACKER_MOCKUP, "--T-tool-tip", "probe=" + tip)
        found = self.calibrate("tip", "--device", "tracker", "--channel", "probe", "--seconds", "4")
        for a, b in zip(found["tip_mm"], TIP):
            self.assertAlmostEqual(a, b, delta=0.05)
        self.assertLess(found["residual"], 0.05)
        text = self.saved()
        self.assertIn("[tip tracker probe]", text)
        self.assertRegex(text, r"date = \d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
        self.assertRegex(text, r"residual = \d")

    def test_a_tip_that_hardly_turns_is_refused_and_nothing_is_written(self):
        self.play(swinging(0.03), "--T-tool-tip", "probe=0 0 120 1 0 0 0")
        config = self.calibrated()
        done = call("arthron-station", "calibrate", "tip", "--config", config, "--device", "tracker", "--channel",
                    "probe", "--seconds", "2", code=1)
        self.assertIn("second axis", done.stderr)
        self.assertFalse(os.path.exists(self.path("calibration.ini")))

    def test_a_file_that_cannot_be_written_is_told_before_anything_is_measured(self):
        config = self.config("calibration = nowhere/calibration.ini\n")
        begun = time.monotonic()
        done = call("arthron-station", "calibrate", "tip", "--config", config, "--device", "tracker", "--channel",
                    "probe", "--seconds", "60", code=1)
        self.assertIn("nowhere/calibration.ini.part: No such file or directory", done.stderr)
        self.assertLess(time.monotonic() - begun, 30)

    def touch_points(self, moved=None, code=0):
        text = "[landmarks]\n" + "".join(f"{n} = {x} {y} {z}\n" for n, (x, y, z) in POINTS.items())
        points = self.write("points.ini", text)

        def playing(name, at):
            at = (at[0] + 12, *at[1:]) if name == moved else at
            return lambda: self.play(still(tip=at), "--T-tracker-mockup", T_TRACKER_MOCKUP)
        return self.converse("landmarks", "--device", "tracker", "--channel", "probe", "--points", points, code=code,
                             answers=[playing(name, at) for name, at in POINTS.items()])

    def test_landmarks_tell_where_the_tracker_stands_and_the_loop_uses_it(self):
        found, _ = self.touch_points()
        self.assertLess(found["residual"], 0.01)
        self.assertEqual(set(found["landmarks_mm"]), set(POINTS))
        values = re.search(r"T_mockup_tracker = (.*)", self.saved()).group(1).split()
        # The inverse of T_TRACKER_MOCKUP: the same turn backward.
        sign = math.copysign(1, float(values[3]))
        for a, b in zip(values[3:], (0.5, -0.5, -0.5, -0.5)):
            self.assertAlmostEqual(sign * float(a), b, delta=1e-4)
        self.start_server()
        self.enrol("room-1")
        call("arthron-station", "run", "--config", self.calibrated(), "--seconds", "2")
        info = self.session()
        self.assertEqual(info["calibration"]["problem"], "")
        self.assertLess(info["calibration"]["residual_mm"], 0.01)
        rows = call("arthron-trace", "export", info["trace"], "--csv", "-", code=None).stdout.splitlines()
        names, last = rows[0].split(","), None
        for row in rows[1:]:
            cells = dict(zip(names, row.split(",")))
            last = cells if cells.get("probe_validity") == "ok" else last
        at = [float(last[next(n for n in names if n.startswith("probe_t" + axis))]) for axis in "xyz"]
        for a, b in zip(at, POINTS["top"]):
            self.assertAlmostEqual(a, b, delta=0.05)

    def test_a_landmark_that_was_missed_is_named_and_nothing_is_written(self):
        found, log = self.touch_points(moved="front", code=1)
        self.assertEqual(max(found["landmarks_mm"], key=found["landmarks_mm"].get), "front")
        self.assertIn("front", log)
        self.assertFalse(os.path.exists(self.path("calibration.ini")))

    def test_an_encoders_zero_and_scale_are_found(self):
        # The register says 0.01 degree of what the mock-up plays; the joint is at half of that, plus 5.
        found, _ = self.converse("encoder", "--device", "encoders", "--key", "flexion", "--at", "5,25,45",
                                 answers=[lambda f=f: self.play(still(flexion=f)) for f in (0, 40, 80)])
        self.assertAlmostEqual(found["scale"], 0.005, delta=1e-6)
        self.assertAlmostEqual(found["offset"], 5, delta=0.01)
        self.assertIn("[encoder encoders flexion]", self.saved())

    def test_a_calibration_of_what_the_config_does_not_have_is_refused(self):
        self.write("calibration.ini", "[tip elsewhere probe]\ndate = 2026-01-01T00:00:00Z\nresidual = 0.1\n"
                                      "tip_mm = 0 0 100\n")
        done = call("arthron-station", "run", "--config", self.calibrated(), code=2)
        self.assertIn("elsewhere", done.stderr)
        for bad in ("date = yesterday", "tip_mm = far", "colour = red"):
            self.write("calibration.ini", f"[tip tracker probe]\n{bad}\n")
            done = call("arthron-station", "run", "--config", self.calibrated(), code=2)
            self.assertIn("calibration.ini", done.stderr)
            self.assertIn(bad.split()[0], done.stderr)

    def test_the_server_warns_of_a_stale_and_of_a_bad_calibration(self):
        server = self.start_server()
        self.enrol("room-1")
        self.play(swinging())
        for date, residual, words in (("2020-01-01", 0.1, "days old"), ("2100-01-01", 0.1, "to come"),
                                      (None, 4.5, "4.5 mm")):
            date = date or today()
            self.write("calibration.ini", f"[tip tracker probe]\ndate = {date}T00:00:00Z\nresidual = {residual}\n"
                                          "tip_mm = 0 0 0\n")
            call("arthron-station", "run", "--config", self.calibrated(), "--seconds", "1")
            server.wait_for_log(words)
            self.assertIn(words, self.session()["calibration"]["problem"])

    # ---- check

    def check(self, config, code):
        return call_json("arthron-station", "check", "--config", config, "--seconds", "2", code=code)

    def findings(self, report):
        return {finding["what"]: finding for finding in report["findings"]}

    def test_check_is_green_where_all_is_well_and_opens_no_session(self):
        self.start_server()
        self.enrol("room-1")
        self.play(swinging())
        self.write("calibration.ini", GOOD_CALIBRATION.format(today()))
        report = self.check(self.calibrated(), 0)
        self.assertTrue(report["ready"])
        self.assertLessEqual({"encoders", "tracker", "calibration", "certificate", "server", "clock", "round trip"},
                             set(self.findings(report)))
        self.assertIn("none is set", self.findings(report)["tracker's delay"]["text"])
        self.assertFalse(os.listdir(self.traces))
        self.assertFalse(self.session()["connected"])
        page = call("arthron-station", "check", "--config", self.calibrated(), "--seconds", "2").stdout
        self.assertIn("room-1: ready", page)

    def test_check_says_what_to_do(self):
        self.start_server()
        self.enrol("room-1")
        self.play(swinging())
        text = self.read(self.calibrated())
        self.write("calibration.ini", "[tip tracker probe]\ndate = 2020-01-01T00:00:00Z\nresidual = 0.1\n"
                                      "tip_mm = 0 0 0\n")
        nowhere = f"127.0.0.1:{free_port()}"
        for change, what, words in (
            (("", ""), "calibration", "days"),
            ((f"server = 127.0.0.1:{self.port}", f"server = {nowhere}"), "server", "no server answers"),
            ((self.modbus, nowhere), "encoders", "refused"),
            (("tool.probe = probe", "tool.probe = pointer"), "probe", "no value"),
            (("keys = keys-room-1", "keys = nowhere"), "certificate", "authority.pem"),
            (("rate_hz = 200", "rate_hz = fast"), "config", "rate_hz"),
        ):
            path = self.write("changed.ini", text.replace(*change, 1) if change[0] else text)
            finding = self.findings(self.check(path, 1))[what]
            self.assertFalse(finding["good"], what)
            self.assertIn(words, finding["text"])
            self.assertTrue(finding["advice"])

    def test_a_station_that_the_server_does_not_know_is_told_so_by_check(self):
        self.start_server("[station room-2]\ncase = healthy")
        self.enrol("room-1")
        self.play(swinging())
        finding = self.findings(self.check(self.config(), 1))["server"]
        self.assertIn("no case", finding["text"])

    def test_check_goes_beside_a_running_station(self):
        self.start_server()
        self.enrol("room-1")
        self.play(swinging())
        self.write("calibration.ini", GOOD_CALIBRATION.format(today()))
        config = self.calibrated()
        self.start("station", "arthron-station", "run", "--config", config)
        self.wait_for_steps()
        self.assertTrue(self.findings(self.check(config, 0))["server"]["good"])
        self.wait_for_steps()


    # ---- drift

    def touching(self):
        """The probe's palpation, made with a punch that closes (its end switch) where the probe touches."""
        with open(self.motion, newline="") as f:
            rows = list(csv.DictReader(f))
        names = ["t_seconds", "flexion_deg", "varus_deg", "internal_deg", "shift_mm", "drawer_mm", "distraction_mm"]
        pose = ["tx_mm", "ty_mm", "tz_mm", "qw", "qx", "qy", "qz", "valid"]
        lines = [",".join(names + ["punch_" + n for n in pose] + ["punch_opening"])]
        for row in rows:
            lines.append(",".join([row[n] for n in names] + [row["probe_" + n] for n in pose] +
                                  ["1" if row["touch"] == "-" else "0"]))
        return "\n".join(lines) + "\n"

    def drift(self, offset):
        """Drift after some touches, where the station believes that the tracker stands elsewhere by this."""
        self.play(self.touching())
        text = self.read(self.config(f"calibration = {offset[0]}.ini\n")).replace("tool.probe = probe", "tool.punch = punch")
        x, y, z = offset
        self.write(f"{offset[0]}.ini", f"[registration tracker]\ndate = {today()}T00:00:00Z\nresidual = 0.1\n"
                                       f"T_mockup_tracker = {x} {y} {z}\n")
        config = self.write("drift.ini", text.replace("punch.opening = 7 0.0001 0", "punch.buttons = 8"))
        before = self.session()["id"]
        station = self.start("drift", "arthron-station", "run", "--config", config)
        wait_until("a new session", lambda: self.session()["id"] != before and not self.session()["touches"])
        wait_until("touches", lambda: self.session()["touches"] >= 3, 60)
        drift_mm = self.session()["drift_mm"]
        station.end()
        self.session_command("stop", "room-1")
        return drift_mm

    def test_a_tracker_that_was_moved_shows_in_the_drift_of_touches(self):
        self.start_server("[station room-1]\ncase = healthy\ncontact.punch = 0")
        self.enrol("room-1")
        self.assertLess(self.drift((0, 0, 0)), 0.5)
        self.assertGreater(self.drift((0, 0, 4)), 1)


def today():
    return time.strftime("%Y-%m-%d", time.gmtime())


if __name__ == "__main__":
    unittest.main(verbosity=2)
