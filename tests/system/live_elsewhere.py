#!/usr/bin/env python3
"""A page at one server sees and commands what another server serves. Their configs have the stations in another order."""

import shutil
import signal
import time
import unittest

from arthron import call, wait_until
from page import ASSIGN, PAUSE, RECORDED, START, STATION, STOP, UNDO, WALL, Browser, piece
from several_servers import SeveralServers

RUNNING, PAUSED, CLOSED = 1, 2, 3
MENISCUS = "meniscus_medial"
ROOMS = ("room-1", "room-2", "room-3")  # at a, at b, and never there


class LiveElsewhere(SeveralServers):
    more_cases = ("healthy",)

    def setUp(self):
        self.pages, self.others_first = [], set()
        super().setUp()
        self.enrol("room-2")
        self.others_first.add("room-2")
        browser = Browser(self.web_ports["a"], self.path("keys/authority.pem"))
        browser.first(self.servers["a"].log())
        self.cookie = browser.cookie
        wait_until("the account at b", lambda: self.knows("b"))

    def knows(self, name):
        try:
            return self.browser_at(name).request("GET", "/me")
        except ConnectionError:
            return False

    def tearDown(self):
        for page in self.pages:
            page.close()
        super().tearDown()

    def settings_of(self, name):
        port = self.web_ports[name]
        return {**super().settings_of(name), "web.port": port,
                "cluster.pages": f"localhost:{port}"}

    def config_of(self, name):
        """The stations of b in another order."""
        rooms = reversed(ROOMS) if name == "b" else ROOMS
        path = self.server_config("".join(f"[station {room}]\ncase = healthy\n" for room in rooms))
        return shutil.copy(path, self.path(f"{name}.ini"))

    def station_config(self, name="room-1", **more):
        ports = self.ports
        if name in self.others_first:
            self.ports = dict(reversed(list(ports.items())))
        path = super().station_config(name, **more)
        self.ports = ports
        return path

    def browser_at(self, name):
        browser = Browser(self.web_ports[name], self.path("keys/authority.pem"))
        browser.cookie = self.cookie
        return browser

    def open(self, name="a"):
        self.pages.append(self.browser_at(name).page())
        return self.pages[-1]

    def wait_at(self, name, state="running", room="room-2"):
        self.ask(name)
        wait_until(f"{room} at {name}", lambda: self.session(room)["connected"] and self.session(room)["state"] == state)

    def begin(self):
        station = self.start_station("room-2")
        self.wait_at("b")
        return station

    def resection(self, group=MENISCUS):
        return next(r for r in self.session_command("show", "room-2")["resections"] if r["group"] == group)

    def pause(self):
        self.session_command("pause", "room-2")

        def rests():
            before = self.resection()
            time.sleep(2)
            return self.resection() == before
        wait_until("the last cut", rests)

    def assert_is_shown(self, page):
        there = self.resection()
        page.read_until(lambda: page.meshes.get(MENISCUS, (0,))[0] == there["mesh_number"] and
                        page.resections[MENISCUS]["mesh_hash"] == there["mesh_hash"])
        self.assertEqual(page.meshes[MENISCUS][2], there["mesh_hash"])
        for key in ("cuts", "volume_mm3", "removed_mm3", "mesh_number"):
            self.assertEqual(page.resections[MENISCUS][key], there[key], key)

    def moments_of(self, page, room):
        return [m for m in page.moments if m["station_number"] == page.places[room]["number"]]

    def test_the_wall_shows_all_stations_of_all_servers(self):
        self.start_station("room-1")
        self.begin()
        wall, there = self.open("a"), self.open("b")
        for page in (wall, there):
            page.watch(WALL, rate_hz=20)
            page.read_until(lambda: set(page.places) == set(ROOMS) and
                            all(page.places[room]["state"] == RUNNING for room in ("room-1", "room-2")))
            self.assertEqual({room: page.places[room]["server"] for room in ROOMS},
                             {"room-1": "a", "room-2": "b", "room-3": ""})
            page.read_until(lambda: all(len(self.moments_of(page, room)) > 20 for room in ("room-1", "room-2")))
            for room in ("room-1", "room-2"):
                steps = [m["step"] for m in self.moments_of(page, room)]
                self.assertEqual(steps, sorted(set(steps)))
            self.assertEqual({row["station"]: row["state"] for row in page.listed()},
                             {"room-1": RUNNING, "room-2": RUNNING, "room-3": CLOSED})
            self.assertFalse(page.troubles)
        self.assertEqual([wall.places[room]["number"] for room in ROOMS], [0, 1, 2])
        self.assertEqual([there.places[room]["number"] for room in ROOMS], [2, 1, 0])

    def test_a_page_follows_and_commands_a_station_elsewhere(self):
        self.begin()
        page = self.open()
        page.watch(STATION, station="room-2", mismatch=True)
        page.read_until(lambda: page.resections.get(MENISCUS, {}).get("cuts", 0) >= 2)
        self.assertEqual(page.sessions[0]["id"], self.session("room-2")["id"])
        self.assertTrue(page.command(PAUSE, "room-2")["ok"])
        self.assertEqual(self.session("room-2")["state"], "paused")
        self.assertTrue(page.command(UNDO, "room-2")["ok"])
        self.assert_is_shown(page)
        self.assertEqual(page.meshes[MENISCUS][1], sorted(set(page.meshes[MENISCUS][1])))
        self.assertTrue(page.mismatches[MENISCUS])
        self.assertTrue(page.note("Here", marker=(1, (1, 2, 3)), station="room-2")["ok"])
        page.read_until(lambda: page.remarks)
        self.assertEqual((page.remarks[1]["text"], page.remarks[1]["author"]), ("Here", "otto"))
        self.assertTrue(page.command(START, "room-2")["ok"])
        page.read_until(lambda: page.metrics and page.metrics["time", "", 1][0] > 0)
        self.assertFalse(page.command(START, "room-1")["ok"])  # which nobody serves
        rows = {row["station"]: row for row in page.listed()}
        self.assertEqual(set(rows), set(ROOMS))
        self.assertEqual((rows["room-2"]["state"], rows["room-2"]["server"]),
                         (RUNNING, f"127.0.0.1:{self.ports['b']}"))
        self.assertTrue(page.command(STOP, "room-2")["ok"])
        page.read_until(lambda: page.moments[-1]["state"] == CLOSED)
        self.assertFalse(page.troubles)

    def trainee_at(self, name, trainee):
        instructor, browser = self.browser_at("a"), self.browser_at(name)
        instructor.request("POST", "/trainees", {"name": trainee})
        code = instructor.request("POST", f"/trainees/{trainee}/code", {})["code"]
        browser.cookie = None
        browser.request("POST", "/sign-in", {"code": code})
        self.pages.append(browser.page())  # at once: the other server may not know the sign-in yet
        return self.pages[-1]

    def test_a_trainee_sees_their_own_session_elsewhere_and_no_other(self):
        self.begin()
        anna, bert, otto = self.trainee_at("a", "anna"), self.trainee_at("a", "bert"), self.open("a")
        for page in (anna, bert):
            page.watch(STATION, station="room-2")
            page.read_until(lambda: page.troubles)
            self.assertEqual((page.troubles, page.sessions), (["there is no session of yours at room-2"], []))
        self.assertTrue(otto.command(ASSIGN, "room-2", more=piece(12, "anna"))["ok"])
        for kind in (STOP, START):
            self.assertTrue(otto.command(kind, "room-2")["ok"])
        anna.read_until(lambda: anna.sessions and anna.moments)
        self.assertEqual(anna.sessions[0]["id"], self.session("room-2")["id"])
        self.assertFalse(anna.places)
        self.assertFalse(anna.command(START, "room-2")["ok"])  # that is for instructors
        self.assertFalse(bert.command(STOP, "room-2")["ok"])
        self.assertEqual(self.session("room-2")["state"], "running")
        self.assertTrue(anna.command(STOP, "room-2")["ok"])
        wait_until("its end", lambda: self.session("room-2")["state"] != "running")
        self.assertEqual(bert.sessions, [])

    def test_a_page_goes_on_when_its_session_goes_on_elsewhere(self):
        station = self.begin()
        page, wall = self.open(), self.open()
        wall.watch(WALL, rate_hz=10)
        page.watch(STATION, station="room-2")
        page.read_until(lambda: page.resections.get(MENISCUS, {}).get("cuts", 0) >= 2)
        self.pause()
        self.assert_is_shown(page)
        session, cut = self.session("room-2")["id"], self.resection()
        wall.read_until(lambda: set(wall.places) == set(ROOMS) and wall.places["room-2"]["server"] == "b")
        self.servers["b"].end(signal.SIGKILL)
        page.read_until(lambda: wall.read() and len(page.sessions) > 1)
        self.assertEqual([s["id"] for s in page.sessions], [session, session])
        self.wait_at("a", "paused")
        self.assertEqual(self.resection()["mesh_hash"], cut["mesh_hash"])
        self.assert_is_shown(page)
        wall.read_until(lambda: wall.places["room-2"]["server"] == "a" and wall.places["room-2"]["state"] == PAUSED)
        self.start_named("b")
        self.assertTrue(page.command(START, "room-2")["ok"])
        self.servers["a"].process.send_signal(signal.SIGUSR1)  # its pages end with it
        self.wait_at("b")
        page = self.open("b")
        page.watch(STATION, station="room-2")
        self.pause()
        self.assert_is_shown(page)
        self.assertEqual(page.sessions[0]["id"], session)
        self.assert_same_mesh(station)

    def assert_same_mesh(self, station):
        there, here = self.resection(), self.mesh_at(station)
        self.assertEqual((here["number"], here["hash"]), (there["mesh_number"], there["mesh_hash"]))

    def test_a_slow_page_skips_to_the_newest(self):
        self.begin()
        page = self.open()
        page.watch(STATION, station="room-2", rate_hz=60)
        page.read_until(lambda: len(page.moments) > 30)
        time.sleep(5)  # what came meanwhile lies in the socket: two batches
        seen = len(page.moments)
        now = self.session("room-2")["steps"]
        page.read_until(lambda: page.moments[-1]["step"] >= now)
        self.assertLess(len(page.moments) - seen, 60)  # and not three hundred

    def test_a_server_that_hangs_holds_up_nothing(self):
        self.start_station("room-1")
        self.begin()
        wall, page = self.open(), self.open()
        wall.watch(WALL, rate_hz=20)
        page.watch(STATION, station="room-2")
        wall.read_until(lambda: set(wall.places) == set(ROOMS) and self.moments_of(wall, "room-2"))
        page.read_until(lambda: page.moments)
        self.servers["b"].process.send_signal(signal.SIGSTOP)
        asked = time.monotonic()
        reply = page.command(PAUSE, "room-2")
        self.assertFalse(reply["ok"])
        self.assertIn("server b did not answer", reply["text"])
        self.assertLess(time.monotonic() - asked, 12)
        page.read_until(lambda: page.troubles)
        self.assertIn("server b does not answer", page.troubles[0])
        gaps, last = [], time.monotonic()
        end, count = last + 3, len(self.moments_of(wall, "room-1"))
        wall.read_until(lambda: len(self.moments_of(wall, "room-1")) > count)
        while time.monotonic() < end:
            count = len(self.moments_of(wall, "room-1"))
            wall.read_until(lambda: len(self.moments_of(wall, "room-1")) > count)
            gaps.append(time.monotonic() - last)
            last = time.monotonic()
        self.assertLess(max(gaps[1:]), 1)
        self.wait_at("a")  # it takes over what b does not serve
        page.read_until(lambda: len(page.sessions) > 1)
        self.servers["b"].process.send_signal(signal.SIGCONT)
        steps = self.session("room-2")["steps"]
        page.read_until(lambda: page.moments[-1]["step"] > steps)

    def test_a_recorded_session_of_another_server_is_seen(self):
        self.begin()
        page = self.open()
        page.watch(STATION, station="room-2")
        page.read_until(lambda: page.resections.get(MENISCUS, {}).get("cuts", 0) >= 2)
        self.pause()
        cut, session = self.resection(), self.session("room-2")
        self.assertTrue(page.command(STOP, "room-2")["ok"])
        wait_until("its end", lambda: call("arthron-trace", "verify", session["trace"], code=None).returncode == 0)
        page.watch(RECORDED, session=session["id"], rate_hz=20)
        page.read_until(lambda: page.done)
        self.assertEqual(page.troubles, [])
        self.assertEqual((page.sessions[0]["id"], page.sessions[0]["recorded"]), (session["id"], True))
        self.assertEqual(page.meshes[MENISCUS][2], cut["mesh_hash"])
        page.watch(RECORDED, session="00" * 16)
        page.read_until(lambda: page.done)
        self.assertIn("has the trace of session", page.troubles[0])


if __name__ == "__main__":
    unittest.main()
