"""From mock-up to warped pose: the whole path with the real programs."""

import json
import os
import re
import shutil
import socket
import time
import unittest

from arthron import SystemTest, call, call_json, free_port, program, text_of, wait_until
from relay import Relay


class Path(SystemTest):
    def test_poses_are_warped_recorded_and_replayed_to_the_bit(self):
        self.start_mockup()
        server = self.start_server()
        self.enrol("room-1")
        station = self.start_station("room-1", "--seconds", "4")
        self.assertEqual(station.process.wait(timeout=30), 0)
        self.assertEqual(server.end(), 0)
        summary = self.summary(station)
        self.assertGreater(summary["poses_sent"], 300)
        self.assertEqual(summary["poses_warped"], summary["poses_sent"])
        [trace] = os.listdir(self.traces)
        trace = os.path.join(self.traces, trace)
        self.assertGreaterEqual(call_json("arthron-trace", "info", trace)["steps"], summary["poses_sent"])
        call("arthron-trace", "verify", trace)
        self.assertEqual(call_json("arthron-trace", "replay", trace)["different"], 0)

    def test_frames_travel_in_the_control_connection_where_datagrams_are_not_wanted(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        station = self.start_station("room-1", "--seconds", "2", datagrams="no")
        self.assertEqual(station.process.wait(timeout=30), 0)
        summary = self.summary(station)
        self.assertGreater(summary["poses_warped"], 100)
        self.assertLessEqual(summary["unanswered"], 2)

    def test_its_summary_tells_late_frames_from_lost_ones(self):
        self.start_mockup()
        os.rename(self.keys, self.keys + "-before")
        call("arthron-server", "keys", "init", self.keys, "127.0.0.1", "127.0.0.2")
        self.start_server()
        self.enrol("room-1")
        relay = Relay("127.0.0.2", self.port, self.udp_port)
        self.addCleanup(relay.close)
        relay.network.change(loss=0.1, reorder=0.2)
        station = self.start_station("room-1", "--set", f"station.server={relay.address}:{self.port}")
        wait_until("some of both", lambda: min(self.session()["frames_" + kind] for kind in ("lost", "late")) > 5)
        self.wait_for_steps()
        station.end()
        summary, session = self.summary(station), self.session()
        for kind in ("lost", "late"):
            self.assertGreater(summary[kind], 0)
            self.assertLessEqual(summary[kind], session["frames_" + kind])
        self.assertGreaterEqual(summary["unanswered"], summary["lost"] + summary["late"])

    def test_a_session_waits_for_its_station_and_goes_on(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        first = self.start_station()
        wait_until("running", lambda: self.session()["state"] == "running")
        self.wait_for_steps()
        before = self.session()
        first.end()
        wait_until("away", lambda: not self.session()["connected"])
        self.start_station(label="again")
        wait_until("connected", lambda: self.session()["connected"])
        self.wait_for_steps()
        after = self.session()
        self.assertEqual(before["id"], after["id"])
        self.assertGreater(after["steps"], before["steps"])

    def test_a_station_that_comes_back_at_the_last_moment_has_a_session(self):
        self.start_mockup()
        self.start_server(extra="wait_s = 1")
        self.enrol("room-1")
        for label in ("first", "second", "third"):
            station = self.start_station(label=label)
            self.wait_for_steps()
            station.end()
            time.sleep(0.85)

    def test_a_session_that_cannot_be_opened_is_told_and_tried_again(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        os.rmdir(self.traces)
        station = self.start_station("room-1", "--live")
        wait_until("told", lambda: "no session: " in station.out())
        self.assertIn(self.traces, self.session_command("start", "room-1", code=1)["text"])
        os.mkdir(self.traces)
        wait_until("running", lambda: self.session()["state"] == "running")
        self.wait_for_steps()

    def test_a_session_ends_when_its_station_stays_away(self):
        self.start_mockup()
        self.start_server(extra="wait_s = 1")
        self.enrol("room-1")
        station = self.start_station()
        self.wait_for_steps()
        station.end()
        wait_until("closed", lambda: self.session()["state"] == "closed")
        trace = self.session()["trace"]
        wait_until("whole trace", lambda: call("arthron-trace", "verify", trace, code=None).returncode == 0)

    def test_a_killed_server_leaves_a_readable_trace_and_stations_come_back(self):
        self.start_mockup()
        server = self.start_server()
        self.enrol("room-1")
        station = self.start_station("room-1", "--live")
        self.wait_for_steps(200)
        steps, trace = self.session()["steps"], self.session()["trace"]
        server.end(9)
        info = call_json("arthron-trace", "info", trace, code=None)
        self.assertGreaterEqual(info["steps"], steps - 20)
        self.assertEqual(call_json("arthron-trace", "replay", trace, code=None)["different"], 0)
        self.start_server()
        wait_until("connected again", lambda: self.session()["connected"])
        self.wait_for_steps()
        self.assertEqual(station.end(), 0)

    def test_sessions_are_commanded_over_the_local_socket(self):
        self.start_mockup()
        self.more_cases = ("healthy",)
        self.start_server("[station room-1]\ncase = arthrosis\nstart = command")
        self.enrol("room-1")
        self.start_station()
        wait_until("a session that waits", lambda: self.session()["state"] == "waiting")
        for command, state in (("start", "running"), ("pause", "paused"), ("start", "running"),
                               ("reset", "running"), ("stop", "closed")):
            self.assertTrue(self.session_command(command, "room-1")["ok"])
            self.assertEqual(self.session()["state"], state)
        ended = self.session()["trace"]
        wait_until("whole trace", lambda: call("arthron-trace", "verify", ended, code=None).returncode == 0)
        self.assertTrue(self.session_command("start", "room-1")["ok"])
        self.assertNotEqual(self.session()["trace"], ended)
        self.wait_for_steps()
        self.assertEqual(self.session()["frames_lost"], 0)
        self.assertTrue(self.session_command("case", "room-1", "healthy")["ok"])
        self.assertEqual(self.session()["case"], "healthy")
        self.assertIn("no case", self.session_command("case", "room-1", "nowhere", code=1)["text"])
        self.assertIn("no station", self.session_command("start", "nobody", code=1)["text"])


class Strangers(SystemTest):
    def test_foreign_datagrams_get_silence_and_poses_go_on(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        self.start_station()
        self.wait_for_steps()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            s.settimeout(0.5)
            for size in (0, 1, 15, 16, 40, 400, 1400):
                s.sendto(os.urandom(size), ("127.0.0.1", self.udp_port))
            with self.assertRaises(socket.timeout):
                s.recv(2000)
        self.wait_for_steps()
        self.assertEqual(self.session_command("list")["refused"]["strangers"], 7)

    def test_a_revoked_station_is_refused(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        call("arthron-server", "keys", "revoke", self.keys, "room-1")
        time.sleep(1)  # the server looks at the record twice a second
        station = self.start_station("room-1", "--seconds", "3", "--live")
        station.process.wait(timeout=30)
        self.assertEqual(self.summary(station)["poses_sent"], 0)
        self.assertFalse(self.session()["connected"])

    def test_a_connected_station_is_cut_off_when_it_is_revoked(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        self.start_station()
        self.wait_for_steps()
        call("arthron-server", "keys", "revoke", self.keys, "room-1")
        wait_until("cut off", lambda: not self.session()["connected"])

    def test_a_station_that_the_config_does_not_name_is_told_so(self):
        self.start_mockup()
        self.start_server("[station room-1]\ncase = healthy")
        self.enrol("room-2")
        station = self.start_station("room-2", "--seconds", "2", "--live")
        station.process.wait(timeout=30)
        self.assertIn("room-2 has no case", station.out() + station.log())

    def test_a_case_that_was_found_unfit_is_served_only_where_the_config_says_so(self):
        bad = self.path("bad")
        shutil.copytree(f"{self.cases}/arthrosis", bad)
        call("arthron-case", "check", bad, "--quick")
        with open(f"{bad}/check.json") as f:
            found = json.load(f)
        self.assertEqual(found["grade"], "fit with warnings")
        found["grade"] = "unfit"
        found["findings"].insert(0, {"level": "fault", "where": "femur", "text": "faces too much"})
        with open(f"{bad}/check.json", "w") as f:
            json.dump(found, f)
        self.more_cases = ("healthy",)
        stations = f"[case bad]\ndir = {bad}\n[station room-1]\ncase = {{}}"
        self.start_mockup()
        server = self.start_server(stations.format("bad"))
        self.enrol("room-1")
        self.assertIn("case healthy is not checked", server.log())
        self.assertIn("case bad is unfit, so no session opens on it: femur: faces too much", server.log())
        station = self.start_station("room-1", "--seconds", "2", "--live")
        station.process.wait(timeout=30)
        self.assertIn("case bad is unfit: femur: faces too much", station.out() + station.log())
        self.assertIn("case bad is unfit", self.session_command("case", "room-1", "bad", code=1)["text"])
        self.assertTrue(self.session_command("case", "room-1", "healthy")["ok"])
        self.assertEqual(self.session()["case_grade"], "not checked")
        server.end()
        server = self.start_server(stations.format("bad"), "unfit = serve", ("--bench-field", "smooth"))
        self.assertIn("case bad was checked with the field integral and is served with smooth", server.log())
        self.assertIn("case bad is unfit, and is served because of unfit = serve", server.log())
        self.start_station()
        wait_until("connected", lambda: self.session()["connected"])
        self.assertEqual(self.session()["case"], "bad")
        self.assertEqual(self.session()["case_grade"], "unfit")

    def test_of_two_stations_with_one_name_the_second_is_refused(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        self.start_station()
        self.wait_for_steps()
        rival = self.start_station("room-1", "--seconds", "2", "--live", label="rival")
        rival.process.wait(timeout=30)
        self.assertIn("connected already", rival.out() + rival.log())
        self.assertEqual(self.summary(rival)["poses_warped"], 0)
        self.wait_for_steps()

    def test_a_code_is_good_once_and_for_one_name(self):
        self.start_server()
        code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        server = f"127.0.0.1:{self.port}"
        call("arthron-station", "enrol", server, code, "--name", "room-9", "--keys", self.path("k0"), code=3)
        code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        call("arthron-station", "enrol", server, code, "--name", "room-1", "--keys", self.path("k1"))
        call("arthron-station", "enrol", server, code, "--name", "room-1", "--keys", self.path("k2"), code=3)
        self.assertFalse(os.path.exists(self.path("k2/station.pem")))


class Devices(SystemTest):
    def validity(self, column):
        trace = self.session()["trace"]
        rows = call("arthron-trace", "export", trace, "--csv", "-", code=None).stdout.splitlines() if trace else []
        at = rows[0].split(",").index(column) if rows else 0
        return [row.split(",")[at] or "lost" for row in rows[1:]]

    def changes(self, column):
        """From the first value on."""
        seen = self.validity(column)
        seen = seen[seen.index("ok"):] if "ok" in seen else []
        return ",".join(v for i, v in enumerate(seen) if i == 0 or seen[i - 1] != v)

    def run_through(self, fault, column):
        """Until the fault is over, however long the programs take to start; returns the ended station."""
        self.start_server()
        self.enrol("room-1")
        self.start_mockup("--faults", self.faults(fault))
        station = self.start_station("room-1")
        wait_until("its loss and return", lambda: re.search(r"lost.*,ok", self.changes(column)))
        self.wait_for_steps(200)
        station.end()
        wait_until("the station's end", lambda: not self.session()["connected"])
        return station

    def test_a_silent_tracker_is_held_then_lost_then_back(self):
        self.run_through(("tracker", "dropout", 4, 1), "probe_validity")
        self.assertRegex(self.changes("probe_validity"), "^(ok,held,)*ok,held,lost,ok(,held,ok)*(,held)?(,lost)?$")
        events = call_json("arthron-trace", "info", self.session()["trace"], code=None)["events"]
        self.assertEqual(events["device_back"], 1)
        self.assertLessEqual(events["device_lost"], 2)  # the tracker, and at the end the station

    def test_silent_encoders_leave_the_tracker_alone(self):
        station = self.run_through(("modbus", "dropout", 4, 2), "joint_validity")
        self.assertGreater(self.summary(station)["poses_warped"], 500)
        joint, probe = self.validity("joint_validity"), self.validity("probe_validity")
        lost = [p for j, p in zip(joint, probe) if j == "lost"]
        self.assertTrue(lost)
        self.assertGreater(lost.count("ok"), len(lost) / 2)
        self.assertEqual(joint[-30], "ok")


class Configs(SystemTest):
    def refused(self, path, *texts):
        done = call("arthron-server", "run", "--config", path, code=None)
        self.assertIn(done.returncode, (1, 2))
        for text in texts:
            self.assertIn(text, done.stderr)

    def test_bad_server_configs_are_refused_by_file_line_section_and_key(self):
        good = text_of(self.server_config("[station room-1]\ncase = arthrosis\n[station room-2]\ncase = healthy\n"))
        for change, texts in (
            (("port = ", "prot = "), ("server.ini", "line", "[server]", "prot")),
            ((f"port = {self.port}", "port = 70000"), ("[server]", "port", "70000")),
            (("case = arthrosis", "case = nowhere"), ("room-1", "nowhere")),
            (("socket = s", "socket = s\nunfit = perhaps"), ("[server]", "unfit", "perhaps")),
            (("udp_port = ", " udp_port = "), ("line", "port", "blank")),
            (("[case healthy]", "[cose healthy]"), ("cose healthy",)),
        ):
            self.refused(self.write("server.ini", good.replace(*change, 1)), *texts)

    def test_bad_station_configs_are_refused_by_section_and_key(self):
        self.modbus = self.tracker = "127.0.0.1:1"
        good = text_of(self.station_config())
        for change, texts in (
            (("rate_hz = 200", "rate_hz = -1"), ("encoders", "rate_hz")),
            (("driver = tracker", "driver = telepathy"), ("tracker", "telepathy")),
            (("tool.probe", "tool.spoon"), ("tracker", "tool.spoon")),
            (("flexion = 1 0.01 0", "flexion = one"), ("encoders", "flexion")),
            (("name = room-1", "nome = room-1"), ("[station]", "nome")),
            (("[device enc", "[view]\nport = 65536\n[device enc"), ("[view]", "port", "65536")),
            (("[device enc", "[view]\norigins = localhost:8080\n[device enc"), ("[view]", "origins")),
            (("[device enc", "[view]\norigins = http://a/b\n[device enc"), ("[view]", "origins")),
        ):
            path = self.write("bad.ini", good.replace(*change, 1))
            done = call("arthron-station", "run", "--config", path, code=2)
            for text in texts:
                self.assertIn(text, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
