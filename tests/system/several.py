"""Several servers with pages that share stations, through a real NATS server."""

from arthron import wait_until
from asking import Asking
from with_nats import WithNats


class Several(WithNats, Asking):
    def setUp(self):
        super().setUp()
        self.prepare_servers()

    def settings_of(self, name):
        return {**super().settings_of(name), "web.port": self.web_ports[name]}

    def at(self, name):
        """What is asked from now on is asked of this server."""
        self.socket = self.socket_of(name)
        self.port, self.web_port = self.ports[name], self.web_ports[name]
        self.origin = f"https://127.0.0.1:{self.web_port}"

    def begin(self):
        """All servers, which know each other; self.token is an instructor's at each of them."""
        self.start_named("a")
        self.at("a")
        grace = self.make_first(self.servers["a"])
        self.token = self.ask("POST", "/tokens", {"name": "night"}, grace, 201).json["token"]
        for name in self.names[1:]:
            self.start_named(name)
        for name in self.names:
            wait_until("the token", lambda: self.knows(name))
            wait_until("all the others", lambda: sum(row["lives"] for row in self.servers_at(name)) == len(self.names))

    def knows(self, name):
        """Whether the server knows the token."""
        self.at(name)
        try:
            return self.get("/me", self.token)
        except AssertionError:
            return None

    def servers_at(self, name):
        self.at(name)
        return self.get("/servers", self.token)["servers"]
