#!/usr/bin/env python3
"""Files that arthron-trace makes: which columns a table has, and what a disk that is full leaves."""

import csv
import io
import os
import resource
import signal
import subprocess
import tempfile
import unittest

from arthron import CASES, call, program
from old_traces import FITTED, unpack, unpack_trace


class Exports(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-test-")
        cls.trace, cls.case = unpack(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def table(self, *options):
        text = call("arthron-trace", "export", self.trace, "--csv", "-", *options).stdout
        return list(csv.DictReader(io.StringIO(text)))

    def test_a_frame_has_one_row_and_the_times_of_its_measurements(self):
        frames = [row for row in self.table() if row["input"] == "frame"]
        times = [int(row["frame_time_ns"]) for row in frames]
        self.assertEqual(times, sorted(set(times)))
        measured = [int(row["measured_punch_time_ns"]) for row in frames if row["measured_punch_time_ns"]]
        self.assertGreater(len(set(measured)), 300)
        self.assertTrue(all(later >= earlier for earlier, later in zip(measured, measured[1:])))

    def test_groups_are_named_where_the_case_is_there(self):
        rows = self.table("--case", self.case, "--columns", "*")
        self.assertEqual({row["landed_group"] for row in rows if row["landed_job"]}, {"meniscus_medial"})
        self.assertIn("skin", {row["punch_nearest_group"] for row in rows})

    def test_columns_are_those_that_are_asked_for_in_that_order(self):
        rows = self.table("--columns", "punch_t?_mm,t_seconds,measured_punch_t?_mm")
        self.assertEqual(list(rows[0]), ["punch_tx_mm", "punch_ty_mm", "punch_tz_mm", "t_seconds",
                                         "measured_punch_tx_mm", "measured_punch_ty_mm", "measured_punch_tz_mm"])
        seen = [row for row in rows if row["measured_punch_tx_mm"]]
        self.assertTrue(seen and all(row["punch_tx_mm"] == row["measured_punch_tx_mm"] for row in seen[10:]))
        refused = call("arthron-trace", "export", self.trace, "--csv", "-", "--columns", "step,prob_*", code=1)
        self.assertIn("no column 'prob_*'", refused.stderr)

    def test_an_unknown_column_is_named_and_the_known_ones_are_listed(self):
        known = list(self.table("--case", self.case, "--columns", "*")[0])
        refused = call("arthron-trace", "export", self.trace, "--csv", "-", "--case", self.case,
                       "--columns", "step,punch_tx_m", code=1)
        *listed, why = refused.stderr.splitlines()
        self.assertEqual((refused.stdout, [name.strip() for name in listed]), ("", known))
        self.assertIn("no column 'punch_tx_m'; did you mean 'punch_tx_mm'?", why)
        refused = call("arthron-trace", "export", self.trace, "--csv", "-", "--columns", ",", code=1)
        self.assertIn("the list of columns is empty", refused.stderr)

    def test_every_measurement_has_its_time_and_its_values(self):
        rows = self.table("--columns", "measured_*")
        times = [name for name in rows[0] if name.endswith("_time_ns")]
        self.assertEqual(times, ["measured_joint_time_ns", "measured_probe_time_ns", "measured_punch_time_ns",
                                 "measured_punch_handle_time_ns"])
        for name in times:
            values = [v for v in rows[0] if v.startswith(name[:-len("time_ns")])]
            self.assertGreater(len(values), 4)
            for row in rows:
                self.assertEqual({bool(row[v]) for v in values if "handle" in name or "handle" not in v},
                                 {bool(row[name])})

    def test_another_case_is_refused_and_one_that_is_not_there_is_told(self):
        for option in ("--csv", "--mcap"):
            refused = call("arthron-trace", "export", self.trace, option, "-", "--case", os.path.join(CASES, "healthy"),
                           code=1)
            self.assertIn("the case is not the one that the session was recorded with", refused.stderr)
            refused = call("arthron-trace", "export", self.trace, option, "-", "--case", self.folder.name, code=1)
            self.assertIn("case.json", refused.stderr)
        with tempfile.TemporaryDirectory(prefix="arthron-test-") as folder:
            done = call("arthron-trace", "export", unpack_trace(FITTED, folder), "--csv", "-")  # names no folder
        self.assertIn("the names of groups are left out: the case", done.stderr)
        self.assertEqual({row["landed_group"] for row in csv.DictReader(io.StringIO(done.stdout))}, {""})

    def test_an_undo_has_no_move(self):
        undone = [row for row in self.table() if row["job_kind"] == "undo"]
        self.assertTrue(undone)
        for row in undone:
            self.assertEqual((row["job_blade"], row["job_from_qw"], row["job_to_tx_mm"], row["job_tissue"]),
                             ("", "", "", "0"))

    def test_a_time_in_which_there_is_nothing_is_refused_and_leaves_no_file(self):
        out = os.path.join(self.folder.name, "none")
        for option in ("--csv", "--exr", "--gltf", "--mcap"):
            refused = call("arthron-trace", "export", self.trace, "--case", self.case, option, out, "--from", "100",
                           code=1)
            self.assertIn("no step in that time", refused.stderr)
            self.assertFalse(os.path.exists(out))
        refused = call("arthron-trace", "cut", self.trace, "--from", "100", "--out", out, code=1)
        self.assertIn("no step in that time", refused.stderr)
        self.assertFalse(os.path.exists(out))

    def test_a_full_disk_is_named_and_leaves_what_was_there(self):
        folder = os.path.join(self.folder.name, "full")
        os.mkdir(folder)
        out = os.path.join(folder, "out")

        def full():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))

        for arguments in (["export", self.trace, "--csv", out], ["export", self.trace, "--exr", out],
                          ["export", self.trace, "--gltf", out], ["export", self.trace, "--mcap", out], ["report", self.trace, "--out", out],
                          ["picture", self.trace, "--out", out]):
            with open(out, "w") as f:
                f.write("before")
            done = subprocess.run([program("arthron-trace"), *arguments, "--case", self.case], preexec_fn=full,
                                  capture_output=True, text=True, timeout=50)
            self.assertEqual(done.returncode, 1, arguments)
            self.assertIn("File too large", done.stderr, arguments)
            self.assertEqual(os.listdir(folder), ["out"], arguments)
            with open(out) as f:
                self.assertEqual(f.read(), "before", arguments)

    def test_a_device_without_room_is_named(self):
        refused = call("arthron-trace", "export", self.trace, "--csv", "/dev/full", code=1)
        self.assertIn("No space left on device", refused.stderr)


if __name__ == "__main__":
    unittest.main()
