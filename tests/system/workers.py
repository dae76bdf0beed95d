#!/usr/bin/env python3
"""Sessions in parallel on 1, 2 and 4 workers, with cuts: each trace says to the bit what happened."""

import os
import subprocess
import unittest

from arthron import SystemTest, call, call_json, wait_until
from bites import BITES

ROOMS = {"room-1": "healthy", "room-2": "arthrosis", "room-3": "healthy", "room-4": "arthrosis"}
CUTS = 2
# Kernels as a debug build has them; it is built with the tests.
UNOPTIMIZED = os.environ["ARTHRON_UNOPTIMIZED"]
ANOTHER_CPU = "glibc.cpu.hwcaps=-AVX2_Usable,-FMA_Usable,-AVX2,-FMA,-FMA4"


class Workers(SystemTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for seed, (room, case) in enumerate(ROOMS.items(), 1):
            script = os.path.join(cls.shared.name, room + ".ini")
            with open(script, "w") as f:
                f.write(BITES.replace("seed = 1", f"seed = {seed}"))
            call("arthron-case", "motion", script, "--case", os.path.join(cls.cases, case), "--out",
                 os.path.join(cls.shared.name, room + ".csv"))

    def start_rooms(self, workers):
        sections = "".join(f"[station {room}]\ncase = {case}\n" for room, case in ROOMS.items())
        server = self.start(f"server-{workers}", "arthron-server", "run", "--config", self.server_config(sections),
                            "--set", f"server.workers={workers}")
        server.wait_for_log("ready")
        for room in ROOMS:
            if not os.path.exists(self.path("keys-" + room)):
                self.enrol(room)
        return server, [self.start_hands(room, workers) for room in ROOMS]

    def start_hands(self, room, workers):
        config = self.write(room + ".ini", f"""
[station]
name = {room}
server = 127.0.0.1:{self.port}
keys = keys-{room}
[device hands]
driver = recorded
file = {self.shared.name}/{room}.csv
""")
        return self.start(f"{room}-{workers}", "arthron-station", "run", "--config", config)

    def cuts(self, room):
        return sum(r["cuts"] for r in self.session_command("show", room, code=None)["resections"])

    def record(self, workers):
        """The traces of sessions side by side, and how often each was cut."""
        server, stations = self.start_rooms(workers)
        for room in ROOMS:
            wait_until(f"cuts in {room}", lambda: self.cuts(room) >= CUTS, 60)
        for room in ROOMS:
            wait_until("time of its worker", lambda: self.session_command("stop", room, code=None)["ok"])
        sessions = {room: (self.session(room)["trace"], self.cuts(room)) for room in ROOMS}
        for station in stations:
            station.end()
        self.assertEqual(server.end(), 0)
        return sessions

    def replay(self, trace):
        return call_json("arthron-trace", "replay", trace)

    def replay_unoptimized(self, trace, case):
        return subprocess.run([UNOPTIMIZED, trace, os.path.join(self.cases, case)], capture_output=True, text=True)

    def test_each_trace_replays_to_the_bit_however_many_workers_wrote_them(self):
        for workers in (1, 2, 4):
            for room, (trace, cuts) in self.record(workers).items():
                with self.subTest(workers=workers, room=room):
                    replay = self.replay(trace)
                    self.assertEqual((replay["verdict"], replay["different"], replay["left_out"], replay["end"]),
                                     ("identical", 0, 0, ""))
                    info = call_json("arthron-trace", "info", trace)
                    self.assertGreaterEqual(info["events"]["cut"], CUTS)
                    self.assertEqual(info["events"]["cut"], cuts)
            done = self.replay_unoptimized(trace, ROOMS[room])
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_on_another_processor_it_is_the_same_within_a_millionth_of_a_millimetre_and_said_to_be_another(self):
        trace, cuts = self.record(2)["room-1"]
        self.assertTrue(self.replay(trace)["same_cpu"])
        os.environ["GLIBC_TUNABLES"] = ANOTHER_CPU
        self.addCleanup(os.environ.pop, "GLIBC_TUNABLES", None)
        replay = self.replay(trace)
        self.assertFalse(replay["same_cpu"])
        self.assertTrue(replay["same_events"])
        self.assertLessEqual(replay["largest_mm"], 1e-6)
        self.assertIn(replay["verdict"], ("identical", "equivalent"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
