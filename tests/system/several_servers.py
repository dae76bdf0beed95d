"""Several servers that share stations through a real server of NATS, with a mock-up that bites."""

import os

from arthron import SystemTest, wait_until
from bites import Bites
from with_nats import WithNats


class SeveralServers(WithNats, Bites):
    def setUp(self):
        SystemTest.setUp(self)
        self.prepare_servers()
        self.port = self.ports["a"]
        for name in self.names:
            self.start_named(name)
        self.ask("a")
        self.enrol("room-1")
        self.start_mockup()

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
