#!/usr/bin/env python3
"""A station of an earlier release, played from its recorded conversation, gets from this server what it got then.

tests/corpus/conversation has the messages of that station and of the server that it spoke to, the schema of that
release, and record.py, which makes such a file. The station's answers to pings, its hash of each mesh and its
challenges are made here; all else that it says are its own bytes. What the server says is read by the old schema.

That release blended surfaces by another field. Where a tip is shown is therefore held against the trace that this
server writes, and against the recorded replies only where both fields agree.

An attempt runs meanwhile. That release knows no AttemptState: it skips the message and goes on.
"""

import csv
import io
import json
import lzma
import math
import os
import subprocess
import sys
import tarfile
import tempfile
import threading
import time
import unittest

from arthron import SOURCE, SystemTest, call

CORPUS = os.path.join(SOURCE, "tests/corpus/conversation")
CASE = os.path.join(SOURCE, "tests/corpus/trace/version4/case.tar.xz")
RECORD = os.path.join(CORPUS, "station-0.1.0.jsonl.xz")

made = tempfile.TemporaryDirectory(prefix="arthron-test-")
subprocess.run(["protoc", "--proto_path", CORPUS, "--python_out", made.name, "arthron.proto"], check=True)
sys.dont_write_bytecode = True
sys.path[:0] = [made.name, os.path.join(SOURCE, "docs/examples")]
import arthron_pb2 as pb  # noqa: E402
import station as example  # noqa: E402

TASK = """
[task]
title = A bent knee
briefing = Bend it as far as it goes.
limit_s = 60
[pass]
time_s = 60
source = for a test
[goal bent]
flexion_deg = 150 160
"""
CONTACT, CUT = 8, 32
SLACK_NS = 5 * 10**9  # that opening the session may take longer than it did
BY_FIELD = {"body", "pose", "trust_radius_mm", "nearest_mm", "lead"}  # of a warped instrument
TOUCH_MM = 0.1  # so near a surface every field displaces as the surface does, and
TOUCH_ERROR_MM = 1e-3


class Line:
    """What was said at one time: a Control, or the Frame or Reply of a datagram."""

    def __init__(self, text):
        line = json.loads(text)
        self.ns, self.sender, self.by, self.data = line["ns"], line["from"], line["by"], bytes.fromhex(line["message"])
        if self.by == "udp":
            self.kind = "frame" if self.sender == "station" else "reply"
            self.value = (pb.Frame if self.kind == "frame" else pb.Reply).FromString(self.data)
        else:
            control = pb.Control.FromString(self.data)
            self.kind = control.WhichOneof("message")
            self.value = getattr(control, self.kind)


with lzma.open(RECORD, "rt") as packed:
    LINES = [Line(text) for text in packed]


def said(sender, kind):
    return [line for line in LINES if (line.sender, line.kind) == (sender, kind)]


def turned(q, v):
    """v by the rotation (w, x, y, z)."""
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return [v[0] + w * t[0] + y * t[2] - z * t[1],
            v[1] + w * t[1] + z * t[0] - x * t[2],
            v[2] + w * t[2] + x * t[1] - y * t[0]]


def pose_of(row, name):
    """Rotation and translation of T_mockup_NAME in a row of an exported trace."""
    return ([float(row[f"{name}_q{c}"]) for c in "wxyz"], [float(row[f"{name}_t{c}_mm"]) for c in "xyz"])


def shown_at(row, instrument):
    """In the mock-up: the tip of a reply's instrument."""
    rotation, translation = pose_of(row, pb.Body.Name(instrument.body).lower().removeprefix("body_"))
    p = instrument.pose
    return [a + b for a, b in zip(turned(rotation, (p.x, p.y, p.z)), translation)]


