#!/usr/bin/env python3
"""An instructor sets a session back before its last stroke; the tissue, the station and the trace know."""

import os
import signal
import unittest

from arthron import call, call_json, wait_until
from bites import Bites

FIGURES = ("cuts", "pieces", "volume_mm3", "removed_mm3", "pieces_mm3", "warped_mm3", "left_mm3", "distance_mm",
           "rim_mm", "step_mm", "over_mm3", "under_mm3", "removed_zone_mm3", "mesh_hash")


class SetBack(Bites):
    def figures(self, resection=None):
        r = resection or self.resection()
        return {key: r[key] for key in FIGURES}

    def whole_figures(self):
        """Of one reading: a cut may land at any moment."""
        whole = self.whole()
        return whole and self.figures(whole)

    def refused(self, *words):
        reply = self.session_command(*words, code=1)
        self.assertFalse(reply["ok"])
        return reply["text"]

    def undo(self):
        """A cut that is on its way when the session is paused lands before: from the second on all is known."""
        reply = self.session_command("undo", "room-1")
        self.assertTrue(reply["ok"])
        self.assertGreater(reply["undone"]["cuts"], 0)
        return reply["undone"]

    def undo_all(self):
        """How many strokes those were."""
        strokes = 0
        while (before := self.resection())["cuts"]:
            undone, now = self.undo(), self.resection()
            self.assertEqual((now["cuts"], now["mesh_number"]),
                             (before["cuts"] - undone["cuts"], before["mesh_number"] + 1))
            self.assertAlmostEqual(now["volume_mm3"] - before["volume_mm3"], undone["volume_mm3"], 9)
            strokes += 1
        return strokes

    def cut_one_more(self):
        cuts = self.resection()["cuts"]
        self.session_command("start", "room-1")
        self.wait_for_cuts(cuts + 1)
        self.session_command("pause", "room-1")

    def test_a_session_goes_back_stroke_by_stroke_and_on_again(self):
        station = self.start_station()
        wait_until("a session", lambda: self.session_command("show", "room-1", code=None)["resections"])
        whole = wait_until("its mesh", self.whole_figures)
        self.wait_for_cuts(7)
        self.session_command("pause", "room-1")
        self.undo()
        strokes = 1 + self.undo_all()
        self.assertGreater(strokes, 1)
        self.assertEqual(self.figures(), whole)
        self.assertIn("no cut", self.refused("undo", "room-1"))
        self.cut_one_more()
        self.undo()
        trace, undone = self.session()["trace"], strokes + 1
        self.assert_same_mesh(station)
        last = self.resection()
        self.server.end()
        self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")
        self.assertEqual(call_json("arthron-trace", "verify", trace)["signature"], "good")
        info = call_json("arthron-trace", "info", trace)
        self.assertEqual(info["events"]["undone"], undone)
        score = call_json("arthron-trace", "score", trace)["metrics"]
        of = {m["name"]: m["value"] for m in score if m.get("tissue") == "meniscus_medial" and "zone" not in m}
        self.assertEqual((of["cuts"], of["cuts_undone"]), (last["cuts"], undone))
        call("arthron-trace", "report", trace, "--out", self.path("page.html"))
        with open(self.path("page.html")) as page:
            self.assertIn("cuts_undone", page.read())

    def test_a_killed_server_knows_what_was_undone(self):
        self.start_station()
        self.wait_for_cuts(2)
        self.session_command("pause", "room-1")
        self.undo()
        before, session = self.figures(), self.session()
        wait_until("the trace on disk", lambda: self.undone_in(session["trace"]))
        self.server.end(signal.SIGKILL)
        self.server = self.start_server()
        self.assertEqual(self.figures(), before)
        self.assertEqual(self.session()["id"], session["id"])
        wait_until("the station", lambda: self.session()["connected"], 30)
        self.cut_one_more()
        self.undo()
        self.undo_all()
        self.assertIn("no cut", self.refused("undo", "room-1"))
        self.server.end()
        self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")

    def undone_in(self, trace):
        return call_json("arthron-trace", "info", trace)["events"].get("undone")

    def test_what_cannot_be_undone_is_said(self):
        self.assertIn("has no session", self.refused("undo", "room-1"))
        self.assertIn("there is no station", self.refused("undo", "room-9"))
        self.start_station()
        wait_until("a session", lambda: self.session()["state"] == "running")
        self.session_command("pause", "room-1")
        self.session_command("reset", "room-1")  # of what it may have cut before
        self.assertIn("no cut", self.refused("undo", "room-1"))

    def test_a_session_is_copied_from_another_ones_trace(self):
        self.start_station()
        self.wait_for_cuts(7)
        self.session_command("pause", "room-1")
        self.undo()
        then, first = self.figures(), self.session()
        at_s = self.a_time_from_now_on(first["trace"])
        self.session_command("start", "room-1")
        self.wait_for_cuts(then["cuts"] + 2)
        self.session_command("stop", "room-1")
        self.session_command("copy", "room-1", "--from", first["id"], "--at", str(at_s))
        second = self.session()
        self.assertNotEqual(second["id"], first["id"])
        self.assertEqual(second["state"], "paused")
        wait_until("the same tissue", lambda: self.figures() == then)
        self.session_command("start", "room-1")
        self.wait_for_cuts(then["cuts"] + 1)
        self.session_command("pause", "room-1")
        self.undo()
        on = self.figures()
        self.session_command("copy", "room-1", "--from", second["trace"])
        third = self.session()
        wait_until("the same tissue", lambda: self.figures() == on)
        wait_until("the end of the one before", lambda: call_json("arthron-trace", "info", second["trace"])["whole"])
        self.server.end(signal.SIGKILL)
        self.server = self.start_server()
        wait_until("its session", lambda: self.session()["id"] == third["id"])
        wait_until("the same tissue", lambda: self.figures() == on)
        self.server.end()
        self.assertEqual(sorted(os.listdir(self.traces)),
                         sorted(os.path.basename(s["trace"]) for s in (first, second, third)))
        for parent, session in ((first, second), (second, third)):
            info = call_json("arthron-trace", "info", session["trace"])
            self.assertGreater(info["past"], 0)
            self.assertEqual((len(info["parent"]), info["parent_session"]), (64, parent["id"]))
            call("arthron-trace", "score", session["trace"])
            call("arthron-trace", "report", session["trace"], "--out", session["trace"] + ".html")
            call("arthron-trace", "export", session["trace"], "--exr", session["trace"] + ".exr")
        for session in (first, second, third):
            self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")
            self.assertEqual(call_json("arthron-trace", "verify", session["trace"])["signature"], "good")

    def a_time_from_now_on(self, trace):
        """Of a session that rests; its length begins with its first step, which is later than its start."""
        def seconds():
            return call_json("arthron-trace", "info", trace)["seconds"]
        now = seconds()
        return wait_until("steps on disk", lambda: max(0, seconds() - now - 1)) + now + 1

    def test_what_cannot_be_copied_leaves_the_session_as_it_is(self):
        self.start_station()
        wait_until("a session", lambda: self.session()["state"] == "running")
        session = self.session()
        no_trace = self.write("no.trace", "ARTHR")
        os.mkfifo(self.path("pipe"))
        for source, text in (("0" * 32, "no trace of a session"), (no_trace, "no.trace"), (self.folder, "no file"),
                             (self.path("pipe"), "no file")):
            self.assertIn(text, self.refused("copy", "room-1", "--from", source))
        self.assertEqual(self.refused_words("copy", "room-1", "--from", self.path("gone")), 1)
        self.assertEqual(self.refused_words("copy", "room-1"), 2)
        self.assertEqual(self.refused_words("copy", "room-1", "--from", no_trace, "--at", "-1"), 2)
        self.assertEqual(self.refused_words("undo", "room-1", "--at", "1"), 2)
        self.assertEqual((self.session()["id"], self.session()["state"]), (session["id"], "running"))
        self.assertEqual(len([name for name in os.listdir(self.traces) if name.endswith(".trace")]), 1)

    def refused_words(self, *words):
        return call("arthron-server", "session", "--socket", self.socket, *words, code=None).returncode

    def test_a_session_on_a_case_that_is_not_here_is_not_copied(self):
        self.start_station()
        self.wait_for_steps()
        trace = self.session()["trace"]
        self.server.end()
        self.server = self.start_server("[station room-1]\ncase = healthy")
        self.assertIn("has not its case", self.refused("copy", "room-1", "--from", trace))


if __name__ == "__main__":
    unittest.main(verbosity=2)
