#!/usr/bin/env python3
"""Another server goes on with a session in a part of its own, which this test writes with nothing but FORMAT.md: from
a state of the server that was killed, and from what its trace has behind it, without poses."""

import hashlib
import importlib.util
import os
import shutil
import signal
import struct
import sys
import unittest

from arthron import SOURCE, call, call_json, wait_until
from bites import Bites
from resume import PLACE_IN_STATE, STATE

sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("example", os.path.join(SOURCE, "docs/examples/trace.py"))
example = importlib.util.module_from_spec(spec)
spec.loader.exec_module(example)

STEP, PAST, REMARK, TOUCH, MARKER, BEGUN, ENDED, STATE_RECORD, TAKEN = 1, 4, 6, 8, 9, 10, 11, 12, 13
COMMANDS, JOB = (2, 3, 4, 5, 7), 6
PART_OF_STATE = 8000  # bytes
spans = {}


def spanned(name):
    """Notes the bytes that were read last."""
    read = example.TYPES[name]

    def note(trace):
        begin = trace.at
        value = read(trace)
        spans[name] = trace.data[begin:trace.at]
        return value
    example.TYPES[name] = note


for field in ("input", "job", "landed"):
    spanned(field)


class Chain:
    """A trace that is written: each piece of it is followed by its hash."""

    def __init__(self, head):
        self.hash, self.data = bytes(32), b""
        self.add(head)

    def add(self, piece):
        self.hash = hashlib.sha256(self.hash + piece).digest()
        self.data += piece + self.hash

    def record(self, kind, payload):
        self.add(struct.pack("<IB", len(payload), kind) + payload)


def header_of(first, part, server, token):
    """That of part 1, but for its last three fields."""
    size = struct.unpack_from("<I", first, 10)[0]
    fields = first[14:14 + size]
    assert fields[-12:] == struct.pack("<HHQ", 1, 0, 0)
    fields = fields[:-12] + struct.pack("<HH", part, len(server)) + server + struct.pack("<Q", token)
    return first[:10] + struct.pack("<I", len(fields)) + fields


def records_of(first):
    """(offset, type, payload, fields, bytes of input, job and landed) of each record."""
    trace = example.Trace(first)
    begin = trace.next
    for name, fields in trace.records():
        spans_then = dict(spans)
        yield begin, first[begin + 4], first[begin + 5:trace.next - 32], fields, spans_then
        begin = trace.next


def next_part(first, state, part=2, server=b"beta", token=9):
    """Its bytes, and how many jobs it takes over."""
    chain, asked, taken = Chain(header_of(first, part, server, token)), None, 0
    place = struct.unpack_from("<Q", state, PLACE_IN_STATE)[0]
    for at in range(0, len(state), PART_OF_STATE):
        chain.record(STATE_RECORD, struct.pack("<II", len(state), at) + state[at:at + PART_OF_STATE])
    for offset, kind, payload, fields, raw in records_of(first):
        if kind in (REMARK, MARKER, BEGUN, ENDED) or offset >= place and kind == TOUCH:
            chain.record(kind, payload)
        elif offset >= place and kind == STEP:
            did = fields["input"]
            if did["kind"] in COMMANDS:
                chain.record(PAST, raw["input"])
            if did["kind"] == JOB:
                chain.record(TAKEN, struct.pack("<q", did["time_ns"]) + asked + raw["landed"])
                taken += 1
        if kind == STEP and fields["job"]:
            asked = raw["job"]
    return chain.data, taken


