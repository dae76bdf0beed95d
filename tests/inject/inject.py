#!/usr/bin/env python3
"""Every door of the operating system, one call after the other: the n-th fails, once and from then on. Without
arguments a sample, and no running server, as ./check runs it; tests/inject/run does all."""

import collections
import os
import random
import signal
import sys
import tempfile
import time

import hall
import programs
import stations
from failing import DOORS
from programs import BIN

# By hand the libraries, too, that ask for memory on behalf of our programs, and those that pass another door. OpenSSL
# and libwebsockets ask for memory by way of our own code in server and station. Left out: see docs/CONTRIBUTING.md.
LIBRARIES = ("libstdc++", "libembree3", "libtbb", "libjansson", "libsqlite3", "libargon2", "libinih",
             "libmodbus", "libOpenIGTLink", "libOpenMeshCore", "libOpenEXRCore", "libpng16", "libz")
OTHER_DOORS = ("libsqlite3", "libwebsockets", "libcrypto", "libinih", "libmodbus", "libOpenIGTLink", "libhidapi-hidraw",
               "libjansson", "libembree3", "libtbb", "libz")


class Tally:
    """What was tried, and what came of it."""

    def __init__(self):
        self.calls, self.tried, self.ends = collections.Counter(), collections.Counter(), collections.Counter()
        self.found = {}
        self.begun = time.monotonic()

    def note(self, door, end):
        self.tried[door] += 1
        self.ends[door, end] += 1

    def find(self, what, where):
        """A fault is told once for each place."""
        if (what[:60], where) not in self.found:
            self.found[what[:60], where] = what
            print(f"  WRONG: {what} | {where}", flush=True)

    def show(self):
        print(f"\n{'door':10} {'calls':>8} {'failed':>7} {'went on':>8} {'refused':>8} {'ended':>6}")
        for door in DOORS:
            if self.calls[door]:
                ends = [self.ends[door, end] for end in ("went on", "refused", "ended")]
                print(f"{door:10} {self.calls[door]:8} {self.tried[door]:7} {ends[0]:8} {ends[1]:8} {ends[2]:6}")
        print(f"{sum(self.tried.values())} failing calls in {time.monotonic() - self.begun:.0f} s, "
              f"{len(self.found)} faults", flush=True)


def numbers(count, most):
    """Each call, or a sample that is the same each time, with the first and the last."""
    if count <= most:
        return range(1, count + 1)
    return sorted({1, count, *random.Random(count).sample(range(1, count + 1), most)})[:most]


def choices(options, door, count, i):
    """Once and from then on; in a short run they take turns. A signal interrupts once."""
    if door in ("poll", "wait"):
        return (False,)
    return (False, True) if options.full else ((i + count) % 2 == 1,)


def wanted(options, door, caller):
    if options.doors and door not in options.doors:
        return False
    return caller == "program" or (options.full and caller in (LIBRARIES if door == "memory" else OTHER_DOORS))


def walk_program(scenario, options, tally):
    fault, outcome = scenario.run()
    if fault:
        return tally.find(f"{scenario.name}: {fault}: {outcome.text[-300:]}", "")
    print(f"{scenario.name}: {outcome.seconds:.2f} s", flush=True)
    for (door, caller), count in sorted(scenario.plan.counts().items()):
        if not wanted(options, door, caller) or tally.tried[door] >= options.most_of_door:
            continue
        tally.calls[door] += count
        for i, n in enumerate(numbers(count, options.most)):
            for on in choices(options, door, count, i):
                try_program(scenario, (door, n, on, caller), tally)


def walk_resume(scenario, tally):
    """A server that resumes sessions cannot open one of their traces: none is lost."""
    for n in (3, 6, 9):
        try_program(scenario, ("open", n, False, "program"), tally, path=".trace")


def try_program(scenario, failing, tally, **more):
    door, n, on, caller = failing
    try:
        fault, outcome = scenario.run(door, n, on=on, caller=caller, **more)
    except AssertionError as why:  # of a program that works on what is left
        fault, outcome = f"afterwards: {why}", None
    if fault:
        text = outcome.text.strip()[-200:] if outcome else ""
        tally.find(f"{scenario.name}: {door} {n} of {caller}, {'from then on' if on else 'once'}: {fault} ({text})",
                   scenario.plan.place(os.path.join(BIN, scenario.program)))
    status = outcome.status if outcome else 1
    in_order = outcome and programs.ORDERLY in outcome.text
    tally.note(door, "went on" if status == 0 else "ended" if in_order else "refused")


def walk_hall(options, tally):
    hall.Hall.setUpClass()
    house = hall.Hall()
    house.setUp()
    with tempfile.TemporaryDirectory(prefix="arthron-test-") as shared:
        for name in hall.ROUNDS:
            if options.names and name not in options.names:
                continue
            walk_round(house, name, options, tally)
        for kind in stations.SCENARIOS:
            if not options.names or kind.name in options.names:
                house.stations["room-2"].end()
                walk_program(kind(shared, house), options, tally)
    wrong, verdicts = house.wrong_at_the_end()
    for fault in wrong:
        tally.find(f"at the end: {fault}", "")
    print(f"traces: {dict(verdicts)}; answered: {dict(house.answered)}; {len(house.ends)} starts")
    house.tearDown()
    hall.Hall.tearDownClass()


def walk_round(house, name, options, tally):
    house.plan.forget_counts()
    getattr(house, name)()
    wrong = house.wrong_after()
    if wrong:
        return tally.find(f"{name}: {wrong} though nothing failed", "")
    print(name, flush=True)
    for (door, caller), count in sorted(house.plan.counts().items()):
        if not wanted(options, door, caller):
            continue
        tally.calls[door] += count
        for i, n in enumerate(numbers(count, options.most_in_hall)):
            for on in choices(options, door, count, i):
                try_round(house, name, (door, n, on, caller), tally)


def try_round(house, name, failing, tally):
    door, n, on, caller = failing
    house.plan.fail(door, n, on=on, caller=caller)
    getattr(house, name)()
    where = house.plan.place(os.path.join(BIN, "arthron-server"))
    ended = house.server.process.poll() is not None
    wrong = house.wrong_after()
    if wrong:
        tally.find(f"{name}: {door} {n} of {caller}, {'from then on' if on else 'once'}: {wrong}", where)
    tally.note(door, "ended" if ended else "went on")


class Options:
    """full: each call, in each way; else a sample, of each door in two scenarios. most: of a door's calls, in each
    scenario."""

    def __init__(self, full=False, most=1, most_in_hall=1, names=(), doors=()):
        self.full, self.most, self.most_in_hall = full, most, most_in_hall
        self.most_of_door = 1 << 30 if full else 2
        self.names, self.doors = names, doors


def scenarios():
    return [kind.name for kind in (*programs.SCENARIOS, *stations.SCENARIOS)] + list(hall.ROUNDS)


def run(options):
    tally = Tally()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # what was counted is shown, and what runs is ended
    with tempfile.TemporaryDirectory(prefix="arthron-test-") as shared:
        try:
            for kind in programs.SCENARIOS:
                if kind.name in options.names or not options.names and (options.full or kind.in_short):
                    walk_program(kind(shared), options, tally)
            in_hall = {*hall.ROUNDS, *(kind.name for kind in stations.SCENARIOS)}
            if options.full and (not options.names or in_hall & set(options.names)):
                walk_hall(options, tally)
            if not options.full:
                walk_resume(programs.Resume(shared), tally)
        finally:
            tally.show()
    return 1 if tally.found else 0


if __name__ == "__main__":
    sys.exit(run(Options()))
