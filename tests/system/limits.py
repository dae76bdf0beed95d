"""What the system does not give: a session that does not fit is refused with its reason, and the others go on."""

import http.client
import os
import re
import resource
import socket
import subprocess
import unittest

from arthron import Process, SystemTest, call_json, program, text_of, wait_until
from hall import Answer, Hall

ROOMS = [f"room-{i}" for i in range(1, 8)]
MB = 1 << 20


class FewDescriptors(Hall, SystemTest):
    """64 in all: a fifth of them for each kind of connection."""

    def start_server(self, stations="", extra="", options=()):
        server = Process(self.folder, "server", "prlimit", "--nofile=64:64", program("arthron-server"), "run",
                         "--config", self.server_config(stations, extra))
        self.processes.append(server)
        server.wait_for_log("ready")
        self.assertIn("the system gives 64 descriptors", server.log())
        return server

    def hold(self, port, count=80):
        for _ in range(count):
            stranger = socket.create_connection(("127.0.0.1", port))
            self.addCleanup(stranger.close)

    def hold_as(self, cookie):
        """A connection that stays, of whoever has the cookie."""
        connection = http.client.HTTPSConnection("127.0.0.1", self.web_port, context=self.trust, timeout=60)
        self.addCleanup(connection.close)
        connection.request("GET", "/api/v1/me", None, {"Cookie": "arthron=" + cookie})
        self.assertEqual(Answer(connection.getresponse()).status, 200)
        return connection

    def test_strangers_keep_out_neither_console_nor_stations_nor_instructors(self):
        server = self.serve()
        boss = self.make_first(server)
        ada = self.make_account(boss, "ada.l", "technician")
        self.start_mockup()
        self.enrol("room-1")
        self.hold(self.port)
        self.hold(self.web_port)
        self.start_station()
        self.wait_for_steps()
        self.done("GET", "/sessions", cookie=boss)
        own = self.hold_as(boss)
        for _ in range(20):
            self.hold_as(ada)
        self.hold(self.web_port)
        own.request("GET", "/api/v1/me", None, {"Cookie": "arthron=" + boss})
        self.assertEqual(Answer(own.getresponse()).json["account"]["name"], "grace")
        self.assertEqual(len(self.sessions()), 1)


class Limits(SystemTest):
    def setUp(self):
        super().setUp()
        self.server = self.start_server("".join(f"[station {room}]\ncase = healthy\n" for room in ROOMS))
        self.stations = {}
        for room in ROOMS:
            self.enrol(room)

    def limit(self, what, value):
        """Of the running server, so that the test knows how much is left."""
        resource.prlimit(self.server.process.pid, what, (value, resource.prlimit(self.server.process.pid, what)[1]))

    def start_rooms(self, rooms):
        for room in rooms:
            config = self.write(room + ".ini", f"""
[station]
name = {room}
server = 127.0.0.1:{self.port}
keys = keys-{room}
[device hands]
driver = simulated
rate_hz = 50
""")
            self.stations[room] = self.start(room, "arthron-station", "run", "--config", config)

    def running(self):
        return [s["station"] for s in self.sessions() if s["state"] == "running"]

    def start_first(self):
        """They are served, and the server's threads have what they need."""
        self.start_rooms(ROOMS[:3])
        wait_until("the first run", lambda: len(self.running()) == 3)

    def some_are_served_and_the_rest_is_told(self, reason):
        self.start_rooms(ROOMS[3:])
        wait_until("each station has an answer", lambda: all(
            room in self.running() or re.search(reason, self.stations[room].log()) for room in ROOMS))
        served = self.running()
        self.assertGreaterEqual(len(served), 3)
        self.assertLess(len(served), len(ROOMS))
        before = {s["station"]: s["steps"] for s in self.sessions()}
        wait_until("they go on", lambda: all(s["steps"] > before[s["station"]] + 20 for s in self.sessions()
                                             if s["station"] in served))
        self.assertIsNone(self.server.process.poll())

    def all_are_served_in_the_end(self):
        wait_until("all", lambda: len(self.running()) == len(ROOMS))

    def test_without_descriptors(self):
        self.start_first()
        open_now = len(os.listdir(f"/proc/{self.server.process.pid}/fd"))
        before = resource.prlimit(self.server.process.pid, resource.RLIMIT_NOFILE)[0]
        self.limit(resource.RLIMIT_NOFILE, open_now + 16 + 4)
        self.some_are_served_and_the_rest_is_told("descriptors left and keeps them for its console")
        self.limit(resource.RLIMIT_NOFILE, before)
        self.all_are_served_in_the_end()

    def test_without_memory(self):
        self.start_first()
        size_kb = int(re.search(r"VmSize:\s*(\d+)", text_of(f"/proc/{self.server.process.pid}/status"))[1])
        self.limit(resource.RLIMIT_AS, size_kb * 1024 + 32 * MB)  # another session wants 48, a thread that ends gives 8
        self.some_are_served_and_the_rest_is_told("no memory left for another session")
        self.limit(resource.RLIMIT_AS, resource.RLIM_INFINITY)
        self.all_are_served_in_the_end()
        for room in ROOMS:
            self.stations[room].end()
        self.assertEqual(self.server.end(), 0)
        for trace in os.listdir(self.traces):
            self.assertEqual(call_json("arthron-trace", "replay", os.path.join(self.traces, trace))["different"], 0)


class NoThreads(SystemTest):
    """Root may have as many as it likes, so the server runs as a user that has nothing else."""

    def give_files(self, user):
        for folder, _, files in os.walk(self.folder):
            for path in [folder] + [os.path.join(folder, name) for name in files]:
                os.chown(path, user, -1)

    def start_as_another(self):
        user = 40000 + os.getpid() % 20000
        os.chmod(self.shared.name, 0o711)
        self.start_server("".join(f"[station {room}]\ncase = healthy\n" for room in ROOMS[:2]))
        for room in ROOMS[:2]:
            self.enrol(room)
        self.processes.pop().end()
        self.give_files(user)
        self.as_user = ["setpriv", "--reuid", str(user), "--clear-groups"]
        self.server = Process(self.folder, "server", *self.as_user, program("arthron-server"), "run", "--config",
                              self.path("server.ini"))
        self.processes.append(self.server)
        self.server.wait_for_log("ready")

    def limit_threads(self, most):
        """Of the running server. A process may change the limits of others of its user."""
        subprocess.run([*self.as_user, "prlimit", "--pid", str(self.server.process.pid), f"--nproc={most}:"], check=True)

    @unittest.skipUnless(os.geteuid() == 0, "only root may run a server as another user")
    def test_a_session_that_gets_no_thread_is_refused_and_others_go_on(self):
        self.start_as_another()
        self.limit_threads(1)
        self.start_mockup()
        first = self.start_station("room-1")
        first.wait_for_log("the system gives no thread")
        self.limit_threads(1000)
        self.wait_for_steps(20, "room-1")
        self.limit_threads(1)
        self.start_station("room-2")
        wait_until("the other", lambda: self.session("room-2")["state"] == "running")
        for room in ROOMS[:2]:
            self.wait_for_steps(20, room)


if __name__ == "__main__":
    unittest.main(verbosity=2)
