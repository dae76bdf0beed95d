"""A station that sends without end gets its share of the server, and the other one on its worker loses nothing."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from arthron import SOURCE, SystemTest, call, call_json, wait_until

made = tempfile.TemporaryDirectory(prefix="arthron-test-")
subprocess.run(["protoc", "--proto_path", os.path.join(SOURCE, "shared/wire"), "--python_out", made.name,
                "arthron.proto"], check=True)
sys.path.insert(0, made.name)
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("example", os.path.join(SOURCE, "docs/examples/station.py"))
example = importlib.util.module_from_spec(spec)
spec.loader.exec_module(example)
pb = example.pb

FLOOD_S, FLOOD_HZ = 3, 8000
SHARE_HZ, BURST = 2500, 1000  # server/runtime/fair_share.h


class Asking(example.Station):
    """It may ask for meshes, and looks at none."""

    def say(self, **message):
        if "hello" in message:
            message["hello"].capabilities.append("meshes")
        super().say(**message)


class Flood(threading.Thread):
    def __init__(self, station):
        super().__init__(daemon=True)
        self.station, self.sent, self.ends, self.told = station, 0, False, []
        hear = station.hear_message

        def hear_message(message, received_ns):
            if message.WhichOneof("message") == "session_change" and message.session_change.text:
                self.told.append(message.session_change.text)
            return hear(message, received_ns)
        station.hear_message = hear_message

    def run(self):
        samples = example.samples_at(1)
        begin = time.monotonic()
        while not self.ends:
            time.sleep(max(0, begin + self.sent / FLOOD_HZ - time.monotonic()))
            for _ in range(100):
                self.station.number += 1
                self.station.datagrams.send(pb.Frame(number=self.station.number, time_ns=time.monotonic_ns(),
                                                     samples=samples))
            self.sent += 100
            self.station.hear(0)


    def ask_for_meshes(self):
        """Far more often than once a second, until it is told."""
        before = len(self.told)
        for _ in range(60):
            self.station.say(mesh_ask=pb.MeshAsk())
        wait_until("word of it", lambda: self.station.hear(0.01) or len(self.told) > before)


class Share(SystemTest):
    def setUp(self):
        super().setUp()
        self.server = self.start_server("[station flood]\ncase = healthy\n[station room-1]\ncase = healthy")

    def start_flood(self):
        code = call("arthron-server", "keys", "enrol", self.keys, "flood").stdout.strip()
        folder = self.path("keys-flood")
        example.enrol("127.0.0.1", self.port, code, "flood", folder)
        station = Asking("127.0.0.1", self.port, "flood", folder)
        wait_until("its session", lambda: station.hear(0.01) or (station.state == pb.RUNNING and station.datagrams))
        self.addCleanup(station.close)
        return Flood(station)

    def assert_copies_get_no_answers(self, station):
        """But one, which a station needs that tries both ways."""
        time.sleep(1)  # for its share to come back
        station.hear(0)
        station.number += 1
        frame = pb.Frame(number=station.number, time_ns=time.monotonic_ns(), samples=example.samples_at(1))
        before = station.by_datagram
        for _ in range(500):
            station.datagrams.send(frame)
        wait_until("an answer", lambda: station.hear(0.1) is not None and station.by_datagram > before)
        station.hear(0.5)
        self.assertLessEqual(station.by_datagram - before, 2)

    def test_who_sends_without_end_is_told_and_slowed_and_costs_nobody_else(self):
        self.enrol("room-1")
        self.start_mockup()
        self.start_station()
        flood = self.start_flood()
        self.wait_for_steps()
        before = {s["station"]: s for s in self.sessions()}
        begin = time.monotonic()
        flood.start()
        time.sleep(FLOOD_S)
        flood.ends = True
        flood.join()
        passed_s = time.monotonic() - begin
        flood.station.hear(0.5)
        after = {s["station"]: s for s in self.sessions()}
        steps = after["flood"]["steps"] - before["flood"]["steps"]
        if flood.sent < 1.5 * (SHARE_HZ * passed_s + BURST):
            self.skipTest(f"{flood.sent} frames in {passed_s:.1f} s are no flood")
        self.assertLessEqual(steps, SHARE_HZ * (passed_s + 1) + BURST)
        self.assertGreater(after["flood"]["frames_excess"], 1000)
        self.assertIn("more than its share", flood.told[0])
        self.assert_copies_get_no_answers(flood.station)
        flood.ask_for_meshes()
        self.assertIn("asks for its meshes too often", flood.told[-1])
        self.assertEqual(self.session("flood")["slowed"], ["frames", "mesh_asks"])
        self.assertIn("station flood sends more than its share", self.server.log())
        self.assertEqual((after["flood"]["id"], after["flood"]["connected"]), (before["flood"]["id"], True))
        self.assertLessEqual(after["room-1"]["frames_lost"] - before["room-1"]["frames_lost"],
                             0.05 * (after["room-1"]["steps"] - before["room-1"]["steps"]))
        self.assertEqual(call_json("arthron-trace", "replay", after["flood"]["trace"], code=None)["different"], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
