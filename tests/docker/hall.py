"""A training hall in containers: the project's own compose file under a name of its own."""

import csv
import json
import os
import shutil
import time

from engine import docker, run

ROOMS = ("room-1", "room-2", "room-3")
SOCKET = "/var/lib/arthron/server.sock"
PATIENCE_S = 30


def wait_until(what, condition, seconds=PATIENCE_S):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.1)
    raise AssertionError(f"waited {seconds} s in vain: {what}")


class Hall:
    def __init__(self, source, tag):
        self.project = f"arthron-test-{os.getpid()}"
        self.tag = tag
        self.file = os.path.join(source, "docker", "compose.yaml")
        self.injected = []  # what the running test did from outside
        self.recovered = {}  # room: seconds from the fault's end to the first frame with all devices

    def compose(self, *arguments):
        tool = ["docker-compose"] if shutil.which("docker-compose") else ["docker", "compose"]
        return run(*tool, "-p", self.project, "-f", self.file, *arguments, timeout=180,
                   env=dict(os.environ, ARTHRON_TAG=self.tag, ARTHRON_CONSOLE=""))  # "": any free port

    def open(self):
        self.compose("up", "-d", "--no-build")
        self.containers = {service: self.compose("ps", "-q", service).stdout.strip()
                           for service in ("server", *ROOMS, "mockup-1", "mockup-2", "mockup-3")}

    def close(self):
        self.compose("down", "--volumes", "--timeout", "5")

    # ---- questions

    def inspect(self, service):
        return json.loads(docker("inspect", self.containers[service]).stdout)[0]

    def address(self, room):
        return self.inspect(room)["NetworkSettings"]["Networks"][f"{self.project}_center"]["IPAddress"]

    def on_server(self, *command, check=True):
        return docker("exec", self.containers["server"], *command, check=check)

    def sessions(self):
        listed = self.on_server("arthron-server", "session", "--socket", SOCKET, "list", "--json", check=False)
        return json.loads(listed.stdout)["sessions"] if listed.returncode == 0 else []

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

    def inject(self, *command):
        """docker COMMAND SERVICE, and remembers it for the report."""
        words = [self.containers.get(word, word) for word in command]
        self.injected.append(" ".join(command))
        return docker(*words)

    def plug(self, action, network, service, *options):
        self.injected.append(f"network {action} {network} {service}")
        docker("network", action, *options, f"{self.project}_{network}", self.containers[service])

    def in_network_of(self, service, *command):
        """Runs this machine's own program inside a container's network."""
        pid = str(self.inspect(service)["State"]["Pid"])
        return run("nsenter", "-t", pid, "-n", *command)
