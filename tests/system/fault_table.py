#!/usr/bin/env python3
"""Faults between real stations and a real server, each with what it does to a trainee.

  tests/system/fault_table.py [SECONDS [WORD ...]]

Each row has a station and a relay of its own. Rows of the network share a server; each other row has one of its own.
Prints a table: for each fault the longest time without a pose, the largest error of a shown pose, what the pages told
an instructor, and what the trace holds. With SECONDS each fault lasts so long; with WORDs only the rows that have one
of them. As a test (no arguments) some rows last a second or two, and they must hold.
"""

import contextlib
import math
import os
import resource
import struct
import sys
import time
import unittest

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
for name, path in (("BIN", "build/release/bin"), ("SOURCE", "."), ("CASES", "build/release/tests/cases"),
                   ("STEP_CLOCK", "build/release/tests/libstep_clock.so")):
    os.environ.setdefault("ARTHRON_" + name, os.path.join(SOURCE, path))

from arthron import SystemTest, call, call_json, free_port, wait_until  # noqa: E402
from fault_kinds import (RATE, SILENT, WAVES, ClockSteps, Fault, Flood, Limit, PortTaken, ServerKilled,  # noqa: E402
                         ServerStops, StationKilled, StationStops, Strangers, Weather, WorkerHangs)
from fault_people import PAGE, Instructor, Watcher  # noqa: E402
from relay import DOWN, UP, Relay  # noqa: E402

RATE_HZ, SHORT_RATE_HZ = 100, 50
BEFORE_S, AFTER_S = 1.0, 2.0
NOTHING = "nothing"
AWAY_S = 5
SILENT_S = 60  # after so long without TCP a station connects anew, beside its datagrams
LOST, ERROR_MM = 0.1, 5  # the largest share of views without a pose, and error of a pose that is shown
STEP_CLOCK = os.environ["ARTHRON_STEP_CLOCK"]
TOGETHER_AT_ONCE, ALONE_AT_ONCE = 8, 3  # rows of the network, and rows with servers of their own
NOTICED_S, NOTICED_HELD = 1.0, 0.2  # from here on a trainee notices, and an instructor has to be told


class Row:
    """gap_s: how long a trainee may be without a pose, besides a busy machine; lasting: and while the fault lasts.
    held: the largest share of views with an answer that is older than usual. tells: what the instructor has to see.
    short_s: how long it lasts as a test; None: it is none."""

    def __init__(self, name, fault, short_s=None, gap_s=0.5, held=0.2, lasting=False, tells="", welcomes=1):
        self.name, self.fault, self.short_s, self.gap_s, self.held = name, fault, short_s, gap_s, held
        self.lasting, self.tells, self.welcomes = lasting, tells, welcomes
        self.goes_on = not lasting and gap_s < AWAY_S  # poses are shown while the fault lasts


ROWS = [
    Row(NOTHING, Fault(), 2),
    Row("1 % of the datagrams are lost", Weather(loss=0.01)),
    Row("5 % are lost", Weather(loss=0.05)),
    Row("20 % are lost", Weather(loss=0.2), 2),
    Row("20 % come twice", Weather(twice=0.2)),
    Row("20 % come 30 ms late", Weather(reorder=0.2)),
    Row("each takes 50 to 90 ms", Weather(delay_ms=(50, 90)), 2),
    Row("each takes 200 to 300 ms, TCP too", Weather(delay_ms=(200, 300)), 2, gap_s=1.5, held=0.5),
    Row("no datagram passes", Weather(no_udp={UP, DOWN}), 2, gap_s=1, held=0.5),
    Row("no datagram reaches the server", Weather(no_udp={UP}), gap_s=1, held=0.5),
    Row("no datagram comes back", Weather(no_udp={DOWN}), gap_s=1, held=0.5),
    Row("copies: old, flipped, too long, reflected", Weather(old=0.2, flipped=0.2, long=0.2, reflected=0.2), 2),
    Row("a new source port each second", Weather(port_s=1), 2),
    Row("TCP is not read, datagrams pass", Weather(stalled={UP, DOWN}), 6.5),
    Row("TCP reaches the server alone", Weather(stalled={DOWN})),
    Row("TCP comes from the server alone", Weather(stalled={UP})),
    Row("nothing passes", Weather(cut=True), 2.5, gap_s=6, lasting=True, tells="no frame came", welcomes=0),
    Row("nothing passes, connections break", Weather(cut=True, resets=True), 1, gap_s=6, lasting=True, tells="away",
        welcomes=2),
    Row("the clock goes back by 2 s", ClockSteps(-2000), 2),
    Row("the clock goes back by 150 ms", ClockSteps(-150)),
    Row("the clock goes ahead by 2 s", ClockSteps(2000)),
    Row("the station is killed and started again", StationKilled(), 2, gap_s=6, welcomes=2),
    Row("the station stands still", StationStops(), 2.5, gap_s=3, lasting=True, tells="no frame", welcomes=0),
    Row("the server stands still", ServerStops(), gap_s=3, lasting=True, tells="no data|connection lost", welcomes=0),
    Row("the server is killed and started again", ServerKilled(), gap_s=10, tells="connection lost", welcomes=2),
    Row("a worker hangs", WorkerHangs(), gap_s=12, tells="connection lost", welcomes=2),
    Row("the disk is full", Limit(resource.RLIMIT_FSIZE), tells="cannot be written to the disk"),
    Row("no memory for another session", Limit(resource.RLIMIT_AS, others=True), tells="no memory left"),
    Row("no descriptors for another session", Limit(resource.RLIMIT_NOFILE, others=True), tells="descriptors left"),
    Row(f"{RATE} false datagrams a second", Strangers("datagrams", RATE), 2),
    Row(f"{SILENT} silent connections, and the station comes back", PortTaken("silent", SILENT), gap_s=6, welcomes=2),
    Row(f"{WAVES[2]} as if to enrol, and the station comes back", PortTaken("again", *WAVES), gap_s=6, welcomes=2),
    Row("another station sends without end", Flood(), tells="more than its share"),
    Row("5 wrong passwords a second", Strangers("passwords", 5)),
    Row("100 requests for pages that never end", Strangers("slow", 100)),
]


