#!/usr/bin/env python3
"""The server is killed and started again: its sessions go on where they were, in their traces."""

import os
import re
import resource
import shutil
import signal
import struct
import time
import unittest

from arthron import call, call_json, wait_until
from bites import Bites

STATE = ("mesh_number", "mesh_hash", "cuts", "removed_mm3", "pieces_mm3", "volume_mm3", "warped_mm3", "left_mm3",
         "distance_mm", "over_mm3", "under_mm3", "rim_mm", "removed_zone_mm3")

PLACE_IN_STATE = 9 + 4 + 4 + 20 + 64 + 64  # behind magic, version, format, and who wrote it: its offset and its step


class Resume(Bites):
    def cuts(self):
        return self.session_command("show", "room-1", code=None)["resections"][0]["cuts"]

    def kill(self):
        self.server.end(signal.SIGKILL)

    def restart(self):
        self.server = self.start_server()

    def verify(self, trace, code=0):
        return call_json("arthron-trace", "verify", trace, "--authority", os.path.join(self.keys, "authority.pem"),
                         code=code)

    def test_a_killed_server_goes_on_with_what_was_cut(self):
        station = self.start_station()
        wait_until("two cuts", lambda: self.cuts() >= 2, 60)
        self.pause()
        before, session = self.resection(), self.session()
        time.sleep(0.1)  # five times what a kill may cost
        self.kill()
        self.assertEqual(self.verify(session["trace"], code=1)["signature"], "none")
        self.restart()
        after, again = self.resection(), self.session()
        self.assertEqual({key: after[key] for key in STATE}, {key: before[key] for key in STATE})
        self.assertEqual((again["id"], again["trace"], again["state"]), (session["id"], session["trace"], "paused"))
        wait_until("the station", lambda: self.session()["connected"], 30)
        self.session_command("start", "room-1")
        self.wait_for_steps()
        wait_until("another cut", lambda: self.cuts() > before["cuts"], 60)
        self.pause()
        there = self.resection()
        station.end()
        here = next(m for m in self.summary(station)["meshes"] if m["group"] == there["group"])
        self.assertEqual((here["number"], here["hash"]), (there["mesh_number"], there["mesh_hash"]))
        self.server.end()
        self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")
        self.assertEqual(call_json("arthron-trace", "info", session["trace"])["resumes"], 1)
        self.assertEqual(self.verify(session["trace"])["signature"], "good")

    def test_a_trace_whose_replay_ended_the_program_keeps_nobody_out(self):
        self.start_station()
        self.wait_for_steps()
        session = self.session()
        self.kill()
        marker = self.write(session["trace"] + ".resuming", "")
        self.restart()
        wait_until("a new session", lambda: self.session()["state"] == "running", 60)
        self.assertNotEqual(self.session()["id"], session["id"])
        self.assertIn(f"is not resumed: an earlier start ended while it ran this trace again; remove {marker}",
                      self.server.log())

    def test_a_server_that_is_upgraded_hands_its_sessions_over(self):
        self.start_station()
        wait_until("two cuts", lambda: self.cuts() >= 2, 60)
        self.pause()
        before, session = self.resection(), self.session()
        self.assertEqual(self.server.end(signal.SIGUSR1), 0)
        self.assertEqual(call_json("arthron-trace", "info", session["trace"])["state"], "paused")
        self.assertEqual(self.verify(session["trace"], code=1)["signature"], "none")
        self.restart()
        after, again = self.resection(), self.session()
        self.assertEqual({key: after[key] for key in STATE}, {key: before[key] for key in STATE})
        self.assertEqual((again["id"], again["trace"], again["state"]), (session["id"], session["trace"], "paused"))
        self.session_command("stop", "room-1")
        self.server.end()
        self.assertEqual(self.verify(session["trace"])["signature"], "good")

    def test_killed_amid_cuts_again_and_again_it_goes_on(self):
        self.start_station()
        wait_until("a cut", lambda: self.session_command("show", "room-1", code=None)["resections"] and self.cuts() >= 1, 60)
        session = self.session()
        for times in range(1, 4):
            self.kill()
            self.restart()
            self.assertEqual(self.session()["id"], session["id"])
            self.wait_for_steps(100)
        self.session_command("stop", "room-1")
        metrics = self.metrics()
        self.assertGreater(metrics["present", "punch", 1][0], 1)
        self.server.end()
        self.assert_metrics_are_those_of(session["trace"], metrics)
        self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")
        self.assertEqual(call_json("arthron-trace", "info", session["trace"])["resumes"], 3)
        self.assertEqual(len(os.listdir(self.traces)), 1)

    def run_again(self):
        """The steps that the server ran again at its start: from, to."""
        steps = re.search(r"run again from step (\d+) to step (\d+)", self.server.log())
        return int(steps[1]), int(steps[2])

    def cut_until_its_state_is_kept(self):
        """The session, the path of its state, and its tissue at rest."""
        self.start_station()
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        session = self.session()
        state = session["trace"] + ".state"
        wait_until("its state", lambda: os.path.exists(state), 90)
        self.wait_for_steps(50)
        self.pause()
        time.sleep(0.1)  # five times what a kill may cost
        return session, state, self.resection()

    def assert_goes_on(self, session, before):
        after, again = self.resection(), self.session()
        self.assertEqual({key: after[key] for key in STATE}, {key: before[key] for key in STATE})
        self.assertEqual((again["id"], again["trace"], again["state"]), (session["id"], session["trace"], "paused"))

    def test_only_what_follows_the_state_that_was_kept_is_run_again(self):
        session, state, before = self.cut_until_its_state_is_kept()
        self.kill()
        self.restart()
        first, last = self.run_again()
        self.assertTrue(1 < first <= last, (first, last))
        self.assert_goes_on(session, before)
        wait_until("the station", lambda: self.session()["connected"], 30)
        self.session_command("start", "room-1")
        wait_until("another cut", lambda: self.cuts() > before["cuts"], 60)
        self.session_command("stop", "room-1")
        metrics = self.metrics()
        wait_until("its state's end", lambda: not os.path.exists(state))
        self.server.end()
        self.assert_metrics_are_those_of(session["trace"], metrics)
        self.assertEqual(self.verify(session["trace"])["signature"], "good")
        self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")

    def test_a_state_of_the_last_record_is_gone_on_from(self):
        session, state, _ = self.cut_until_its_state_is_kept()
        self.kill()
        with open(state, "rb") as f:
            offset, step = struct.unpack_from("<QQ", f.read(), PLACE_IN_STATE)
        os.truncate(session["trace"], offset)
        self.restart()
        self.assertEqual(self.run_again(), (step + 1, step))
        self.assertEqual(self.session()["id"], session["id"])
        wait_until("more steps", lambda: self.session()["steps"] > step, 30)
        self.session_command("stop", "room-1")
        self.server.end()
        self.assertGreater(os.path.getsize(session["trace"]), offset)
        self.assertEqual(call_json("arthron-trace", "replay", session["trace"])["verdict"], "identical")
        self.assertEqual(self.verify(session["trace"])["signature"], "good")

    def test_a_state_that_is_damaged_is_not_used(self):
        session, state, before = self.cut_until_its_state_is_kept()
        self.kill()
        with open(state, "rb") as f:
            whole = f.read()
        for bad, why in ((whole[:-1], "it is not whole"), (b"", "it is no state of a session"),
                         (whole[:5000] + bytes([whole[5000] ^ 1]) + whole[5001:], "it is not whole")):
            with open(state, "wb") as f:
                f.write(bad)
            self.restart()
            self.assertIn(why, self.server.log())
            self.assertEqual(self.run_again()[0], 1)
            self.assert_goes_on(session, before)
            self.kill()

    def test_a_full_disk_stops_no_pose_and_is_told(self):
        self.start_station()
        self.wait_for_steps()
        trace = self.session()["trace"]
        self.assertFalse(self.session()["trace_failing"])
        pid, hard = self.server.process.pid, resource.getrlimit(resource.RLIMIT_FSIZE)[1]
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (os.path.getsize(trace) + 1000, hard))
        wait_until("the disk's failing", lambda: self.session()["trace_failing"])
        self.wait_for_steps(200)
        self.assertIn("its trace cannot be written to the disk", call("arthron-server", "session", "--socket", self.socket, "list").stdout)
        self.assertEqual(self.verify(trace, code=1)["signature"], "none")
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (hard, hard))
        wait_until("the disk again", lambda: not self.session()["trace_failing"])
        self.assertEqual(self.session()["trace_missing"], 0)
        self.server.end()
        self.assertEqual(self.verify(trace)["signature"], "good")
        self.assertEqual(call_json("arthron-trace", "replay", trace)["verdict"], "identical")

    def assert_is_closed(self, trace, why):
        wait_until("its end", lambda: call_json("arthron-trace", "info", trace)["whole"])
        self.assertEqual(self.verify(trace)["signature"], "good")
        self.assertIn("The session could not go on: " + why, call("arthron-trace", "info", trace).stdout)

    def test_a_session_that_was_closed_stays_as_it_is_and_one_of_long_ago_is_closed(self):
        self.start_station()
        self.wait_for_steps()
        first = self.session()
        self.server.end()
        size = os.path.getsize(first["trace"])
        self.restart()
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        second = self.session()
        self.assertNotEqual(second["id"], first["id"])
        self.assertEqual(os.path.getsize(first["trace"]), size)
        self.kill()
        os.utime(second["trace"], (time.time() - 3600, time.time() - 3600))
        self.restart()
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        self.assertNotIn(self.session()["id"], (first["id"], second["id"]))
        self.assertEqual(os.path.getsize(first["trace"]), size)
        self.assert_is_closed(second["trace"], "no server resumed it within 300 s")

    def test_sessions_that_are_not_resumed_are_closed_with_the_reason(self):
        self.start_station()
        self.wait_for_steps()
        session = self.session()
        self.kill()
        # As a station that is no more left it, and as a kill left an older session of this station.
        gone = os.path.join(self.traces, "room-9-20260102T030405Z-01234567.trace")
        older = os.path.join(self.traces, "room-1-20260102T030405Z-01234567.trace")
        damaged = os.path.join(self.traces, "room-1-20260102T030406Z-01234567.trace")
        for path in (gone, older, damaged):
            shutil.copy(session["trace"], path)
        size = os.path.getsize(damaged)
        with open(damaged, "r+b") as f:
            f.seek(size // 2)
            byte = f.read(1)[0]
            f.seek(-1, os.SEEK_CUR)
            f.write(bytes([byte ^ 1]))
        self.restart()
        self.assertEqual(self.session()["id"], session["id"])
        self.assert_is_closed(gone, "the server's config has no station room-9")
        self.assert_is_closed(older, "its station has a newer session")
        self.session_command("stop", "room-1")
        self.server.end()
        self.assertEqual(os.path.getsize(damaged), size)
        self.assertNotIn("could not go on", call("arthron-trace", "info", session["trace"]).stdout)
        self.assertEqual(call_json("arthron-trace", "replay", gone)["verdict"], "identical")

    def test_of_two_sessions_of_one_second_the_one_that_was_open_goes_on(self):
        self.start_station()
        self.wait_for_steps()
        closed = self.session()["trace"]
        self.server.end()
        self.restart()
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        session = self.session()
        before, after = os.path.join(self.traces, "{}-00000000.trace"), os.path.join(self.traces, "{}-ffffffff.trace")
        stamp = os.path.basename(session["trace"])[:-len("-00000000.trace")]
        os.rename(closed, after.format(stamp))
        self.kill()
        self.restart()
        self.assertEqual(self.session()["id"], session["id"])
        os.rename(after.format(stamp), before.format(stamp))
        self.kill()
        self.restart()
        self.assertEqual(self.session()["id"], session["id"])

    def test_a_session_that_was_stopped_just_before_a_kill_gets_its_end(self):
        self.start_station()
        self.wait_for_steps()
        first = self.session()
        self.server.process.send_signal(signal.SIGSTOP)
        with open(first["trace"], "rb") as f:
            open_trace = f.read()
        self.server.process.send_signal(signal.SIGCONT)
        self.session_command("stop", "room-1")
        wait_until("its end", lambda: call_json("arthron-trace", "info", first["trace"])["whole"])
        self.session_command("start", "room-1")
        self.wait_for_steps()
        second = self.session()
        self.kill()
        with open(first["trace"], "wb") as f:
            f.write(open_trace)  # as if its end had not come to the disk
        before = os.stat(second["trace"]).st_mtime - 1
        os.utime(first["trace"], (before, before))
        self.assertEqual(self.verify(first["trace"], code=1)["signature"], "none")
        self.write(os.path.join(self.traces, "room-1-20260102T030405Z-01234567.trace.draft"), "of a copy")
        self.restart()
        self.assertEqual(self.session()["id"], second["id"])
        self.assert_is_closed(first["trace"], "its station has a newer session")
        self.assertEqual(call_json("arthron-trace", "replay", first["trace"])["verdict"], "identical")
        self.assertEqual(sorted(name for name in os.listdir(self.traces) if not name.endswith(".state")),
                         sorted(os.path.basename(s["trace"]) for s in (first, second)))
        self.assertIn("trace.draft: removed", self.server.log())

    def test_a_closed_session_on_a_case_that_is_gone_is_no_error(self):
        self.start_station()
        self.wait_for_steps()
        first = self.session()
        self.server.end()
        self.server = self.start_server("[station room-1]\ncase = healthy")
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        self.assertEqual(self.session()["case"], "healthy")
        self.assertNotEqual(self.session()["id"], first["id"])
        self.assertNotIn("cannot go on", self.server.log())

    def test_a_trace_that_comes_out_otherwise_is_left_as_it_is(self):
        self.start_station()
        self.wait_for_steps()
        session = self.session()
        self.kill()
        with open(session["trace"], "r+b") as f:
            f.seek(os.path.getsize(session["trace"]) // 2)
            byte = f.read(1)[0]
            f.seek(-1, os.SEEK_CUR)
            f.write(bytes([byte ^ 1]))
        self.restart()
        self.server.wait_for_log("cannot go on")
        wait_until("a session", lambda: self.session()["steps"] > 0, 30)
        self.assertNotEqual(self.session()["id"], session["id"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