class Played:
    """The station's side. Its clock is the recorded one, set back by the slack."""

    def __init__(self, port, keys):
        with open(os.path.join(keys, "authority.pem")) as f:
            self.socket = example.WebSocket("127.0.0.1", port, example.tls_context(f.read(), keys), "arthron.1")
        self.start_ns = time.monotonic_ns()
        self.unknown = 0  # messages of a later release
        self.heard, self.replies, self.payloads, self.meshes, self.datagrams = {}, {}, {}, {}, None
        self.socket.send(LINES[0].data)

    def now_ns(self):
        return LINES[0].ns - SLACK_NS + time.monotonic_ns() - self.start_ns

    def say(self, **message):
        self.socket.send(pb.Control(**message).SerializeToString())

    def hear(self, until_ns):
        while True:
            left_s = max(0, until_ns - self.now_ns()) / 1e9
            if self.socket.poll([self.datagrams.socket] if self.datagrams else [], left_s):
                reply = pb.Reply.FromString(self.datagrams.open(self.datagrams.socket.recv(2048)))
                self.replies["udp", reply.frame_number] = reply
            while (data := self.socket.message()) is not None:
                control = pb.Control.FromString(data)
                kind = control.WhichOneof("message")
                if kind is None:
                    self.unknown += 1
                    continue
                self.heard.setdefault(kind, []).append(getattr(control, kind))
                getattr(self, "hear_" + kind, lambda value: None)(getattr(control, kind))
            if self.now_ns() >= until_ns:
                return

    def hear_ping(self, ping):
        now = self.now_ns()
        self.say(pong=pb.Pong(sent_ns=ping.sent_ns, received_ns=now, answered_ns=now))

    def hear_udp_path(self, path):
        self.say(udp_path=path)

    def hear_udp_keys(self, keys):
        self.datagrams = example.Datagrams("127.0.0.1", keys)

    def hear_reply(self, reply):
        self.replies["tcp", reply.frame_number] = reply

    def hear_mesh_chunk(self, chunk):
        begun = b"" if chunk.index == 0 else self.payloads[chunk.group]
        payload = self.payloads[chunk.group] = begun + chunk.data
        if len(payload) < chunk.size:
            return
        assert len(payload) == chunk.size and chunk.base in (0, self.meshes.get(chunk.group, (0,))[0]), chunk.group
        self.meshes[chunk.group] = chunk.number, int.from_bytes(payload[-8:], "little")
        self.say(mesh_ack=pb.MeshState(group=chunk.group, number=chunk.number, hash=self.meshes[chunk.group][1]))

    def wait_for(self, kind):
        while kind not in self.heard and self.now_ns() < LINES[0].ns:
            self.hear(self.now_ns() + 10**7)

    def play(self):
        """All that the station said, each message at its time, by its way."""
        for line in LINES:
            if line.sender == "station" and line.kind in ("frame", "ping", "mesh_ask"):
                self.hear(line.ns)
                if line.by == "udp":
                    self.datagrams.socket.send(self.datagrams.seal(line.data))
                else:
                    self.socket.send(line.data)

    def end(self):
        self.hear(self.now_ns() + 10**9)

    def close(self):
        self.socket.close()
        if self.datagrams:
            self.datagrams.close()


