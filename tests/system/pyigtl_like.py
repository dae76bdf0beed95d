#!/usr/bin/env python3
"""What a program gets that reads OpenIGTLink as pyigtl 0.3 does (github.com/lassoan/pyigtl): of a recorded session, beside
its table; of a station, beside its view.

pyigtl's client says nothing unless its user does, and then with header version 1. It knows TRANSFORM, STRING and three
types more, and passes over any other type. It keeps the newest message of each device, whatever its type. Of the
encodings of a STRING it knows US-ASCII and UTF-8. It believes lengths and looks at no checksum."""

import csv
import io
import json
import math
import os
import re
import socket
import struct
import tempfile
import threading
import time
import unittest

from arthron import PATIENCE_S, Process, SystemTest, call, free_port, program, wait_until
from old_traces import FITTED, unpack, unpack_trace
from websocket import Viewer

HEADER = struct.Struct(">H12s20sIIQQ")
PROBE = 4
KNOWN = ("TRANSFORM", "STRING", "IMAGE", "POINT", "POSITION")
ENCODINGS = {3: "ascii", 106: "utf8"}


def text_of(field):
    return field.decode().rstrip(" \t\r\n\0")


class Message:
    def __init__(self, header, body):
        self.version, kind, device, seconds, fraction, _, _ = header
        self.kind, self.device = text_of(kind), text_of(device)
        self.time_ns = seconds * 10**9 + round(fraction * 10**9 / 2**32)
        self.metadata, content = {}, body
        if self.version > 1:
            extended, keys, values, _ = struct.unpack(">HHII", body[:12])
            content = body[extended:len(body) - keys - values]
            self.metadata = self.pairs(body[len(body) - keys - values:]) if keys + values else {}
        if self.kind == "TRANSFORM":
            v = struct.unpack(">12f", content)
            self.matrix = [[v[row + 3 * column] for column in range(4)] for row in range(3)]
        elif self.kind == "STRING":
            encoding, size = struct.unpack(">HH", content[:4])
            self.string = content[4:4 + size].decode(ENCODINGS[encoding])

    @staticmethod
    def pairs(data):
        count, = struct.unpack(">H", data[:2])
        at, found = 2 + 8 * count, {}
        for key, encoding, value in struct.iter_unpack(">HHI", data[2:at]):
            found[data[at:at + key].decode()] = data[at + key:at + key + value].decode(ENCODINGS[encoding])
            at += key + value
        return found