class Place:
    """A row's station with its relay and its watcher."""

    def __init__(self, hall, row, number):
        self.hall, self.row, self.name = hall, row, f"row-{number}"
        self.relay = Relay(f"127.0.0.{number + 2}", hall.port, hall.udp_port, seed=number)
        self.view_port = free_port()
        self.clock = hall.path(self.name + ".clock")
        self.starts = 0
        self.step_clock(0)

    def step_clock(self, ms):
        with open(self.clock, "r+b" if os.path.exists(self.clock) else "wb") as f:
            f.write(struct.pack("<q", ms * 1000000))

    def begin(self):
        place = f"{self.relay.address}:{self.hall.port}"
        self.hall.enrol_at(place, self.name)
        self.config = self.hall.station_file(self.name, place, f"[view]\nport = {self.view_port}\n")
        self.start_station()

    def start_station(self):
        self.starts += 1
        stepped = isinstance(self.row.fault, ClockSteps)
        environment = {"LD_PRELOAD": STEP_CLOCK, "STEP_CLOCK_FILE": self.clock} if stepped else {}
        os.environ.update(environment)
        self.station = self.hall.start(f"{self.name}-{self.starts}", "arthron-station", "run", "--config", self.config)
        for name in environment:
            del os.environ[name]

    def look(self):
        self.station.wait_for_log("/view?token=")
        with open(self.hall.path(f"keys-{self.name}/view.token")) as f:
            self.watcher = Watcher(self.view_port, f.read().strip())
        wait_until(f"{self.name} shows poses by datagram",
                   lambda: self.watcher.shown and self.relay.passed > 20)

    def begin_fault(self, seconds, before):
        self.before = before
        self.seconds, self.begun, self.calm = seconds, time.monotonic(), False
        self.row.fault.begin(self, seconds)

    def is_over(self):
        if not self.calm and time.monotonic() < self.begun + self.seconds:
            self.row.fault.go_on(self)
        elif not self.calm:
            self.row.fault.end(self)
            self.calm = True
        return self.calm

    def shows_poses(self):
        return self.watcher.states and self.watcher.states[-1][1] == "ok" and (
            self.watcher.states[-1][0] > self.begun + self.seconds)

    # ---- what it did

    def finish(self, after):
        self.ended = time.monotonic()
        self.after = after
        self.watcher.ends = True
        self.station.process.terminate()
        self.relay.close()

    def judge(self):
        wait_until("the trace is whole",
                   lambda: call("arthron-trace", "verify", self.after["trace"], code=None).returncode == 0)
        return call_json("arthron-trace", "replay", self.after["trace"])["verdict"]

    def read_trace(self):
        """From the trace: steps since the fault began, frames between them without a step, and the error of shown
        poses whose frames it has, from where the server put that very tip."""
        lines = call("arthron-trace", "export", self.after["trace"], "--csv", "-", "--columns",
                     "frame_number,probe_t?_mm,probe_warped_t?_mm").stdout.splitlines()
        names = lines[0].split(",")
        at = [[names.index(f"{name}_t{c}_mm") for c in "xyz"] for name in ("probe", "probe_warped")]
        number_at = names.index("frame_number")
        said, steps, missing, before = {}, 0, 0, 0
        for i, line in enumerate(lines[1:]):
            values = line.split(",")
            if values[at[0][0]]:
                tip, warped = (tuple(float(values[k]) for k in columns) for columns in at)
                said[tip] = warped
            if i < self.before["steps"] or not int(values[number_at] or 0):
                continue
            number = int(values[number_at])
            steps += 1
            missing += max(0, number - before - 1) if before else 0
            before = number
        errors = [math.dist(warped, said[tip]) for now, tip, warped in self.watcher.shown
                  if now >= self.begun and tip in said]
        return steps, missing, max(errors, default=math.nan)

    def figures(self):
        replay = self.judge()
        steps, missing, error_mm = self.read_trace()
        alone = self.row.fault.server_alone
        told = self.hall.instructor.told({self.name, PAGE, "other", "flood"} if alone else {self.name},
                                         self.begun, self.ended)
        new = self.hall.starts > 1  # the server counts from its start
        return {
            "gap_s": self.watcher.longest_gap_s(self.begun, self.ended),
            **{state: self.watcher.share(state, self.begun, self.begun + self.seconds) for state in ("held", "lost")},
            "error_mm": error_mm,
            "counts": {k: self.after["frames_" + k] - (0 if new else self.before["frames_" + k])
                       for k in ("lost", "late", "old", "excess")},
            "steps": steps, "missing": missing, "not_written": self.after["trace_missing"],
            "told": [text if station == self.name else f"{station}: {text}" for station, text in told],
            "fault_s": self.seconds,
            "welcomes": sum(p.log().count("welcomed by") for p in self.hall.processes if p.label.startswith(self.name + "-")),
            "same": self.before["id"] == self.after["id"],
            "replay": replay,
        }


