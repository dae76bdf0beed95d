"""What several servers that share stations do when one of them, or of the NATS servers, is lost."""

import collections
import json
import os
import shutil
import struct
import tempfile
import time
import unittest

from engine import SOURCE, docker
from hall import PATIENCE_S, SOCKET, Stand, part_of, session_of, wait_until
from history import Part, Said, faults_of
from watch import Watch

SERVERS = ("a", "b", "c")
NATS = ("nats-1", "nats-2", "nats-3")
ROOMS = tuple(f"room-{i}" for i in range(1, 7))
TISSUE = ("group", "mesh_number", "mesh_hash", "cuts", "removed_mm3", "pieces_mm3", "volume_mm3")
CUTS = 2  # that the mock-ups' motion makes
HOUR_S = 3600
LEASE_S = 12  # so long without a renewal, and a server counts as dead
BUFFERED_STEPS = 20  # that a server which is paused still had to write
STATIONS, CLIENTS, ROUTES = "4810:4899", "4222", "6222"  # ports: of servers; of NATS for servers, and for NATS
DISK = "/var/lib/arthron/jetstream"

centre = None  # set by `run`


class Centre(Stand):
    """Three servers, three NATS servers and six rooms."""

    def __init__(self, source, tag):
        super().__init__(source, tag, "cluster.yaml", os.path.join(SOURCE, "tests/docker/changes.yaml"))
        self.losses = collections.Counter()  # how often a session went on at another server
        self.seen, self.said = [], []  # the history so far
        self.watches = {}
        self.ahead_s = {server: [0] for server in SERVERS}  # by so much its clock is, or was, ahead

    def open(self):
        self.make_clocks()
        self.opened = time.time()
        super().open()
        self.watches = {server: Watch(server, self.containers[server], ROOMS, self.seen) for server in SERVERS}

    def close(self):
        self.end_watches()
        super().close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def make_clocks(self):
        """A library with a clock that is wrong by what a file of each server says, for changes.yaml."""
        self.folder = self.variables["ARTHRON_CLOCKS"] = tempfile.mkdtemp(prefix="arthron-docker-")
        os.chmod(self.folder, 0o755)
        docker("run", "--rm", "--network", "none", "-v", f"{self.folder}:/clocks", "-v",
               f"{SOURCE}/tests/system/wrong_clock.c:/wrong_clock.c:ro", f"arthron/build:{self.tag}", "gcc", "-shared",
               "-fPIC", "-o", "/clocks/wrong_clock.so", "/wrong_clock.c")
        for server in SERVERS:
            with open(os.path.join(self.folder, server), "wb") as file:
                file.write(struct.pack("=q", 0))

    def set_clock(self, server, ahead_s):
        """For all that runs in its container, from now on."""
        self.injected.append(f"clock of {server} ahead by {ahead_s} s")
        with open(os.path.join(self.folder, server), "r+b") as file:
            file.write(struct.pack("=q", ahead_s))
        self.ahead_s[server].append(ahead_s)

    def right_time(self, server, at):
        """What this machine's clock showed at a time in a trace: it is wrong by hours, and the tests take minutes."""
        return next(at - ahead_s for ahead_s in self.ahead_s[server] if self.opened <= at - ahead_s <= time.time())

    def end_watches(self):
        for watch in self.watches.values():
            watch.end()
        self.watches = {}

    def is_healthy(self, service):
        return self.inspect(service)["State"]["Health"]["Status"] == "healthy"

    def sessions_of(self, server):
        return self.watches[server].sessions()[1]

    def sessions(self):
        """room: (server, session) of each that is served with its station there. Where several servers say so, the
        one with the latest part: the others do not know yet. What they do meanwhile is in the history."""
        found = {}
        for server in SERVERS:
            begun, sessions = self.watches[server].sessions()
            for session in sessions:
                if session["connected"] and session["state"] in ("running", "paused"):
                    found.setdefault(session["station"], []).append((part_of(session["trace"]), begun, server, session))
        return {room: max(at, key=lambda one: one[:2])[2:] for room, at in found.items()}

    def ask(self, server, command, room):
        done = self.on(server, "arthron-server", "session", "--socket", SOCKET, command, room, "--json")
        return json.loads(done.stdout)

    def note_in_all(self):
        """Tells a trainee something in each room, at the server that has its session."""
        for room, (server, session) in self.sessions().items():
            text = f"note {len(self.said)}"
            self.on(server, "arthron-server", "session", "--socket", SOCKET, "note", room, text, "--json")
            self.said.append(Said(time.time(), session_of(session["trace"]), text))

    def cut(self, service, ports):
        """Nothing passes between a container and these ports, on either side. Returns what ends it."""
        if os.geteuid() != 0:
            raise unittest.SkipTest("dropping packets in a container's network needs root")
        self.injected.append(f"{service} cut off from port {ports}")
        rules = [[chain, "-p", protocol, side, ports, "-j", "DROP"] for chain in ("INPUT", "OUTPUT")
                 for protocol in ("tcp", "udp") for side in ("--sport", "--dport")]

        def change(action):
            for rule in rules:
                self.in_network_of(service, "iptables", action, *rule)
        change("-A")
        return lambda: change("-D")

    def tissue(self, server, room):
        """As it is from now on."""
        since = time.time()
        answer = wait_until(f"what {server} says of {room}", lambda: self.watches[server].show(room, since))
        return [{key: part[key] for key in TISSUE} for part in answer["resections"]]

    def trace(self, server, command, *arguments):
        """What arthron-trace says of a server's traces, be it paused or dead."""
        done = docker("run", "--rm", "--network", "none", "--read-only", "--volumes-from",
                      f"{self.containers[server]}:ro", "--entrypoint", "arthron-trace", f"arthron/server:{self.tag}",
                      command, *arguments, "--json", check=False)
        return json.loads(done.stdout)


