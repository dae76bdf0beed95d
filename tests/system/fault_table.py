#!/usr/bin/env python3
"""Faults of the network between real stations and a real server, each with what it does to a trainee.

  tests/system/fault_table.py [SECONDS [ROW ...]]

Each row has a station and a relay of its own; all share one server. Prints a table: for each fault the longest time
without a pose, the largest error of a shown pose, what the instructor was told, and what the trace holds. With
SECONDS each fault lasts so long. As a test (no arguments) it lasts a second or two, and the rows must hold.
"""

import math
import os
import resource
import struct
import sys
import threading
import time
import unittest

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
for name, path in (("BIN", "build/release/bin"), ("SOURCE", "."), ("CASES", "build/release/tests/cases"),
                   ("STEP_CLOCK", "build/release/tests/libstep_clock.so")):
    os.environ.setdefault("ARTHRON_" + name, os.path.join(SOURCE, path))

from arthron import SystemTest, call, call_json, free_port, wait_until  # noqa: E402
from relay import DOWN, UP, Network, Relay  # noqa: E402
from websocket import Viewer  # noqa: E402

PROBE = 4
RATE_HZ, SHORT_RATE_HZ = 100, 50
BEFORE_S, AFTER_S = 1.0, 2.0
STEP_CLOCK = os.environ["ARTHRON_STEP_CLOCK"]


class Row:
    def __init__(self, name, short_s=2.0, gap_s=0.5, step_ms=0, by_hand=False, **faults):
        self.name, self.short_s, self.gap_s, self.step_ms, self.faults = name, short_s, gap_s, step_ms, faults
        self.by_hand = by_hand  # not in the short form


# gap_s: how long a trainee may be without a pose, besides a busy machine.
ROWS = [
    Row("nothing", by_hand=True),
    Row("5 % lost", by_hand=True, loss=0.05),
    Row("20 % lost", loss=0.2),
    Row("20 % come twice", by_hand=True, twice=0.2),
    Row("20 % are 30 ms late", reorder=0.2),
    Row("50 to 90 ms, each its own", delay_ms=(50, 90)),
    Row("200 to 300 ms, each its own", delay_ms=(200, 300), gap_s=1.5),
    Row("no datagram passes", no_udp={UP, DOWN}, gap_s=1.0),
    Row("no datagram reaches the server", no_udp={UP}, gap_s=1.0, by_hand=True),
    Row("no datagram comes back", no_udp={DOWN}, gap_s=1.0, by_hand=True),
    Row("the connection is not read", stalled={UP, DOWN}, short_s=6.5),
    Row("nothing passes", cut=True, short_s=1.0, gap_s=6.0),
    Row("clock - 2 s", step_ms=-2000),
    Row("clock - 150 ms", step_ms=-150),
    Row("clock + 2 s", step_ms=2000, by_hand=True),
]


class Watcher(threading.Thread):
    """What a trainee sees: when each pose was shown, and where."""

    def __init__(self, viewer):
        super().__init__(daemon=True)
        self.viewer, self.shown, self.states = viewer, [], []
        self.start()

    def run(self):
        try:
            while True:
                probe = self.viewer.next()["instruments"].get(PROBE)
                now = time.monotonic()
                state = probe["warp_validity"] if probe and probe["tip"] else "lost"
                self.states.append((now, state))
                if state != "lost":
                    self.shown.append((now, *(tuple(probe[name][k] for k in "xyz") for name in ("tip", "warped"))))
        except (ConnectionError, OSError):
            pass

    def longest_gap_s(self, begin, end):
        times = [begin] + [now for now, *_ in self.shown if begin <= now <= end] + [end]
        return max(b - a for a, b in zip(times, times[1:]))

    def share(self, state, begin, end):
        states = [s for now, s in self.states if begin <= now <= end]
        return states.count(state) / max(1, len(states))