class Hall(SystemTest):
    """A server with pages, an instructor, and a place for each row."""

    def __init__(self, rows, seconds):
        super().__init__()
        self.rows, self.seconds, self.starts, self.instructor = rows, seconds, 0, None

    def setUp(self):
        super().setUp()
        call("arthron-server", "keys", "renew", self.keys, "localhost", "127.0.0.1",
             *(f"127.0.0.{i + 2}" for i in range(len(self.rows))))
        self.web_port = free_port()
        names = [f"row-{i}" for i in range(len(self.rows))] + ["other", "flood"]
        self.server_file = self.server_config("".join(f"[station {name}]\ncase = arthrosis\n" for name in names),
                                              f"records = records.db\n[web]\nport = {self.web_port}\n")
        self.start_again()
        self.places = [Place(self, row, i) for i, row in enumerate(self.rows)]

    def start_again(self):
        self.starts += 1
        self.server = self.start(f"server-{self.starts}", "arthron-server", "run", "--config", self.server_file)

    def open(self):
        self.server.wait_for_log("ready")
        self.instructor = Instructor(self.web_port, os.path.join(self.keys, "authority.pem"), self.server.log())
        for place in self.places:
            place.begin()

    def enrol_at(self, place, name):
        code = call("arthron-server", "keys", "enrol", self.keys, name).stdout.strip()
        call("arthron-station", "enrol", place, code, "--name", name, "--keys", self.path("keys-" + name))

    def station_file(self, name, place, more=""):
        return self.write(name + ".ini", f"""
[station]
name = {name}
server = {place}
keys = keys-{name}
rate_hz = {RATE_HZ if self.seconds else SHORT_RATE_HZ}
{more}[device hands]
driver = recorded
file = {self.motion}
""")

    def start_other(self):
        place = f"127.0.0.1:{self.port}"
        self.enrol_at(place, "other")
        return self.start("other", "arthron-station", "run", "--config", self.station_file("other", place))

    def begin_faults(self):
        before = {s["station"]: s for s in self.sessions()}
        for place in self.places:
            place.begin_fault(self.seconds or place.row.short_s, before[place.name])

    def finish(self):
        """The sessions end with the server, in one go."""
        after = {s["station"]: s for s in self.sessions()}
        for place in self.places:
            place.finish(after[place.name])
        self.instructor.ends = True
        self.server.end()

    def close(self):
        if self.instructor:
            self.instructor.ends = True
        self.tearDown()


