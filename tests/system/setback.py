#!/usr/bin/env python3
"""An instructor sets a session back before its last cut; the tissue, the station and the trace know."""

import signal
import unittest

from arthron import call, call_json, wait_until
from bites import Bites

FIGURES = ("cuts", "pieces", "volume_mm3", "removed_mm3", "pieces_mm3", "warped_mm3", "left_mm3", "distance_mm",
           "rim_mm", "step_mm", "over_mm3", "under_mm3", "removed_zone_mm3", "mesh_hash")


class SetBack(Bites):
    def figures(self):
        r = self.resection()
        return {key: r[key] for key in FIGURES}

    def refused(self, *words):
        reply = self.steer(*words, code=1)
        self.assertFalse(reply["ok"])
        return reply["text"]

    def undo(self):
        """A cut that is on its way when the session is paused lands before: from the second on all is known."""
        self.assertTrue(self.steer("undo", "room-1")["ok"])

    def cut_one_more(self):
        cuts = self.resection()["cuts"]
        self.steer("start", "room-1")
        self.wait_for_cuts(cuts + 1)
        self.steer("pause", "room-1")

    def test_a_session_goes_back_cut_by_cut_and_on_again(self):
        station = self.start_station()
        wait_until("a session", lambda: self.steer("show", "room-1", code=None)["resections"])
        whole = wait_until("its mesh", lambda: self.whole() and self.figures())
        self.wait_for_cuts(3)
        self.steer("pause", "room-1")
        self.undo()
        cuts, number = self.resection()["cuts"], self.resection()["mesh_number"]
        for left in reversed(range(cuts)):
            self.undo()
            number += 1
            now = self.resection()
            self.assertEqual((now["cuts"], now["mesh_number"]), (left, number))
        self.assertEqual(self.figures(), whole)
        self.assertIn("no cut", self.refused("undo", "room-1"))
        self.cut_one_more()
        self.undo()
        trace, undone = self.session()["trace"], cuts + 2
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
        self.assertIn("cuts_undone", call("arthron-trace", "report", trace, "--out", self.path("page.html")).stdout
                      + open(self.path("page.html")).read())

    def test_a_killed_server_knows_what_was_undone(self):
        self.start_station()
        self.wait_for_cuts(2)
        self.steer("pause", "room-1")
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
        for _ in range(self.resection()["cuts"]):
            self.undo()
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
        self.assertIn("no cut", self.refused("undo", "room-1"))


if __name__ == "__main__":
    unittest.main(verbosity=2)
