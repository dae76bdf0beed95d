#!/usr/bin/env python3
"""NATS as docs/SCALE.md sets it up: its keys and its example config, and a server that signs in there."""

import os
import subprocess
import unittest

from arthron import SOURCE, Process, SystemTest, free_port, text_of, wait_until

HOSTS = ("nats-1.example.org", "nats-2.example.org", "localhost")
EXAMPLE = os.path.join(SOURCE, "docs/examples/nats-server.conf")


class NatsExample(SystemTest):
    def setUp(self):
        super().setUp()
        subprocess.run((os.path.join(SOURCE, "docker/nats-keys"), self.path("made"), *HOSTS), check=True,
                       capture_output=True)

    def config_of(self, host, **more):
        """The example at places that this test may write."""
        os.makedirs(self.path(host))
        os.symlink(self.path(f"made/{host}"), self.path(f"{host}/nats"))
        text = text_of(EXAMPLE).replace("/etc/nats/", self.path(f"made/{host}/"))
        text = text.replace("/var/lib/nats", self.path(f"{host}/store"))
        for old, new in more.items():
            self.assertIn(old, text)
            text = text.replace(old, new)
        return self.write(f"{host}/nats-server.conf", text)

    def test_the_config_is_valid_and_the_keys_are_for_one_user(self):
        for host in HOSTS:
            checked = subprocess.run(("nats-server", "-t", "-c", self.config_of(host)), capture_output=True, text=True)
            self.assertEqual(checked.returncode, 0, checked.stderr)
        for folder, _, files in os.walk(self.path("made")):
            for file in files:
                self.assertEqual(os.stat(os.path.join(folder, file)).st_mode & 0o077, 0, file)
        self.assertNotIn("authority.key", os.listdir(self.path("made/localhost")))

    def start_nats(self):
        """One server alone: the example without its part about the others."""
        port = free_port()
        text = text_of(self.config_of("localhost")).replace("port: 4222", f"port: {port}\nhost: 127.0.0.1")
        nats = Process(self.folder, "nats", "nats-server", "-c", self.write("alone.conf", text[:text.index("cluster {")]),
                       statuses=(0, 1))
        self.processes.append(nats)
        nats.wait_for_log("Server is ready")
        return port

    def cluster(self, port, password):
        return f"""
[cluster]
name = a
nats = tls://localhost:{port}
replicas = 1
authority = {self.path("made/arthron/nats-authority.pem")}
user = arthron
password = {password}
stations = localhost:{self.port}
"""

    def test_a_server_signs_in_with_the_keys_and_not_with_another_password(self):
        os.makedirs(self.path("nats"))
        os.link(self.path("made/localhost/machine.conf"), self.path("nats/machine.conf"))
        port = self.start_nats()
        wrong = self.write("wrong", "another\n")
        os.chmod(wrong, 0o600)
        server = self.start_server("[station room-1]\ncase = healthy\n",
                                   extra=self.cluster(port, self.path("made/arthron/nats.password")))
        server.wait_for_log("NATS answers")
        server.end()
        server = self.start_server("[station room-1]\ncase = healthy\n", extra=self.cluster(port, wrong))
        wait_until("the refusal", lambda: "authentication error" in text_of(self.path("nats.log")))
        self.assertNotIn("NATS answers", server.log())


if __name__ == "__main__":
    unittest.main()
