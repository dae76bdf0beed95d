"""What `arthron-station probe` finds on Modbus lines: their settings, slaves and types of registers."""

import math
import struct
import unittest

from arthron import SystemTest, call, call_json, wait_until


class Probe(SystemTest):
    def play(self, *arguments):
        rows = [f"{i / 100:.2f},{40.03 + 10 * math.sin(i / 50):.4f},1.3,-2.2,3.1,4.7,5.9" for i in range(400)]
        motion = self.write("motion.csv", "\n".join(
            ["t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm", *rows, ""]))
        mockup = self.start("mockup", "arthron-mockup", "--motion", motion, *arguments)
        wait_until("the mock-up's line", lambda: "modbus-" in mockup.out())
        return mockup

    def test_one_serial_line_with_its_settings_and_slaves(self):
        line = self.path("line")
        self.play("--modbus-rtu", line, "--slaves", "2", "--line", "19200 2", "--order", "CDAB")
        found = call_json("arthron-station", "probe", "--modbus", line, "--slaves", "2")
        self.assertEqual([(row["slave"], row["baud"], row["stop_bits"], row["sequence"]) for row in found["modbus"]],
                         [(1, 19200, 2, 0), (2, 19200, 2, 0)])
        for row in found["modbus"]:
            self.assertEqual(len(row["registers"]), 48)
            low, high = row["registers"][14:16]  # varus
            self.assertAlmostEqual(struct.unpack(">f", struct.pack(">HH", high, low))[0], 1.3, places=5)
        text = found["config"]
        self.assertEqual(text.count(f"serial = {line}\nbaud = 19200\nparity = none\nstop_bits = 2\n"), 2)
        floats = text[text.index("order = CDAB"):]
        self.assertIn(" 14 f32 (1.3) 16 f32 (-2.2) 18 f32 (3.1)", floats)
        self.assertLess(max(map(len, text.splitlines())), 199)  # of a config's lines

    def test_the_slaves_behind_a_gateway(self):
        mockup = self.play("--modbus-tcp", "127.0.0.1:0", "--slaves", "3")
        address = mockup.out().split()[1]
        found = call_json("arthron-station", "probe", "--modbus", address, "--slaves", "5")
        self.assertEqual([row["slave"] for row in found["modbus"]], [1, 2, 3])
        self.assertEqual([row["registers"][10] for row in found["modbus"]], [1, 2, 3])

    def test_the_forces_of_a_tracker(self):
        rows = [f"{i / 100:.2f},1,2,3,1,0,0,0,1,2.5" for i in range(100)]
        recording = self.write("force.csv", "\n".join(
            ["t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid,force_n", *rows, ""]))
        mockup = self.start("mockup", "arthron-mockup", "--recording", recording, "--tool", "probe", "--tracker",
                            "127.0.0.1:0")
        wait_until("the mock-up's tracker", lambda: "tracker " in mockup.out())
        found = call_json("arthron-station", "probe", "--tracker", mockup.out().split()[1])
        self.assertEqual(found["trackers"][0]["sensors"], [{"name": "probeForce", "is_force": True, "values": [2.5]}])
        self.assertIn("; probeForce: SENSOR with 1 numbers: 2.5 N\n; force.CHANNEL = probeForce\n", found["config"])

    def test_a_line_without_slaves_says_what_to_look_at(self):
        line = self.path("line")
        self.play("--modbus-rtu", line, "--slave", "9")
        done = call("arthron-station", "probe", "--modbus", line, "--slaves", "1", code=1)
        self.assertIn("no slave from 1 to 1 answers. Check its cable, baud rate and number", done.stderr)


if __name__ == "__main__":
    unittest.main()
