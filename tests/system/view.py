"""What a station shows on its own PC: the server's answer while the hand stands, and what is without one."""

import math
import os
import stat
import time
import unittest

from arthron import PATIENCE_S, SystemTest, call, call_json, free_port, wait_until
from websocket import POSE, Viewer

PROBE = 4
COLUMNS = dict(zip(POSE, ("qw", "qx", "qy", "qz", "tx_mm", "ty_mm", "tz_mm")))


class View(SystemTest):
    def setUp(self):
        super().setUp()
        self.view_port = free_port()
        self.viewers = []

    def tearDown(self):
        for viewer in self.viewers:
            viewer.close()
        super().tearDown()

    # ---- motions

    def play(self, choose):
        """The mock-up's motion becomes what `choose` takes of its rows, 10 ms each."""
        with open(self.motion) as f:
            header, *rows = f.read().splitlines()
        chosen = [row.split(",", 1)[1] for row in choose(rows)]
        self.motion = self.write("played.csv", "\n".join([header] + [f"{i / 100:.2f},{r}" for i, r in enumerate(chosen)]))

    def stand(self):
        """One moment, with the probe on the tibia."""
        def choose(rows):
            touching = [row for row in rows if row.endswith(",tibia")]
            return [touching[len(touching) // 6]] * 100
        self.play(choose)

    def stroke(self):
        """The probe strokes the tibia, there and back."""
        def choose(rows):
            first = next(i for i, row in enumerate(rows) if row.endswith(",tibia"))
            there = rows[first:first + 120]
            return there + there[::-1]
        self.play(choose)

    # ---- programs

    def station_config(self, *arguments, **named):
        path = super().station_config(*arguments, **named)
        with open(path, "a") as f:
            f.write(f"[view]\nport = {self.view_port}\norigins = http://localhost:8080\n")
        return path

    def token(self):
        with open(self.path("keys-room-1/view.token")) as f:
            return f.read().strip()

    def look(self):
        self.viewers.append(Viewer(self.view_port, self.token()))
        return self.viewers[-1]

    def start_all(self, extra=""):
        self.start_mockup()
        self.server = self.start_server(extra=extra)
        self.enrol("room-1")
        station = self.start_station("room-1", "--live")
        station.wait_for_log("/view?token=")
        return station

    def probe_when(self, viewer, what, condition):
        """The probe in the first message that is so."""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            probe = viewer.next()["instruments"].get(PROBE)
            if probe and condition(probe):
                return probe
        raise AssertionError(f"in vain: {what}")

    def steps(self):
        trace = self.session()["trace"]
        rows = call("arthron-trace", "export", trace, "--csv", "-", code=None).stdout.splitlines()
        return [dict(zip(rows[0].split(","), row.split(","))) for row in rows[1:]]

    def last_step(self):
        steps = self.steps()
        return steps[-1] if steps else {}

    def assert_pose(self, shown, step, name):
        for key, column in COLUMNS.items():
            self.assertAlmostEqual(shown[key], float(step[f"{name}_{column}"]), delta=2e-5, msg=f"{name} {key}")

    # ---- tests

    def check_answer(self, extra):
        self.stand()
        station = self.start_all(extra)
        viewer = self.look()
        self.probe_when(viewer, "an answer", lambda p: p["warp_validity"] == "ok")
        self.wait_for_steps(100)
        before = viewer.next()["number"]
        messages = [viewer.next() for _ in range(200)]
        numbers = [m["number"] for m in messages]
        self.assertEqual(sorted(set(numbers)), numbers)
        self.assertGreater(numbers[0], before)
        wait_until("the trace is on the disk", lambda: self.last_step().get("probe_tx_mm"))
        step = self.last_step()
        for message in messages:
            probe = message["instruments"][PROBE]
            self.assertEqual((message["state"], message["case"]), ("running", "arthrosis"))
            self.assertEqual((probe["validity"] in ("ok", "held"), probe["clamped"]), (True, False))
            self.assert_pose(probe["tip"], step, "probe")
            self.assert_pose(probe["warped"], step, "probe_warped")
            self.assert_pose(message["bodies"][1]["pose"], step, "tibia")
        moved = math.dist(*([p[key] for key in "xyz"] for p in (probe["tip"], probe["warped"])))
        self.assertGreater(moved, 0.1)
        wait_until("a live line", lambda: f"warp {moved:5.2f} mm" in station.out())

    def test_a_standing_hand_is_shown_where_the_server_puts_it(self):
        self.check_answer("")

    def test_a_standing_rigid_instrument_is_too(self):
        self.check_answer("[warp]\navatar = rigid\n")

    def test_a_moving_hand_is_shown_where_the_server_will_say(self):
        self.stroke()
        self.start_all()
        viewer = self.look()
        self.probe_when(viewer, "an answer", lambda p: p["warp_validity"] == "ok")
        shown = [viewer.next()["instruments"][PROBE] for _ in range(600)]

        def place(step, name):
            return tuple(float(step[f"{name}_{column}"]) for column in ("tx_mm", "ty_mm", "tz_mm"))
        said = {place(step, "probe"): place(step, "probe_warped") for step in self.steps() if step["probe_tx_mm"]}
        errors, warps = [], []
        for probe in shown:
            if not probe["warped"] or probe["age_ms"] > 20:
                continue  # the machine is busy
            tip = tuple(probe["tip"][key] for key in "xyz")
            if tip not in said:
                continue  # the trace is not on the disk yet
            warped = tuple(probe["warped"][key] for key in "xyz")
            errors.append(math.dist(warped, said[tip]))
            warps.append(math.dist(tip, said[tip]))
        self.assertGreater(len(errors), 200)
        self.assertGreater(max(warps) - min(warps), 0.2)
        self.assertLess(sum(errors) / len(errors), 0.01)  # 0.002, and 0.017 by the displacement alone

    def test_without_the_server_the_last_answer_is_held_then_lost_then_back(self):
        self.stand()
        self.start_all()
        viewer = self.look()
        self.probe_when(viewer, "an answer", lambda p: p["warp_validity"] == "ok")
        self.server.end(9)
        held = self.probe_when(viewer, "held", lambda p: p["warp_validity"] == "held")
        self.assertGreater(held["age_ms"], 100)
        self.assertIsNotNone(held["warped"])
        lost = self.probe_when(viewer, "lost", lambda p: p["warp_validity"] == "lost")
        self.assertIsNone(lost["warped"])
        self.assertIsNotNone(lost["tip"])
        self.start_server()
        self.probe_when(viewer, "back", lambda p: p["warp_validity"] == "ok")

    def test_a_paused_session_shows_its_instruments(self):
        self.stand()
        self.start_all()
        viewer = self.look()
        self.probe_when(viewer, "an answer", lambda p: p["warp_validity"] == "ok")
        self.session_command("pause", "room-1")
        wait_until("told", lambda: viewer.next()["state"] == "paused")
        begin = time.monotonic()
        while time.monotonic() < begin + 1:  # longer than an answer from before the pause is held
            viewer.next()
        self.assertEqual(self.probe_when(viewer, "an answer", lambda p: p["tip"])["warp_validity"], "ok")
        self.assertEqual(viewer.next()["state"], "paused")

    def test_the_token_is_the_users_own_and_stays(self):
        station = self.start_all()
        token = self.token()
        path = self.path("keys-room-1/view.token")
        self.assertEqual(stat.S_IMODE(os.stat(path).st_mode), 0o600)
        self.assertIn(path, station.log())
        self.assertNotIn(token, station.log() + station.out())
        for changed in ({"token": "0" * 64}, {"origin": "http://evil.example"}, {"host": "evil.example"}):
            with self.assertRaisesRegex(ConnectionError, "403"):
                Viewer(self.view_port, **{"token": token, **changed})
        self.viewers.append(Viewer(self.view_port, token, origin="http://localhost:8080"))
        self.viewers[0].next()
        station.end()
        self.start_station(label="again").wait_for_log("/view?token=")
        self.assertEqual(self.token(), token)

    def test_check_tells_of_port_and_token(self):
        self.start_mockup()
        self.start_server()
        self.enrol("room-1")
        path = self.station_config()

        def finding():
            report = call_json("arthron-station", "check", "--config", path, "--seconds", "2", code=None)
            return next(f for f in report["findings"] if f["what"] == "view")
        self.assertTrue(finding()["good"])
        self.assertIn("is free", finding()["text"])
        station = self.start("station", "arthron-station", "run", "--config", path)
        station.wait_for_log("/view?token=")
        self.assertTrue(finding()["good"])
        self.assertIn("a running station", finding()["text"])
        station.end()
        os.chmod(self.path("keys-room-1/view.token"), 0o644)
        self.assertFalse(finding()["good"])
        self.assertIn("644", finding()["text"])

    def test_a_taken_port_ends_the_station_with_a_reason(self):
        self.start_all()
        path = self.station_config("room-2", keys="keys-room-1")
        done = call("arthron-station", "run", "--config", path, "--set", "view.token=other", code=1)
        self.assertIn(f"port {self.view_port} is in use", done.stderr)


if __name__ == "__main__":
    unittest.main()
