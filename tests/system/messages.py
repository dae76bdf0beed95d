"""What programs say of a wrong start: which port, which user, which argument."""

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import unittest

from arthron import SystemTest, call, free_port, program, wait_until

NOBODY = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups"]


class Starts(SystemTest):
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


def open_writer(fifo):
    """None until somebody reads."""
    try:
        return os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
    except OSError:
        return None


class Codes(SystemTest):
    def test_a_code_for_a_station_that_the_config_lacks_comes_with_a_warning(self):
        def enrol(name):
            done = call("arthron-server", "keys", "enrol", self.keys, name)
            self.assertTrue(done.stdout.strip())
            return done.stderr

        self.assertEqual(enrol("room-1"), "")
        self.start_server()
        self.assertEqual(enrol("room-1"), "")
        self.assertIn("no [station room-10]", enrol("room-10"))


class InterruptedStart(SystemTest):
    def test_a_start_is_interrupted_and_the_next_one_resumes_the_session(self):
        self.start_mockup()
        server = self.start_server()
        self.enrol("room-1")
        self.start_station()
        self.wait_for_steps()
        session = self.session()["id"]
        server.end(signal.SIGKILL)

        keys = self.path("keys-that-hang")
        shutil.copytree(self.keys, keys)
        fifo = os.path.join(keys, "server.pem")
        os.remove(fifo)
        os.mkfifo(fifo)
        for signal_number in (signal.SIGTERM, signal.SIGINT):
            starting = self.start("starting", "arthron-server", "run", "--config", self.server_config(),
                                  "--set", f"server.keys={keys}")
            writer = wait_until("the start hangs", lambda: open_writer(fifo))
            try:
                self.assertEqual(starting.end(signal_number), 0, starting.log())
            finally:
                os.close(writer)
            self.assertIn("ending before the server is ready", starting.log())

        self.start_server()
        self.assertEqual(self.session()["id"], session)


class Arguments(unittest.TestCase):
    def test_a_wrong_argument_is_answered_with_what_is_possible(self):
        rows = (
            ("arthron-server sesion", "did you mean session?"),
            ("arthron-server run", "--config FILE is missing"),
            ("arthron-server session --socket s lst", "did you mean list?"),
            ("arthron-server session --socket s start", "usage: start STATION"),
            ("arthron-server session --socket s list --at 3", "usage: list"),
            ("arthron-server session --socket s copy a --from x --at never", "--at never: must be seconds"),
            ("arthron-server session --socket s case a b --strength 2", "--strength 2: must be a number from 0 to 1"),
            ("arthron-server records --file {db} add account x --role boss",
             "--role boss is unknown; the choices are technician, instructor, trainee"),
            ("arthron-server records --file {db} add acount x", "did you mean account?"),
            ("arthron-server records --file {db} list trainee", "did you mean trainees?"),
            ("arthron-server records --file {db} show sesion x", "did you mean session?"),
            ("arthron-server records --file {db} erase", "usage: erase TRAINEE"),
            ("arthron-server backup", "usage: backup --file FILE --out BACKUP"),
            ("arthron-server restore x", "usage: restore BACKUP --file FILE"),
            ("arthron-case chek", "did you mean check?"),
            ("arthron-server run --config x --bench-field integral",
             "--bench-field integral is unknown; the choices are gaussian, inverse-distance, smooth"),
            ("arthron-case check", "one case folder is needed"),
            ("arthron-case picture x --out y --view left", "the choices are front, back"),
            ("arthron-case record-pose x --as targt", "did you mean target?"),
            ("arthron-station calibrate tip --channel prob", "--channel prob is unknown; did you mean probe?"),
            ("arthron-station calibrate tip --channel probe", "usage: tip --config FILE"),
            ("arthron-station runn", "did you mean run?"),
            ("arthron-station run --config x --set x", "--set x: must be SECTION.KEY=VALUE"),
            ("arthron-station run", "--config is required"),
            ("arthron-station check --config x --seconds 1", "--seconds 1: must be from 1.2 to 600"),
            ("arthron-station check --config x now", "takes no now"),
            ("arthron-station probe --slaves 900", "--slaves 900: must be from 1 to 247"),
            ("arthron-station enrol x", "HOST:PORT and CODE are required"),
            ("arthron-trace repaly", "did you mean replay?"),
            ("arthron-mockup --tool prob", "did you mean probe?"),
            ("arthron-mockup --message TDTA", "did you mean TDATA?"),
            ("arthron-case import --side lft", "did you mean left?"),
            ("arthron-case import --unit inch", "the choices are mm, cm, m"),
            ("arthron-station calibrate tips", "did you mean tip?"),
        )
        with tempfile.TemporaryDirectory() as folder:
            db = os.path.join(folder, "r.db")
            call("arthron-server", "records", "--file", db, "add", "course", "spring")
            for line, said in rows:
                words = line.format(db=db).split()
                done = call(*words, code=2)
                self.assertEqual(done.stdout, "")
                first, last = done.stderr.splitlines()
                self.assertIn(said, first)
                self.assertIn(f"Try: {words[0]}", last)


if __name__ == "__main__":
    unittest.main(verbosity=2)
