#!/usr/bin/env python3
"""What an instructor says to a session, with which warp and for whom it is: done live, and found in its trace."""

import signal
import unittest

from arthron import SystemTest, call, call_json, wait_until
from example_trace import figures_of, figures_of_info


class Remarks(SystemTest):
    more_cases = ("healthy",)

    def setUp(self):
        super().setUp()
        self.start_mockup()
        self.server = self.start_server("[station room-1]\ncase = arthrosis\ntrainee = anna\n")
        self.enrol("room-1")
        self.start_station("room-1")
        wait_until("a session", lambda: self.session()["state"] == "running")
        self.wait_for_steps()

    def info(self, trace):
        return call_json("arthron-trace", "info", trace)

    def test_notes_are_in_the_trace_and_outlive_the_server(self):
        trace = self.session()["trace"]
        self.session_command("note", "room-1", "Lift the hand – slowly")
        self.wait_for_steps()
        self.server.end(signal.SIGKILL)
        self.server = self.start_server("[station room-1]\ncase = arthrosis\ntrainee = anna\n")
        wait_until("the station", lambda: self.session()["connected"], 30)
        self.session_command("note", "room-1", "Better")
        self.wait_for_steps()
        self.session_command("stop", "room-1")
        self.server.end()
        remarks = self.info(trace)["remarks"]
        self.assertEqual([(r["number"], r["text"]) for r in remarks], [(1, "Lift the hand – slowly"), (2, "Better")])
        self.assertGreater(remarks[1]["second"], remarks[0]["second"])
        self.assertGreater(remarks[0]["second"], 0)
        self.assertTrue(remarks[0]["author"])
        self.assertFalse(remarks[0]["withdrawn"])
        self.assertIn("Better", call("arthron-trace", "info", trace).stdout)
        self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")
        call("arthron-trace", "verify", trace)
        self.assertEqual(figures_of(trace), figures_of_info(trace))
        self.assertEqual(figures_of(trace)["resumes"], 1)
        recording = trace + ".mcap"
        call("arthron-trace", "export", trace, "--mcap", recording)
        with open(recording, "rb") as f:
            said = f.read()
        self.assertTrue("Lift the hand – slowly".encode() in said and b"Better" in said)

    def test_a_note_says_something_and_needs_a_session(self):
        self.assertIn("one line", self.session_command("note", "room-1", "", code=1)["text"])
        self.assertIn("one line", self.session_command("note", "room-1", "two\nlines", code=1)["text"])
        call("arthron-server", "session", "--socket", self.socket, "note", "room-1", "x" * 300, code=2)
        self.session_command("stop", "room-1")
        self.assertIn("no session", self.session_command("note", "room-1", "too late", code=1)["text"])

    def test_strength_and_trainee_are_of_the_sessions_to_come(self):
        first = self.session()["trace"]
        assigned = self.session_command("assign", "room-1", "bert")["sessions"][0]
        self.assertEqual((assigned["trainee"], assigned["next_trainee"]), ("anna", "bert"))
        said = call("arthron-server", "session", "--socket", self.socket, "list").stdout
        self.assertIn("room-1: bert from the next session on", said)
        self.session_command("case", "room-1", "healthy", "--strength", "0.25")
        second = self.session()["trace"]
        self.assertEqual(self.session()["trainee"], "bert")
        self.wait_for_steps()
        self.session_command("assign", "room-1", "")
        self.session_command("case", "room-1", "arthrosis")
        third = self.session()["trace"]
        self.wait_for_steps()
        call("arthron-server", "session", "--socket", self.socket, "case", "room-1", "healthy", "--strength", "2", code=2)
        self.server.end()
        found = [(i["trainee"], i["case"]["name"], i["settings"]["strength"])
                 for i in (self.info(t) for t in (first, second, third))]
        self.assertEqual(found, [("anna", "arthrosis", 1), ("bert", "healthy", 0.25), ("", "arthrosis", 1)])
        for trace in (second, third):
            self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")


if __name__ == "__main__":
    unittest.main()
