"""What the tests run in containers, and a training hall of it."""

import csv
import json
import os
import re
import shutil
import time

from engine import docker, run

ROOMS = ("room-1", "room-2", "room-3")
SOCKET = "/var/lib/arthron/server.sock"
PATIENCE_S = 90  # only ends what hangs: other programs may load the machine


def wait_until(what, condition, seconds=PATIENCE_S):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.1)
    raise AssertionError(f"waited {seconds} s in vain: {what}")


def session_of(trace):
    """What the names of all parts of a session begin with."""
    return re.sub(r"(-p\d+)?\.trace$", "", os.path.basename(trace))


def part_of(trace):
    part = re.search(r"-p(\d+)\.trace$", trace)
    return int(part[1]) if part else 1


class Stand:
    """What a compose file of the project runs, under a name of its own. more: files beside it."""

    def __init__(self, source, tag, file, *more):
        self.project = f"arthron-test-{os.getpid()}-{os.path.splitext(file)[0]}"
        self.tag = tag
        self.files = [os.path.join(source, "docker", file), *more]
        self.injected = []  # what the running test did from outside
        self.variables = {}  # of the files
        self.recovered = {}  # room: seconds from the fault's end to the first frame with all devices

    def compose(self, *arguments):
        tool = ["docker-compose"] if shutil.which("docker-compose") else ["docker", "compose"]
        any_port = {name: "" for name in ("ARTHRON_CONSOLE", *(f"ARTHRON_CONSOLE_{server}" for server in "ABC"))}
        files = [word for file in self.files for word in ("-f", file)]
        return run(*tool, "-p", self.project, *files, *arguments, timeout=600,
                   env=dict(os.environ, ARTHRON_TAG=self.tag, **any_port, **self.variables))

    def open(self):
        self.compose("up", "-d", "--no-build")
        services = self.compose("config", "--services").stdout.split()
        ids = {service: self.compose("ps", "-q", service).stdout.strip() for service in services}
        self.containers = {service: id for service, id in ids.items() if id}

    def close(self):
        self.compose("down", "--volumes", "--timeout", "5")

    def inspect(self, service):
        return json.loads(docker("inspect", self.containers[service]).stdout)[0]

    def on(self, service, *command, check=True):
        return docker("exec", self.containers[service], *command, check=check)

    def sessions_of(self, server):
        listed = self.on(server, "arthron-server", "session", "--socket", SOCKET, "list", "--json", check=False)
        return json.loads(listed.stdout)["sessions"] if listed.returncode == 0 else []

    def inject(self, *command):
        """docker COMMAND SERVICE, and remembers it for the report."""
        words = [self.containers.get(word, word) for word in command]
        self.injected.append(" ".join(command))
        return docker(*words)

    def in_network_of(self, service, *command):
        """Runs this machine's own program inside a container's network."""
        pid = str(self.inspect(service)["State"]["Pid"])
        return run("nsenter", "-t", pid, "-n", *command)


class Hall(Stand):
    """A training hall: one server and three rooms."""

    def __init__(self, source, tag):
        super().__init__(source, tag, "compose.yaml")

    # ---- questions

    def address(self, room):
        return self.inspect(room)["NetworkSettings"]["Networks"][f"{self.project}_center"]["IPAddress"]

    def on_server(self, *command, check=True):
        return self.on("server", *command, check=check)

    def sessions(self):
        return self.sessions_of("server")

    def session(self, room):
        return next((s for s in self.sessions() if s["station"] == room), None)

    def trace(self, command, path):
        """What arthron-trace says of a trace, and its exit code."""
        done = self.on_server("arthron-trace", command, path, "--json", check=False)
        return json.loads(done.stdout), done.returncode

    def rows(self, room, since):
        """The steps in a room's trace from a moment (time.time()) on."""
        session = self.session(room)
        if not session or not session["trace"]:
            return []
        start = since - session["start_utc_s"]
        table = self.on_server("arthron-trace", "export", session["trace"], "--csv", "-", "--from", f"{start:.3f}",
                               check=False).stdout
        return list(csv.DictReader(table.splitlines()))

    def wait_for(self, room, what, good, since=None, steps=20):
        """Waits for steps of which `good` is true, recorded after `since`; returns all rows from then."""
        since = since or time.time()

        def enough():
            rows = self.rows(room, since)
            return rows if sum(map(good, rows)) >= steps else None
        return wait_until(f"{room}: {what}", enough)

    def wait_for_silence(self, room, since):
        """Waits for steps without a frame. A session that rests makes one in ten seconds."""
        self.wait_for(room, "steps without frames", lambda row: row["frame_number"] == "0", since, steps=5)

    # ---- what is done to it from outside

    def plug(self, action, network, service, *options):
        self.injected.append(f"network {action} {network} {service}")
        docker("network", action, *options, f"{self.project}_{network}", self.containers[service])
