#!/usr/bin/env python3
"""What a page hears of a hall: the wall, a station while it cuts, and a session again when it is over."""

import os
import signal
import time
import unittest

from arthron import call, call_json, free_port, wait_until
from bites import Bites
from page import ASSIGN, FAILED, NOT_THERE, NOTE, PAUSE, RECORDED, START, STATION, STOP, UNDO, WALL, Browser, piece

WAITING, RUNNING, PAUSED, CLOSED = range(4)
MENISCUS = "meniscus_medial"
PUNCH = 5


class Live(Bites):
    more_cases = ("healthy",)

    def server_config(self, stations="", extra=""):
        self.web_port = getattr(self, "web_port", None) or free_port()
        return super().server_config(stations, extra + f"records = records.db\n[web]\nport = {self.web_port}\n")

    def setUp(self):
        super().setUp()
        self.pages = []
        self.browser = Browser(self.web_port, self.path("keys/authority.pem"))
        self.browser.first(self.server.log())

    def tearDown(self):
        for page in self.pages:
            page.close()
        super().tearDown()

    def open(self):
        self.pages.append(self.browser.page())
        return self.pages[-1]

    def assert_is_shown(self, page):
        there = self.resection()
        page.read_until(lambda: page.meshes.get(MENISCUS, (0,))[0] == there["mesh_number"] and
                        page.resections[MENISCUS]["mesh_hash"] == there["mesh_hash"])
        self.assertEqual(page.meshes[MENISCUS][2], there["mesh_hash"])
        for key in ("cuts", "volume_mm3", "removed_mm3", "mesh_number"):
            self.assertEqual(page.resections[MENISCUS][key], there[key], key)

    def test_the_wall_sees_a_station_come_and_go(self):
        wall = self.open()
        wall.watch(WALL, rate_hz=20)
        wall.read_until(lambda: "room-1" in wall.places)
        self.assertFalse(wall.places["room-1"]["connected"])
        self.assertEqual(wall.places["room-1"]["urgency"], 0)
        station = self.start_station()
        wall.read_until(lambda: wall.places["room-1"]["state"] == RUNNING)
        wall.read_until(lambda: all(d["rate_hz"] > 5 for d in wall.places["room-1"]["devices"].values()))
        self.assertEqual(set(wall.places["room-1"]["devices"]), {"encoders", "tracker"})
        begin, seen = time.monotonic(), len(wall.moments)
        wall.read_until(lambda: time.monotonic() > begin + 2)
        rate = (len(wall.moments) - seen) / (time.monotonic() - begin)
        self.assertTrue(0 < rate < 22, rate)
        steps = [m["step"] for m in wall.moments]
        self.assertEqual(steps, sorted(set(steps)))
        station.end(signal.SIGKILL)
        wall.read_until(lambda: "away" in wall.places["room-1"]["warning"])
        self.assertEqual(wall.places["room-1"]["urgency"], 3)

    def test_a_page_follows_a_station_and_commands_it(self):
        self.start_station()
        wait_until("a session", lambda: self.session()["state"] == "running")
        page, other = self.open(), self.open()
        page.watch(STATION, station="room-1", mismatch=True)
        page.read_until(lambda: page.resections.get(MENISCUS, {}).get("cuts", 0) >= 2)
        self.assertEqual(page.order[page.order.index("moment") - 1] != "moment" and page.sessions[0]["id"],
                         self.session()["id"])
        self.assertTrue(page.command(PAUSE)["ok"])
        self.assertEqual(self.session()["state"], "paused")
        self.assertTrue(page.command(UNDO)["ok"])
        self.assert_is_shown(page)
        self.assertEqual(page.meshes[MENISCUS][1], sorted(set(page.meshes[MENISCUS][1])))
        other.watch(STATION, station="room-1")  # comes late
        self.assert_is_shown(other)
        self.assertEqual(len(other.meshes[MENISCUS][1]), 1)
        self.assertFalse(other.mismatches)  # it did not ask
        self.assert_mismatch_goes_with_the_mesh(page)
        self.assertTrue(page.note("Here", marker=(1, (1, 2, 3)))["ok"])
        self.assertFalse(page.note("two\nlines")["ok"])
        for p in (page, other):
            p.read_until(lambda: p.remarks)
            self.assertEqual(p.remarks[1]["text"], "Here")
            self.assertEqual((p.remarks[1]["author"], p.remarks[1]["marker"], p.remarks[1]["body"]), ("otto", True, 1))
        self.assertTrue(page.command(START)["ok"])
        page.read_until(lambda: page.metrics and page.metrics["time", "", 1][0] > 0)
        self.assertTrue(page.command(STOP)["ok"])
        page.read_until(lambda: page.moments[-1]["state"] == CLOSED)
        self.assertFalse(page.troubles)

    def assert_mismatch_goes_with_the_mesh(self, page):
        """Each mesh has one: none while it is whole, and none once all cuts are undone."""
        told = page.mismatches[MENISCUS]
        self.assertEqual([number for number, _ in told], page.meshes[MENISCUS][1])
        self.assertTrue(any(mm for _, mm in told))
        self.assertTrue(all(0 < abs(x) <= 10 for _, mm in told for x in mm.values()))
        while page.command(UNDO)["ok"]:
            pass
        self.assert_is_shown(page)
        self.assertEqual(page.mismatches[MENISCUS][-1], (page.meshes[MENISCUS][0], {}))

    def record(self):
        """A session that was cut in, as it was in the end."""
        self.start_station()
        wait_until("a session", lambda: self.session()["state"] == "running")
        page = self.open()
        page.watch(STATION, station="room-1")
        page.read_until(lambda: page.sessions and page.moments)
        page.note("Well done")
        self.wait_for_cuts(3)
        self.session_command("undo", "room-1")
        self.wait_for_cuts(3)
        self.session_command("pause", "room-1")
        self.session_command("undo", "room-1")
        resection, session = self.resection(), self.session()
        self.session_command("stop", "room-1")
        page.close()
        self.pages.remove(page)
        wait_until("its end", lambda: call("arthron-trace", "verify", session["trace"], code=None).returncode == 0)
        return resection, session

    def test_what_nobody_looks_at_keeps_no_command_from_the_log(self):
        page = self.open()
        page.watch(STATION, station="room-1")
        self.assertFalse(page.command(ASSIGN, more=piece(12, b"\xff"))["ok"])
        self.assertTrue(page.command(ASSIGN, case="\n", more=piece(12, "anna"))["ok"])
        log = wait_until("the command in the log", lambda: [
            row for row in self.browser.request("GET", "/audit")["audit"] if row["action"] == "assign"])
        self.assertEqual([(row["actor"], row["subject"]) for row in log], [("otto", "station room-1")])

    def test_a_recorded_session_is_seen_again(self):
        resection, session = self.record()
        page = self.open()
        page.watch(RECORDED, session=session["id"], rate_hz=20, mismatch=True)
        page.read_until(lambda: page.done)
        self.assertEqual(page.troubles, [])
        self.assertEqual([number for number, _ in page.mismatches[MENISCUS]], page.meshes[MENISCUS][1])
        self.assertTrue(any(mm for _, mm in page.mismatches[MENISCUS]))
        self.assertEqual((page.sessions[0]["id"], page.sessions[0]["recorded"]), (session["id"], True))
        self.assertEqual(page.meshes[MENISCUS][2], resection["mesh_hash"])
        self.assertEqual(page.meshes[MENISCUS][1], list(range(1, resection["mesh_number"] + 1)))
        for key in ("cuts", "volume_mm3", "removed_mm3", "mesh_hash", "mesh_number"):
            self.assertEqual(page.resections[MENISCUS][key], resection[key], key)
        self.assertEqual([r["text"] for r in page.remarks.values()], ["Well done"])
        times = [m["s"] for m in page.moments]
        self.assertEqual(times, sorted(times))
        info = call_json("arthron-trace", "info", session["trace"])
        self.assertEqual(info["settings"]["field"], "integral")
        self.assertAlmostEqual(page.sessions[0]["length_s"], times[-1], delta=0.2)
        self.assertGreaterEqual(times[-1], info["seconds"])
        self.assertLess(len(times), 20 * info["seconds"] + resection["mesh_number"] + 20)
        self.assertGreater(len(times), 50)
        self.assert_metrics_are_those_of(session["trace"], page.metrics)
        first_chunk, first_moment = page.order.index("chunk"), page.order.index("moment")
        self.assertLess(first_chunk, first_moment)
        self.assertIn("moment", page.order[first_moment:len(page.order) - page.order[::-1].index("chunk")])
        self.damage(session["trace"])
        page.watch(RECORDED, session=session["id"], rate_hz=20)
        page.read_until(lambda: page.troubles)
        self.assertIn(os.path.basename(session["trace"]), page.troubles[0])
        self.assertNotIn(self.folder, page.troubles[0])
        page.read_until(lambda: page.done)
        os.truncate(session["trace"], 3)
        page.watch(RECORDED, session=session["id"], rate_hz=20)
        page.read_until(lambda: page.done)
        self.assertEqual(page.trouble_kinds, [FAILED])
        self.assertIn(os.path.basename(session["trace"]), page.troubles[0])
        self.assertFalse(page.sessions)

    @staticmethod
    def damage(path):
        with open(path, "r+b") as trace:
            trace.seek(os.path.getsize(path) // 2)
            byte = trace.read(1)
            trace.seek(-1, os.SEEK_CUR)
            trace.write(bytes([byte[0] ^ 1]))

    def test_a_session_that_was_copied_begins_with_what_was_cut(self):
        resection, session = self.record()
        page = self.open()
        page.watch(STATION, station="room-1")
        self.session_command("copy", "room-1", "--from", session["id"])
        copy = self.session()
        page.read_until(lambda: page.sessions and page.sessions[-1]["id"] == copy["id"])
        page.read_until(lambda: page.meshes.get(MENISCUS, (0, [], ""))[2] == resection["mesh_hash"])
        self.session_command("stop", "room-1")
        page.watch(RECORDED, session=copy["id"])
        page.read_until(lambda: page.done)
        self.assertEqual(page.troubles, [])
        self.assertEqual(page.meshes[MENISCUS][1:], ([resection["mesh_number"]], resection["mesh_hash"]))
        self.assertEqual(page.resections[MENISCUS]["volume_mm3"], resection["volume_mm3"])
        self.assertGreaterEqual(page.moments[0]["s"], 0)

    def test_the_same_hands_on_another_case(self):
        resection, session = self.record()
        page = self.open()
        page.watch(RECORDED, session=session["id"], case="healthy", rate_hz=20)
        page.read_until(lambda: page.done)
        self.assertEqual(page.troubles, [])
        self.assertEqual((page.sessions[0]["case"], page.sessions[0]["own_case"]), ("healthy", "arthrosis"))
        own = self.open()
        own.watch(RECORDED, session=session["id"], rate_hz=20, meshes=False)
        own.read_until(lambda: own.done)
        self.assertFalse(own.meshes)
        self.assertEqual(own.resections[MENISCUS]["volume_mm3"], resection["volume_mm3"])
        mine, other = ({moment["step"]: moment["instruments"][PUNCH] for moment in p.moments if PUNCH in moment["instruments"]}
                       for p in (own, page))
        both = mine.keys() & other.keys()  # what a cut adds is told of its case alone
        self.assertGreater(len(both), max(10, len(mine) / 2))
        self.assertTrue(all(mine[step][3] == other[step][3] for step in both))
        self.assertFalse(all(mine[step].get(4) == other[step].get(4) for step in both))

    def test_what_is_not_there_is_told(self):
        page = self.open()
        page.watch(STATION, station="room-9")
        page.read_until(lambda: page.troubles)
        self.assertIn("room-9", page.troubles[0])
        self.assertEqual(page.trouble_kinds, [NOT_THERE])
        page.read_until(lambda: page.beats >= 2)
        page.watch(RECORDED, session="0" * 32)
        page.read_until(lambda: page.troubles)
        self.assertIn("0" * 32, page.troubles[0])
        page.read_until(lambda: page.done)
        page.watch(RECORDED, session="../../etc/passwd")
        page.read_until(lambda: page.troubles)
        self.assertFalse(page.command(PAUSE)["ok"])
        self.assertFalse(page.command(NOTE, station="room-9")["ok"])


if __name__ == "__main__":
    unittest.main()