class InTheCentre(unittest.TestCase):
    @staticmethod
    def stand():
        return centre

    def setUp(self):
        centre.injected, centre.recovered = [], {}
        for room, (server, session) in centre.sessions().items():
            if session["state"] == "paused":  # a test before has failed
                centre.ask(server, "start", room)
        wait_until("all rooms train", self.all_train)

    def all_train(self):
        sessions = centre.sessions()
        return len(sessions) == len(ROOMS) and all(s["state"] == "running" for _, s in sessions.values())

    def all_steps(self):
        return {room: (at, session["id"], session["steps"]) for room, (at, session) in centre.sessions().items()}

    def assert_all_go_on(self):
        """Every room at its server, in its session."""
        before = self.all_steps()
        self.assertEqual(sorted(before), sorted(ROOMS))

        def more():
            now = self.all_steps()
            return all(room in now and now[room][2] >= before[room][2] + 50 for room in ROOMS) and now
        now = wait_until("more steps", more)
        self.assertEqual({room: at[:2] for room, at in now.items()}, {room: at[:2] for room, at in before.items()})

    def cut(self, service, ports):
        """Until doCleanups."""
        self.addCleanup(centre.cut(service, ports))

    def wait_for_protection(self):
        wait_until("others could go on", lambda: not any(s["unprotected"] for _, s in centre.sessions().values()))

    def wait_for_health(self, service):
        wait_until(f"{service} healthy", lambda: centre.is_healthy(service))

    def wait_for_other_servers(self, lost, sessions):
        """Until all rooms are served, and those that `lost` had elsewhere: in another part of their sessions."""
        since = time.monotonic()

        def taken():
            now = centre.sessions()
            for room in sessions:
                if room in now and now[room][0] != lost:
                    centre.recovered.setdefault(room, round(time.monotonic() - since, 1))
            return all(room in now and now[room][0] != lost for room in sessions) and len(now) == len(ROOMS) and now
        now = wait_until(f"the rooms of {lost} run elsewhere", taken)
        for room, session in sessions.items():
            self.assertEqual(now[room][1]["id"], session["id"], room)
            centre.losses[session_of(session["trace"])] += 1
        return now


