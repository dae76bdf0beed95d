#!/usr/bin/env python3
"""What a program gets that speaks OpenIGTLink to a station: poses, the menisci as they are cut, events, the state."""

import socket
import struct
import time
import unittest

from arthron import PATIENCE_S, free_port, wait_until
from bites import Bites

HEADER = struct.Struct(">H12s20sIIQQ")  # version, type, device, seconds, fraction, size of the body, checksum


def text_of(field):
    return field.split(b"\0")[0].decode()


class Message:
    def __init__(self, header, body):
        self.version, kind, device, self.seconds, _, _, _ = header
        self.kind, self.device = text_of(kind), text_of(device)
        self.content = body
        if self.version > 1:
            extended, index, metadata = struct.unpack(">HHI", body[:8])
            self.content = body[extended:len(body) - index - metadata]

    def place(self):
        return struct.unpack(">12f", self.content)[9:]

    def mesh(self):
        """Corners of triangles."""
        counts = struct.unpack(">10I", self.content[:40])
        points = list(struct.iter_unpack(">3f", self.content[40:40 + 12 * counts[0]]))
        polygons = struct.iter_unpack(">4I", self.content[40 + 12 * counts[0]:])
        return [[points[i] for i in corners] for three, *corners in polygons if three == 3]

    def volume(self):
        return sum(ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
                   for (ax, ay, az), (bx, by, bz), (cx, cy, cz) in self.mesh()) / 6


class Client:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.stream = self.socket.makefile("rb")

    def close(self):
        self.stream.close()
        self.socket.close()

    def next(self):
        header = HEADER.unpack(self.stream.read(HEADER.size))
        return Message(header, self.stream.read(header[5]))

    def until(self, condition):
        """The first message that is so, and all before it."""
        end, before = time.monotonic() + PATIENCE_S, []
        while time.monotonic() < end:
            message = self.next()
            if condition(message):
                return message, before
            before.append(message)
        raise AssertionError(f"in vain, after {len(before)} messages: {[(m.kind, m.device, m.content[:60]) for m in before if m.kind != 'TRANSFORM']}")

    def ask(self, kind, version=1, content=b""):
        body = struct.pack(">HHII", 12, 2, 0, 0) + content + b"\0\0" if version > 1 else content
        self.socket.sendall(HEADER.pack(version, kind.encode(), b"", 0, 0, len(body), checksum(body)) + body)


def checksum(data):
    """CRC-64 of ECMA-182."""
    crc = 0
    for byte in data:
        crc ^= byte << 56
        for _ in range(8):
            crc = (crc << 1 ^ (0x42F0E1EBA9EA3693 if crc >> 63 else 0)) & 0xFFFFFFFFFFFFFFFF
    return crc


class OpenIGTLink(Bites):
    def setUp(self):
        super().setUp()
        self.outlet = free_port()
        self.clients = []

    def tearDown(self):
        for client in self.clients:
            client.close()
        super().tearDown()

    def station_config(self, *arguments, **named):
        path = super().station_config(*arguments, **named)
        with open(path, "a") as f:
            f.write(f"[openigtlink]\nport = {self.outlet}\n")
        return path

    def client(self):
        self.clients.append(Client(self.outlet))
        return self.clients[-1]

    def test_a_program_sees_the_session_and_what_is_cut(self):
        station = self.start_station()
        station.wait_for_log("openigtlink: serving at 127.0.0.1")
        client = self.client()
        state, _ = client.until(lambda m: m.kind == "STATUS" and m.content[30:] == b"running\0")
        self.assertEqual((state.version, state.device, state.content[:2]), (1, "Arthron", b"\0\1"))
        whole, _ = client.until(lambda m: m.kind == "POLYDATA" and m.device == "meniscus_medial")
        self.check_poses(client)
        self.check_tracking_data()
        client.until(lambda m: m.kind == "STRING" and (m.device, m.content[4:]) == ("events", b"cut"))
        self.session_command("pause", "room-1")
        wait_until("the mesh of the server", lambda: abs(self.newest_volume() - self.resection()["volume_mm3"]) < 1e-3)
        self.assertLess(self.newest_volume(), whole.volume())
        client.until(lambda m: m.kind == "STATUS" and m.content[30:] == b"paused\0")

    def check_poses(self, client):
        _, messages = client.until(lambda m: m.kind == "TRANSFORM" and m.device == "punch_warped")
        _, more = client.until(lambda m: m.device == "punch_warped")
        newest = {m.device: m for m in messages + more if m.kind == "TRANSFORM"}
        self.assertLessEqual({"femur", "tibia", "patella", "virtual_tibia", "punch"}, set(newest))
        self.assertLess(abs(newest["punch"].seconds - time.time()), PATIENCE_S)

    def check_tracking_data(self):
        client = self.client()
        client.ask("STT_TDATA", 2, struct.pack(">i32s", 50, b""))
        ready, _ = client.until(lambda m: m.kind == "RTS_TDATA")
        self.assertEqual((ready.version, ready.content), (2, b"\0"))
        data, _ = client.until(lambda m: m.kind == "TDATA")
        _, between = client.until(lambda m: m.kind == "TDATA")
        names = [text_of(data.content[at:at + 20]) for at in range(0, len(data.content), 70)]
        self.assertIn("virtual_tibia", names)
        self.assertNotIn("TRANSFORM", [m.kind for m in between])

    def newest_volume(self):
        client = self.client()
        mesh, _ = client.until(lambda m: m.kind == "POLYDATA" and m.device == "meniscus_medial")
        client.close()
        return mesh.volume()


if __name__ == "__main__":
    unittest.main(verbosity=2)
