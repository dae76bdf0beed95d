#!/usr/bin/env python3
"""Two servers that share a station: where one is killed, paused or drained, the other goes on with the session."""

import os
import re
import shutil
import signal
import struct
import subprocess
import time
import unittest
from unittest import mock

from arthron import call_json, program, wait_until
from several_servers import SeveralServers

LEASE_S = 12  # so long without a renewal, and a server counts as dead
STATE = ("mesh_number", "mesh_hash", "cuts", "removed_mm3", "pieces_mm3", "volume_mm3", "warped_mm3", "left_mm3",
         "distance_mm", "over_mm3", "under_mm3", "rim_mm", "removed_zone_mm3")


def other_build(path):
    """The server with another build id: to others it is another program."""
    shutil.copy(program("arthron-server"), path)
    notes = subprocess.run(("readelf", "-n", path), check=True, capture_output=True, text=True).stdout
    build_id = bytes.fromhex(re.search(r"Build ID: (\w+)", notes)[1])
    with open(path, "r+b") as f:
        content = f.read()
        assert content.count(build_id) == 1
        f.seek(content.index(build_id))
        f.write(bytes(byte ^ 0xff for byte in build_id))
    return path


class Cluster(SeveralServers):
    def verify(self):
        return call_json("arthron-trace", "verify", *self.parts(), "--authority",
                         os.path.join(self.keys, "authority.pem"), code=None)

    def rows(self, name, what):
        return call_json("arthron-server", "records", "--file", self.path(f"records-{name}.db"), "list", what)

    def assert_recorded(self, name, session, server):
        """Its records have the session, with the part that each server wrote."""
        wait_until("the end in the records of " + name,
                   lambda: [row["state"] for row in self.rows(name, "sessions")] == ["closed"])
        row, = self.rows(name, "sessions")
        self.assertEqual((row["id"], row["server"]), (session["id"], server))
        part, = self.rows(name, "parts")
        self.assertEqual((part["number"], row["part"], part["server"]), (1, 2, "a"))

    def begin(self):
        station = self.start_station()
        self.wait_at("a")
        self.wait_for_cuts()
        self.pause()
        return station, self.session(), self.resection()

    def assert_goes_on(self, name, before, cut):
        self.wait_at(name, "paused")
        self.assertEqual(self.session()["id"], before["id"])
        now = self.resection()
        self.assertEqual({key: now[key] for key in STATE}, {key: cut[key] for key in STATE})
        self.session_command("start", "room-1")
        self.wait_for_cuts(cut["cuts"] + 1)

    def assert_one_session(self, parts):
        """Its trace is in so many parts, which verify together, and each that was closed is signed."""
        found = self.verify()
        self.assertEqual((found["one_session"], found["why"]), (True, ""))
        self.assertEqual(sorted(part["part"] for part in found["parts"]), list(range(1, parts + 1)))
        for part in found["parts"]:
            self.assertEqual(part["signature"], "good" if part["whole"] else "none", part["file"])
            self.assertEqual((part["missing"], part["damages"]), (0, []))
        return found["parts"]

    def test_another_server_goes_on_when_one_is_killed(self):
        station, before, cut = self.begin()
        self.servers["a"].end(signal.SIGKILL)
        self.assert_goes_on("b", before, cut)
        self.pause()
        self.assert_same_mesh(station)
        self.servers["b"].end()
        self.assert_one_session(2)
        self.assert_recorded("b", before, "b")
        self.start_named("a")
        self.assert_recorded("a", before, "b")

    def test_a_server_that_is_drained_gives_its_sessions_away(self):
        station, before, cut = self.begin()
        self.servers["a"].end(signal.SIGUSR1)
        self.assert_goes_on("b", before, cut)
        self.start_named("a")
        self.pause()
        cut = self.resection()
        self.servers["b"].end(signal.SIGUSR1)
        self.assert_goes_on("a", before, cut)
        self.pause()
        self.assert_same_mesh(station)
        self.servers["a"].end()
        self.assertTrue(all(part["whole"] for part in self.assert_one_session(3)))

    def test_a_session_of_a_drained_server_is_not_run_again(self):
        station = self.start_station()
        self.wait_at("a")
        self.wait_for_cuts()
        self.servers["a"].end(signal.SIGUSR1)
        self.wait_at("b")
        self.wait_for_cuts(self.resection()["cuts"] + 1)
        self.pause()
        self.assert_same_mesh(station)
        self.servers["b"].end()
        (second,) = [path for path in self.parts() if path.endswith("-p2.trace")]
        self.assertLessEqual(call_json("arthron-trace", "info", second)["taken"], 2)  # cuts of the last moment
        self.assert_one_session(2)

    def test_a_server_of_another_build_goes_on_with_the_state_and_says_so(self):
        self.servers["b"].end()
        self.start_named("b", server=other_build(self.path("arthron-server")))
        station, before, cut = self.begin()
        self.servers["a"].end(signal.SIGKILL)
        self.assert_goes_on("b", before, cut)
        self.pause()
        self.assert_same_mesh(station)
        self.servers["b"].end()
        self.assertIn("it begins with a state that another program or machine kept", self.servers["b"].log())
        self.assert_one_session(2)

    def test_a_server_that_was_paused_serves_nothing(self):
        station, before, cut = self.begin()
        self.servers["a"].process.send_signal(signal.SIGSTOP)
        self.assert_goes_on("b", before, cut)
        steps = int(self.verify()["parts"][0]["records"])
        self.servers["a"].process.send_signal(signal.SIGCONT)
        self.servers["a"].wait_for_log("another server has it now")
        self.ask("a")
        wait_until("no session", lambda: self.session()["state"] == "closed")
        self.ask("b")
        self.wait_for_steps()
        self.pause()
        self.assert_same_mesh(station)
        self.servers["b"].end()
        first = min(self.assert_one_session(2), key=lambda part: part["part"])
        self.assertEqual(first["server"], "a")
        self.assertLess(first["records"] - steps, 20)  # which its buffer had, and none of the socket's

    def test_a_server_that_starts_again_goes_on_itself(self):
        station, before, cut = self.begin()
        self.servers["b"].end()
        self.servers["a"].end(signal.SIGKILL)
        self.start_named("a")
        self.assert_goes_on("a", before, cut)
        self.assertEqual(self.session()["trace"], before["trace"])
        self.pause()
        self.assert_same_mesh(station)

    def set_clock(self, name, off_h):
        """In place: the server has mapped it."""
        path = self.path("clock-" + name)
        with open(path, "r+b" if os.path.exists(path) else "wb") as f:
            f.write(struct.pack("<q", off_h * 3600))
        return path

    def restart_by_clock(self, name, off_h):
        self.servers[name].end()
        moved = {"LD_PRELOAD": os.environ["ARTHRON_WRONG_CLOCK"], "WRONG_CLOCK_FILE": self.set_clock(name, off_h),
                 "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"}
        with mock.patch.dict(os.environ, moved):
            self.start_named(name)

    def test_clocks_that_are_hours_off_and_jump_do_no_harm(self):
        """Back by half a day, and forth: the session stays where it is, protected, until its server is killed."""
        self.restart_by_clock("a", 6)
        self.restart_by_clock("b", -6)
        station, before, cut = self.begin()
        self.assertGreater(before["start_utc_s"], time.time() + 5 * 3600)
        for off_h in (-6, 6):
            self.set_clock("a", off_h)
            time.sleep(LEASE_S)
            self.wait_for_steps()
            wait_until("the session is protected", lambda: not self.session()["unprotected"])
            self.assertEqual((self.session()["id"], self.session()["trace"]), (before["id"], before["trace"]))
        self.servers["a"].end(signal.SIGKILL)
        self.assert_goes_on("b", before, cut)
        self.pause()
        self.assert_same_mesh(station)
        self.servers["b"].end()
        self.assert_one_session(2)

    def test_sessions_go_on_without_nats(self):
        """Beyond the end of the lease. What was cut meanwhile is in the journal once NATS is back."""
        station, before, cut = self.begin()
        self.nats.end(signal.SIGKILL)
        gone = time.monotonic()
        self.session_command("start", "room-1")
        self.wait_for_cuts(cut["cuts"] + 1)
        time.sleep(max(0, gone + LEASE_S - time.monotonic()))
        self.wait_for_steps()
        self.start_nats()
        wait_until("the session is protected", lambda: not self.session()["unprotected"])
        self.pause()
        cut = self.resection()
        wait_until("the last cut is protected", lambda: not self.session()["unprotected"])
        self.servers["a"].end(signal.SIGKILL)
        self.assert_goes_on("b", before, cut)
        self.pause()
        self.assert_same_mesh(station)


if __name__ == "__main__":
    unittest.main()
