#!/usr/bin/env python3
"""A server of the last version was killed: this one goes on with its session, in its trace, or closes it and says
why."""

import os
import shutil
import unittest

from arthron import SystemTest, call, call_json
from old_traces import SOURCE, unpack, unpack_trace

KILLED = os.path.join(SOURCE, "tests/corpus/trace/version6/killed.trace.xz")  # amid cuts and an undo, on the same case


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

    def test_one_of_version_6_goes_on_in_its_version(self):
        os.unlink(self.trace)
        trace = os.path.join(self.traces, "room-1-20261129T024309Z-afa94321.trace")
        os.rename(unpack_trace(KILLED, self.folder), trace)
        before = call_json("arthron-trace", "info", trace)
        server = self.start_server(self.stations("tear-radial").replace("demo", "room-1"))
        session = self.session("room-1")
        self.assertEqual((session["id"], session["trace"], session["state"]), (before["session"], trace, "running"))
        self.session_command("stop", "room-1")
        server.end()
        after = call_json("arthron-trace", "info", trace)
        self.assertEqual([after[key] for key in ("version", "part", "server", "token", "resumes", "state", "whole")],
                         [6, 1, "", 0, 1, "closed", True])
        self.assertEqual(after["resections"], before["resections"])
        replay = call_json("arthron-trace", "replay", trace, "--case", self.case)
        self.assertEqual((replay["verdict"], replay["rules"]), ("identical", 12))
        self.assertEqual(call_json("arthron-trace", "verify", trace)["signature"], "good")
        for option, name in (("--csv", "a.csv"), ("--gltf", "a.glb")):
            call("arthron-trace", "export", trace, "--case", self.case, option, self.path(name))

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
