#!/usr/bin/env python3
"""Two servers that share a station: where one is killed, paused or drained, the other goes on with the session.

NATS is a real server of it."""

import os
import signal
import time
import unittest

from arthron import Process, SystemTest, call_json, free_port, wait_until
from bites import Bites

STATE = ("mesh_number", "mesh_hash", "cuts", "removed_mm3", "pieces_mm3", "volume_mm3", "warped_mm3", "left_mm3",
         "distance_mm", "over_mm3", "under_mm3", "rim_mm", "removed_zone_mm3")


class Cluster(Bites):
    names = ("a", "b")

    def setUp(self):
        SystemTest.setUp(self)
        self.nats_port = free_port()
        self.start_nats()
        self.ports = {name: free_port() for name in self.names}
        self.port = self.ports["a"]
        self.server_config("[station room-1]\ncase = healthy\n")
        self.servers = {}
        for name in self.names:
            self.start_named(name)
        self.ask("a")
        self.enrol("room-1")
        self.start_mockup()

    def start_nats(self):
        command = ("nats-server", "-a", "127.0.0.1", "-p", str(self.nats_port), "-js", "-sd", self.path("nats"))
        self.nats = Process(self.folder, f"nats{len(self.processes)}", *command, statuses=(0, 1))
        self.processes.append(self.nats)
        self.nats.wait_for_log("Server is ready")

    def socket_of(self, name):
        return self.path("s-" + name)

    def start_named(self, name):
        settings = {"server.port": self.ports[name], "server.udp_port": free_port(),
                    "server.traces": self.path("traces-" + name), "server.socket": self.socket_of(name),
                    "cluster.name": name, "cluster.replicas": 1, "cluster.nats": f"nats://127.0.0.1:{self.nats_port}",
                    "cluster.stations": f"127.0.0.1:{self.ports[name]}"}
        words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        count = sum(process.label.startswith(name) for process in self.processes)
        self.servers[name] = self.start(f"{name}{count}", "arthron-server", "run", "--config", self.path("server.ini"),
                                        *words)
        self.servers[name].wait_for_log("ready on port")

    def station_config(self, *arguments, **more):
        path = super().station_config(*arguments, **more)
        with open(path) as f:
            text = f.read()
        both = ", ".join(f"127.0.0.1:{port}" for port in self.ports.values())
        return self.write("room-1.ini", text.replace(f"server = 127.0.0.1:{self.port}\n", f"server = {both}\n"))

    def ask(self, name):
        """What is asked from now on is asked of this server."""
        self.socket = self.socket_of(name)

    def wait_at(self, name, state="running"):
        self.ask(name)
        wait_until("the station at " + name,
                   lambda: self.session()["connected"] and self.session()["state"] == state)

    def parts(self):
        paths = []
        for name in self.names:
            folder = self.path("traces-" + name)
            paths += [os.path.join(folder, file) for file in os.listdir(folder) if file.endswith(".trace")]
        return paths

    def verify(self):
        return call_json("arthron-trace", "verify", *self.parts(), "--authority",
                         os.path.join(self.keys, "authority.pem"), code=None)

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

    def test_sessions_go_on_without_nats(self):
        """Beyond the end of the lease. What was cut meanwhile is in the journal once NATS is back."""
        station, before, cut = self.begin()
        self.nats.end(signal.SIGKILL)
        gone = time.monotonic()
        self.session_command("start", "room-1")
        self.wait_for_cuts(cut["cuts"] + 1)
        time.sleep(max(0, gone + 12 - time.monotonic()))
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