class Conversation(SystemTest):
    def setUp(self):
        super().setUp()
        with tarfile.open(CASE) as packed:
            packed.extractall(self.folder)
        os.mkdir(self.path("tasks"))
        self.write("tasks/bent.ini", TASK)
        self.start_server("[warp]\nhold_ms = 5000\n[case case]\ndir = case\n[station room-1]\ncase = case",
                          extra="tasks = tasks")
        code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        example.enrol("127.0.0.1", self.port, code, "room-1", self.path("keys-room-1"))
        self.played = Played(self.port, self.path("keys-room-1"))
        self.addCleanup(self.played.close)

    def welcome(self):
        self.played.wait_for("session_change")
        self.assertIn("session_change", self.played.heard, "no session in time")
        before, now = said("server", "welcome")[0].value, self.played.heard["welcome"][0]
        self.assertEqual(len(now.session_id), len(before.session_id))
        self.assertFalse(now.resumed)
        self.assertIn(now.state, (pb.CLOSED, pb.WAITING))  # a session that is being opened
        for field in ("version", "capabilities", "case_name", "case_hash"):
            self.assertEqual(getattr(now, field), getattr(before, field), field)
        self.assertEqual(self.played.heard["session_change"][0], said("server", "session_change")[0].value)

    def assert_same(self, now, before, where, but=frozenset()):
        """Field by field: doubles within 1e-9, floats within what one rounding of them can be."""
        self.assertEqual([f.name for f, _ in now.ListFields()], [f.name for f, _ in before.ListFields()], where)
        for field, value in before.ListFields():
            if field.name in but:
                continue
            found = getattr(now, field.name)
            many = field.label == field.LABEL_REPEATED
            for a, b in zip(*((found, value) if many else ([found], [value])), strict=True):
                if field.type == field.TYPE_MESSAGE:
                    self.assert_same(a, b, f"{where} {field.name}", but)
                elif field.type in (field.TYPE_DOUBLE, field.TYPE_FLOAT):
                    bound = 1e-9 if field.type == field.TYPE_DOUBLE else 1e-6 * max(1, abs(b))
                    self.assertLessEqual(abs(a - b), bound, f"{where} {field.name}")
                else:
                    self.assertEqual(a, b, f"{where} {field.name}")

    def rows(self):
        """Of this session's trace, by the number of their frame."""
        table = call("arthron-trace", "export", self.session()["trace"], "--csv", "-", code=None).stdout
        return {int(row["frame_number"]): row for row in csv.DictReader(io.StringIO(table))}

    def assert_shown(self, row, instrument, before):
        """Where the trace says; and where the earlier release did, if both touch the same place."""
        name = "joint femur tibia patella probe punch shaver knife scope".split()[instrument.channel]
        _, tip = pose_of(row, f"{name}_warped")
        shown = shown_at(row, instrument)
        self.assertLessEqual(math.dist(shown, tip), 1e-6, row["frame_number"])
        nearest = float(row[f"{name}_nearest_mm"])
        self.assertAlmostEqual(instrument.nearest_mm, nearest if math.isfinite(nearest) else -1, 5)
        self.assertEqual(instrument.lead.mode, pb.TIP)
        moved = [float(row[f"{name}_displacement_{c}_mm"]) for c in "xyz"]
        self.assertAlmostEqual(math.hypot(*instrument.lead.v), math.hypot(*moved), 5)
        if instrument.body != before.body or not all(0 <= i.nearest_mm <= TOUCH_MM for i in (instrument, before)):
            return 0
        self.assertLessEqual(math.dist(shown, shown_at(row, before)), TOUCH_ERROR_MM, row["frame_number"])
        return 1

    def replies(self):
        """One to each frame by its way, the same while nothing is cut but for the field, and the same contacts."""
        rows = self.rows()
        before = {(line.by, line.value.frame_number): line.value for line in said("server", "reply")}
        self.assertEqual(set(self.played.replies), set(before))
        first_cut = min(reply.frame_number for reply in before.values() if reply.events & CUT)
        first_cut = min([first_cut] + [r.frame_number for r in self.played.replies.values() if r.events & CUT])
        warped = touched = 0
        for key, reply in before.items():
            now = self.played.replies[key]
            self.assertEqual((now.frame_number, now.frame_time_ns, now.state),
                             (reply.frame_number, reply.frame_time_ns, reply.state))
            if reply.frame_number < first_cut:
                self.assert_same(now, reply, f"reply {reply.frame_number}", BY_FIELD)
                warped += sum(i.nearest_mm >= 0 for i in reply.instruments)
                for instrument, earlier in zip(now.instruments, reply.instruments, strict=True):
                    touched += self.assert_shown(rows[now.frame_number], instrument, earlier)
        self.assertGreater(warped, 100)
        self.assertGreater(touched, 10)
        self.assertTrue(any(r.events & CUT for r in self.played.replies.values()))

    def meshes_and_resections(self):
        self.assertEqual(set(self.played.meshes), {line.value.group for line in said("server", "mesh_chunk")})
        last = {r.group: r for r in self.played.heard["resection"]}
        first = {}
        for r in self.played.heard["resection"]:
            first.setdefault(r.group, r)
        for line in said("server", "resection")[:2]:
            self.assert_same(first[line.value.group], line.value, line.value.group)
        for group, mesh in self.played.meshes.items():
            self.assertEqual((last[group].mesh_number, last[group].mesh_hash), mesh)
        cut = last["meniscus_medial"]
        self.assertEqual(cut.mesh_number, 1 + cut.cuts)
        self.assertGreaterEqual(cut.cuts, 1)
        self.assertGreater(cut.removed_mm3, 0)

    def pongs(self):
        sent = [line.value.sent_ns for line in said("station", "ping")]
        self.assertEqual([pong.sent_ns for pong in self.played.heard["pong"]], sent)

    def connects_again(self):
        """With the same Hello, as after a lost link: the same session, and nothing of the meshes that it has."""
        self.played.close()
        again = Played(self.port, self.path("keys-room-1"))
        self.addCleanup(again.close)
        again.wait_for("session_change")
        welcome = again.heard["welcome"][0]
        self.assertTrue(welcome.resumed)
        self.assertEqual(welcome.session_id, self.played.heard["welcome"][0].session_id)
        self.assertEqual(again.heard["session_change"][0].state, pb.RUNNING)
        have = [pb.MeshState(group=group, number=number, hash=hash_)
                for group, (number, hash_) in self.played.meshes.items()]
        again.say(mesh_ask=pb.MeshAsk(have=have))
        again.wait_for("resection")
        again.hear(again.now_ns() + 10**9)
        self.assertNotIn("mesh_chunk", again.heard)

    def test_the_station_gets_what_it_got(self):
        self.welcome()
        begins = threading.Thread(target=self.session_command, args=("begin", "room-1", "bent"))
        begins.start()
        self.played.play()
        begins.join()
        self.session_command("leave", "room-1")
        self.played.end()
        self.assertGreaterEqual(self.played.unknown, 2)  # it began, and it ended
        self.assertNotIn("refusal", self.played.heard)
        self.pongs()
        self.replies()
        self.meshes_and_resections()
        session = self.session()
        self.assertEqual([session[f] for f in ("frames_lost", "frames_invalid", "frames_early")], [0, 0, 0])
        self.connects_again()


if __name__ == "__main__":
    unittest.main()
