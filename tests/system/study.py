#!/usr/bin/env python3
"""All attempts of a course as a zip: what Python's zipfile and csv read is what the records have, and the codebook
describes each column."""

import csv
import io
import os
import sqlite3
import stat
import tempfile
import unittest
import zipfile

from arthron import call

IDS = ["%032x" % (0xFEED + i) for i in range(3)]
TABLES = ["attempts.csv", "figures.csv", "errors.csv", "ratings.csv", "results.csv"]
DAY_NS = 86400 * 10**9
BEGIN_NS = 20_000 * DAY_NS  # 2024-10-04


def seed(path):
    """Ada and Zoe of the course, and Bob of none: practice, and exams that are released and are not."""
    attempt = ("INSERT INTO attempt (id, session_id, number, task, task_version, title, file_hash, purpose, hand, "
               "first_step, last_step, begun_utc_ns, time_s, goals, goals_met, errors, sentinel, verdict, end, "
               "pass_time_s, pass_errors, mark_version, figures, occurrences) VALUES (?, ?, ?, ?, 1, "
               "'Look, \"then\" touch', ?, ?, 'left', 5, 9, ?, ?, 4, 3, 1, 0, 'not yet', 'left', 75, 0, 0, ?, ?)")
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO station (id, name) VALUES (1, '=2+3 room, \"one\"')")
        db.execute("INSERT INTO knee_case (id, name, hash) VALUES (1, 'tear', '00000000000000ff')")
        trainees = dict(db.execute("SELECT name, id FROM trainee").fetchall())
        for i, name in enumerate(("ada", "zoe", "bob")):
            db.execute("INSERT INTO session (id, uuid, station_id, trainee_id, case_id, start_utc_ns, end_utc_ns, "
                       "state, steps, missing, trace) VALUES (?, ?, 1, ?, 1, ?, ?, 'closed', 10, 0, ?)",
                       (i + 1, IDS[i], trainees[name], BEGIN_NS, BEGIN_NS + 10**9, f"/{i}.trace"))
        db.execute("INSERT INTO result VALUES (1, 'over', 'meniscus', 1, 'mm3', 4.5, NULL), "
                   "(1, 'rim', 'meniscus', 2, 'mm', NULL, NULL), (3, 'over', '', 1, 'mm3', 1, NULL), (2, 'over', '', 1, 'mm3', 2, NULL)")
        figures = ('{"goals": [{"name": "notch", "met_s": 1.5}, {"name": "horn", "met_s": null}], "calm": true,'
                   ' "resections": [{"group": "meniscus_medial", "over_mm3": 4.25}], "view": {"lost_s": 2}}')
        errors = ('[{"error": "too deep", "tool": "probe", "step": 7, "time_s": 0.1},'
                  ' {"error": "bump", "step": 8, "time_s": 2}]')
        empty = ("{}", "[]")
        for row in ((1, 1, 1, "probing", "practice", 0, 1 / 3, figures, errors),
                    (2, 1, 2, "centring", "practice", 1, 40, *empty),
                    (3, 2, 1, "probing", "exam", 2, 40, *empty),
                    (4, 2, 2, "probing", "exam", 3, 40, *empty),
                    (5, 3, 1, "probing", "practice", 1, 40, *empty)):
            db.execute(attempt, (*row[:4], "a" * 64, row[4], BEGIN_NS + row[5] * DAY_NS, *row[6:]))
        for exam, attempt_id, state in ((1, 3, "released"), (2, 4, "done")):
            db.execute("INSERT INTO exam (id, trainee_id, title, state, seed, created_utc_ns) VALUES (?, ?, 'exam', ?, 1, 1)",
                       (exam, trainees["zoe"], state))
            db.execute("INSERT INTO exam_task (exam_id, position, task, knee_case, attempt_id) VALUES (?, 1, 'probing', "
                       "'tear', ?)", (exam, attempt_id))
        accounts = [db.execute("INSERT INTO account (name, role, created_utc_ns) VALUES (?, 'instructor', 1)",
                               (name,)).lastrowid for name in ("grace", "mary")]
        for attempt_id, rater in ((3, accounts[0]), (3, accounts[1]), (4, accounts[0]), (1, None)):
            db.execute("INSERT INTO rating (attempt_id, account_id, utc_ns, safety, field_of_view, camera_dexterity, "
                       "instrument_dexterity, bimanual_dexterity, flow, quality, autonomy, remark) "
                       "VALUES (?, ?, 1, 1, 2, 3, 4, 5, 4, 3, 2, 'as zoe does')", (attempt_id, rater))
    db.close()


