"""The hall of tests/soak/run, its faults, and what must hold."""

import collections
import json
import os
import random
import signal
import ssl
import subprocess
import sys
import threading
import time
from http.client import HTTPException, HTTPSConnection

from failing import Plan
from arthron import Process, SystemTest, call, call_json, free_port, program, wait_until
from bites import Bites

HERE = os.path.dirname(os.path.abspath(__file__))
PATIENCE_S = 180
ORDERLY = "; the program ends"
KILL_COSTS_S = 5  # audit entries of so long before a kill may not have come to the disk


def say(text):
    print(time.strftime("%H:%M:%S"), text, flush=True)


class Hall(Bites):
    """Server and stations with their plans of failing calls; the programs are started again when they end."""

    def __init__(self, seed, count):
        super().__init__()
        self.seed, self.names = seed, [f"room-{i}" for i in range(1, count + 1)]
        self.random = random.Random(seed)
        self.wrong, self.ended = [], collections.Counter()
        self.answered, self.uncertain = [], 0
        self.poses = collections.Counter()
        self.rss_kb, self.descriptors = [], []
        self.starts, self.relays = 0, {}

    # ---- the programs

    def setUp(self):
        SystemTest.setUp(self)
        call("arthron-server", "keys", "renew", self.keys, "127.0.0.1", *(self.near(name) for name in self.names))
        self.web_port = free_port()
        self.start_mockup()
        self.plans = {name: Plan(self.folder) for name in ("server", *self.names)}
        self.start_the_server()
        self.relays = {name: self.start_relay(name) for name in self.names}
        self.stations = {}
        for name in self.names:
            self.enrol(name)
            self.start_one(name)

    def near(self, name):
        return f"127.0.1.{self.names.index(name) + 1}"

    def spawn(self, label, plan, command, statuses):
        before = dict(os.environ)
        os.environ.update(plan.environment())
        try:
            process = Process(self.folder, label, program(command[0]), *command[1:], statuses=statuses)
        finally:
            os.environ.clear()
            os.environ.update(before)
        self.processes.append(process)
        return process

    def start_the_server(self):
        extra = f"records = records.db\n[web]\naddress = 127.0.0.1\nport = {self.web_port}\n"
        stations = "".join(f"[station {name}]\ncase = healthy\n" for name in self.names)
        self.starts += 1
        self.server = self.spawn(f"server-{self.starts}", self.plans["server"],
                                 ("arthron-server", "run", "--config", self.server_config(stations, extra)), (0, 1))
        self.server.wait_for_log(" ready on", PATIENCE_S)

    def start_relay(self, name):
        seed = self.seed * 100 + self.names.index(name)
        return subprocess.Popen([sys.executable, HERE + "/relay.py", self.near(name), "127.0.0.1", str(self.port),
                                 str(self.udp_port), str(seed)], stdin=subprocess.PIPE, text=True)

    def start_one(self, name):
        path = self.station_config(name)
        with open(path) as f:
            text = f.read().replace(f"server = 127.0.0.1:{self.port}", f"server = {self.near(name)}:{self.port}")
        with open(path, "w") as f:
            f.write(text)
        count = sum(p.label.startswith(name) for p in self.processes)
        self.stations[name] = self.spawn(f"{name}-{count}", self.plans[name],
                                         ("arthron-station", "run", "--config", path, "--json"), (0, 1))

    def end_relays(self):
        for relay in self.relays.values():
            relay.kill()
            relay.wait()

    # ---- what ended, and how

    def look_after(self):
        """Starts again what ended; how it ended must be right."""
        if self.server.process.poll() is not None:
            self.judge_end("server", self.server)
            self.plans["server"].calm()
            self.start_the_server()
        for name, station in list(self.stations.items()):
            if station.process.poll() is not None:
                self.judge_end("station", station)
                self.count_poses(name, station)
                self.plans[name].calm()
                self.start_one(name)

    def judge_end(self, kind, process):
        status, log = process.process.returncode, process.log()
        if status == 1 and ORDERLY in log:
            self.ended[f"{kind} ended with a sentence"] += 1
        elif status != -signal.SIGKILL and status != 0:
            self.wrong.append(f"{process.label} ended with {status}: {log.strip().splitlines()[-1:]}")

    def count_poses(self, name, station):
        for line in station.out().splitlines()[-1:]:
            summary = json.loads(line) if line.startswith("{") else {}
            self.poses["sent"] += summary.get("poses_sent", 0)
            self.poses["warped"] += summary.get("poses_warped", 0)

    def measure(self):
        pid = self.server.process.pid
        try:
            with open(f"/proc/{pid}/status") as f:
                rss = next(int(line.split()[1]) for line in f if line.startswith("VmRSS"))
            self.rss_kb.append(rss)
            self.descriptors.append(len(os.listdir(f"/proc/{pid}/fd")))
        except (OSError, StopIteration):
            pass

    # ---- people

    def ask(self, *words):
        try:
            done = subprocess.run([program("arthron-server"), "session", "--socket", self.socket, *words],
                                  capture_output=True, timeout=30)
        except subprocess.TimeoutExpired:
            return False
        if done.returncode == 0:
            self.answered.append((time.monotonic(), words[0]))
        return done.returncode == 0

    def forget_uncertain(self):
        """What was answered so shortly before a kill may be lost from the audit log."""
        now = time.monotonic()
        kept = [(at, word) for at, word in self.answered if now - at > KILL_COSTS_S]
        self.uncertain += len(self.answered) - len(kept)
        self.answered = kept

    def browse(self, stop):
        context = ssl.create_default_context(cafile=os.path.join(self.keys, "authority.pem"))
        while not stop.wait(0.5):
            for path in ("/", "/api/v1/stations"):
                try:
                    connection = HTTPSConnection("127.0.0.1", self.web_port, context=context, timeout=5)
                    connection.request("GET", path)
                    self.poses["pages answered"] += connection.getresponse().status in (200, 401)
                    connection.close()
                except (OSError, HTTPException):
                    self.poses["pages not answered"] += 1


