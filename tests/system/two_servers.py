"""A station that knows two servers of one authority goes from one that is lost to the other, and tells where it is.

Both are real servers that know nothing of each other: each has a session of its own for the station."""

import datetime
import json
import re
import signal
import time
import unittest

from arthron import SystemTest, call, call_json, free_port, wait_until
from websocket import Viewer

SILENCE_S = 4  # that a server may be silent until the station is at the next one


class Servers(SystemTest):
    def setUp(self):
        super().setUp()
        self.ports = {"a": self.port, "b": free_port()}
        self.view_port = free_port()
        self.server_config()
        self.servers = {}
        for name in self.ports:
            self.start_named(name)
        self.enrol("room-1")
        self.start_mockup()

    def socket_of(self, name):
        return self.path("s-" + name)

    def start_named(self, name):
        settings = {"port": self.ports[name], "udp_port": free_port(), "traces": self.path("traces-" + name),
                    "socket": self.socket_of(name)}
        words = [word for key, value in settings.items() for word in ("--set", f"server.{key}={value}")]
        count = sum(label.startswith(name) for label in (process.label for process in self.processes))
        self.servers[name] = self.start(f"{name}{count}", "arthron-server", "run", "--config", self.path("server.ini"),
                                        *words)
        self.servers[name].wait_for_log("ready")

    def station_config(self, *arguments, **more):
        path = super().station_config(*arguments, **more)
        with open(path) as f:
            text = f.read()
        both = ", ".join(f"127.0.0.1:{port}" for port in self.ports.values())
        text = text.replace(f"server = 127.0.0.1:{self.port}\n", f"server = {both}\n")
        return self.write("room-1.ini", text + f"[view]\nport = {self.view_port}\n")

    def session_at(self, name):
        sessions = call_json("arthron-server", "session", "--socket", self.socket_of(name), "list")["sessions"]
        return sessions[0]

    def is_at(self, name):
        return self.session_at(name)["connected"]

    def wait_at(self, name):
        wait_until("the station at " + name, lambda: self.is_at(name))
        steps = self.session_at(name)["steps"]
        wait_until("steps", lambda: self.session_at(name)["steps"] > steps + 20)
        with open(self.path("keys-room-1/view.token")) as f:
            viewer = Viewer(self.view_port, f.read().strip())
        self.assertEqual(viewer.next()["server"], f"127.0.0.1:{self.ports[name]}")
        viewer.close()

    def welcomes(self, station):
        """When, since 1970, and by which server."""
        found = re.findall(r"^(\S+)Z info link: welcomed by 127\.0\.0\.1, port (\d+)", station.log(), re.MULTILINE)
        names = {port: name for name, port in self.ports.items()}
        return [(datetime.datetime.fromisoformat(when + "+00:00").timestamp(), names[int(port)])
                for when, port in found]

    def seconds_to(self, name, station, since):
        def there():
            when, where = self.welcomes(station)[-1]
            return when - since if where == name and when > since else None
        return wait_until("the station at " + name, there)

    def test_a_station_goes_where_a_server_answers(self):
        station = self.start_station()
        self.wait_at("a")
        now = time.time()
        self.servers["a"].end(signal.SIGKILL)
        self.assertLess(self.seconds_to("b", station, now), 1)
        self.wait_at("b")
        self.start_named("a")
        time.sleep(5)  # a connection that lasts: it is where it was sent, though a is first in its list
        self.assertTrue(self.is_at("b"))

        now = time.time()
        self.servers["b"].process.send_signal(signal.SIGSTOP)
        self.assertLess(self.seconds_to("a", station, now), SILENCE_S)
        self.wait_at("a")
        self.servers["b"].process.send_signal(signal.SIGCONT)
        wait_until("b knows that the station is gone", lambda: not self.is_at("b"))
        self.assertTrue(self.is_at("a"))

        self.servers["b"].process.send_signal(signal.SIGSTOP)
        now = time.time()
        self.servers["a"].process.send_signal(signal.SIGSTOP)  # nobody is there
        time.sleep(8)
        self.servers["b"].process.send_signal(signal.SIGCONT)
        self.seconds_to("b", station, now)
        self.servers["a"].process.send_signal(signal.SIGCONT)
        self.wait_at("b")
        self.assertEqual([where for _, where in self.welcomes(station)], ["a", "b", "a", "b"])

    def test_a_check_tells_which_server_answers(self):
        def server():
            done = call("arthron-station", "check", "--config", self.station_config(), "--seconds", "1.2", "--json",
                        code=None)
            return next(f for f in json.loads(done.stdout)["findings"] if f["what"] == "server")
        self.assertIn(f"127.0.0.1, port {self.ports['a']}: connected", server()["text"])
        self.servers["a"].process.send_signal(signal.SIGSTOP)
        found = server()
        self.assertTrue(found["good"])
        self.assertIn(f"127.0.0.1, port {self.ports['b']}: connected", found["text"])


if __name__ == "__main__":
    unittest.main()
