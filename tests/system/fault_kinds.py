"""The faults of fault_table.py: how each begins and ends. What is not said of a fault does nothing."""

import os
import re
import resource
import signal
import subprocess
import sys
import time

from arthron import SOURCE, call, text_of
from relay import Network
from watchdog_programs import ALL_THREADS, stop_thread

HERE = os.path.join(SOURCE, "tests/system")
MB = 1 << 20
RATE = 3000         # of datagrams that nobody wants, a second
SILENT, WAVES = 2000, (0, 0, 140)  # connections to the stations' port: at once; that come again, as if to enrol
KEEP_MB, KEEP_FILES = 40, 12       # that the server may still take: less than a session needs


class Fault:
    server_alone = False  # it is one of the whole server

    def begin(self, place, seconds):
        pass

    def go_on(self, place):
        """Again and again while it lasts."""

    def end(self, place):
        pass


class Weather(Fault):
    """Of the network between station and server. resets: connections break at once, as at a router that forgets."""

    def __init__(self, resets=False, **network):
        self.resets, self.network = resets, network

    def begin(self, place, seconds):
        place.relay.network.change(**self.network)
        if self.resets:
            place.relay.cut_connections()

    def end(self, place):
        place.relay.network = Network()


class ClockSteps(Fault):
    """For good."""

    def __init__(self, ms):
        self.ms = ms

    def begin(self, place, seconds):
        place.step_clock(self.ms)


class StationKilled(Fault):
    def begin(self, place, seconds):
        place.station.end(signal.SIGKILL)
        place.start_station()


class StationStops(Fault):
    def begin(self, place, seconds):
        place.station.process.send_signal(signal.SIGSTOP)

    def end(self, place):
        place.station.process.send_signal(signal.SIGCONT)


class ServerFault(Fault):
    server_alone = True


class ServerStops(ServerFault):
    def begin(self, place, seconds):
        place.hall.server.process.send_signal(signal.SIGSTOP)

    def end(self, place):
        place.hall.server.process.send_signal(signal.SIGCONT)


class ServerKilled(ServerFault):
    def begin(self, place, seconds):
        place.hall.server.end(signal.SIGKILL)
        place.hall.start_again()


class WorkerHangs(ServerFault):
    def begin(self, place, seconds):
        server = self.server = place.hall.server
        server.statuses.add(-signal.SIGABRT)
        folder = f"/proc/{server.process.pid}/task"
        [self.thread] = [int(t) for t in os.listdir(folder) if text_of(f"{folder}/{t}/comm").strip() == "worker 0"]
        stop_thread(self.thread)

    def go_on(self, place):
        """Its service manager starts it again."""
        if place.hall.server is not self.server:
            return
        try:
            os.waitpid(self.thread, os.WNOHANG | ALL_THREADS)
        except ChildProcessError:
            pass
        if self.server.process.poll() is not None:
            place.hall.start_again()


class Limit(ServerFault):
    """Of the running server. others: another station comes meanwhile."""

    def __init__(self, what, others=False):
        self.what, self.others = what, others

    def left(self, place):
        pid = place.hall.server.process.pid
        if self.what == resource.RLIMIT_FSIZE:
            return os.path.getsize(place.before["trace"]) + 1000
        if self.what == resource.RLIMIT_NOFILE:
            return len(os.listdir(f"/proc/{pid}/fd")) + KEEP_FILES
        return int(re.search(r"VmSize:\s*(\d+)", text_of(f"/proc/{pid}/status"))[1]) * 1024 + KEEP_MB * MB

    def begin(self, place, seconds):
        pid = place.hall.server.process.pid
        self.before = resource.prlimit(pid, self.what)
        resource.prlimit(pid, self.what, (self.left(place), self.before[1]))
        if self.others:
            self.other = place.hall.start_other()

    def end(self, place):
        resource.prlimit(place.hall.server.process.pid, self.what, self.before)
        if self.others:
            self.other.end()


class Program(ServerFault):
    """Another program that the server suffers from."""

    def begin(self, place, seconds):
        environment = dict(os.environ, PYTHONPATH=HERE, PYTHONDONTWRITEBYTECODE="1")
        self.process = subprocess.Popen([sys.executable, *map(str, self.command(place, seconds))], text=True,
                                        env=environment, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)

    def end(self, place):
        self.process.terminate()
        self.process.communicate()


class Strangers(Program):
    """kind: of strangers.py, whose port is that of the pages unless it says otherwise."""

    def __init__(self, kind, *arguments):
        self.kind, self.arguments = kind, arguments

    def command(self, place, seconds):
        port = place.hall.udp_port if self.kind == "datagrams" else place.hall.web_port
        return [HERE + "/strangers.py", self.kind, seconds, port, *self.arguments]

    def begin(self, place, seconds):
        super().begin(place, seconds)
        if self.kind == "datagrams":
            self.process.stdin.write("".join(data.hex() + "\n" for data in place.relay.last["up"]))
            self.process.stdin.flush()


class Flood(Program):
    def command(self, place, seconds):
        keys = place.hall.path("keys-flood")
        code = call("arthron-server", "keys", "enrol", place.hall.keys, "flood").stdout.strip()
        call("arthron-station", "enrol", f"127.0.0.1:{place.hall.port}", code, "--name", "flood", "--keys", keys)
        return [HERE + "/strangers.py", "flood", seconds, place.hall.port, keys]


class PortTaken(Program):
    """The stations' port is full of connections, and the station has to come back."""

    def __init__(self, kind, *arguments):
        self.kind, self.arguments = kind, arguments

    def command(self, place, seconds):
        self.full_s = time.monotonic() + 1
        return [SOURCE + "/tests/siege/port.py", "--attack", self.kind, "127.0.0.66", place.hall.port, seconds,
                *self.arguments]

    def go_on(self, place):
        if self.full_s and time.monotonic() > self.full_s:
            self.full_s = None
            place.relay.cut_connections()