class Faults:
    """Each method is a fault; a fault ends with what undoes it, after some seconds."""

    def __init__(self, hall):
        self.hall, self.random = hall, hall.random
        self.undoing = []  # (when, what)
        self.counts = collections.Counter()

    def kinds(self):
        return sorted(name for name in dir(self) if name.startswith(("fault_", "person_")))

    def one(self):
        name = self.random.choice(self.kinds())
        self.counts[name.removeprefix("fault_").replace("_", " ")] += 1
        getattr(self, name)()

    def after(self, seconds, undo):
        self.undoing.append((time.monotonic() + seconds, undo))

    def undo_due(self, all_of_them=False):
        now = time.monotonic()
        due = [undo for at, undo in self.undoing if all_of_them or at <= now]
        self.undoing = [] if all_of_them else [(at, undo) for at, undo in self.undoing if at > now]
        for undo in due:
            undo()

    def some_station(self):
        return self.random.choice(self.hall.names)

    # ---- programs

    def fault_server_killed(self):
        self.hall.forget_uncertain()
        self.hall.server.end(signal.SIGKILL)

    def fault_station_killed(self):
        self.hall.stations[self.some_station()].end(signal.SIGKILL)

    def fault_server_ended_in_order(self):
        self.hall.server.end(self.random.choice((signal.SIGTERM, signal.SIGUSR1)))

    def stopped(self, process, seconds):
        def goes_on():
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
        if process.poll() is None:
            process.send_signal(signal.SIGSTOP)
            self.after(seconds, goes_on)

    def fault_server_stopped_for_a_while(self):
        self.stopped(self.hall.server.process, self.random.uniform(0.1, 5))

    def fault_station_stopped_for_a_while(self):
        self.stopped(self.hall.stations[self.some_station()].process, self.random.uniform(0.1, 5))

    # ---- networks

    def relay(self, seconds, **rules):
        relay = self.hall.relays[self.some_station()]
        calm = {"loss": 0, "delay_s": 0, "jitter_s": 0, "cut": False}

        def tell(said):
            relay.stdin.write(json.dumps(said) + "\n")
            relay.stdin.flush()
        tell({**calm, **rules})
        self.after(seconds, lambda: tell(calm))

    def fault_network_loses(self):
        self.relay(self.random.uniform(1, 10), loss=self.random.uniform(0.01, 0.4))

    def fault_network_jitters(self):
        self.relay(self.random.uniform(1, 10), jitter_s=self.random.uniform(0.01, 0.15))

    def fault_network_is_slow(self):
        self.relay(self.random.uniform(1, 10), delay_s=self.random.uniform(0.05, 0.4))

    def fault_network_is_cut(self):
        self.relay(self.random.uniform(0.5, 15), cut=True)

    # ---- what the operating system does not give

    def failing(self, who, door, seconds, **how):
        plan = self.hall.plans[who]
        plan.fail(door, self.random.randint(1, 20), **how)
        self.after(seconds, plan.calm)

    def fault_disk_is_full(self):
        self.failing("server", "write", self.random.uniform(0.2, 6), on=True)

    def fault_disk_fails_to_sync(self):
        self.failing("server", "sync", self.random.uniform(0.2, 3), on=True)

    def fault_no_descriptors(self):
        self.failing("server", self.random.choice(("open", "accept", "socket")), self.random.uniform(0.2, 3), on=True)

    def fault_no_threads(self):
        self.failing("server", "thread", self.random.uniform(0.2, 3), on=True)

    def fault_server_short_of_memory_once(self):
        self.failing("server", "memory", 5)

    def fault_server_without_memory(self):
        self.failing("server", "memory", 1, on=True)
        self.hall.forget_uncertain()

    def fault_station_short_of_memory_once(self):
        self.failing(self.some_station(), "memory", 5)

    def fault_sockets_fail(self):
        self.failing("server", self.random.choice(("send", "receive")), 0.5)

    def fault_clock_of_the_server_steps(self):
        self.hall.plans["server"].step_clock(self.random.choice((-3600, -2, -0.15, 0, 0.15, 2, 3600)))

    def fault_clock_of_a_station_steps(self):
        self.hall.plans[self.some_station()].step_clock(self.random.choice((-3600, -2, -0.15, 0, 0.15, 2, 3600)))

    # ---- people: no faults, but they meet them

    def person_pauses(self):
        name = self.some_station()
        self.hall.ask("pause", name)
        self.after(self.random.uniform(1, 5), lambda: self.hall.ask("start", name))

    def person_undoes_or_resets(self):
        self.hall.ask(self.random.choice(("undo", "undo", "reset")), self.some_station())

    def person_begins_a_new_session(self):
        name = self.some_station()
        self.hall.ask("stop", name)
        self.hall.ask("start", name)

    def person_copies_a_session(self):
        traces = sorted(name for name in os.listdir(self.hall.traces) if name.endswith(".trace"))
        self.hall.ask("copy", self.some_station(), "--from", os.path.join(self.hall.traces, self.random.choice(traces)))


