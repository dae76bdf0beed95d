"""A technician records the keys of a torn ligament on the running mock-up."""

import json
import os
import re
import shutil
import unittest

from arthron import SystemTest, call, call_json, free_port, program, wait_until

COLUMNS = ["flexion_deg", "varus_deg", "internal_deg", "shift_mm", "drawer_mm", "distraction_mm"]
RESOLUTION = 0.01  # of the encoders' registers


def held(seconds=60, **joint):
    rows = [[t * 0.1] + [joint.get(c, 0) for c in COLUMNS] for t in range(int(10 * seconds))]
    return rows


def bending(degrees_s):
    return [[t * 0.01, 20 + degrees_s * t * 0.01, 0, 0, 0, 0, 0] for t in range(2000)]


def text(rows):
    return "t_seconds," + ",".join(COLUMNS) + "\n" + "".join(",".join(f"{v:.4f}" for v in r) + "\n" for r in rows)


class RecordPose(SystemTest):
    def setUp(self):
        super().setUp()
        self.modbus, self.tracker = f"127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
        self.mockup = None
        self.case = self.path("torn")
        shutil.copytree(f"{self.cases}/healthy", self.case)
        self.play(held(flexion_deg=20))
        self.start_server(extra=f"[case torn]\ndir = {self.case}\n")
        self.enrol("room-1")
        self.start_station()
        wait_until("the joint", lambda: self.joint() and self.joint()["validity"] == "ok")

    def play(self, rows):
        """A mock-up that holds its joint so, always on the same ports."""
        if self.mockup:
            self.mockup.end()
        self.mockup = self.start("mockup", "arthron-mockup", "--motion", self.write("motion.csv", text(rows)),
                                 "--modbus-tcp", self.modbus, "--tracker", self.tracker)
        wait_until("the mock-up's ports", lambda: self.mockup.out().count("\n") >= 2)

    def joint(self):
        return self.session_command("show", "room-1").get("joint")

    def hold(self, **joint):
        self.play(held(**joint))
        wait_until("the pose", lambda: self.joint()["validity"] == "ok" and
                   all(abs(self.joint()[c] - joint.get(c, 0)) <= RESOLUTION for c in COLUMNS))

    def record(self, role, ligament=None, code=0, station="room-1"):
        more = ["--ligament", ligament] if ligament else []
        done = call("arthron-case", "record-pose", self.case, "--as", role, *more, "--station", station,
                    "--socket", self.socket, code=code)
        return done.stdout + done.stderr

    def info(self):
        return call_json("arthron-case", "info", self.case)

    def test_keys_are_recorded_pose_by_pose(self):
        poses = {15: (dict(varus_deg=-5, distraction_mm=1.5), dict(varus_deg=-14, distraction_mm=6)),
                 50: (dict(varus_deg=-4.5, drawer_mm=1), dict(varus_deg=-13, distraction_mm=5, drawer_mm=1))}
        before = self.info()["hash"]
        for flexion, (physical, _) in poses.items():
            self.hold(flexion_deg=flexion, **physical)
            said = self.record("physical", "mcl")
            self.assertIn(f"mcl at {flexion}.0 deg of flexion waits for its target", said)
        self.assertEqual(self.info()["hash"], before)
        self.assertEqual(self.info()["torn"], [])
        for flexion, (_, target) in poses.items():
            self.hold(flexion_deg=flexion + 1, **target)
            said = self.record("target", "mcl")
            self.assertIn("arthron-case check", said)
        self.assertNotIn("waits", said)
        self.assertFalse(os.path.exists(os.path.join(self.case, "recorded.json")))
        info = self.info()
        self.assertNotEqual(info["hash"], before)
        self.assertEqual([t["ligament"] for t in info["torn"]], ["mcl"])
        self.assertEqual(len(info["torn"][0]["keys"]), 2)
        for key, (flexion, (physical, target)) in zip(info["torn"][0]["keys"], poses.items()):
            for part, wanted in (("physical", dict(physical, flexion_deg=flexion)),
                                 ("target", dict(target, flexion_deg=flexion + 1))):
                for column in COLUMNS:
                    self.assertAlmostEqual(key[part][column], wanted.get(column, 0), delta=RESOLUTION, msg=column)
        for flexion in (0, 60):
            self.hold(flexion_deg=flexion, internal_deg=flexion / 10)
            self.record("rest")
        self.assertEqual(self.info()["rest_poses"], 2)
        # A server takes the case, and gives way where it was recorded.
        self.processes[1].end()
        self.start_server("[station room-1]\ncase = torn", f"[case torn]\ndir = {self.case}\n")

    def test_a_joint_that_cannot_be_recorded_is_refused_with_the_reason(self):
        before = self.info()["hash"]
        self.assertIn("mcl has no physical pose within 5 degrees of 20.0", self.record("target", "mcl", code=1))
        self.assertIn("no station room-9", self.record("physical", "mcl", code=1, station="room-9"))
        self.play(bending(5))
        wait_until("motion", lambda: self.joint()["flexion_deg"] > 22)
        said = self.record("physical", "mcl", code=1)
        moved = re.search(r"the joint moves: by (\d+\.\d\d) degrees", said)
        self.assertGreater(float(moved.group(1)), 2)  # half of what it bends in a second
        self.mockup.end()
        wait_until("the loss", lambda: self.joint()["validity"] == "lost")
        self.assertIn("the joint is lost", self.record("rest", code=1))
        self.session_command("stop", "room-1")
        self.assertNotIn("joint", self.session_command("show", "room-1"))
        self.assertIn("room-1 has no session", self.record("rest", code=1))
        self.assertEqual(self.info()["hash"], before)
        self.assertFalse(os.path.exists(os.path.join(self.case, "recorded.json")))

    def test_a_case_of_another_mock_up_is_refused(self):
        path = os.path.join(self.case, "case.json")
        with open(path) as f:
            case = json.load(f)
        case["joint"]["T_femur_joint"][1] = 3.0
        with open(path, "w") as f:
            json.dump(case, f)
        self.assertIn("other joint frames", self.record("rest", code=1))


if __name__ == "__main__":
    unittest.main()
