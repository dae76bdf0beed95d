"""What programs say of a wrong start: which port, which user, which argument."""

import os
import socket
import subprocess
import unittest

from arthron import House, call, free_port, program

NOBODY = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups"]


class Starts(House):
    def refused(self, *settings):
        done = call("arthron-server", "run", "--config", self.server_config(extra="records = r.db"),
                    *(word for setting in settings for word in ("--set", setting)), code=1)
        return done.stderr

    def test_a_port_that_is_taken_is_named(self):
        with socket.create_server(("127.0.0.1", 0)) as tcp, \
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.bind(("127.0.0.1", 0))
            port, udp_port = tcp.getsockname()[1], udp.getsockname()[1]
            self.assertIn(f"TCP port {port} is in use", self.refused(f"server.port={port}"))
            self.assertIn(f"TCP port {port} is in use", self.refused(f"web.port={port}"))
            self.assertIn(f"UDP port {udp_port} is in use", self.refused(f"server.udp_port={udp_port}"))

    def test_an_address_of_another_machine_is_named(self):
        self.assertIn("this machine has no address 192.0.2.1", self.refused("server.address=192.0.2.1"))

    def test_a_second_server_on_one_socket_learns_that_one_runs(self):
        self.start_server()
        self.assertIn("s is in use: another server is running",
                      self.refused(f"server.port={free_port()}", "server.udp_port=0",
                                   f"server.traces={self.path('other')}"))

    def test_a_socket_in_a_folder_that_is_not_there_is_named(self):
        self.assertIn(f"no socket can be made in {self.folder}/none: No such file",
                      self.refused("server.socket=none/s"))

    def test_a_session_command_without_a_server_says_so(self):
        self.assertIn("there is no such socket; does the server run?",
                      call("arthron-server", "session", "--socket", self.socket, "list", code=1).stderr)

    @unittest.skipUnless(os.geteuid() == 0, "only root can be another user")
    def test_a_session_command_of_another_user_says_whose_socket_it_is(self):
        self.start_server()
        os.chmod(self.folder, 0o755)
        os.chmod(self.shared.name, 0o755)
        done = subprocess.run([*NOBODY, program("arthron-server"), "session", "--socket", self.socket, "list"],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn("permission denied; run this as the user root (runuser -u root -- ...)", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
