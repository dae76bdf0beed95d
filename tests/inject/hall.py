"""A running server with two stations and what must hold when one of its calls fails: it stays, and refuses what it
cannot do, or ends with a sentence; nothing that it answered is lost, and the other station goes on."""

import collections
import json
import os
import signal
import subprocess
import sys
import time

from failing import Plan

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "system"))
from arthron import CASES, Process, SystemTest, call, call_json, free_port, program, wait_until  # noqa: E402
import bites  # noqa: E402

STATIONS = """
[station room-1]
case = healthy
[station room-2]
case = healthy
"""
ORDERLY = "; the program ends"


class Hall(bites.Bites):
    """Not a test of its own: inject.py drives it."""

    def setUp(self):
        SystemTest.setUp(self)
        self.answered = collections.Counter()
        self.web_port = free_port()
        self.start_mockup()
        self.plan = Plan(self.folder)
        self.ends = []
        self.server = self.start_server()
        for name in ("room-1", "room-2"):
            self.enrol(name)
        self.stations = {name: self.start_station(name) for name in ("room-1", "room-2")}
        for name in self.stations:
            self.wait_for_poses(name)

    def start_server(self, stations=STATIONS, extra=""):
        self.plan.calm()
        extra = f"records = records.db\n[web]\naddress = 127.0.0.1\nport = {self.web_port}\n"
        before = dict(os.environ)
        os.environ.update(self.plan.environment())
        try:
            process = Process(self.folder, f"server-{len(self.ends)}", program("arthron-server"), "run", "--config",
                              self.server_config(stations, extra), statuses=(0, 1))
        finally:
            os.environ.clear()
            os.environ.update(before)
        self.processes.append(process)
        self.ends.append(process)
        process.wait_for_log(" ready on")
        return process

    def session_of(self, name):
        return next((s for s in self.sessions() if s["station"] == name), None)

    def wait_for_poses(self, name, more=5):
        wait_until(f"{name}'s session", lambda: (self.session_of(name) or {}).get("state") == "running", 20)
        self.wait_for_steps(more, name)

    def ask(self, *words):
        """Through the local socket; an answer counts as acknowledged. False: refused, or no answer."""
        try:
            done = call("arthron-server", "session", "--socket", self.socket, *words, code=None)
        except Exception:
            return False
        if done.returncode == 0 and words[0] in ("start", "stop", "pause", "undo", "copy", "note"):
            self.answered[words[0]] += 1
        return done.returncode == 0

    # ---- what a hall does: each of these in a round

    def a_session_begins(self):
        self.ask("stop", "room-1")
        self.ask("start", "room-1")
        time.sleep(0.15)

    def a_session_is_controlled(self):
        self.ask("pause", "room-1")
        self.ask("note", "room-1", "look")
        self.ask("start", "room-1")
        self.ask("undo", "room-1")
        self.ask("list")

    def a_session_is_copied(self):
        trace = next(name for name in sorted(os.listdir(self.traces)) if name.startswith("room-1"))
        self.ask("copy", "room-1", "--from", os.path.join(self.traces, trace))

    def tissue_is_cut(self):
        time.sleep(1)

    def a_station_returns(self):
        self.stations["room-1"].end()
        self.stations["room-1"] = self.start_station("room-1")
        time.sleep(0.3)

    def a_page_is_asked(self):
        from http.client import HTTPSConnection
        import ssl
        context = ssl.create_default_context(cafile=os.path.join(self.keys, "authority.pem"))
        for path in ("/", "/api/v1/stations"):
            try:
                connection = HTTPSConnection("127.0.0.1", self.web_port, context=context, timeout=3)
                connection.request("GET", path)
                connection.getresponse().read()
                connection.close()
            except OSError:
                pass

    # ---- after a round

    def wrong_after(self):
        """"" where all is as it must be; else what is not. A server that ended is started again."""
        self.plan.calm()
        wrong = self.wrong_if_ended()
        for name in ("room-2", "room-1", "room-2"):
            try:
                self.ask("start", name)
                self.wait_for_poses(name)
            except AssertionError as fault:
                if not self.ends_soon():
                    return wrong or f"{name}: {fault}"
                wrong = wrong or self.wrong_if_ended()
        return wrong

    def ends_soon(self):
        """A server without what it needs still writes its traces before it ends."""
        try:
            return self.server.process.wait(5) is not None
        except subprocess.TimeoutExpired:
            return False

    def wrong_if_ended(self):
        if self.server.process.poll() is None:
            return ""
        wrong = self.wrong_end_of_server()
        try:
            self.server = self.start_server()
        except AssertionError:
            wrong = wrong or f"the next start is not ready: {self.ends[-1].log()[-400:]}"
            self.ends[-1].end(signal.SIGKILL)
            self.server = self.start_server()
        return wrong

    def wrong_end_of_server(self):
        status, log = self.server.process.wait(), self.server.log()
        if status < 0:
            return f"the server ended by {signal.Signals(-status).name}: {log.strip().splitlines()[-1][:300]}"
        return "" if status == 1 and ORDERLY in log else f"the server ended with {status}"

    def wrong_at_the_end(self):
        """Once all has ended: the traces and the audit log hold what was answered."""
        wrong = []
        self.plan.calm()
        for station in self.stations.values():
            station.end()
        self.server.end()
        verdicts = collections.Counter()
        for name in sorted(os.listdir(self.traces)):
            path = os.path.join(self.traces, name)
            if not name.endswith(".trace"):
                wrong.append(f"{name} is left")
                continue
            said = call("arthron-trace", "replay", path, "--json", code=None)
            verdict = json.loads(said.stdout)["verdict"] if said.stdout else said.stderr.strip()
            verdicts[verdict] += 1
            if verdict != "identical":
                wrong.append(f"{name}: {verdict}")
            info = call_json("arthron-trace", "info", path)
            told = any(f"{name}: its last" in process.log() for process in self.ends)
            if not info["whole"] and not told:
                wrong.append(f"{name}: not whole at the end")
        rows = call_json("arthron-server", "records", "--file", self.path("records.db"), "list", "audit")
        noted = collections.Counter(row["action"] for row in rows)
        for action, count in self.answered.items():
            if noted[action] < count:
                wrong.append(f"{count} times {action} was answered, and {noted[action]} times it is in the audit log")
        return wrong, verdicts


ROUNDS = ("a_session_begins", "a_session_is_controlled", "a_session_is_copied", "tissue_is_cut", "a_station_returns",
          "a_page_is_asked")
