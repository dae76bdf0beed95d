#!/usr/bin/env python3
"""docs/examples/trace.py reads a trace with nothing but FORMAT.md: it finds the figures of arthron-trace info."""

import glob
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import unittest

from arthron import SOURCE, call, call_json
from old_traces import CORPUS, FITTED, unpack_trace

EXAMPLE = os.path.join(SOURCE, "docs/examples/trace.py")
spec = importlib.util.spec_from_file_location("example", EXAMPLE)
example = importlib.util.module_from_spec(spec)
sys.dont_write_bytecode = True
spec.loader.exec_module(example)
# What info tells besides: where the session comes from, its settings, and what docs/examples/touch.py reads.
NOT_FIGURES = {"station", "trainee", "case", "start", "from_utc_s", "until_utc_s", "settings", "machine", "parent",
               "parent_session", "optic", "remarks", "markers", "markers_count", "touches", "attempts", "state_step"}


def rounded(value):
    """As info prints it."""
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def figures_of(trace):
    done = subprocess.run([sys.executable, "-I", EXAMPLE, trace], capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise AssertionError(f"{trace}: {done.stderr}")
    return rounded(json.loads(done.stdout))


def figures_of_info(trace):
    return {key: value for key, value in call_json("arthron-trace", "info", trace).items() if key not in NOT_FIGURES}


class ExampleTrace(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-test-")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def same(self, trace):
        self.every_byte_is_read(trace)
        figures = figures_of(trace)
        self.assertEqual(figures, figures_of_info(trace), trace)
        return figures

    def every_byte_is_read(self, path):
        with open(path, "rb") as f:
            trace = example.Trace(f.read())
        for name, _ in trace.records():
            if name != "touch":
                self.assertEqual(trace.at, trace.next - (8 if trace.version == 2 else 32), (path, name))

    def unpacked(self, name):
        packed = {"4": os.path.join(CORPUS, "cuts.trace.xz"), "5": FITTED}[name]
        return unpack_trace(packed, self.folder.name)

    def test_traces_of_versions_2_and_3(self):
        traces = sorted(glob.glob(os.path.join(SOURCE, "tests/corpus/trace/*.trace")))
        self.assertEqual([self.same(trace)["version"] for trace in traces], [2, 2, 3, 3])

    def test_traces_of_versions_4_and_5_with_cuts(self):
        for version in ("4", "5"):
            figures = self.same(self.unpacked(version))
            self.assertGreater(figures["resections"][0]["cuts"], 10)
            self.assertGreater(figures["instruments"]["punch"]["noticeable_share"]["any"], 0)

    def test_a_piece_that_this_build_wrote(self):
        piece = self.path("piece.trace")
        call("arthron-trace", "cut", self.unpacked("5"), "--from", "834", "--to", "838", "--out", piece)
        self.assertGreater(self.same(piece)["past"], 100)

    def test_a_trace_that_breaks_off_and_one_that_was_changed(self):
        with open(self.unpacked("5"), "rb") as f:
            data = bytearray(f.read())
        broken = self.path("broken.trace")
        with open(broken, "wb") as f:
            f.write(data[:len(data) // 2])
        figures = self.same(broken)
        self.assertFalse(figures["whole"])
        data[len(data) // 3] ^= 1
        with open(broken, "wb") as f:
            f.write(data)
        self.assertLess(self.same(broken)["steps"], figures["steps"])

    def test_it_is_short_and_needs_no_package(self):
        with open(EXAMPLE) as f:
            lines = f.read().splitlines()
        self.assertLess(len(lines), 160)
        imported = [line.split()[1] for line in lines if line.startswith(("import ", "from "))]
        self.assertLessEqual(set(imported), sys.stdlib_module_names)


if __name__ == "__main__":
    unittest.main()
