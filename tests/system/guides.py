#!/usr/bin/env python3
"""What the guides for beginners, technicians and researchers show is run as it is written there: the commands and
configs are read from the documents. Only places, addresses and the length of the demo are others."""

import glob
import os
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time
import unittest

from arthron import BIN, CASES, PATIENCE_S, SOURCE, SystemTest, call_json, free_port, program, text_of, wait_until
from manuals import Manual

PROGRAMS = ("case", "mockup", "server", "station", "trace")


def document(name):
    return Manual(os.path.join(SOURCE, "docs", name))


def run(line, folder, environment=None):
    """The output of a command, which must succeed."""
    done = subprocess.run(["bash", "-c", line], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, timeout=240)
    if done.returncode:
        raise AssertionError(f"{line}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def newest(pattern):
    return max(glob.glob(pattern), key=os.path.getmtime)


class Start(unittest.TestCase):
    """The demo in a tree of its own, with programs that are built already and one recipe."""

    def setUp(self):
        self.tree = tempfile.mkdtemp(prefix="arthron-start-")
        self.addCleanup(shutil.rmtree, self.tree)
        os.chmod(self.tree, 0o755)
        for name in ("demo", "docker/packages/fresh-build-folder", "station/mockup/play-week"):
            os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
            shutil.copy(os.path.join(SOURCE, name), self.path(name))
        for name in ("arthrosis", "motions"):
            shutil.copytree(os.path.join(SOURCE, "cases", name), self.path("cases/" + name))
        os.makedirs(self.path("build/release/bin"))
        for name in PROGRAMS:
            shutil.copy(program("arthron-" + name), self.path("build/release/bin"))
        os.mkdir(self.path("bin"))
        for name in ("bin/cmake", "docker/packages/install"):
            with open(self.path(name), "w") as file:
                file.write("#!/bin/sh\n")
            os.chmod(self.path(name), 0o755)
        self.hold_the_usual_port()

    def path(self, name):
        return os.path.join(self.tree, name)

    def hold_the_usual_port(self):
        """So the demo takes a free one, and not this one, which another program may take meanwhile."""
        held = socket.socket()
        self.addCleanup(held.close)
        try:
            held.bind(("127.0.0.1", 4880))
        except OSError:
            pass  # another program has it

    def test_the_start_shows_a_session_and_what_it_recorded(self):
        guide = document("START.md")
        environment = {**os.environ, "PATH": f"{self.path('bin')}:{os.environ['PATH']}"}
        [demo] = guide.commands("2-run-it")
        said = run(demo.replace("--seconds 60", "--seconds 3"), self.tree, environment)
        self.assertIn("poses sent", said)
        trace = os.path.relpath(newest(self.path("run/traces/demo-*.trace")), self.tree)
        commands = guide.commands("3-look-at-what-was-recorded", "4-compute-it-again")
        self.assertGreaterEqual(len(commands), 5)
        for line in commands:
            self.assertIn("demo-….trace", line)
            run(line.replace("run/traces/demo-….trace", trace), self.tree)
        self.assertIn("<svg", text_of(self.path("run/session.html")))


class Centre(SystemTest):
    """The server and the station of INSTALL.md, whose folders begin in that of the test."""

    def setUp(self):
        super().setUp()
        self.etc, self.kept, self.station_kept = self.path("etc"), self.path("server"), self.path("station")
        for folder in (self.etc, self.path("run"), self.path("backups"), self.station_kept, os.path.join(self.kept, "cases")):
            os.makedirs(folder)
        os.symlink(os.path.join(CASES, "arthrosis"), os.path.join(self.kept, "cases/arthrosis"))
        os.symlink(os.path.join(SOURCE, "cases/tasks"), os.path.join(self.kept, "cases/tasks"))
        self.socket = self.path("run/server.sock")
        self.code = "CODE"
        self.install = document("INSTALL.md")
        self.start_mockup()
        [init] = [line for line in self.install.commands("2-the-server") if "keys init" in line]
        self.do(init)
        self.serve()

    def here(self, text):
        """As a document says it, at the places of this test."""
        traces = glob.glob(os.path.join(self.kept, "traces/room-1-*.trace"))
        trace = os.path.basename(max(traces, key=os.path.getmtime)) if traces else "no trace"
        for there, ours in (("runuser -u arthron -- ", ""), ("runuser -u arthron-station -- ", ""),
                            ("-o arthron -g arthron ", ""), ("/etc/arthron", self.etc),
                            ("/var/lib/arthron-station", self.station_kept), ("/var/lib/arthron", self.kept),
                            ("/var/backups", self.path("backups")), ("/run/arthron", self.path("run")),
                            ("arthron-server session ", f"arthron-server session --socket {self.socket} "),
                            ("/usr/share/doc/arthron-tools", os.path.join(SOURCE, "docs")), ("CODE", self.code),
                            ("server.example.org:4810", f"127.0.0.1:{self.port}"), ("127.0.0.1:5020", self.modbus),
                            ("10.0.0.9:502", self.modbus), ("127.0.0.1:18944", self.tracker),
                            ("10.0.0.8:18944", self.tracker), ("room-1-….trace", trace)):
            text = text.replace(there, ours)
        return text

    def do(self, line):
        if line.startswith("systemctl "):
            return ""  # tests/docker/packages runs the services
        return run(self.here(line), self.folder, {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"})

    def config(self, chapter, section):
        """The config that INSTALL.md shows in the chapter, which begins with the section."""
        [text] = [block for block in self.install.blocks(chapter) if block.startswith(section)]
        return self.here(text)

    def serve(self):
        self.write("etc/server.ini", self.config("2-the-server", "[server]"))
        self.web_port = free_port()
        ports = {"server.port": self.port, "server.udp_port": self.udp_port, "web.port": self.web_port,
                 "server.address": "127.0.0.1", "server.workers": 1}
        options = [word for key, value in ports.items() for word in ("--set", f"{key}={value}")]
        config = os.path.join(self.etc, "server.ini")
        self.start("server", "arthron-server", "run", "--config", config, *options).wait_for_log("ready")

    def follow(self, guide, *chapters):
        """Runs the commands of the chapters, and returns what each said."""
        return [self.do(line) for chapter in chapters for line in guide.commands(chapter)]

    def enrol_by(self, guide):
        make, enrol, *rest = guide.commands("enrol")
        self.code = self.do(make).strip()
        self.do(enrol)
        return rest

    def configure_station(self):
        """As INSTALL.md shows, and calibrated."""
        date = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        self.write("station/calibration.ini",
                   f"[tip tracker probe]\ndate = {date}\nresidual = 0.1\ntip_mm = 0 0 0\n")
        self.write("etc/station.ini", self.config("3-a-station", "[station]"))

    def do_until_it_succeeds(self, line):
        """On a busy machine the check finds answers that come late. Then it is run again, as a technician would."""
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                return self.do(line)
            except AssertionError:
                if time.monotonic() > end:
                    raise

    def run_station(self):
        self.start("room-1", "arthron-station", "run", "--config", os.path.join(self.etc, "station.ini"))
        wait_until("a session", lambda: self.session()["steps"] > 20)

    def shown_certificate(self):
        return ssl.get_server_certificate(("127.0.0.1", self.web_port))

    # ---- the guides

    def test_a_technician_enrols_checks_backs_up_restores_and_renews(self):
        guide = document("TECHNICIAN.md")
        [revoke] = self.enrol_by(guide)
        self.do(revoke)
        self.enrol_by(guide)  # a station that was revoked
        self.configure_station()
        [probed] = self.follow(guide, "probe")
        self.assertIn("[device ", probed)
        _, check, _, list_stations = guide.commands("check")
        self.assertIn("room-1: ready", self.do_until_it_succeeds(check))
        self.assertIn("room-1", self.do(list_stations))
        self.follow(guide, "back-up")
        self.assertTrue(glob.glob(self.path("backups/arthron/*.db")))
        *_, verified = self.follow(guide, "restore")
        self.assertIn("the audit log is whole", verified)
        self.assertTrue(glob.glob(os.path.join(self.kept, "records.db.replaced-*")))
        self.run_station()
        [renew] = guide.commands("renew")
        before = self.shown_certificate()
        self.do(renew)
        wait_until("a new certificate", lambda: self.shown_certificate() != before)
        self.wait_for_steps()

    def test_a_researcher_gets_tables_and_traces_of_a_study(self):
        guide = document("STUDY.md")
        self.enrol_by(document("TECHNICIAN.md"))
        self.configure_station()
        self.run_station()
        self.follow(guide, "pseudonyms")
        for line in guide.commands("run"):
            self.do(line)
            if " start room-1" in line or " begin room-1" in line:
                self.wait_for_steps(20)
        db = os.path.join(self.kept, "records.db")

        def rows(what):
            return call_json("arthron-server", "records", "--file", db, "list", what)
        wait_until("the attempt's row", lambda: rows("attempts"))
        wait_until("the ends of the sessions", lambda: all(row["state"] == "closed" for row in rows("sessions")))
        self.follow(guide, "export")
        [read_tables], [read_trace] = (guide.blocks(chapter, language="python") for chapter in ("export", "traces"))
        told = run_python(self.here(read_tables))
        self.assertRegex(told, r"^trainee-\d+ palpation not yet ")
        self.follow(guide, "traces")
        table = text_of(os.path.join(self.kept, "p01.csv"))
        self.assertTrue(table.startswith("t_seconds,input,flexion_deg,probe_tx_mm"))
        self.assertRegex(run_python(self.here(read_trace)), r"^\d+ steps, flexion from ")
        self.assertIn("traces/room-1-", self.follow(guide, "withdrawal")[0])


def run_python(text):
    done = subprocess.run([sys.executable, "-B", "-c", text], capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise AssertionError(f"{text}\n{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    unittest.main()