class Losing(InTheCentre):
    def rest(self):
        """Pauses all sessions once something is cut in each. A cut that is on its way lands all the same."""
        at = {room: server for room, (server, _) in centre.sessions().items()}

        def tissues():
            return {room: centre.tissue(at[room], room) for room in ROOMS}

        def rests():
            before = tissues()
            time.sleep(2)
            return before == tissues() and before
        wait_until("cuts in each room", lambda: all(sum(part["cuts"] for part in tissue) >= CUTS
                                                    for tissue in tissues().values()))
        for room in ROOMS:
            centre.ask(at[room], "pause", room)
        centre.note_in_all()
        tissue = wait_until("the last cut", rests)
        self.wait_for_protection()
        return centre.sessions(), tissue

    def go_on(self):
        for room, (server, _) in centre.sessions().items():
            centre.ask(server, "start", room)
        self.assert_all_go_on()
        centre.note_in_all()

    def lose(self, how):
        """Takes away the server with most rooms. Returns it and its sessions, once others serve them as they were."""
        before, tissue = self.rest()
        count = collections.Counter(server for server, _ in before.values())
        lost = max(SERVERS, key=lambda server: count[server])
        sessions = {room: session for room, (server, session) in before.items() if server == lost}
        how(lost)
        now = self.wait_for_other_servers(lost, sessions)
        for room in ROOMS:
            server, session = now[room]
            self.assertEqual((session["id"], session["state"]), (before[room][1]["id"], "paused"), room)
            self.assertEqual(centre.tissue(server, room), tissue[room], room)
            if room not in sessions:
                self.assertEqual(server, before[room][0], room)
        self.go_on()
        return lost, sessions

    def wait_until_closed(self, lost, sessions):
        def closed():
            states = {s["station"]: s["state"] for s in centre.sessions_of(lost)}
            return states and all(states[room] == "closed" for room in sessions)
        wait_until(f"the sessions at {lost} are closed", closed)
        self.assert_all_go_on()
        self.assertTrue(closed())


class Losses(Losing):
    def test_a_clock_that_is_wrong_stops_nobody(self):
        """Clocks are still wrong in the tests that follow."""
        for server, ahead_s in (("a", 30 * 24 * HOUR_S), ("b", 2 * HOUR_S)):
            centre.set_clock(server, ahead_s)
        time.sleep(LEASE_S)
        self.assert_all_go_on()

    def test_others_go_on_where_one_server_is_killed_and_then_a_second_one(self):
        lost = [self.lose(lambda server: centre.inject("kill", server))[0] for _ in range(2)]
        for server in lost:
            centre.inject("start", server)
        for server in lost:
            self.wait_for_health(server)
        centre.set_clock("a", 0)
        self.assert_all_go_on()

    def test_sessions_go_on_while_one_server_after_the_other_is_restarted(self):
        for server in SERVERS:
            sessions = {room: session for room, (at, session) in centre.sessions().items() if at == server}
            centre.inject("kill", "--signal", "USR1", server)
            self.wait_for_other_servers(server, sessions)
            centre.inject("stop", server)
            centre.inject("start", server)
            self.wait_for_health(server)
            self.wait_for_protection()
            centre.note_in_all()
        self.assert_all_go_on()


class Partitions(Losing):
    """What takes longer: those who are paused, and connections that are cut."""

    def test_a_server_that_was_paused_serves_nothing_of_what_was_taken(self):
        lost, sessions = self.lose(lambda server: centre.inject("pause", server))
        steps = {room: int(centre.trace(lost, "info", s["trace"])["steps"]) for room, s in sessions.items()}
        centre.inject("unpause", lost)
        self.wait_until_closed(lost, sessions)
        for room, session in sessions.items():
            after = int(centre.trace(lost, "info", session["trace"])["steps"])
            self.assertLess(after - steps[room], BUFFERED_STEPS, room)

    def test_a_server_goes_on_without_nats_but_not_without_stations(self):
        def cut_off(server):
            self.cut(server, CLIENTS)
            time.sleep(LEASE_S)
            self.assert_all_go_on()
            unprotected = {room for room, (_, session) in centre.sessions().items() if session["unprotected"]}
            self.assertEqual(unprotected, {room for room, (at, _) in centre.sessions().items() if at == server})
            self.cut(server, STATIONS)
        lost, sessions = self.lose(cut_off)
        self.doCleanups()
        self.wait_until_closed(lost, sessions)
        self.wait_for_protection()

    def test_all_go_on_without_any_one_of_the_nats_servers(self):
        """The third one is cut off from the others first, and its disk is full: then it has to do for one of these."""
        before = {room: (at, session["id"]) for room, (at, session) in centre.sessions().items()}
        self.cut("nats-3", ROUTES)
        time.sleep(LEASE_S)
        self.assert_all_go_on()
        self.doCleanups()
        self.wait_for_health("nats-3")
        centre.injected.append("disk of nats-3 full")
        centre.on("nats-3", "dd", "if=/dev/zero", f"of={DISK}/full", "bs=1M", check=False)
        time.sleep(LEASE_S)
        self.assert_all_go_on()
        self.wait_for_protection()
        centre.on("nats-3", "rm", f"{DISK}/full")
        centre.inject("restart", "nats-3")
        self.wait_for_health("nats-3")
        for nats in NATS:
            centre.inject("kill", nats)
            time.sleep(LEASE_S)
            self.assert_all_go_on()
            self.wait_for_protection()
            centre.note_in_all()
            centre.inject("start", nats)
            self.wait_for_health(nats)
        self.assertEqual({room: (at, session["id"]) for room, (at, session) in centre.sessions().items()}, before)


