#!/usr/bin/env python3
"""Edges that the mock-up makes at known times: each is in the trace once, whatever becomes of server and connection."""

import csv
import io
import os
import signal
import time
import unittest

from arthron import SystemTest, call, call_json, wait_until
from example_trace import example, figures_of, figures_of_info
from relay import Relay

STATION = """[device encoders]
driver = modbus
address = {modbus}
rate_hz = 200
sequence = 0
flexion = 1 0.01
[device sync]
driver = modbus
address = {modbus}
rate_hz = 200
sequence = 0
marker.pulse = coil 0
marker.half = input 0 both
marker.count = register 11
"""
PULSE_NS = 250_000_000  # the mock-up's, on the monotonic clock of this PC
EARLY_NS = 10_000_000


class Markers(SystemTest):
    def setUp(self):
        super().setUp()
        os.rename(self.keys, self.keys + "-before")
        call("arthron-server", "keys", "init", self.keys, "127.0.0.1", "127.0.0.2")
        self.start_mockup()
        self.server = self.start_server()
        self.enrol("room-1")
        self.relay = Relay("127.0.0.2", self.port, self.udp_port)
        self.addCleanup(self.relay.close)
        self.start("station", "arthron-station", "run", "--config", self.write("station.ini", f"""
[station]
name = room-1
server = 127.0.0.2:{self.port}
keys = keys-room-1
{STATION.format(modbus=self.modbus)}"""))
        wait_until("a session", lambda: self.session()["state"] == "running")
        self.trace = self.session()["trace"]

    def markers(self, name=None, trace=None):
        found = call_json("arthron-trace", "info", trace or self.trace)["markers"]
        return [m for m in found if name in (None, m["name"])]

    def wait_for_pulse(self, after_ns):
        wait_until("a pulse from then on", lambda: any(m["time_ns"] > after_ns for m in self.markers("pulse")), 30)

    def assert_each_pulse_once(self, least):
        """By the register, which tells the number of the pulse, and by the times of both edges."""
        counts = [m for m in self.markers("count")]
        numbers = [m["time_ns"] // PULSE_NS for m in counts]
        self.assertEqual([int(m["value"]) for m in counts], [n % 65536 for n in numbers])
        for name, half in (("pulse", 0), ("half", 1)):
            times = sorted(m["time_ns"] for m in self.markers(name) if m["value"] == 1)
            pulses = [(t + EARLY_NS) // PULSE_NS for t in times]
            self.assertEqual(pulses, list(range(pulses[0], pulses[-1] + 1)), name)
            self.assertGreaterEqual(len(pulses), least)
            late = sorted(t - p * PULSE_NS for t, p in zip(times, pulses))
            print(name, "late by", late[len(late) // 2] / 1e6, "ms, at most", late[-1] / 1e6)
            self.assertLess(abs(late[len(late) // 2]), EARLY_NS)
        self.assertEqual(sorted(numbers), list(range(min(numbers), max(numbers) + 1)))
        ends = [m["time_ns"] for m in self.markers("half") if m["value"] == 0]
        self.assertEqual(len(ends), len({(t - PULSE_NS // 2 + EARLY_NS) // PULSE_NS for t in ends}))
        own = [m["number"] for m in self.markers()]
        self.assertEqual(len(own), len(set(own)))

    def test_each_edge_is_recorded_once_over_a_lost_connection_and_a_killed_server(self):
        begin_ns = time.monotonic_ns()
        self.wait_for_pulse(begin_ns)
        self.relay.network.change(cut=True)
        self.relay.cut_connections()
        wait_until("the end of the connection", lambda: not self.session()["connected"])
        time.sleep(0.6)  # two pulses that nobody hears of yet
        self.relay.network.change(cut=False)
        self.wait_for_pulse(time.monotonic_ns())
        self.server.end(signal.SIGKILL)
        time.sleep(0.3)
        self.server = self.start_server()
        wait_until("the station", lambda: self.session()["connected"], 30)
        self.wait_for_pulse(time.monotonic_ns())
        self.assertEqual(self.session()["trace"], self.trace)
        held = [m["number"] for m in self.markers()]
        self.session_command("copy", "room-1", "--from", self.trace)
        self.assert_each_pulse_once((time.monotonic_ns() - begin_ns) // PULSE_NS - 4)
        self.assert_outputs(held)

    def assert_outputs(self, held):
        """held: what was recorded before it was copied; more may have come until the copy began."""
        markers = self.markers()
        self.assertEqual(call_json("arthron-trace", "replay", self.trace)["verdict"], "identical")
        call("arthron-trace", "verify", self.trace)
        self.assertEqual(figures_of(self.trace), figures_of_info(self.trace))
        with open(self.trace, "rb") as f:
            read = [r for name, r in example.Trace(f.read()).records() if name == "marker"]
        self.assertEqual([(r["number"], r["time_ns"], r["name"]) for r in read],
                         [(m["number"], m["time_ns"], m["name"]) for m in markers])
        rows = list(csv.DictReader(io.StringIO(call("arthron-trace", "export", self.trace, "--markers", "-").stdout)))
        self.assertEqual([(int(r["number"]), int(r["time_ns"]), r["marker"], r["device"], float(r["value"])) for r in rows],
                         [(m["number"], m["time_ns"], m["name"], "sync", m["value"]) for m in markers])
        report = self.path("report.html")
        call("arthron-trace", "report", self.trace, "--out", report)
        with open(report) as f:
            page = f.read()
        self.assertEqual(page.count("<td>sync</td>"), min(len(markers), 100))
        middle = sorted(m["second"] for m in markers)[len(markers) // 2]
        piece = self.path("piece.trace")
        call("arthron-trace", "cut", self.trace, "--from", "0.5", "--to", str(middle), "--out", piece)
        self.assertEqual(sorted(m["number"] for m in self.markers(trace=piece)),
                         sorted(m["number"] for m in markers if 0.5 <= m["second"] <= middle))
        copied = [m["number"] for m in self.markers(trace=self.session()["trace"]) if m["second"] <= 0]
        self.assertEqual(copied, [m["number"] for m in markers][:len(copied)])
        self.assertEqual(copied[:len(held)], held)


if __name__ == "__main__":
    unittest.main()
