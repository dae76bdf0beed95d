"""A mock-up bites with a punch, and what station and server then know of the tissue."""

import os
import time

from arthron import SystemTest, call, wait_until

BITES = """
[motion]
rate_hz = 100
speed_mm_s = 120
joint_speed_deg_s = 60
tremor_mm = 0.05
seed = 1
[steps]
flex = 20
approach = punch anterolateral
bite = punch meniscus_medial
bite = punch meniscus_medial
withdraw = punch
"""


class Bites(SystemTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.motion = os.path.join(cls.shared.name, "bites.csv")
        script = os.path.join(cls.shared.name, "bites.ini")
        with open(script, "w") as f:
            f.write(BITES)
        call("arthron-case", "motion", script, "--case", os.path.join(cls.cases, "healthy"), "--out", cls.motion)

    def setUp(self):
        super().setUp()
        self.start_mockup()
        self.server = self.start_server()
        self.enrol("room-1")

    def resection(self, group="meniscus_medial"):
        return next(r for r in self.session_command("show", "room-1")["resections"] if r["group"] == group)

    def whole(self):
        resection = self.resection()
        return resection["mesh_number"] == 1 and resection

    def wait_for_cuts(self, count=2):
        wait_until(f"{count} cuts", lambda: self.resection()["cuts"] >= count, 60)

    def pause(self):
        """A cut that is on its way lands all the same, on a busy machine some time later."""
        self.session_command("pause", "room-1")

        def rests():
            before = self.resection()
            time.sleep(2)
            return self.resection() == before
        wait_until("the last cut", rests)

    def mesh_at(self, station):
        """What the station has of the medial meniscus, as it says at its end."""
        station.end()
        return next(m for m in self.summary(station)["meshes"] if m["group"] == "meniscus_medial")

    def assert_same_mesh(self, station):
        """Nothing is cut while the session rests, so both sides can be asked one after the other."""
        there = self.resection()
        here = self.mesh_at(station)
        self.assertEqual((here["number"], here["hash"]), (there["mesh_number"], there["mesh_hash"]))