class Parts(InTheCentre):
    def test_the_parts_of_each_session_verify_as_one_and_agree_with_what_was_seen(self):
        centre.end_watches()
        centre.injected.append("stop of all")
        centre.compose("stop", "--timeout", str(PATIENCE_S))
        with tempfile.TemporaryDirectory(prefix="arthron-docker-") as folder:
            os.chmod(folder, 0o755)
            sessions = self.copied(folder)
            for name, files in sessions.items():
                self.assert_one_session(folder, name, files)
                self.assertEqual(len(files), 1 + centre.losses[name], name)
            parts = self.parts(folder, [file for files in sessions.values() for file in files])
        self.assertEqual(faults_of(centre.seen, centre.said, parts), [])
        self.assertGreater(len(centre.seen), 100)
        self.assertGreater(len(centre.said), len(ROOMS))

    def on_copies(self, folder, *command):
        return docker("run", "--rm", "--network", "none", "--read-only", "-v", f"{folder}:/copied:ro", "--entrypoint",
                      command[0], f"arthron/server:{centre.tag}", *command[1:], check=False, timeout=300)

    def copied(self, folder):
        """The traces of all servers, in a folder of each, and the authority: name of the session: its files."""
        sessions = {}
        docker("cp", f"{centre.containers['a']}:/var/lib/arthron/keys/authority.pem", folder)
        os.chmod(os.path.join(folder, "authority.pem"), 0o644)
        for server in SERVERS:
            docker("cp", f"{centre.containers[server]}:/var/lib/arthron/traces", os.path.join(folder, server))
            os.chmod(os.path.join(folder, server), 0o755)
            for name in os.listdir(os.path.join(folder, server)):
                os.chmod(os.path.join(folder, server, name), 0o644)
                if name.endswith(".trace"):
                    sessions.setdefault(session_of(name), []).append(f"/copied/{server}/{name}")
        return sessions

    def assert_one_session(self, folder, name, files):
        done = self.on_copies(folder, "arthron-trace", "verify", *files, "--authority", "/copied/authority.pem",
                              "--json")
        found = json.loads(done.stdout)
        parts = found["parts"] if len(files) > 1 else [dict(found, part=1)]
        self.assertEqual((done.returncode, found.get("one_session", True), found.get("why", "")), (0, True, ""), name)
        self.assertEqual(sorted(part["part"] for part in parts), list(range(1, len(files) + 1)), name)
        for part in parts:
            self.assertEqual((part["missing"], part["damages"]), (0, []), name)
            self.assertEqual(part["signature"], "good" if part["whole"] else "none", name)

    def parts(self, folder, files):
        told = self.on_copies(folder, "bash", "-c", 'for file; do arthron-trace info "$file" --json; done', "-",
                              *files).stdout
        parts = []
        for file in files:
            info, end = json.JSONDecoder().raw_decode(told.lstrip())
            told = told.lstrip()[end:]
            begun, ended = (centre.right_time(info["server"], info[end]) for end in ("from_utc_s", "until_utc_s"))
            parts.append(Part(info["server"], info["station"], session_of(file), info["part"], info["token"],
                              begun, ended,
                              frozenset(remark["text"] for remark in info["remarks"]),
                              sum(part["cuts"] for part in info["resections"])))
        return parts