class Study(unittest.TestCase):
    def setUp(self):
        self.keep = tempfile.TemporaryDirectory(prefix="arthron-test-")
        self.db = os.path.join(self.keep.name, "records.db")
        self.zip = os.path.join(self.keep.name, "out.zip")
        for name in ("ada", "zoe", "bob"):
            self.run_records("add", "trainee", name)
        self.run_records("add", "course", "autumn")
        self.run_records("enrol", "ada", "autumn")
        self.run_records("enrol", "zoe", "autumn")
        seed(self.db)

    def tearDown(self):
        self.keep.cleanup()

    def run_records(self, *words, code=0):
        return call("arthron-server", "records", "--file", self.db, *words, code=code)

    def export(self, *more):
        """{file: rows}, each a dictionary of texts."""
        self.run_records("export", "--course", "autumn", "--zip", self.zip, *more)
        with zipfile.ZipFile(self.zip) as z:
            self.assertIsNone(z.testzip())
            self.about = z.read("about.txt").decode()
            self.everything = b"".join(z.read(name) for name in z.namelist())
            self.assertEqual(sorted(TABLES + ["about.txt", "codebook.csv"]), sorted(z.namelist()))
            tables = {}
            for name in TABLES + ["codebook.csv"]:
                text = io.TextIOWrapper(z.open(name), "utf-8", newline="")
                tables[name] = list(csv.DictReader(text, strict=True))
            self.headings = {name: next(csv.reader(io.StringIO(z.read(name).decode()))) for name in TABLES}
        return tables

    def test_all_attempts_of_the_course_are_there_and_no_others(self):
        tables = self.export()
        self.assertEqual([("trainee-2", "1"), ("trainee-1", "2"), ("trainee-1", "1")],
                         [(row["trainee"], row["number"]) for row in tables["attempts.csv"]])
        last = tables["attempts.csv"][-1]
        self.assertEqual(1 / 3, float(last["time_s"]))
        self.assertEqual("2024-10-04T00:00:00.000Z", last["begun_utc"])
        self.assertEqual('Look, "then" touch', last["title"])
        self.assertEqual('\'=2+3 room, "one"', last["station"], "no formula")
        self.assertEqual(("", "1"), (last["exam"], tables["attempts.csv"][0]["exam"]))
        self.assertEqual({"goals.notch.met_s": "1.5", "goals.horn.met_s": "", "calm": "1", "view.lost_s": "2",
                          "resections.meniscus_medial.over_mm3": "4.25"},
                         {row["figure"]: row["value"] for row in tables["figures.csv"]})
        self.assertEqual([("too deep", "probe", "7", "0.1"), ("bump", "", "8", "2")],
                         [(row["error"], row["tool"], row["step"], str(float(row["time_s"])).removesuffix(".0"))
                          for row in tables["errors.csv"]])
        self.assertEqual(["over", "rim"], [row["metric"] for row in tables["results.csv"]])
        self.assertEqual("", tables["results.csv"][1]["value"])
        self.assertIn("Left out: 1 attempts of exams", self.about)
        self.assertEqual({IDS[0]}, {row["session"] for row in tables["results.csv"]})  # zoe's session has it too
        self.assertEqual(0o600, stat.S_IMODE(os.stat(self.zip).st_mode))
        audit = self.run_records("list", "audit", "--json").stdout
        self.assertIn('"export"', audit)

    def test_nobody_is_named_unless_somebody_asks(self):
        tables = self.export()
        for name in (b"ada", b"zoe", b"grace", b"mary"):
            self.assertNotIn(name, self.everything)
        self.assertEqual(["", "rater-1", "rater-2"], sorted(row["rater"] for row in tables["ratings.csv"]))
        tables = self.export("--names")
        self.assertEqual({"ada", "zoe"}, {row["trainee"] for row in tables["attempts.csv"]})
        self.assertEqual(["", "grace", "mary"], sorted(row["rater"] for row in tables["ratings.csv"]))
        self.assertNotIn(b"as zoe does", self.everything)

    def test_the_codebook_has_each_column_and_no_other(self):
        tables = self.export()
        self.assertEqual([(name, column) for name in TABLES for column in self.headings[name]],
                         [(row["file"], row["column"]) for row in tables["codebook.csv"]])
        for row in tables["codebook.csv"]:
            self.assertTrue(row["meaning"] and row["missing"], row)
            self.assertIn(row["type"], ("text", "integer", "number", "time", "switch"))
            self.assertEqual(row["column"].endswith("_s"), row["unit"] == "s", row)
            for cell in (line[row["column"]] for line in tables[row["file"]]):
                if not cell:
                    self.assertNotEqual("never", row["missing"], row)
                elif row["type"] == "integer":
                    int(cell)
                elif row["type"] == "number":
                    float(cell)
                elif row["type"] == "switch":
                    self.assertIn(cell, "01")

    def test_task_and_days_choose(self):
        def chosen(*more):
            return [row["session"][-1] + row["number"] for row in self.export(*more)["attempts.csv"]]
        self.assertEqual(["e1", "d1"], chosen("--task", "probing"))
        self.assertEqual(["e1", "d2"], chosen("--from", "2024-10-05"))
        self.assertEqual(["d2", "d1"], chosen("--to", "2024-10-06"))
        self.assertEqual([], chosen("--from", "2024-10-08"))
        self.assertIn("Begun on 2024-10-08T00:00:00.000Z or later.", self.about)

    def test_what_is_wrong_is_said_and_leaves_no_file(self):
        for words, why in ((("--course", "spring"), "no course 'spring'"), (("--course", "autumn", "--from", "May"), "--from May"),
                           ((), "--zip needs --course")):
            done = self.run_records("export", "--zip", self.zip, *words, code=1)
            self.assertIn(why, done.stderr)
            self.assertFalse(os.path.exists(self.zip))


if __name__ == "__main__":
    unittest.main()
