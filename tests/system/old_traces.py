#!/usr/bin/env python3
"""A session that version 4 of the trace recorded, with cuts and an undo: what the programs make of it is what the
build that recorded it made of it. The same hand once more, as version 5 recorded it under rules 5."""

import csv
import io
import json
import lzma
import os
import tarfile
import tempfile
import unittest

from arthron import SOURCE, call, call_json

CORPUS = os.path.join(SOURCE, "tests/corpus/trace/version4")
FITTED = os.path.join(SOURCE, "tests/corpus/trace/version5/cuts.trace.xz")


def expected(name):
    with open(os.path.join(CORPUS, name)) as f:
        return json.load(f)


def unpack_trace(path, folder):
    trace = os.path.join(folder, "cuts.trace")
    with lzma.open(path) as packed, open(trace, "wb") as f:
        f.write(packed.read())
    return trace


def unpack(folder):
    """The trace and the case that it was recorded with."""
    trace, case = unpack_trace(os.path.join(CORPUS, "cuts.trace.xz"), folder), os.path.join(folder, "case")
    with tarfile.open(os.path.join(CORPUS, "case.tar.xz")) as packed:
        packed.extractall(folder)
    return trace, case


class OldTraces(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-test-")
        cls.trace, cls.case = unpack(cls.folder.name)
        with lzma.open(os.path.join(CORPUS, "table.csv.xz"), "rt") as packed:
            cls.table = packed.read()

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def test_it_verifies_and_its_signature_is_good(self):
        found = call_json("arthron-trace", "verify", self.trace, "--authority", os.path.join(CORPUS, "authority.pem"))
        self.assertEqual((found.pop("disk_faults"), found.pop("touches")), (0, 0))
        self.assertEqual(found, expected("verify.json"))

    def test_it_scores_to_the_same_bits(self):
        found = call("arthron-trace", "score", self.trace, "--case", self.case, "--json").stdout
        with open(os.path.join(CORPUS, "score.json")) as f:
            self.assertEqual(found, f.read())

    def test_it_tells_the_same_of_itself_and_one_volume_is_removed(self):
        found, before = call_json("arthron-trace", "info", self.trace), expected("info.json")
        scored = next(m for m in expected("score.json")["metrics"] if m["name"] == "removed")
        resection = found["resections"][0]
        self.assertAlmostEqual(resection["removed_mm3"] + resection["pieces_mm3"], scored["value"], 9)
        resection["removed_mm3"] = before["resections"][0]["removed_mm3"]
        self.assertEqual((found.pop("markers"), found.pop("markers_count"), found.pop("attempts")), ([], 0, []))
        self.assertEqual([found.pop(key) for key in ("part", "server", "token", "taken", "state_step")], [1, "", 0, 0, 0])
        self.assertEqual([found["events"].pop(event) for event in ("grasped", "dropped", "taken_out")], [0, 0, 0])
        self.assertAlmostEqual(found.pop("until_utc_s") - found.pop("from_utc_s"), found["seconds"], delta=0.05)
        self.assertEqual(found, before)

    def test_its_table_has_the_same_values(self):
        old = list(csv.DictReader(io.StringIO(self.table)))
        names = self.table.split("\n", 1)[0]
        found = call("arthron-trace", "export", self.trace, "--csv", "-", "--columns", names).stdout
        self.assertEqual(found.split("\n", 1)[0], names)
        for before, row in zip(old, csv.DictReader(io.StringIO(found)), strict=True):
            if row["job_kind"] == "undo":  # it had a blade's move of zeros
                before = {key: "" if key.startswith("job_") and not row[key] else before[key] for key in before}
            self.assertEqual(row, before)

    def test_it_replays_with_its_own_rules(self):
        found = call_json("arthron-trace", "replay", self.trace, "--case", self.case)
        self.assertTrue(found["same_events"])
        if found["same_libc"] and found["same_cpu"]:
            self.assertEqual((found["verdict"], found["different"]), ("identical", 0))

    def test_its_images_scene_and_report_are_made(self):
        for option, name in (("--exr", "a.exr"), ("--gltf", "a.glb")):
            call("arthron-trace", "export", self.trace, "--case", self.case, option, self.path(name))
            self.assertGreater(os.path.getsize(self.path(name)), 100000)
        call("arthron-trace", "report", self.trace, "--case", self.case, "--out", self.path("a.html"))
        with open(self.path("a.html")) as f:
            self.assertIn("68.5", f.read())

    def test_a_piece_of_it_replays(self):
        piece = self.path("piece.trace")
        call("arthron-trace", "cut", self.trace, "--from", "8", "--to", "12", "--out", piece)
        self.assertEqual(call_json("arthron-trace", "info", piece)["version"], 7)
        found = call_json("arthron-trace", "replay", piece, "--case", self.case)
        self.assertTrue(found["same_events"])

    def test_under_rules_5_its_touch_is_fitted_to_the_same_bits(self):
        with tempfile.TemporaryDirectory(prefix="arthron-test-") as folder:
            trace = unpack_trace(FITTED, folder)
            found = call_json("arthron-trace", "replay", trace, "--case", self.case)
        self.assertEqual((found["rules"], found["touches"]["compared"]), (5, 27))
        self.assertLessEqual(found["touches"]["largest_mm"], 1e-6)
        self.assertEqual(found["verdict"], "equivalent")  # its field's sums have another order since rules 10
        self.assertLessEqual(found["largest_mm"], 1e-12)
        self.assertEqual((found["first"]["step"], found["first"]["field"]), (77, "punch_gradient_xy"))
        self.assertIn("since rules 10 the integral field adds up the same sums in another order", found["reason"])
        if found["same_libc"] and found["same_cpu"]:
            self.assertEqual(found["touches"]["different"], 0)


if __name__ == "__main__":
    unittest.main()