# ---- the end --------------------------------------------------------------------------------------


def end_in_order(hall, faults):
    faults.undo_due(all_of_them=True)
    for plan in hall.plans.values():
        plan.calm()
        plan.step_clock(0)
    hall.look_after()
    for name in hall.names:
        hall.ask("start", name)
        try:
            wait_until(f"poses of {name} after all faults", lambda: hall.session(name)["state"] == "running", PATIENCE_S)
            hall.wait_for_steps(20, name)
        except (AssertionError, StopIteration) as why:
            hall.wrong.append(f"{name} does not train any more: {why}")
    hall.measure()
    for name, station in hall.stations.items():
        if station.end() != 0:
            hall.judge_end("station", station)
        hall.count_poses(name, station)
    wait_until("older traces are closed", lambda: all(info(hall, name)["whole"] or name in open_now(hall)
                                                      for name in traces(hall)), PATIENCE_S)
    hall.server.end()
    hall.end_relays()
    for process in hall.processes:
        process.end()


def traces(hall):
    return sorted(name for name in os.listdir(hall.traces) if name.endswith(".trace"))


def info(hall, name):
    return call_json("arthron-trace", "info", os.path.join(hall.traces, name), code=None)


def open_now(hall):
    return {os.path.basename(session["trace"]) for session in hall.sessions()}


