"""Several servers that share stations through a real server of NATS. For a SystemTest, before it in the list of bases."""

import re

from arthron import Process, free_port


class WithNats:
    names = ("a", "b")
    stations = "[station room-1]\ncase = healthy\n"

    def prepare_servers(self):
        """Behind SystemTest.setUp: NATS runs, and no server yet."""
        self.nats_port = free_port()
        self.start_nats()
        self.ports = {name: free_port() for name in self.names}
        self.web_ports = {name: free_port() for name in self.names}
        self.servers = {}

    def start_nats(self):
        command = ("nats-server", "-a", "127.0.0.1", "-p", str(self.nats_port), "-js", "-sd", self.path("nats"))
        self.nats = Process(self.folder, f"nats{len(self.processes)}", *command, statuses=(0, 1))
        self.processes.append(self.nats)
        self.nats.wait_for_log("Server is ready")

    def socket_of(self, name):
        return self.path("s-" + name)

    def file(self, name):
        return self.path(f"records-{name}.db")

    def keys_of(self, name):
        return self.keys

    def settings_of(self, name):
        return {"server.port": self.ports[name], "server.udp_port": free_port(), "server.keys": self.keys_of(name),
                "server.traces": self.path("traces-" + name), "server.socket": self.socket_of(name),
                "server.records": self.file(name), "cluster.name": name, "cluster.replicas": 1,
                "cluster.nats": f"nats://127.0.0.1:{self.nats_port}",
                "cluster.stations": f"127.0.0.1:{self.ports[name]}"}

    def config_of(self, name):
        return self.server_config(self.stations)

    def launch(self, name, server="arthron-server", statuses=(0,), **more):
        """more: settings, "__" for the dot in a name."""
        settings = {**self.settings_of(name), **{key.replace("__", "."): value for key, value in more.items()}}
        words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        count = sum(process.label.startswith(name) for process in self.processes)
        self.servers[name] = self.start(f"{name}{count}", server, "run", "--config", self.config_of(name), *words,
                                        statuses=statuses)
        return self.servers[name]

    def start_named(self, name, **more):
        server = self.launch(name, **more)
        server.wait_for_log("ready on port")
        return server

    def station_config(self, *arguments, **more):
        path = super().station_config(*arguments, **more)
        all_of_them = ", ".join(f"127.0.0.1:{port}" for port in self.ports.values())
        with open(path, "r+") as f:
            text = f.read()
            f.seek(0)
            f.write(re.sub(r"(?m)^server = .*$", "server = " + all_of_them, text))
            f.truncate()
        return path