class TraceParts(Bites):
    def cuts(self):
        return self.session_command("show", "room-1", code=None)["resections"][0]["cuts"]

    def kill_amid_cuts(self):
        """Of the session: what is known of it, the first part of its trace, a state, and its tissue in the end."""
        self.start_station()
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        session = self.session()
        state = session["trace"] + ".state"
        wait_until("its state", lambda: os.path.exists(state), 90)
        kept = self.path("kept.state")
        shutil.copy(state, kept)
        cuts = self.cuts()
        wait_until("more cuts", lambda: self.cuts() >= cuts + 2, 60)
        self.pause()
        resection = self.resection()
        self.session_command("start", "room-1")
        self.session_command("pause", "room-1")
        self.wait_for_steps(20)
        self.server.end(signal.SIGKILL)
        first = self.path("first.trace")
        shutil.move(session["trace"], first)
        os.unlink(state)
        with open(first, "rb") as f, open(kept, "rb") as g:
            return session, first, f.read(), g.read(), resection

    def verify(self, *traces, code=0):
        return call_json("arthron-trace", "verify", *traces, "--authority", os.path.join(self.keys, "authority.pem"),
                         code=code)

    def test_a_server_goes_on_in_a_later_part_and_both_are_one_session(self):
        session, first, content, state, before = self.kill_amid_cuts()
        part, taken = next_part(content, state)
        self.assertGreater(taken, 0)
        second = session["trace"]  # the records know this session as open by this name
        with open(second, "wb") as f:
            f.write(part)
        self.server = self.start_server()
        after, again = self.resection(), self.session()
        self.assertEqual({key: after[key] for key in STATE}, {key: before[key] for key in STATE})
        self.assertEqual((again["id"], again["state"]), (session["id"], "paused"))
        wait_until("the station", lambda: self.session()["connected"], 30)
        self.session_command("start", "room-1")
        wait_until("another cut", lambda: self.cuts() > before["cuts"], 60)
        self.session_command("stop", "room-1")
        metrics = self.metrics()
        self.server.end()
        self.assert_metrics_are_those_of(second, metrics)
        info = call_json("arthron-trace", "info", second)
        self.assertEqual([info[key] for key in ("version", "part", "server", "token", "taken", "resumes")],
                         [7, 2, "beta", 9, taken, 1])
        self.assertIn("part        2 of the session", call("arthron-trace", "info", second).stdout)
        replay = call_json("arthron-trace", "replay", second)
        self.assertEqual((replay["verdict"], replay["taken"]), ("identical", {"compared": taken, "different": 0}))
        found = self.verify(second, first)
        self.assertEqual((found["one_session"], [p["part"] for p in found["parts"]]), (True, [2, 1]))
        self.assertEqual([p["signature"] for p in found["parts"]], ["good", "none"])
        self.assertIn("one session, parts 1 to 2", call("arthron-trace", "verify", first, second).stdout)
        self.work_from_its_state(second)
        self.refuse(first, content, state, second)

    def work_from_its_state(self, second):
        for option, name in (("--csv", "a.csv"), ("--gltf", "a.glb"), ("--exr", "a.exr")):
            call("arthron-trace", "export", second, option, self.path(name))
        call("arthron-trace", "report", second, "--out", self.path("a.html"))
        call("arthron-trace", "picture", second, "--group", "meniscus_medial", "--out", self.path("a.png"))
        call("arthron-trace", "judge", second)
        self.assertIn("nothing can be cut", call("arthron-trace", "cut", second, "--from", "1", "--to", "2", "--out",
                                                 self.path("piece"), code=1).stderr)
        self.assertIn("no other settings", call("arthron-trace", "replay", second, "--strength", "0.5", code=1).stderr)

    def refuse(self, first, content, state, second):
        def why(*traces):
            return call_json("arthron-trace", "verify", *traces, code=1)["why"]

        def written(name, data):
            path = self.path(name)
            with open(path, "wb") as f:
                f.write(data)
            return path
        self.assertIn("part 1 of the session is missing", why(second, second))
        third = written("third", next_part(content, state, part=3)[0])
        self.assertIn("part 2 of the session is missing", why(first, third))
        lower = written("lower", next_part(content, state, token=0)[0])
        self.assertIn("part 2 has the token 0, and part 1 before it has 0", why(first, lower))
        place = struct.unpack_from("<Q", state, PLACE_IN_STATE)[0]
        self.assertIn("which part 1 does not have", why(written("short", content[:place - 1]), second))
        with open(second, "rb") as f:
            whole = f.read()
        cut = written("cut", whole[:len(whole) // 2])
        self.assertEqual(call_json("arthron-trace", "verify", cut, code=1)["whole"], False)


if __name__ == "__main__":
    unittest.main()
