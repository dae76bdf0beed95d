#!/usr/bin/env python3
"""A server of the last version was killed: this one goes on with its session, in its trace, or closes it and says
why."""

import os
import shutil
import unittest

from arthron import SystemTest, call, call_json
from old_traces import unpack


class OldSession(SystemTest):
    def setUp(self):
        super().setUp()
        whole, self.case = unpack(self.folder)
        os.makedirs(self.traces, exist_ok=True)
        self.trace = os.path.join(self.traces, "demo-20261122T153400Z-fe965edd.trace")
        with open(whole, "rb") as source, open(self.trace, "wb") as f:
            f.write(source.read()[:-3000])  # without its end, and amid a record, as kill -9 leaves it

    def stations(self, case):
        return f"""
[case tear-radial]
dir = {self.case}
[station demo]
case = {case}
start = auto
"""

    def test_it_goes_on_in_its_trace_under_its_rules_and_with_its_field(self):
        before = call_json("arthron-trace", "info", self.trace)
        server = self.start_server(self.stations("tear-radial"))
        session = self.session("demo")
        self.assertEqual((session["id"], session["trace"], session["state"]),
                         (before["session"], self.trace, "running"))
        self.session_command("stop", "demo")
        server.end()
        after = call_json("arthron-trace", "info", self.trace)
        self.assertEqual((after["version"], after["resumes"], after["state"]), (4, 1, "closed"))
        self.assertEqual(after["settings"]["field"], "inverse-distance")
        self.assertGreater(after["steps"], before["steps"])
        self.assertEqual(after["resections"], before["resections"])
        replay = call_json("arthron-trace", "replay", self.trace, "--case", self.case)
        self.assertEqual((replay["verdict"], replay["rules"]), ("identical", 1))
        verified = call_json("arthron-trace", "verify", self.trace, "--authority",
                             os.path.join(self.keys, "authority.pem"))
        self.assertEqual(verified["signature"], "good")

    def test_what_cannot_go_on_is_closed_and_signed_with_the_reason(self):
        shutil.rmtree(self.case)
        shutil.copytree(os.path.join(self.cases, "healthy"), self.case)
        server = self.start_server(self.stations("tear-radial"))
        self.assertNotEqual(self.session("demo")["trace"], self.trace)
        server.end()
        verified = call_json("arthron-trace", "verify", self.trace, "--authority",
                             os.path.join(self.keys, "authority.pem"))
        self.assertEqual((verified["whole"], verified["signature"]), (True, "good"))
        said = call("arthron-trace", "info", self.trace).stdout
        self.assertIn("The session could not go on: ", said)
        self.assertIn("has not its case", said)

    def test_a_copy_is_of_a_time_that_there_was_and_counts_its_own_steps(self):
        old = self.path("old.trace")
        os.rename(self.trace, old)
        server = self.start_server(self.stations("tear-radial"))
        copy = ("session", "--socket", self.socket, "copy", "demo", "--from", old, "--at")
        self.assertIn("its session ends after 13.", call("arthron-server", *copy, "1000", code=1).stderr)
        call("arthron-server", *copy, "10")
        self.session_command("stop", "demo")
        session = self.session("demo")
        server.end()
        info = call_json("arthron-trace", "info", session["trace"])
        self.assertEqual(session["steps"], info["steps"])
        self.assertLess(info["steps"], 300)  # 400 inputs of the other one come first


if __name__ == "__main__":
    unittest.main()