class Place:
    """A row's station with its relay and its watcher."""

    def __init__(self, hall, row, number):
        self.hall, self.row, self.name = hall, row, f"row-{number}"
        self.relay = Relay(f"127.0.0.{number + 2}", hall.port, hall.udp_port, seed=number)
        self.view_port = free_port()
        self.clock = hall.path(self.name + ".clock")
        self.step(0)

    def step(self, ms):
        with open(self.clock, "r+b" if os.path.exists(self.clock) else "wb") as f:
            f.write(struct.pack("<q", ms * 1000000))

    def begin(self):
        hall = self.hall
        code = call("arthron-server", "keys", "enrol", hall.keys, self.name).stdout.strip()
        place = f"{self.relay.address}:{hall.port}"
        call("arthron-station", "enrol", place, code, "--name", self.name, "--keys", hall.path("keys-" + self.name))
        config = hall.write(self.name + ".ini", f"""
[station]
name = {self.name}
server = {place}
keys = keys-{self.name}
rate_hz = {RATE_HZ if hall.seconds else SHORT_RATE_HZ}
[view]
port = {self.view_port}
[device hands]
driver = recorded
file = {hall.motion}
""")
        environment = {"LD_PRELOAD": STEP_CLOCK, "STEP_CLOCK_FILE": self.clock} if self.row.step_ms else {}
        os.environ.update(environment)
        self.station = hall.start(self.name, "arthron-station", "run", "--config", config)
        for name in environment:
            del os.environ[name]

    def look(self):
        self.station.wait_for_log("/view?token=")
        with open(self.hall.path(f"keys-{self.name}/view.token")) as f:
            self.watcher = Watcher(Viewer(self.view_port, f.read().strip()))
        wait_until(f"{self.name} shows poses by datagram",
                   lambda: self.watcher.shown and self.relay.passed > 20)

    def fault(self, seconds):
        self.before = self.hall.session(self.name)
        self.begun = time.monotonic()
        self.relay.network.change(**self.row.faults)
        if self.row.faults.get("cut"):
            self.relay.cut_connections()
        self.step(self.row.step_ms)
        self.seconds = seconds

    def calm(self):
        """True once its fault is over."""
        if time.monotonic() < self.begun + self.seconds:
            return False
        self.relay.network = Network()
        return True

    # ---- what it did

    def finish(self):
        self.ended = time.monotonic()
        self.after = self.hall.session(self.name)
        self.told = [line.split(": ", 1)[1] for line in self.hall.server.log().splitlines()
                     if f"station {self.name}:" in line and " warning " in line or
                     f"station {self.name} " in line and " warning " in line]
        self.hall.session_command("stop", self.name)
        self.watcher.viewer.close()
        self.station.end()
        self.relay.close()
        wait_until("the trace is whole",
                   lambda: call("arthron-trace", "verify", self.after["trace"], code=None).returncode == 0)
        self.replay = call_json("arthron-trace", "replay", self.after["trace"])

    def error_mm(self):
        """Of shown poses whose frames the trace has: from where the server put that very tip."""
        lines = call("arthron-trace", "export", self.after["trace"], "--csv", "-").stdout.splitlines()
        names = lines[0].split(",")
        at = [[names.index(f"{name}_t{c}_mm") for c in "xyz"] for name in ("probe", "probe_warped")]
        said = {}
        for line in lines[1:]:
            values = line.split(",")
            if values[at[0][0]]:
                tip, warped = (tuple(float(values[i]) for i in columns) for columns in at)
                said[tip] = warped
        errors = [math.dist(warped, said[tip]) for now, tip, warped in self.watcher.shown
                  if now >= self.begun and tip in said]
        return max(errors, default=math.nan)

    def figures(self):
        counts = {k: self.after["frames_" + k] - self.before["frames_" + k] for k in ("lost", "late", "old", "excess")}
        return {
            "gap_s": self.watcher.longest_gap_s(self.begun, self.ended),
            "held": self.watcher.share("held", self.begun, self.begun + self.seconds),
            "error_mm": self.error_mm(),
            "counts": counts,
            "told": self.told,
            "fault_s": self.seconds,
            "welcomes": self.station.log().count("welcomed by"),
            "same": self.before["id"] == self.after["id"],
            "replay": self.replay["verdict"],
            "steps": self.after["steps"] - self.before["steps"],
        }


class FaultTable(SystemTest):
    seconds = None  # else each row's own
    only = ()

    def setUp(self):
        super().setUp()
        self.rows = [row for row in ROWS if not self.only or any(word in row.name for word in self.only)]
        self.rows = [row for row in self.rows if self.seconds or not row.by_hand]
        os.rename(self.keys, self.keys + "-before")
        call("arthron-server", "keys", "init", self.keys, "127.0.0.1",
             *(f"127.0.0.{i + 2}" for i in range(len(self.rows))))
        resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
        self.server = self.start_server("".join(f"[station row-{i}]\ncase = arthrosis\n" for i in range(len(self.rows))))

    def run_rows(self):
        places = [Place(self, row, i) for i, row in enumerate(self.rows)]
        for place in places:
            place.begin()
        for place in places:
            place.look()
        time.sleep(BEFORE_S)
        for place in places:
            place.fault(self.seconds or place.row.short_s)
        wait_until("all faults are over", lambda: all([place.calm() for place in places]), 600)
        time.sleep(AFTER_S)
        wait_until("poses come again", lambda: all(
            place.watcher.states and place.watcher.states[-1][1] == "ok" for place in places))
        for place in places:
            place.finish()
        return [(place.row, place.figures()) for place in places]

    def print_table(self, table):
        print("| fault | longest without a pose | held | largest error | lost, late, old | steps | instructor | trace |")
        print("|---|---|---|---|---|---|---|---|")
        for row, f in table:
            c = f["counts"]
            print(f"| {row.name} | {f['gap_s']:.2f} s | {100 * f['held']:.0f} % | {f['error_mm']:.2f} mm "
                  f"| {c['lost']}, {c['late']}, {c['old']} | {f['steps']} | {'; '.join(f['told']) or '-'} "
                  f"| {'same session' if f['same'] else 'ANOTHER'}, {f['replay']} |")
        sys.stdout.flush()

    def test_sessions_and_poses_survive_the_network(self):
        table = self.run_rows()
        self.print_table(table)
        for row, f in table:
            with self.subTest(row.name):
                self.assertTrue(f["same"])
                self.assertEqual(f["replay"], "identical")
                self.assertLess(f["gap_s"], row.gap_s + f["fault_s"] * row.faults.get("cut", False) + 2)
                if "reorder" in row.faults or "delay_ms" in row.faults or "twice" in row.faults:
                    self.assertLessEqual(f["counts"]["lost"], 0.02 * f["steps"])
                self.assertEqual(f["welcomes"], 2 if row.faults.get("cut") else 1)
                if row.step_ms:
                    self.assertTrue(any("its clock was stepped" in line for line in f["told"]))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        FaultTable.seconds, FaultTable.only = float(sys.argv[1]), sys.argv[2:]
        del sys.argv[1:]
    unittest.main()
