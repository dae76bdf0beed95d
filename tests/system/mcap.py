#!/usr/bin/env python3
"""A recording (MCAP) as the format's own library reads it (web/test/read_mcap.mjs), beside the table of the session."""

import csv
import io
import json
import os
import shutil
import subprocess
import tempfile
import unittest

from arthron import SOURCE, call
from old_traces import CORPUS, FITTED, unpack, unpack_trace

READER = os.path.join(SOURCE, "web/test/read_mcap.mjs")
AXES = ("x", "y", "z")
FIGURES = {"cuts": "cuts", "refused": "cuts_refused", "volumeMm3": "volume_mm3", "removedMm3": "quality_removed_mm3",
           "plannedMm3": "quality_planned_mm3", "overMm3": "quality_over_mm3", "rimMm": "quality_rim_mm",
           "touchedUnseenMm3": "touched_unseen_mm3"}


def read_recording(path):
    done = subprocess.run([os.environ.get("ARTHRON_NODE") or shutil.which("node"), READER, path], capture_output=True,
                          text=True, timeout=60)
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return json.loads(done.stdout)


class Recordings(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="arthron-test-")
        _, cls.case = unpack(cls.folder.name)
        cls.trace = unpack_trace(FITTED, cls.folder.name)
        cls.found = cls.read(cls.trace, "--case", cls.case)
        cls.rows = cls.table("--case", cls.case, "--columns", "*")
        cls.start_ns = int(cls.rows[0]["time_ns"]) - round(float(cls.rows[0]["t_seconds"]) * 1e9)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def read(cls, trace, *options):
        out = os.path.join(cls.folder.name, "a.mcap")
        call("arthron-trace", "export", trace, "--mcap", out, *options)
        return read_recording(out)

    @classmethod
    def table(cls, *options):
        return list(csv.DictReader(io.StringIO(call("arthron-trace", "export", cls.trace, "--csv", "-", *options).stdout)))

    def messages(self, topic, schema):
        self.assertEqual(self.found["topics"][topic]["schema"], schema)
        return self.found["topics"][topic]["messages"]

    def utc_of(self, row, column="time_ns"):
        """The session of this trace began with 1970."""
        return str(int(row[column]) - self.start_ns)

    def near(self, found, expected):
        self.assertTrue(found == expected or abs(found - expected) <= 1e-12 * max(1, abs(expected)), (found, expected))

    def test_it_is_a_whole_file(self):
        counts = self.found["statistics"]
        self.assertTrue(self.found["done"])
        self.assertEqual(self.found["streamed"]["Message"], counts["messageCount"])
        self.assertEqual(self.found["streamed"]["Chunk"], counts["chunkCount"])
        self.assertGreater(counts["chunkCount"], 5)
        self.assertEqual(counts["channelMessageCounts"],
                         {topic: len(one["messages"]) for topic, one in self.found["topics"].items()})
        self.assertEqual(self.found["metadata"]["arthron"]["case"], "tear-radial")
        middle = int(self.found["later"]["from"])
        self.assertEqual(self.found["later"]["joint"], sum(int(self.utc_of(row)) >= middle for row in self.rows))

    def test_poses_are_those_of_the_table_in_metres(self):
        for name in ("femur", "virtual_tibia", "patella", "probe", "probe_warped", "punch", "punch_warped"):
            rows = [row for row in self.rows if row[f"{name}_qw"]]
            messages = self.messages(f"/pose/{name}", "foxglove.FrameTransform")
            self.assertEqual(len(messages), len(rows))
            for row, (time, m) in zip(rows, messages):
                self.assertEqual((time, m["timestamp"], m["parentFrameId"], m["childFrameId"]),
                                 (self.utc_of(row), time, "mockup", name))
                self.assertEqual([m["rotation"][a] for a in "wxyz"], [float(row[f"{name}_q{a}"]) for a in "wxyz"])
                for axis in AXES:
                    self.near(m["translation"][axis], float(row[f"{name}_t{axis}_mm"]) / 1000)
        warped = [m["translation"]["x"] for _, m in self.messages("/pose/punch_warped", "foxglove.FrameTransform")]
        plain = [m["translation"]["x"] for _, m in self.messages("/pose/punch", "foxglove.FrameTransform")]
        self.assertNotEqual(warped, plain)

    def test_joint_and_instruments_are_those_of_the_table(self):
        for row, (_, m) in zip(self.rows, self.messages("/joint", "arthron.session.Joint"), strict=True):
            self.assertEqual((m["flexionDeg"], m["validity"]), (float(row["flexion_deg"]), row["joint_validity"]))
            self.near(m["drawerM"], float(row["drawer_mm"]) / 1000)
        rows = [row for row in self.rows if row["punch_valid"] == "1"]
        messages = self.messages("/instrument/punch", "arthron.session.Instrument")
        for row, (_, m) in zip(rows, messages, strict=True):
            measured = self.utc_of(row, "measured_punch_time_ns") if row["measured_punch_time_ns"] else None
            self.assertEqual((m.get("measured"), m["nearest"], m["opening"]),
                             (measured, row["punch_nearest_group"], float(row["punch_opening"])))
            self.near(float(m["nearestM"]), float(row["punch_nearest_mm"]) / 1000)
        self.assertIn("meniscus_medial", {m["nearest"] for _, m in messages})

    def test_events_are_those_of_the_table(self):
        expected = [(self.utc_of(row), name) for row in self.rows for name in row["events"].split("+") if name]
        messages = self.messages("/events", "foxglove.Log")
        self.assertEqual([(time, m["name"]) for time, m in messages], expected)
        self.assertIn("running", [m["message"] for _, m in messages])

    def test_each_cut_has_its_figures_and_its_mesh(self):
        rows = [row for row in self.rows if row["landed_job"]]
        figures = self.messages("/resection/meniscus_medial", "arthron.session.Resection")
        for row, (time, m) in zip(rows, figures, strict=True):
            self.assertEqual((time, m["outcome"]), (self.utc_of(row), row["landed_outcome"]))
            for key, column in FIGURES.items():
                self.assertEqual(m[key], float(row[column]), key)
        changed = [row for row in rows if row["landed_outcome"] == "done"]
        first, *later = self.messages("/mesh/patient/meniscus_medial", "foxglove.SceneUpdate")
        self.assertEqual([time for time, _ in later], [self.utc_of(row) for row in changed])
        for row, (_, m) in zip(changed, later):
            (entity,), = [m["entities"]]
            self.assertEqual((entity["frameId"], entity["id"], entity["frameLocked"]),
                             ("virtual_tibia", "meniscus_medial", True))
            self.assertAlmostEqual(entity["triangles"][0]["volume_m3"] * 1e9, float(row["volume_mm3"]), 4)
        self.assertGreater(first[1]["entities"][0]["triangles"][0]["volume_m3"] * 1e9, float(changed[-1]["volume_mm3"]))

    def test_bones_have_meshes_and_an_instrument_has_one_while_it_is_there(self):
        for topic, frame in (("/mesh/patient/femur", "virtual_femur"), ("/mesh/mockup/femur", "femur")):
            (_, m), = self.messages(topic, "foxglove.SceneUpdate")
            self.assertEqual(m["entities"][0]["frameId"], frame)
            self.assertGreater(m["entities"][0]["triangles"][0]["triangles"], 10000)
        came = [(time, len(m["entities"]), len(m["deletions"]))
                for time, m in self.messages("/mesh/instrument/punch_warped", "foxglove.SceneUpdate")]
        valid = [(self.utc_of(row), row["punch_valid"]) for row in self.rows]
        changes = [one for one, before in zip(valid, [("", "")] + valid) if one[1] != before[1]]
        self.assertEqual(came, [(time, int(there), 1 - int(there)) for time, there in changes])

    def test_a_part_of_it_begins_with_the_tissue_as_it_was(self):
        cut = [row for row in self.rows if row["landed_outcome"] == "done"]
        at = float(cut[2]["t_seconds"]) + 0.001
        found = self.read(self.trace, "--case", self.case, "--from", str(at), "--to", str(at + 0.5))
        meshes = found["topics"]["/mesh/patient/meniscus_medial"]["messages"]
        self.assertAlmostEqual(meshes[0][1]["entities"][0]["triangles"][0]["volume_m3"] * 1e9,
                               float(cut[2]["volume_mm3"]), 4)
        self.assertEqual(len(found["topics"]["/joint"]["messages"]),
                         sum(at <= float(row["t_seconds"]) <= at + 0.5 for row in self.rows))

    def test_without_the_case_there_are_poses_and_figures(self):
        found = self.read(self.trace)
        self.assertEqual({topic.split("/")[1] for topic in found["topics"]},
                         {"pose", "mesh", "instrument", "joint", "events", "markers", "remarks", "resection"})
        self.assertFalse([topic for topic in found["topics"] if topic.startswith(("/mesh/patient", "/mesh/mockup"))])
        self.assertEqual(len(found["topics"]["/resection/0"]["messages"]),
                         len(self.found["topics"]["/resection/meniscus_medial"]["messages"]))

    def test_a_session_of_an_older_version_is_recorded(self):
        found = self.read(os.path.join(os.path.dirname(CORPUS), "version2-cut.trace"))
        shown = [one["messages"] for topic, one in found["topics"].items() if topic.endswith("_warped")]
        self.assertTrue(shown and all(shown))


if __name__ == "__main__":
    unittest.main()
