#!/usr/bin/env python3
"""What the server tells monitors: /metrics for Prometheus, /healthz and /readyz, rules and dashboard beside it."""

import json
import os
import re
import signal
import subprocess
import unittest

from arthron import SOURCE, call_json, text_of, wait_until
from asking import Asking, PASSWORD
from bites import Bites
from several import Several
from prometheus_client.openmetrics.parser import text_string_to_metric_families as openmetrics
from prometheus_client.parser import text_string_to_metric_families as plain
from watchdog_programs import Watchdog, stop_thread

EXAMPLES = os.path.join(SOURCE, "docs/examples/prometheus")
has_ended = Watchdog.has_ended
del Watchdog  # its tests are not of this file
OPENMETRICS = {"Accept": "application/openmetrics-text;version=1.0.0;q=0.8,text/plain;version=0.0.4;q=0.3"}
OF_SEVERAL = {"arthron_nats_connected", "arthron_lease_left_seconds"}  # of a server that is not alone
SUFFIXES = ("_bucket", "_count", "_sum")


def promtool(*words, text=None):
    done = subprocess.run(["promtool", *words], input=text, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


def samples(families):
    return {(s.name, *sorted(s.labels.items())): s.value for family in families for s in family.samples}


class Watching(Bites, Asking):
    def start_server(self):
        web = f"records = records.db\nkeep_days = 3650\n[web]\naddress = 127.0.0.1\nport = {self.web_port}"
        return super().start_server(extra=web)

    def setUp(self):
        super().setUp()
        grace = self.make_first(self.server)
        self.token = self.ask("POST", "/tokens", {"name": "prometheus"}, grace, 201).json["token"]

    def text(self, **headers):
        answer = self.ask("GET", "/metrics", who=self.token, headers=headers)
        return answer.bytes.decode()

    def figures(self):
        return samples(openmetrics(self.text(**OPENMETRICS)))

    def line(self, path, status):
        return self.ask("GET", path, status=status).bytes.decode().rstrip("\n")

    # ---- the formats

    def test_both_formats_are_what_their_readers_want(self):
        self.start_station()
        self.wait_for_cuts(1)
        text = self.text()
        self.assertEqual(promtool("check", "metrics", text=text), (0, ""))
        self.assertTrue(list(plain(text)))
        answer = self.ask("GET", "/metrics", who=self.token, headers=OPENMETRICS)
        self.assertEqual(answer.headers["Content-Type"], "application/openmetrics-text; version=1.0.0; charset=utf-8")
        families = list(openmetrics(answer.bytes.decode()))
        self.assertEqual({f.name for f in families if f.type == "histogram"},
                         {"arthron_step_seconds", "arthron_answer_seconds", "arthron_cut_seconds"})
        refused = self.ask("GET", "/metrics", who=self.token, headers={"Accept": "application/openmetrics-text;q=0"})
        self.assertEqual(refused.headers["Content-Type"], "text/plain; version=0.0.4; charset=utf-8")

    def test_it_is_for_staff_and_where_monitors_expect_it(self):
        self.assertEqual(self.ask("GET", "/metrics", status=401).json["error"]["code"], "not_signed_in")
        at = ["curl", "-sS", "--cacert", os.path.join(self.keys, "authority.pem"), "-H",
              f"Authorization: Bearer {self.token}", f"https://127.0.0.1:{self.web_port}"]
        for path, begin in (("/metrics", "# HELP arthron_build_info"), ("/healthz", "ok\n"), ("/readyz", "ok\n")):
            told = subprocess.run([*at[:-1], at[-1] + path], capture_output=True, text=True, timeout=30).stdout
            self.assertTrue(told.startswith(begin), (path, told[:200]))

    # ---- the values

    def test_counters_grow_and_agree_with_session_list_and_trace(self):
        before = self.figures()
        station = self.start_station()
        self.wait_for_cuts(2)
        during = self.figures()
        self.assertEqual(during["arthron_sessions", ("state", "running")], 1)
        self.assertEqual(during["arthron_stations_connected",], 1)
        self.pause()
        station.end()
        wait_until("the station's leave", lambda: not self.session()["connected"])
        listed, figures = self.session(), self.figures()
        self.assertEqual(figures["arthron_sessions", ("state", "paused")], 1)
        self.assertEqual(figures["arthron_stations_connected",], 0)
        room = ("station", "room-1")
        for fate in ("lost", "late", "old", "early", "invalid", "excess"):
            self.assertGreaterEqual(figures[f"arthron_poses_{fate}_total", room], listed[f"frames_{fate}"])
        self.assertEqual(figures["arthron_poses_lost_total", room], listed["frames_lost"])
        taken = figures["arthron_poses_taken_total", room]
        self.assertGreater(taken, 100)
        self.assertEqual(figures["arthron_answer_seconds_count",], taken)
        self.assertGreaterEqual(figures["arthron_step_seconds_count",], taken)
        for earlier, later in ((before, during), (during, figures)):
            for key, value in earlier.items():
                if key[0].endswith(("_total", *SUFFIXES)):
                    self.assertGreaterEqual(later[key], value, key)

        self.session_command("stop", "room-1")
        trace = listed["trace"]
        figures = self.figures()
        self.server.end()
        info = call_json("arthron-trace", "info", trace)
        self.assertEqual(figures["arthron_step_seconds_count",], info["steps"])
        self.assertEqual(figures["arthron_cuts_landed_total", ("outcome", "done")], info["events"]["cut"])
        self.assertGreaterEqual(figures["arthron_cuts_asked_total",], info["events"]["cut"])
        landed = sum(value for key, value in figures.items() if key[0] == "arthron_cuts_landed_total")
        self.assertEqual(figures["arthron_cut_seconds_count",], landed)

    def test_wrong_passwords_and_answers_are_counted(self):
        before = self.figures()
        for _ in range(3):
            self.ask("POST", "/sign-in", {"name": "grace", "password": PASSWORD + "!"}, status=401)
        after = self.figures()
        self.assertEqual(after["arthron_sign_ins_failed_total",] - before["arthron_sign_ins_failed_total",], 3)
        rise = {c: after["arthron_http_answers_total", ("class", c)] - before["arthron_http_answers_total", ("class", c)]
                for c in ("2xx", "4xx", "5xx")}
        self.assertEqual(rise, {"2xx": 1, "4xx": 3, "5xx": 0})

    def test_disk_records_and_certificates(self):
        figures = self.figures()
        disk = os.statvfs(self.traces)
        self.assertEqual(figures["arthron_traces_disk_size_bytes",], disk.f_blocks * disk.f_frsize)
        self.assertGreaterEqual(figures["arthron_records_bytes",], os.path.getsize(self.path("records.db")))
        for name, days in (("authority", 3650), ("server", 730), ("web", 730)):
            left_s = figures["arthron_certificate_left_seconds", ("certificate", name)]
            self.assertAlmostEqual(left_s / 86400, days, delta=1)

    def test_the_log_is_json_on_request(self):
        self.server.end()
        self.server = self.start("json", "arthron-server", "run", "--config", self.path("server.ini"), "--log", "json")
        self.server.wait_for_log("ready")
        lines = [json.loads(line) for line in self.server.log().splitlines()]
        self.assertTrue(all({"time", "level", "room", "message"} <= line.keys() for line in lines))
        self.assertIn(("server", f"ready on port {self.port}"), [(line["room"], line["message"]) for line in lines])

    # ---- health

    def test_ready_says_why_not(self):
        self.assertEqual((self.line("/healthz", 200), self.line("/readyz", 200)), ("ok", "ok"))
        os.rename(self.path("records.db"), self.path("away.db"))
        with open(self.path("records.db"), "w") as f:
            f.write("no database " * 100)
        self.assertEqual(self.line("/readyz", 503), "the records cannot be opened")
        self.assertEqual(self.line("/healthz", 200), "ok")
        os.replace(self.path("away.db"), self.path("records.db"))
        self.assertEqual(self.line("/readyz", 200), "ok")
        os.rename(self.traces, self.path("elsewhere"))
        self.assertEqual(self.line("/readyz", 503), "the disk of the traces has no room")
        os.rename(self.path("elsewhere"), self.traces)
        self.assertEqual(self.line("/readyz", 200), "ok")

    def test_a_loop_that_hangs_is_told(self):
        folder = f"/proc/{self.server.process.pid}/task"
        threads = {text_of(f"{folder}/{thread}/comm").strip(): int(thread) for thread in os.listdir(folder)}
        self.traced = threads["control"]
        try:
            stop_thread(self.traced)
        except PermissionError:
            self.skipTest("threads may not be traced here")
        try:
            told = wait_until("a loop that hangs", lambda: self.fault_at("/healthz"))
            self.assertEqual(told, "the loop of stations does not answer\n")
            self.assertEqual(self.fault_at("/readyz"), told)
        finally:
            self.server.statuses.add(-signal.SIGKILL)
            self.server.process.kill()
            wait_until("it ends", lambda: has_ended(self))

    def fault_at(self, path):
        """Its line; None while there is none."""
        try:
            return self.ask("GET", path, status=503).bytes.decode()
        except AssertionError:
            return None

    # ---- rules and dashboard

    def names_told(self):
        """As queries name them."""
        return {key[0] for key in self.figures()} | OF_SEVERAL

    def test_rules_and_dashboard_name_what_is_there(self):
        told = self.names_told()
        rules = text_of(os.path.join(EXAMPLES, "alerts.yml"))
        board = json.loads(text_of(os.path.join(EXAMPLES, "dashboard.json")))
        queries = [target["expr"] for panel in board["panels"] for target in panel.get("targets", [])]
        self.assertGreater(len(queries), 10)
        for text in (rules, *queries):
            named = set(re.findall(r"\barthron_\w+", text))
            self.assertFalse(named - told, named - told)
        self.assertGreater(len(set(re.findall(r"\barthron_\w+", rules))), 10)

    def test_each_figure_is_in_the_document_and_no_other(self):
        names = {re.sub("(_bucket|_count|_sum)$", "", name) for name in self.names_told()}
        document = text_of(os.path.join(SOURCE, "docs/WATCHING.md"))
        self.assertEqual(names, set(re.findall(r"`(arthron_\w+)", document)))

    def test_rules_do_what_their_tests_say(self):
        code, said = promtool("check", "rules", os.path.join(EXAMPLES, "alerts.yml"))
        self.assertEqual(code, 0, said)
        code, said = promtool("test", "rules", os.path.join(EXAMPLES, "alerts.test.yml"))
        self.assertEqual(code, 0, said)


class WatchingSeveral(Several):
    def figures(self, name):
        self.at(name)
        answer = self.ask("GET", "/metrics", who=self.token, headers=OPENMETRICS)
        return samples(openmetrics(answer.bytes.decode()))

    def figure(self, server, name):
        return self.figures(server)[(f"arthron_{name}",)]

    def test_each_server_tells_whether_others_could_go_on(self):
        self.begin()
        self.at("a")
        self.enrol("room-1")
        self.start_mockup()
        self.start_station()
        wait_until("a protected session", lambda: self.figure("a", "stations_connected") == 1 and
                   self.figure("a", "sessions_unprotected") == 0)
        self.assertEqual([self.figure(name, "nats_connected") for name in self.names], [1, 1])
        self.assertGreater(self.figure("b", "lease_left_seconds"), 0)
        self.nats.end(signal.SIGKILL)
        wait_until("that no other could go on", lambda: self.figure("a", "sessions_unprotected") == 1)
        self.assertEqual([self.figure(name, "nats_connected") for name in self.names], [0, 0])
        self.assertEqual(self.figure("b", "sessions_unprotected"), 0)
        wait_until("the lease's end", lambda: self.figure("a", "lease_left_seconds") == 0)
        self.start_nats()
        wait_until("a protected session again", lambda: self.figure("a", "sessions_unprotected") == 0)
        wait_until("a new lease", lambda: self.figure("a", "lease_left_seconds") > 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
