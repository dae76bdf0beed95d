"""Starts the real programs on free ports, in a folder of their own, and ends what it started."""

import json
import os
import random
import re
import resource
import signal
import socket
import subprocess
import tempfile
import time
import unittest

BIN = os.environ["ARTHRON_BIN"]
SOURCE = os.environ["ARTHRON_SOURCE"]
CASES = os.environ["ARTHRON_CASES"]  # made once for all tests, by make_cases.py; nobody writes there
PATIENCE_S = 60  # an end for what hangs; nothing is measured by it


def program(name):
    return os.path.join(BIN, name)


held_ports = []


def free_port(kind=socket.SOCK_STREAM):
    """A port of this process alone: below those that the kernel gives to clients, and held against other
    tests by an abstract socket of its name."""
    while True:
        port = random.randrange(10000, 32768)
        name = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            name.bind(f"\0arthron-test-port-{port}")
            with socket.socket(socket.AF_INET, kind) as s:
                s.bind(("127.0.0.1", port))
        except OSError:
            name.close()
            continue
        held_ports.append(name)
        return port


def call(name, *arguments, code=0):
    """Runs a program to its end and returns it; its exit code must be as said."""
    done = subprocess.run([program(name), *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=4 * PATIENCE_S)
    if code is not None and done.returncode != code:
        raise AssertionError(
            f"{name} {' '.join(arguments)}: exit {done.returncode}, not {code}\n{done.stdout}{done.stderr}")
    return done


def call_json(name, *arguments, code=0):
    return json.loads(call(name, *arguments, "--json", code=code).stdout)


def text_of(path):
    with open(path) as f:
        return f.read()


def used_by_programs_s():
    """Processor time of all programs that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def wait_until(what, condition, seconds=PATIENCE_S):
    """A condition that asks a program takes a fifth of a processor: tests run side by side."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        before = used_by_programs_s()
        value = condition()
        if value:
            return value
        time.sleep(min(0.5, 0.02 + 4 * (used_by_programs_s() - before)))
    raise AssertionError(f"waited {seconds} s in vain: {what}")


class Process:
    """A program in the background, its output in files. It must end with 0, or with a status in `statuses`."""

    def __init__(self, folder, label, *command, statuses=(0,)):
        self.label, self.statuses = label, set(statuses)
        self.out_path = os.path.join(folder, label + ".out")
        self.log_path = os.path.join(folder, label + ".log")
        with open(self.out_path, "wb") as out, open(self.log_path, "wb") as log:
            self.process = subprocess.Popen(command, stdout=out, stderr=log, stdin=subprocess.DEVNULL)

    def out(self):
        with open(self.out_path, errors="replace") as f:
            return f.read()

    def log(self):
        with open(self.log_path, errors="replace") as f:
            return f.read()

    def wait_for_log(self, text, seconds=PATIENCE_S):
        def there():
            if text in self.log():
                return True
            if self.process.poll() is not None:
                raise AssertionError(f"ended with {self.process.returncode} before '{text}':\n{self.log()}")
            return False
        wait_until(text, there, seconds)

    def end(self, signal_number=signal.SIGTERM):
        """Its exit status, after the signal where it still runs. What SIGKILL ended is told by -SIGKILL."""
        if self.process.poll() is None:
            if signal_number == signal.SIGKILL:
                self.statuses.add(-signal.SIGKILL)
            self.process.send_signal(signal_number)
            self.process.send_signal(signal.SIGCONT)  # one that is stopped would not hear it
        return self.process.wait(timeout=PATIENCE_S)

    def wrong_end(self):
        """Ends it where it still runs. What is wrong with how it ended, with its log; "" where nothing is."""
        try:
            status = self.end()
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return f"{self.label} did not end on SIGTERM:\n{self.log()}"
        return "" if status in self.statuses else f"{self.label} ended with {status}:\n{self.log()}"


class SystemTest(unittest.TestCase):
    """A folder with keys and cases; mock-up, server and station on demand."""

    more_cases = ()  # that the server has beside those of its stations: its start reads each of them

    @classmethod
    def setUpClass(cls):
        cls.shared = tempfile.TemporaryDirectory(prefix="arthron-test-")
        cls.cases = CASES
        cls.motion = os.path.join(CASES, "palpation.csv")

    @classmethod
    def tearDownClass(cls):
        cls.shared.cleanup()

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="system-", dir=self.shared.name)
        self.keys = os.path.join(self.folder, "keys")
        self.traces = os.path.join(self.folder, "traces")
        self.socket = os.path.join(self.folder, "s")
        self.port = free_port()
        self.udp_port = free_port(socket.SOCK_DGRAM)
        self.processes = []
        call("arthron-server", "keys", "init", self.keys)

    def tearDown(self):
        wrong = [process.wrong_end() for process in reversed(self.processes)]
        self.assertFalse(any(wrong), "\n".join(filter(None, wrong)))

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, text):
        with open(self.path(name), "w") as f:
            f.write(text)
        return self.path(name)

    def start(self, label, name, *arguments, statuses=(0,)):
        process = Process(self.folder, label, program(name), *arguments, statuses=statuses)
        self.processes.append(process)
        return process

    # ---- the three programs

    def start_mockup(self, *arguments):
        mockup = self.start("mockup", "arthron-mockup", "--motion", self.motion, "--modbus-tcp", "127.0.0.1:0",
                            "--tracker", "127.0.0.1:0", *arguments)
        wait_until("the mock-up's ports", lambda: mockup.out().count("\n") >= 2)
        ports = dict(line.split() for line in mockup.out().splitlines())
        self.modbus, self.tracker = ports["modbus-tcp"], ports["tracker"]
        return mockup

    def faults(self, *faults):
        """A file of faults: (who, what, at_s, for_s) and perhaps a dictionary of more keys."""
        text = ""
        for i, (who, what, at_s, for_s, *more) in enumerate(faults):
            text += f"[fault {i}-{who}-{what}]\nwho = {who}\nwhat = {what}\nat_s = {at_s}\nfor_s = {for_s}\n"
            text += "".join(f"{key} = {value}\n" for rest in more for key, value in rest.items())
        return self.write("faults.ini", text)

    def server_config(self, stations="", extra=""):
        stations = stations or "[station room-1]\ncase = arthrosis\n"
        names = {*re.findall(r"^case = (healthy|arthrosis)$", stations, re.MULTILINE), *self.more_cases}
        cases = "".join(f"[case {name}]\ndir = {self.cases}/{name}\n" for name in sorted(names))
        return self.write("server.ini", f"""
[server]
address = 127.0.0.1
port = {self.port}
udp_port = {self.udp_port}
workers = 1
keys = keys
traces = traces
socket = s
{extra}
{cases}{stations}
""")

    def start_server(self, stations="", extra="", options=()):
        server = self.start("server", "arthron-server", "run", "--config", self.server_config(stations, extra),
                            *options)
        server.wait_for_log("ready")
        return server

    def enrol(self, name):
        code = call("arthron-server", "keys", "enrol", self.keys, name).stdout.strip()
        call("arthron-station", "enrol", f"127.0.0.1:{self.port}", code, "--name", name, "--keys",
             self.path("keys-" + name))

    def station_config(self, name="room-1", datagrams="yes", keys=None):
        return self.write(f"{name}.ini", f"""
[station]
name = {name}
server = 127.0.0.1:{self.port}
keys = {keys or 'keys-' + name}
datagrams = {datagrams}
[device encoders]
driver = modbus
address = {self.modbus}
rate_hz = 200
sequence = 0
flexion = 1 0.01 0
varus = 2 0.01 0
internal = 3 0.01 0
shift = 4 0.01 0
drawer = 5 0.01 0
distraction = 6 0.01 0
punch.opening = 7 0.0001 0
[device tracker]
driver = tracker
address = {self.tracker}
tool.probe = probe
tool.punch = punch
""")

    def start_station(self, name="room-1", *arguments, label=None, statuses=(0,), **config):
        path = self.station_config(name, **config)
        return self.start(label or name, "arthron-station", "run", "--config", path, "--json", *arguments,
                          statuses=statuses)

    # ---- questions

    def sessions(self):
        return call_json("arthron-server", "session", "--socket", self.socket, "list")["sessions"]

    def session(self, name="room-1"):
        return next(s for s in self.sessions() if s["station"] == name)

    def session_command(self, *words, code=0):
        return call_json("arthron-server", "session", "--socket", self.socket, *words, code=code)

    def wait_for_steps(self, more=50, name="room-1"):
        start = self.session(name)["steps"]
        wait_until(f"{more} more steps", lambda: self.session(name)["steps"] >= start + more)

    def metrics(self, name="room-1"):
        """As the running server has them."""
        return {(m["name"], m["subject"], m["version"]): (m["value"], m["unit"], m["below_floor"])
                for m in self.session_command("show", name)["metrics"]}

    def assert_metrics_are_those_of(self, trace, metrics):
        """Bit for bit what score makes of the trace."""
        scored = {}
        for m in call_json("arthron-trace", "score", trace)["metrics"]:
            if "from_mm" in m and m["value"] == 0:
                continue
            about = [m.get("instrument") or m.get("bone"), m.get("group") or m.get("tissue"), m.get("zone")]
            if "from_mm" in m:
                about.append(f"from {m['from_mm']:g} mm")
            scored[m["name"], " ".join(word for word in about if word), m["version"]] = (
                m["value"], m["unit"], m["below_floor"])
        self.assertEqual(metrics, scored)

    def summary(self, station):
        return json.loads(station.out().splitlines()[-1])
