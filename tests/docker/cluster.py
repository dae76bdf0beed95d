"""What several servers that share stations do when one of them, or of the NATS servers, is lost."""

import collections
import json
import os
import re
import tempfile
import time
import unittest

from engine import docker
from hall import PATIENCE_S, SOCKET, Stand, wait_until

SERVERS = ("a", "b", "c")
NATS = ("nats-1", "nats-2", "nats-3")
ROOMS = tuple(f"room-{i}" for i in range(1, 7))
TISSUE = ("group", "mesh_number", "mesh_hash", "cuts", "removed_mm3", "pieces_mm3", "volume_mm3")
CUTS = 2  # that the mock-ups' motion makes
LEASE_S = 12  # so long without a renewal, and a server counts as dead
BUFFERED_STEPS = 20  # that a server which is paused still had to write

centre = None  # set by `run`


def session_of(trace):
    """What the names of all parts of a session begin with."""
    return re.sub(r"(-p\d+)?\.trace$", "", os.path.basename(trace))


class Centre(Stand):
    """Three servers, three NATS servers and six rooms."""

    def __init__(self, source, tag):
        super().__init__(source, tag, "cluster.yaml")
        self.losses = collections.Counter()  # how often the server of a session was lost

    def is_healthy(self, service):
        return self.inspect(service)["State"]["Health"]["Status"] == "healthy"

    def sessions(self):
        """room: (server, session) of each that is served with its station there."""
        found = {}
        for server in SERVERS:
            for session in self.sessions_of(server):
                if session["connected"] and session["state"] in ("running", "paused"):
                    found.setdefault(session["station"], []).append((server, session))
        twice = {room: [server for server, _ in at] for room, at in found.items() if len(at) > 1}
        if twice:
            raise AssertionError(f"served by two: {twice}")
        return {room: at[0] for room, at in found.items()}

    def ask(self, server, command, room):
        done = self.on(server, "arthron-server", "session", "--socket", SOCKET, command, room, "--json")
        return json.loads(done.stdout)

    def tissue(self, server, room):
        return [{key: part[key] for key in TISSUE} for part in self.ask(server, "show", room)["resections"]]

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
        wait_until("all rooms train", self.all_train, 2 * PATIENCE_S)

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


class Losses(InTheCentre):
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
                                                    for tissue in tissues().values()), 3 * PATIENCE_S)
        for room in ROOMS:
            centre.ask(at[room], "pause", room)
        tissue = wait_until("the last cut", rests)
        wait_until("others could go on", lambda: not any(s["unprotected"] for _, s in centre.sessions().values()))
        return centre.sessions(), tissue

    def go_on(self):
        for room, (server, _) in centre.sessions().items():
            centre.ask(server, "start", room)
        self.assert_all_go_on()

    def lose(self, how):
        """Takes away the server with most rooms. Returns it and its sessions, once others serve them as they were."""
        before, tissue = self.rest()
        rooms = {server: [room for room, (at, _) in before.items() if at == server] for server in SERVERS}
        lost = max(SERVERS, key=lambda server: len(rooms[server]))
        centre.inject(how, lost)
        since = time.monotonic()

        def taken():
            now = centre.sessions()
            for room in rooms[lost]:
                if room in now and now[room][0] != lost:
                    centre.recovered.setdefault(room, round(time.monotonic() - since, 1))
            return len(centre.recovered) == len(rooms[lost]) and len(now) == len(ROOMS) and now
        now = wait_until(f"the rooms of {lost} run elsewhere", taken)
        for room in ROOMS:
            server, session = now[room]
            self.assertEqual((session["id"], session["state"]), (before[room][1]["id"], "paused"), room)
            self.assertEqual(centre.tissue(server, room), tissue[room], room)
            if room not in rooms[lost]:
                self.assertEqual(server, before[room][0], room)
        self.go_on()
        sessions = [before[room][1] for room in rooms[lost]]
        centre.losses.update(session_of(session["trace"]) for session in sessions)
        return lost, sessions

    def test_other_servers_go_on_where_one_is_killed(self):
        lost, _ = self.lose("kill")
        centre.inject("start", lost)
        wait_until(f"{lost} healthy", lambda: centre.is_healthy(lost))
        self.assert_all_go_on()

    def test_a_server_that_was_paused_serves_nothing_of_what_was_taken(self):
        lost, sessions = self.lose("pause")
        steps = [int(centre.trace(lost, "info", session["trace"])["steps"]) for session in sessions]
        centre.inject("unpause", lost)
        taken = {session["station"] for session in sessions}

        def closed():
            states = {s["station"]: s["state"] for s in centre.sessions_of(lost)}
            return states and all(states[room] == "closed" for room in taken)
        wait_until("its sessions are closed", closed)
        self.assert_all_go_on()
        self.assertTrue(closed())
        for session, count in zip(sessions, steps):
            after = int(centre.trace(lost, "info", session["trace"])["steps"])
            self.assertLess(after - count, BUFFERED_STEPS, session["station"])

    def test_all_go_on_without_any_one_of_the_nats_servers(self):
        before = {room: (at, session["id"]) for room, (at, session) in centre.sessions().items()}
        for nats in NATS:
            centre.inject("kill", nats)
            time.sleep(LEASE_S)
            self.assert_all_go_on()
            wait_until("others could go on", lambda: not any(s["unprotected"] for _, s in centre.sessions().values()))
            centre.inject("start", nats)
            wait_until(f"{nats} healthy", lambda: centre.is_healthy(nats))
        self.assertEqual({room: (at, session["id"]) for room, (at, session) in centre.sessions().items()}, before)


class Parts(InTheCentre):
    def test_the_parts_of_each_session_verify_as_one(self):
        centre.injected.append("stop of all")
        centre.compose("stop", "--timeout", str(PATIENCE_S))
        with tempfile.TemporaryDirectory(prefix="arthron-docker-") as folder:
            os.chmod(folder, 0o755)
            sessions = self.copied(folder)
            for name, files in sessions.items():
                self.assert_one_session(folder, name, files)
                self.assertEqual(len(files), 1 + centre.losses[name], name)

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
        done = docker("run", "--rm", "--network", "none", "--read-only", "-v", f"{folder}:/copied:ro", "--entrypoint",
                      "arthron-trace", f"arthron/server:{centre.tag}", "verify", *files, "--authority",
                      "/copied/authority.pem", "--json", check=False)
        found = json.loads(done.stdout)
        parts = found["parts"] if len(files) > 1 else [dict(found, part=1)]
        self.assertEqual((done.returncode, found.get("one_session", True), found.get("why", "")), (0, True, ""), name)
        self.assertEqual(sorted(part["part"] for part in parts), list(range(1, len(files) + 1)), name)
        for part in parts:
            self.assertEqual((part["missing"], part["damages"]), (0, []), name)
            self.assertEqual(part["signature"], "good" if part["whole"] else "none", name)
