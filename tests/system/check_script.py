#!/usr/bin/env python3
"""What makes ./check red: it runs here with a ctest that reports what it is told to; and how programs must end."""

import os
import shutil
import signal
import subprocess
import tempfile
import unittest

from arthron import SOURCE, Process, wait_until

# Its first run fails the tests in `fails`, its second those in `fails-alone`; a report may be left behind.
CTEST = """#!/bin/sh
folder=$2
echo "$*" >>calls
mkdir -p "$folder/Testing/Temporary"
wanted=fails
for word; do
    [ "$word" = --rerun-failed ] && wanted=fails-alone
done
echo '<testsuite><testcase name="one"/></testsuite>' >"$folder/tests.xml"
n=0
for name in $(cat $wanted); do
    n=$((n + 1))
    echo "$n:$name"
done >"$folder/Testing/Temporary/LastTestsFailed.log"
[ -e report ] && cp report "$folder/reports/report.arthron-server.1"
[ $n = 0 ]
"""


class Check(unittest.TestCase):
    def setUp(self):
        keep = tempfile.TemporaryDirectory(prefix="arthron-check-")
        self.addCleanup(keep.cleanup)
        self.tree = keep.name
        shutil.copy(os.path.join(SOURCE, "check"), self.tree)
        for folder in ("bin", "docker/packages", "tests"):
            os.makedirs(os.path.join(self.tree, folder))
        shutil.copy(os.path.join(SOURCE, "docker/packages/fresh-build-folder"), os.path.join(self.tree, "docker/packages"))
        shutil.copy(os.path.join(SOURCE, "tests/list-of-skipped"), os.path.join(self.tree, "tests"))
        for name, text in (("bin/cmake", "#!/bin/sh\n"), ("bin/ctest", CTEST), ("docker/packages/install", "#!/bin/sh\n")):
            os.chmod(self.write(name, text), 0o755)

    def write(self, name, text):
        path = os.path.join(self.tree, name)
        with open(path, "w") as f:
            f.write(text)
        return path

    def check(self, fails="", fails_alone="", report=None):
        """Its exit status, its output, and how often it ran ctest."""
        self.write("fails", fails)
        self.write("fails-alone", fails_alone)
        if report:
            self.write("report", report)
        done = subprocess.run(["./check", "--asan"], cwd=self.tree, capture_output=True, text=True, timeout=60,
                              env={**os.environ, "PATH": f"{self.tree}/bin:{os.environ['PATH']}"})
        with open(os.path.join(self.tree, "calls")) as f:
            return done.returncode, done.stdout + done.stderr, len(f.readlines())

    def test_all_is_well(self):
        status, said, runs = self.check()
        self.assertEqual((status, runs), (0, 1), said)
        self.assertIn("retried: 0\n", said)

    def test_two_that_pass_alone_are_named(self):
        status, said, runs = self.check(fails="path live")
        self.assertEqual((status, runs), (0, 2), said)
        self.assertIn("retried: 2 (path live)", said)

    def test_one_that_fails_alone_too_is_a_failure(self):
        status, said, runs = self.check(fails="path live", fails_alone="live")
        self.assertEqual((status, runs), (1, 2), said)
        self.assertIn("retried: 2 (path live)", said)

    def test_five_are_more_than_may_be_tried_again(self):
        status, said, runs = self.check(fails="path live view link web")
        self.assertEqual((status, runs), (1, 1), said)
        self.assertIn("retried: 0", said)
        self.assertIn("path live view link web", said)

    def test_a_report_of_a_sanitizer_is_a_failure_and_is_shown_though_every_test_passed(self):
        status, said, runs = self.check(report="ERROR: LeakSanitizer: detected memory leaks\n")
        self.assertEqual((status, runs), (1, 1), said)
        self.assertIn("report.arthron-server.1", said)
        self.assertIn("detected memory leaks", said)

    def test_what_a_sanitizer_reports_is_not_tried_again(self):
        status, said, runs = self.check(fails="path", report="WARNING: ThreadSanitizer: data race\n")
        self.assertEqual((status, runs), (1, 1), said)
        self.assertIn("retried: 0", said)


class Ends(unittest.TestCase):
    def wrong(self, script, **options):
        """Of a program that says when its traps are set and then waits."""
        with tempfile.TemporaryDirectory(prefix="arthron-ends-") as folder:
            process = Process(folder, "program", "sh", "-c", f"{script}; echo here >&2; while :; do sleep 0.05; done",
                              **options)
            process.wait_for_log("here")
            return process.wrong_end()

    def test_a_program_must_end_on_sigterm_with_the_status_that_its_test_names(self):
        self.assertEqual(self.wrong("trap 'exit 0' TERM"), "")
        self.assertIn("program ended with 3:\nhere", self.wrong("trap 'exit 3' TERM"))
        self.assertEqual(self.wrong("trap 'exit 3' TERM", statuses=(3,)), "")
        self.assertIn(f"ended with {-signal.SIGTERM}", self.wrong(":"))

    def test_a_program_that_ended_by_itself_is_looked_at_too(self):
        with tempfile.TemporaryDirectory(prefix="arthron-ends-") as folder:
            process = Process(folder, "program", "sh", "-c", "exit 3")
            wait_until("its end", lambda: process.process.poll() is not None)
            self.assertIn("ended with 3", process.wrong_end())

    def test_a_kill_is_right_only_where_the_test_asked_for_it(self):
        with tempfile.TemporaryDirectory(prefix="arthron-ends-") as folder:
            asked, other = (Process(folder, name, "sleep", "60") for name in ("asked", "other"))
            asked.end(signal.SIGKILL)
            other.process.kill()
            self.assertEqual(asked.wrong_end(), "")
            self.assertIn("ended with -9", other.wrong_end())


if __name__ == "__main__":
    unittest.main(verbosity=2)