def judge_traces(hall):
    verdicts, steps, missing = collections.Counter(), 0, 0
    for name in traces(hall):
        path = os.path.join(hall.traces, name)
        said = subprocess.run([program("arthron-trace"), "replay", path, "--json"], capture_output=True, text=True)
        verdict = json.loads(said.stdout)["verdict"] if said.stdout.strip() else said.stderr.strip()
        verdicts[verdict] += 1
        told = info(hall, name)
        signature = call_json("arthron-trace", "verify", path, "--authority", hall.keys + "/authority.pem",
                              code=None)["signature"]
        steps, missing = steps + told.get("steps", 0), missing + told.get("missing", 0)
        if verdict != "identical" and not told.get("missing"):
            hall.wrong.append(f"{name}: {verdict}")
        if not told["whole"] or signature != "good":
            hall.wrong.append(f"{name}: whole: {told['whole']}, signature: {signature}")
    left = [name for name in os.listdir(hall.traces) if not name.endswith(".trace")]
    if left:
        hall.wrong.append(f"left among the traces: {left}")
    return verdicts, steps, missing


def judge_audit(hall):
    rows = call_json("arthron-server", "records", "--file", hall.path("records.db"), "list", "audit")
    noted = collections.Counter(row["action"] for row in rows)
    for word, count in collections.Counter(word for _, word in hall.answered).items():
        if noted[word] < count:
            hall.wrong.append(f"{word} was answered {count} times, and is in the audit log {noted[word]} times")
    return sum(noted.values())


def report(hall, faults, seconds):
    verdicts, steps, missing = judge_traces(hall)
    rows = judge_audit(hall)
    say(f"soak of {seconds / 3600:.2f} h with seed {hall.seed}, {len(hall.names)} stations")
    say(f"  poses: {hall.poses['sent']} sent and {hall.poses['warped']} answered, as stations that ended in order "
        f"say; {steps} steps in {sum(verdicts.values())} traces, {missing} told as missing")
    say(f"  pages: {hall.poses['pages answered']} answered, {hall.poses['pages not answered']} not")
    say(f"  commands: {len(hall.answered) + hall.uncertain} answered, {rows} rows in the audit log")
    for kind, count in sorted(faults.counts.items()):
        say(f"  {count:5d} times {kind}")
    for kind, count in sorted(hall.ended.items()):
        say(f"  {count:5d} times {kind}")
    for what, values in (("KiB of memory", hall.rss_kb), ("descriptors", hall.descriptors)):
        if values:
            say(f"  the server's {what}: {values[0]} at the start, {values[-1]} at the end, {max(values)} at most")
    say(f"  {hall.starts} starts of the server; replay: {dict(verdicts)}")
    for wrong in hall.wrong:
        say(f"  WRONG: {wrong}")
    say("  nothing was lost, nothing differs" if not hall.wrong else f"  {len(hall.wrong)} faults of the programs")


def go_on(hall, faults, end_s):
    while time.monotonic() < end_s:
        faults.undo_due()
        hall.look_after()
        if hall.random.random() < 0.35:
            faults.one()
        hall.measure()
        time.sleep(hall.random.uniform(0.2, 2.5))


def run(hours, seed, stations):
    Hall.setUpClass()
    hall = Hall(seed, stations)
    faults = Faults(hall)
    stop = threading.Event()
    begun = time.monotonic()
    try:
        hall.setUp()
        pages = threading.Thread(target=hall.browse, args=(stop,))
        pages.start()
        for name in hall.names:
            wait_until(f"a session of {name}", lambda: hall.session(name)["state"] == "running", PATIENCE_S)
            hall.wait_for_steps(20, name)
        say(f"all run, in {hall.folder}")
        go_on(hall, faults, begun + hours * 3600)
        end_in_order(hall, faults)
        stop.set()
        pages.join()
        report(hall, faults, time.monotonic() - begun)
    finally:
        stop.set()
        for process in hall.processes:
            if process.process.poll() is None:
                process.process.send_signal(signal.SIGCONT)
                process.process.kill()
                process.process.wait()
        hall.end_relays()
    if hall.wrong:
        say(f"  its folder is kept: {hall.folder}")
        Hall.shared._finalizer.detach()
        return 1
    Hall.tearDownClass()
    return 0