class Client:
    """Its messages in order, too: pyigtl forgets all but the newest of a device. pyigtl waits 10 ms within a message;
    how long a busy machine waits there says nothing about the server."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self.lock, self.newest, self.all, self.passed_over, self.failure = threading.Lock(), {}, [], set(), None
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def take(self, size):
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            if not part:
                raise EOFError
            data += part
        return data

    def run(self):
        try:
            while True:
                header = HEADER.unpack(self.take(HEADER.size))
                body = self.take(header[5])
                if text_of(header[1]) not in KNOWN:
                    self.passed_over.add(text_of(header[1]))
                    continue
                message = Message(header, body)
                with self.lock:
                    self.newest[message.device] = message
                    self.all.append(message)
        except (EOFError, ConnectionResetError):
            pass
        except Exception as failure:  # for the test's own thread
            self.failure = failure

    def wait_for_message(self, device):
        def taken():
            with self.lock:
                return self.newest.pop(device, None)
        return wait_until(f"a message of {device}", taken)

    def send(self, kind, device, content):
        """pyigtl's checksum is that of the protocol: a polynomial of 64 bits, ECMA-182's."""
        crc = 0
        for byte in content:
            crc ^= byte << 56
            for _ in range(8):
                crc = crc << 1 ^ (0x142F0E1EBA9EA3693 if crc >> 63 else 0)
        self.socket.sendall(HEADER.pack(1, kind.encode(), device.encode(), 0, 0, len(content), crc) + content)

    def end(self):
        """Once the server has closed the connection."""
        self.thread.join(PATIENCE_S)
        self.socket.close()
        if self.failure:
            raise self.failure


def matrix_of(row, name):
    return matrix(*(float(row[f"{name}_{part}"]) for part in ("qw", "qx", "qy", "qz", "tx_mm", "ty_mm", "tz_mm")))


def matrix(w, x, y, z, tx, ty, tz):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), tx],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), ty],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), tz]]


def near(test, found, expected):
    for found_row, expected_row in zip(found, expected, strict=True):
        for a, b in zip(found_row, expected_row, strict=True):
            test.assertLess(abs(a - b), 2e-5)


class OfRecord(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-test-")
        _, cls.case = unpack(cls.folder.name)
        cls.trace = unpack_trace(FITTED, cls.folder.name)
        cls.rows = [row for row in csv.DictReader(io.StringIO(call(
            "arthron-trace", "export", cls.trace, "--csv", "-", "--columns", "*").stdout))]
        cls.start_ns = int(cls.rows[0]["time_ns"]) - round(float(cls.rows[0]["t_seconds"]) * 1e9)
        cls.served = []

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def serve(self, *options):
        server = Process(self.folder.name, f"serve-{len(self.served)}", program("arthron-trace"), "serve", self.trace,
                         "--port", "0", *options)
        self.served.append(server)
        self.addCleanup(lambda: self.assertEqual(server.wrong_end(), ""))
        server.wait_for_log("waits for a client")
        return server, int(re.search(r"port (\d+)", server.log())[1])

    def test_each_pose_is_that_of_the_table(self):
        server, port = self.serve("--speed", "20", "--case", self.case, "--json")
        client = Client(port)
        client.end()
        self.assertEqual(server.end(), 0)
        frames = [row for row in self.rows if row["input"] == "frame"]
        for name, measured in (("punch", "punch"), ("punch_warped", "punch"), ("probe_warped", "probe"),
                               ("virtual_tibia", "joint")):
            times, expected = 0, []
            for row in frames:
                times = int(row[f"measured_{measured}_time_ns"] or times)
                if row[f"{measured}_validity" if measured == "joint" else f"measured_{measured}_validity"] != "lost" and \
                        row[f"{name}_qw"]:
                    expected.append((times - self.start_ns, matrix_of(row, name)))
            found = [m for m in client.all if m.device == name]
            self.assertGreater(len(found), len(expected) / 3, name)
            self.assertEqual({(m.kind, m.version) for m in found}, {("TRANSFORM", 1)})
            for m in found:  # on a busy machine it is late and gets the newest
                at = next((i for i, one in enumerate(expected) if abs(one[0] - m.time_ns) <= 1), None)
                self.assertIsNotNone(at, f"{name}: {m.time_ns}")
                near(self, m.matrix, expected[at][1])
                del expected[:at + 1]
            self.assertEqual(expected, [], f"{name}: the last one is missing")
        events = [name if name != "state" else row["state"]
                  for row in self.rows for name in row["events"].split("+") if name]
        self.assertEqual([m.string for m in client.all if m.device == "events"], events)
        self.assertTrue({"POLYDATA", "STATUS"} <= client.passed_over)
        cuts = sum(row["landed_outcome"] == "done" for row in self.rows)
        self.assertEqual(json.loads(server.out()), {"port": port, "rounds": 1, "pose_sets": len(frames),
                                                    "strings": len(events), "meshes": 2 + cuts})

    def test_a_device_has_messages_of_one_type(self):
        _, port = self.serve("--speed", "100", "--case", self.case)
        client = Client(port)
        client.end()
        kinds = {m.device: {n.kind for n in client.all if n.device == m.device} for m in client.all}
        self.assertTrue(all(len(kind) == 1 for kind in kinds.values()), kinds)

    def test_what_it_sends_disturbs_nothing(self):
        server, port = self.serve("--loop")
        client = Client(port)
        client.wait_for_message("punch_warped")
        client.send("TRANSFORM", "mine", struct.pack(">12f", 1, 0, 0, 0, 1, 0, 0, 0, 1, 5, 6, 7))
        client.send("STRING", "mine", struct.pack(">HH", 3, 5) + b"hello")
        client.send("GET_TRANS", "probe_warped", b"")
        after = time.monotonic() + 0.2
        wait_until("poses go on", lambda: client.wait_for_message("punch_warped") and time.monotonic() > after)
        self.assertEqual(client.wait_for_message("probe_warped").version, 1)
        self.assertEqual(server.end(), 0)
        client.end()


class OfStation(SystemTest):
    def setUp(self):
        super().setUp()
        self.outlet, self.view_port = free_port(), free_port()

    def station_config(self, *arguments, **named):
        path = super().station_config(*arguments, **named)
        with open(path, "a") as f:
            f.write(f"[openigtlink]\nport = {self.outlet}\nrate_hz = 2000\n[view]\nport = {self.view_port}\n")
        return path

    def stand(self):
        """The mock-up's motion is one moment, with the probe on the tibia."""
        with open(self.motion) as f:
            header, *rows = f.read().splitlines()
        touching = [row.split(",", 1)[1] for row in rows if row.endswith(",tibia")]
        lines = [f"{i / 100:.2f},{touching[len(touching) // 6]}" for i in range(100)]
        self.motion = self.write("standing.csv", "\n".join([header] + lines))

    def test_each_pose_is_that_of_the_view(self):
        self.stand()
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        station = self.start_station("room-1")
        station.wait_for_log("/view?token=")
        self.wait_for_steps(100)
        client = Client(self.outlet)
        for _ in range(20):
            client.wait_for_message("probe_warped")
        with open(self.path("keys-room-1/view.token")) as f:
            viewer = Viewer(self.view_port, f.read().strip())
        message = viewer.next()
        client.socket.shutdown(socket.SHUT_RDWR)
        client.end()
        viewer.close()
        probe, tibia = message["instruments"][PROBE], message["bodies"][1]
        expected = {"probe": probe["tip"], "probe_warped": probe["warped"], "tibia": tibia["pose"],
                    "virtual_tibia": tibia["virtual"]}
        for name, shown in expected.items():
            found = [m.matrix for m in client.all if m.device == name]
            self.assertGreater(len(found), 19)
            for one in found:
                near(self, one, matrix(*shown.values()))
        self.assertGreater(math.dist(*([probe[end][axis] for axis in "xyz"] for end in ("tip", "warped"))), 0.1)


if __name__ == "__main__":
    unittest.main()
