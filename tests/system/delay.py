"""A tracker that is late by an unknown time is found out by moving the joint, and then tells bone and tool together."""

import math
import os
import unittest

from arthron import SystemTest, call, call_json

LATE_MS, JITTER_MS = 27, 20


def bending(degrees=25.0):
    """A joint that a hand bends, and a probe that is fixed to the bone."""
    lines = ["t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,probe_tx_mm,probe_ty_mm,"
             "probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,probe_valid"]
    for i in range(2000):
        t = i * 0.01
        flexion = 40 + degrees * (math.sin(2 * math.pi * 0.6 * t) + 0.4 * math.sin(2 * math.pi * 0.95 * t))
        half = math.radians(flexion) / 2
        lines.append(f"{t:.2f},{flexion:.6f},0,0,0,0,0,10,20,30,{math.cos(half):.9f},{math.sin(half):.9f},0,0,1")
    return "\n".join(lines) + "\n"


class Delay(SystemTest):
    def play(self, text):
        self.motion = self.write("motion.csv", text)
        self.start_mockup("--rate", "100", "--modbus-rate", "1000", "--faults",
                          self.faults(("tracker", "late", 0, 1000, {"value": LATE_MS}),
                                      ("tracker", "jitter", 0, 1000, {"value": JITTER_MS})))
        self.config = self.station_config()
        with open(self.config) as f:
            text = f.read().replace("tool.punch = punch\n", "").replace("punch.opening = 7 0.0001 0\n", "")
        self.write("room-1.ini", text.replace("[device encoders]", "calibration = calibration.ini\n[device encoders]"))

    def calibrate(self, *arguments, code=0):
        return call_json("arthron-station", "calibrate", "delay", "--config", self.config, "--channel", "probe",
                         *arguments, code=code)

    def test_it_is_found_kept_and_used(self):
        self.play(bending())
        found = self.calibrate("--seconds", "6")
        self.assertEqual(found["late_device"], "tracker")
        self.assertAlmostEqual(found["delay_ms"], LATE_MS, delta=3)  # a busy machine delays, too
        with open(self.path("calibration.ini")) as f:
            kept = f.read()
        self.assertIn("[delay tracker]", kept)
        self.assertIn(f"delay_ms = {found['delay_ms']:.2f}", kept)
        again = self.calibrate("--seconds", "4")
        self.assertAlmostEqual(again["delay_ms"], found["delay_ms"], delta=3)
        self.assert_the_joints_own_delay_counts(found["delay_ms"])

    def assert_the_joints_own_delay_counts(self, delay_ms):
        """The encoders are said to be late already: the tracker is as much later."""
        with open(self.config) as f:
            text = f.read()
        self.write("room-1.ini", text.replace("rate_hz = 200\n", "rate_hz = 200\ndelay_ms = 20\n"))
        found = self.calibrate("--seconds", "4")
        self.assertEqual(found["late_device"], "tracker")
        self.assertAlmostEqual(found["delay_ms"], delay_ms + 20, delta=3)

    def test_a_joint_that_stands_still_tells_nothing(self):
        self.play(bending(degrees=0.5))
        done = call("arthron-station", "calibrate", "delay", "--config", self.config, "--channel", "probe", "--seconds",
                    "2", code=1)
        self.assertIn("Bend and stretch the knee", done.stderr)
        self.assertFalse(os.path.exists(self.path("calibration.ini")))


if __name__ == "__main__":
    unittest.main()
