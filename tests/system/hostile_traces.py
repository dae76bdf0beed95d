#!/usr/bin/env python3
"""Traces whose hashes are right and whose indexes are at the limits of their types: each command answers, none ends
by a signal."""

import hashlib
import os
import struct
import subprocess
import tempfile
import unittest

from arthron import program
from old_traces import unpack

HASH = 32
STEP = 1
POSE = 7 * 8
FIGURES = 4 * 4 + 6 * 8 + 7 * 8 + 27 * 8


def records(data):
    """(start, size with its hash, type) of each record, after the header's own size."""
    at = 14 + struct.unpack_from("<I", data, 10)[0] + HASH
    yield 0, at, None
    while at + 5 <= len(data):
        size, kind = struct.unpack_from("<IB", data, at)
        yield at, 5 + size + HASH, kind
        at += 5 + size + HASH


def mend(data):
    """Every hash is put right again, so that only what is in the records can be wrong."""
    before = bytes(HASH)
    for start, size, _ in list(records(data)):
        before = hashlib.sha256(before + data[start:start + size - HASH]).digest()
        data[start + size - HASH:start + size] = before


def input_size(data, at):
    kind = data[at]
    if kind == 6:
        return 18
    if kind:
        return 9
    end = at + 9 + 17
    for _ in range(data[at + 25]):
        end += 12 + {0: 48, 1: POSE, 2: 12}[data[end + 1]]
    return end - at


class Places:
    """Where the indexes and counts of a step are."""

    def __init__(self, data, start):
        self.at = {}
        at = start + 5
        self.at["input.kind"] = at
        if data[at] == 0:
            self.at["frame.count"] = at + 25
            if data[at + 25]:
                self.at["sample.channel"], self.at["sample.kind"] = at + 26, at + 27
        at += input_size(data, at)
        self.at["state"], self.at["joint_validity"] = at + 24, at + 29 + 48
        at += 29 + 48 + 1
        for _ in range(3):
            at += POSE + 1 + (POSE if data[at + POSE] else 0)
        self.at["torn_count"] = at
        at += 1 + 16 * data[at]
        for i in range(5):
            at = self.instrument(data, at, i)
        self.job_at = at
        at += 8
        if any(data[at - 8:at]):
            self.at["job.kind"], self.at["job.tissue"] = at, at + 1
            if data[at] == 1:
                self.at["job.stroke"], self.at["job.blade"] = at + 2, at + 6
                at += 5 + 2 * (POSE + 8)
            at += 2
        self.landed = any(data[at:at + 8])
        if self.landed:
            self.at["landed.outcome"], self.at["landed.tissue"] = at + 8, at + 9
            self.at["landed.mesh_number"] = at + 10

    def instrument(self, data, at, i):
        present = data[at]
        self.at[f"present {i}"] = at
        if not present:
            return at + 1
        self.at[f"validity {i}"] = at + 1
        at += 2 + 2 * POSE + 24 + 72 + 8
        self.at[f"nearest {i}"] = at
        at += 12
        self.at[f"mode {i}"] = at
        at += 1 + (48 + 8 + 192 + 16 if data[at] else 0) + 56 + 12
        self.at[f"handle_validity {i}"] = at
        return at + 1


WIDE = ("nearest", "job.stroke", "landed.mesh_number")  # 32 bits, all others 8


class Hostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-test-")
        trace, cls.case = unpack(cls.folder.name)
        with open(trace, "rb") as f:
            cls.data = f.read()
        steps = [Places(cls.data, start) for start, _, kind in records(cls.data) if kind == STEP]
        cuts = [step for step in steps if "job.blade" in step.at]
        cls.steps = [cuts[3], [step for step in steps if step.landed][3]]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def forge(self, at, value, wide):
        data = bytearray(self.data)
        struct.pack_into("<I" if wide else "<B", data, at, value)
        mend(data)
        path = os.path.join(self.folder.name, "forged.trace")
        with open(path, "wb") as f:
            f.write(data)
        return path

    def run_all(self, trace, what, commands):
        out = os.path.join(self.folder.name, "out")
        for command in commands:
            arguments = [out if word == "OUT" else self.case if word == "CASE" else word for word in command[1:]]
            done = subprocess.run([program("arthron-trace"), command[0], trace, *arguments], capture_output=True,
                                  timeout=60)
            self.assertIn(done.returncode, (0, 1), f"{what}: {command}: {done.stderr[-300:]}")
            if os.path.exists(out):
                os.unlink(out)

    def test_the_chain_is_made_right_as_the_programs_make_it(self):
        data = bytearray(self.data)
        mend(data)
        self.assertEqual(bytes(data), self.data)

    def test_every_index_at_the_limits_of_its_type(self):
        quick = [["info", "--json"], ["score", "--case", "CASE"], ["export", "--csv", "OUT", "--case", "CASE"]]
        seen = set()
        for step in self.steps:
            for name, at in step.at.items():
                wide = name.startswith(WIDE)
                for value in (0x7fffffff, 0x80000000, 0xffffffff) if wide else (127, 128, 255):
                    self.run_all(self.forge(at, value, wide), f"{name} = {value}", quick[:1])
                seen.add(name.split()[0])
                self.run_all(self.forge(at, 0xffffffff if wide else 255, wide), name, quick)
        self.assertLessEqual({"nearest", "job.tissue", "job.blade", "landed.tissue", "torn_count", "mode"}, seen)

    def test_what_the_types_allow_and_the_case_has_not(self):
        """Four tissues fit into a record, the case has fewer; 64 groups, and it has seven."""
        every = [["info"], ["verify"], ["score", "--case", "CASE"], ["replay", "--case", "CASE"],
                 ["replay", "--case", "CASE", "--field", "smooth"], ["export", "--csv", "OUT", "--case", "CASE"],
                 ["export", "--exr", "OUT", "--case", "CASE"], ["export", "--gltf", "OUT", "--case", "CASE"],
                 ["export", "--mcap", "OUT", "--case", "CASE"],
                 ["report", "--case", "CASE", "--out", "OUT"], ["picture", "--case", "CASE", "--out", "OUT"],
                 ["cut", "--from", "2", "--out", "OUT"]]
        cut, landed = self.steps
        for step, name, value in ((landed, "landed.tissue", 3), (cut, "job.tissue", 3), (cut, "nearest 1", 15),
                                  (cut, "torn_count", 0)):
            self.run_all(self.forge(step.at[name], value, name.startswith("nearest")), f"{name} = {value}", every)

    def test_a_tissue_that_the_case_has_not_is_named(self):
        trace = self.forge(self.steps[1].at["landed.tissue"], 3, False)
        done = subprocess.run([program("arthron-trace"), "replay", trace, "--case", self.case], capture_output=True,
                              text=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn("names a part that its case does not have", done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
