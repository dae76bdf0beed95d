#!/usr/bin/env python3
"""A punch bites in the mock-up: the server cuts, the station's mesh follows, the trace replays."""

import signal
import unittest

from arthron import call_json, wait_until
from bites import Bites


class Resection(Bites):
    def test_the_meniscus_is_cut_and_the_record_replays(self):
        station = self.start_station()
        self.wait_for_cuts(3)
        wait_until("a bite's worth", lambda: self.resection()["removed_mm3"] > 1, 60)
        self.pause()
        r = self.resection()
        self.assertEqual(r["mesh_number"], 1 + r["cuts"])
        whole = r["volume_mm3"] + r["removed_mm3"] + r["pieces_mm3"]
        self.assertAlmostEqual(whole, sum(r["whole_zone_mm3"]), delta=0.01 * whole)
        self.assertAlmostEqual(r["warped_mm3"] - r["left_mm3"], r["volume_mm3"], delta=1e-3)
        self.assertLess(r["rim_mm"], 12)
        unseen, untouched = r["touched_unseen_mm3"], r["seen_untouched_mm3"]
        self.assertGreater(unseen, 0)
        self.assertLess(unseen + untouched, r["removed_mm3"])  # what it is where the touch stays as it was
        self.assertAlmostEqual(unseen - untouched, r["left_mm3"], delta=0.3)
        self.assertEqual(self.resection("meniscus_lateral")["cuts"], 0)
        trace = self.session()["trace"]
        self.assert_same_mesh(station)
        self.session_command("stop", "room-1")
        metrics = self.metrics()
        self.assertGreater(metrics["path_seen", "punch", 1][0], 10)
        self.assertEqual(metrics["cuts", "meniscus_medial", 1][0], r["cuts"])
        self.server.end()
        self.assert_metrics_are_those_of(trace, metrics)
        replay = call_json("arthron-trace", "replay", trace)
        self.assertEqual(replay["verdict"], "identical")
        info = call_json("arthron-trace", "info", trace)
        self.assertEqual(info["events"]["cut"], r["cuts"])
        for figure in ("removed_mm3", "touched_unseen_mm3", "seen_untouched_mm3"):
            self.assertAlmostEqual(info["resections"][0][figure], r[figure], places=9)

    def test_a_station_that_comes_back_has_the_same_mesh(self):
        first = self.start_station()
        self.wait_for_cuts(1)
        first.end(signal.SIGKILL)
        second = self.start_station(label="again")
        self.wait_for_cuts(self.resection()["cuts"] + 1)
        self.pause()
        wait_until("frames", lambda: self.session()["connected"])
        self.assert_same_mesh(second)

    def test_a_reset_makes_the_mesh_whole_at_both_ends(self):
        station = self.start_station()
        wait_until("a session", lambda: self.session_command("show", "room-1", code=None)["resections"])
        before = wait_until("its mesh", self.whole)
        self.wait_for_cuts(1)
        self.session_command("reset", "room-1")
        self.session_command("pause", "room-1")  # after a reset the session runs, and the hand bites again
        wait_until("the whole mesh", lambda: self.resection()["cuts"] == 0)
        after = self.resection()
        self.assertEqual(after["mesh_hash"], before["mesh_hash"])
        self.assertAlmostEqual(after["volume_mm3"], before["volume_mm3"], places=9)
        self.assert_same_mesh(station)


if __name__ == "__main__":
    unittest.main(verbosity=2)
