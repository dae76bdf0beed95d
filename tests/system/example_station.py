#!/usr/bin/env python3
"""The example station of docs/examples enrols, connects, sends frames and places bones as the server does."""

import importlib.util
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from arthron import SOURCE, SystemTest, call, wait_until

made = tempfile.TemporaryDirectory(prefix="arthron-test-")
subprocess.run(["protoc", "--proto_path", os.path.join(SOURCE, "shared/wire"), "--python_out", made.name,
                "arthron.proto"], check=True)
sys.path.insert(0, made.name)
EXAMPLE = os.path.join(SOURCE, "docs/examples/station.py")
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("example", EXAMPLE)
example = importlib.util.module_from_spec(spec)
spec.loader.exec_module(example)
pb = example.pb


class ExampleStation(SystemTest):
    def setUp(self):
        super().setUp()
        self.server = self.start_server()
        self.code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        self.place = f"127.0.0.1:{self.port}"
        self.folder_of_keys = self.path("keys-room-1")

    def program(self, *arguments, code=0):
        done = subprocess.run([sys.executable, "-B", EXAMPLE, *arguments], env={**os.environ, "PYTHONPATH": made.name},
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def test_it_enrols_and_runs_as_the_guide_says(self):
        self.program("enrol", self.place, self.code, "room-1", self.folder_of_keys)
        said = self.program("run", self.place, "room-1", self.folder_of_keys, "3")
        self.assertIn("welcome to case arthrosis", said)
        self.assertIn("probe at", said)
        by_tcp, by_datagram = map(int, re.search(r"(\d+) by TCP, (\d+) by datagram", said.splitlines()[-1]).groups())
        self.assertGreater(by_tcp, 0)
        self.assertGreater(by_datagram, 0)
        session = self.session()
        self.assertEqual((session["frames_invalid"], session["frames_lost"]), (0, 0))

    def test_a_code_works_once(self):
        self.program("enrol", self.place, self.code, "room-1", self.folder_of_keys)
        self.assertIn("ConnectionError", self.program("enrol", self.place, self.code, "room-1", self.folder_of_keys,
                                                      code=1))

    def test_it_sends_no_code_to_another_server(self):
        foreign = self.path("foreign")
        call("arthron-server", "keys", "init", foreign)
        code = call("arthron-server", "keys", "enrol", foreign, "room-1").stdout.strip()
        self.assertIn("is not the server that made this code",
                      self.program("enrol", self.place, code, "room-1", self.folder_of_keys, code=1))
        with self.assertRaises(ValueError):
            example.code_fingerprint(code[:-1] + ("A" if code[-1] != "A" else "B"))

    def test_its_tibia_is_where_the_servers_is(self):
        example.enrol("127.0.0.1", self.port, self.code, "room-1", self.folder_of_keys)
        station = example.Station("127.0.0.1", self.port, "room-1", self.folder_of_keys)
        while station.state == pb.CLOSED:
            station.hear(0.01)
        joint = pb.Joint(flexion_deg=50, varus_deg=-4, internal_deg=7, shift_mm=1, drawer_mm=2, distraction_mm=3)
        stop = threading.Event()

        def stand():
            while not stop.is_set():
                station.send([pb.Sample(channel=0, time_ns=time.monotonic_ns(), joint=joint)])
                station.hear(0.01)

        def shown():
            there = self.session_command("show", "room-1").get("joint")
            return there and there["validity"] == "ok" and there["T_femur_tibia"]
        hand = threading.Thread(target=stand)
        hand.start()
        try:
            there = wait_until("the joint", shown)
        finally:
            stop.set()
            hand.join()
        turn, place = station.bodies[pb.BODY_TIBIA]
        station.close()
        for found, expected in zip(place + turn, there, strict=True):
            self.assertAlmostEqual(found, expected, places=9)


    def test_a_reply_counts_what_lost_ones_told(self):
        """The probe goes out of view and back three times; only the last reply is read."""
        example.enrol("127.0.0.1", self.port, self.code, "room-1", self.folder_of_keys)
        station = example.Station("127.0.0.1", self.port, "room-1", self.folder_of_keys)
        self.addCleanup(station.close)
        while station.state == pb.CLOSED:
            station.hear(0.01)
        replies = []
        for validity in (pb.OK, pb.LOST) * 3 + (pb.OK,):
            station.send([pb.Sample(channel=4, validity=validity, time_ns=time.monotonic_ns(),
                                    pose=pb.Pose(qw=1, x=200))])
            replies += station.hear(0.03)
        while not replies or replies[-1].frame_number < 7:
            replies += station.hear(0.03)
        last = replies[-1]
        self.assertEqual(last.event_counts[1:3], [3, 3])


if __name__ == "__main__":
    unittest.main()