def run_together(halls):
    places = [place for hall in halls for place in hall.places]
    for hall in halls:
        hall.open()
    for place in places:
        place.look()
    time.sleep(BEFORE_S)
    for hall in halls:
        hall.begin_faults()
    wait_until("all faults are over", lambda: all([place.is_over() for place in places]), 600)
    time.sleep(AFTER_S)
    for place in places:
        wait_until(f"poses come again after: {place.row.name}", place.shows_poses)
    for hall in halls:
        hall.finish()
    return [(place.row, place.figures()) for place in places]


def parts(rows, size):
    return [rows[i:i + size] for i in range(0, len(rows), size)]


class FaultTable(unittest.TestCase):
    seconds = None  # else each row's own
    only = ()

    def setUp(self):
        self.rows = [row for row in ROWS
                     if not self.only or row.name == NOTHING or any(word in row.name for word in self.only)]
        self.rows = [row for row in self.rows if self.seconds or row.short_s]
        resource.setrlimit(resource.RLIMIT_NOFILE, (resource.getrlimit(resource.RLIMIT_NOFILE)[1],) * 2)
        Hall.setUpClass()
        self.addCleanup(Hall.tearDownClass)

    def groups(self):
        """Lists of lists of rows: what runs at a time, on which server."""
        together = [row for row in self.rows if not row.fault.server_alone]
        alone = [[row] for row in self.rows if row.fault.server_alone]
        if not self.seconds:
            return [[together] + alone]
        return [[part] for part in parts(together, TOGETHER_AT_ONCE)] + parts(alone, ALONE_AT_ONCE)

    def run_group(self, group):
        halls = [Hall(rows, self.seconds) for rows in group]
        try:
            for hall in halls:
                hall.setUp()
            return run_together(halls)
        finally:
            with contextlib.ExitStack() as ends:
                for hall in halls:
                    ends.callback(hall.close)

    def print_table(self, table):
        print("| fault | longest without a pose | held | largest error | the instructor sees | steps, frames without one, "
              "late ones | trace |")
        print("|---|---|---|---|---|---|---|")
        for row, f in table:
            unwritten = f", {f['not_written']} steps not written" if f["not_written"] else ""
            print(f"| {row.name} | {f['gap_s']:.2f} s | {100 * f['held']:.0f} % | {f['error_mm']:.2f} mm "
                  f"| {'; '.join(f['told']) or '-'} | {f['steps']}, {f['missing']}, {f['counts']['late']} "
                  f"| {'same session' if f['same'] else 'ANOTHER SESSION'}, {f['replay']}{unwritten} |")
        sys.stdout.flush()

    @staticmethod
    def is_calm(nothing):
        """What happens without a fault tells how busy the machine is."""
        return nothing["gap_s"] < 0.5 and nothing["held"] + nothing["lost"] < 0.05 and not nothing["counts"]["lost"]

    def check(self, row, f, nothing):
        self.assertTrue(f["same"])
        self.assertEqual(f["replay"], "identical")
        self.assertEqual(f["not_written"], 0)
        self.assertLess(f["gap_s"], row.gap_s + f["fault_s"] * row.lasting + 1 + nothing["gap_s"])
        self.assertLess(f["error_mm"], ERROR_MM)
        if row.goes_on and self.is_calm(nothing):
            self.assertLessEqual(f["held"], row.held)
            self.assertLessEqual(f["lost"], LOST)
            if getattr(row.fault, "network", {}).keys() & {"reorder", "delay_ms", "twice", "old"}:
                self.assertLessEqual(f["counts"]["lost"], 0.02 * f["steps"])
        self.assertTrue(any(f["told"]) or f["gap_s"] < NOTICED_S + 1 and f["held"] < NOTICED_HELD + 0.2, f)
        if row.tells:
            self.assertRegex("; ".join(f["told"]), row.tells)
        if row.welcomes and f["fault_s"] < SILENT_S:
            self.assertEqual(f["welcomes"], row.welcomes)

    def test_sessions_and_poses_survive_the_network(self):
        table = [figures for group in self.groups() for figures in self.run_group(group)]
        self.print_table(table)
        for row, f in table:
            with self.subTest(row.name):
                self.check(row, f, table[0][1])


if __name__ == "__main__":
    if "--help" in sys.argv:
        sys.exit(print(__doc__) or 0)
    if len(sys.argv) > 1:
        FaultTable.seconds, FaultTable.only = float(sys.argv[1]), sys.argv[2:]
        del sys.argv[1:]
    unittest.main()
