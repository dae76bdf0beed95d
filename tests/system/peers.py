#!/usr/bin/env python3
"""What several servers ask of each other, through a real NATS server."""

import gzip
import hashlib
import http.server
import json
import os
import shutil
import signal
import socket
import ssl
import threading
import time
import unittest
from urllib.parse import parse_qs, urlsplit

from arthron import call, call_json, text_of, wait_until
from asking import PASSWORD
from several import Several


def bytes_of(path):
    with open(path, "rb") as f:
        return f.read()


def content_of(folder):
    """As sha256sum would have it."""
    lines = "".join(f"{hashlib.sha256(bytes_of(os.path.join(folder, name))).hexdigest()}  {name}\n"
                    for name in ("anatomy.glb", "case.json"))
    return hashlib.sha256(lines.encode()).hexdigest()


class Servers(Several):
    def test_each_server_tells_of_all(self):
        self.begin()

        def rows(name):
            return {row["name"]: row for row in self.servers_at(name)}

        for name in self.names:
            known = rows(name)
            self.assertEqual(sorted(known), ["a", "b"])
            for row in known.values():
                self.assertEqual(row, {"name": row["name"], "pages": f"127.0.0.1:{self.web_ports[row['name']]}",
                                       "lives": True, "this": row["name"] == name, "stations": 0})
        self.at("a")
        self.enrol("room-1")
        self.start_mockup()
        self.start_station()
        wait_until("the session at a", lambda: rows("b")["a"]["stations"] == 1)
        self.assertEqual(rows("a")["a"]["stations"], 1)
        self.servers["a"].end(signal.SIGKILL)
        wait_until("a to be dead", lambda: not rows("b")["a"]["lives"])
        wait_until("the session at b", lambda: rows("b")["b"]["stations"] == 1)
        self.assertEqual(rows("b")["a"]["stations"], 0)


class Liar(http.server.ThreadingHTTPServer):
    """Another server, which has a case to give and does `fault` to it."""

    daemon_threads = True

    def __init__(self, keys, folder, fault="", host="127.0.0.1"):
        self.folder, self.fault = folder, fault
        self.asked = []
        super().__init__((host, 0), Answer)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(os.path.join(keys, "server.pem"), os.path.join(keys, "server.key"))
        self.socket = context.wrap_socket(self.socket, server_side=True, do_handshake_on_connect=False)
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def handle_error(self, request, client_address):
        pass  # the other side went away

    def end(self):
        self.shutdown()
        self.server_close()


class Answer(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *words):
        pass

    def files(self):
        return {name: bytes_of(os.path.join(self.server.folder, name)) for name in ("anatomy.glb", "case.json")}

    def list(self):
        fault = self.server.fault
        rows = [{"name": name, "size": len(data), "sha256": hashlib.sha256(data).hexdigest()}
                for name, data in self.files().items()]
        if fault == "a path":
            rows.append({"name": "../../stolen", "size": 3, "sha256": rows[0]["sha256"]})
        elif fault == "another case":
            rows[0]["sha256"] = "0" * 64
        elif fault == "a huge file":
            rows[0]["size"] = 1 << 40
        elif fault == "a file is missing":
            rows.pop()
        elif fault == "no list":
            return b"[" * 3000
        elif fault == "an endless list":
            return b" " * 100_000
        return json.dumps({"files": rows}).encode()

    def do_GET(self):
        url, fault = urlsplit(self.path), self.server.fault
        self.server.asked.append((url.path, parse_qs(url.query)["hash"], self.headers["Authorization"]))
        name = url.path.removeprefix("/api/v1/peer/cases").lstrip("/")
        if fault == "it hangs" or (fault == "a file hangs" and name):
            time.sleep(60)
        data = self.files()[name] if name else self.list()
        if name == "anatomy.glb" and fault == "wrong bytes":
            data = data[:-1] + bytes([data[-1] ^ 1])
        if name == "anatomy.glb" and fault == "half a file":
            data = data[:len(data) // 2]
        self.send_response(302 if fault == "elsewhere" else 200)
        if fault == "elsewhere":
            self.send_header("Location", "https://127.0.0.1:1/")
        if name and fault == "an endless file":
            self.send_header("Connection", "close")
            self.end_headers()
            while True:
                self.wfile.write(bytes(65536))
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)


class Cases(Several):
    """Server b pins the case that server a has, or somebody who is not to be believed."""

    def setUp(self):
        super().setUp()
        self.folder_of_a = os.path.join(self.cases, "healthy")
        self.hash = content_of(self.folder_of_a)
        self.dir = self.path("cases-b/healthy")
        os.mkdir(self.path("cases-b"))

    def launch_b(self, **more):
        return self.launch("b", **{"case healthy__dir": self.dir, "case healthy__hash": self.hash, **more})

    def refused(self, why, **more):
        server = self.launch_b(statuses=(1,), **more)
        self.assertEqual(server.process.wait(timeout=60), 1)
        self.assertIn(why, server.log())
        return server.log()

    def left(self):
        return sorted(os.listdir(self.path("cases-b")))

    def assert_fetched(self):
        self.assertEqual(content_of(self.dir), self.hash)

    def test_a_missing_case_comes_from_the_server_that_has_it(self):
        self.assertEqual(call_json("arthron-case", "info", self.folder_of_a)["sha256"], self.hash)
        self.start_named("a")
        server = self.launch_b()
        server.wait_for_log("ready on port")
        self.assertIn("case healthy: fetched from server a", server.log())
        self.assert_fetched()
        self.assertEqual(self.left(), ["healthy"])
        server.end()
        self.servers["a"].end()
        again = self.launch_b()  # it asks nobody
        again.wait_for_log("ready on port")
        self.assertNotIn("fetched", again.log())

    def test_another_content_is_kept_aside_and_a_check_comes_along(self):
        shutil.copytree(os.path.join(self.cases, "arthrosis"), self.dir)
        other = content_of(self.dir)
        folder = self.path("cases-a")
        shutil.copytree(self.folder_of_a, folder)
        with open(os.path.join(folder, "check.json"), "w") as f:
            f.write('{"a": 1}')
        self.start_named("a", **{"case healthy__dir": folder})
        server = self.launch_b(**{"case healthy__dir": self.dir + "/"})
        server.wait_for_log("ready on port")
        self.assert_fetched()
        self.assertEqual(text_of(os.path.join(self.dir, "check.json")), '{"a": 1}')
        kept = [name for name in self.left() if name.startswith("healthy.until-")]
        self.assertEqual(sorted(["healthy", *kept]), self.left())
        self.assertEqual(content_of(self.path("cases-b/" + kept[0])), other)
        self.assertIn("kept as " + self.path("cases-b/" + kept[0]), server.log())

    def test_nobody_has_it(self):
        self.hash = "0123456789abcdef" * 4
        self.start_named("a")
        self.refused("case healthy: no other server gave it; ")
        self.assertEqual(self.left(), [])
        shutil.copytree(self.folder_of_a, self.dir)
        log = self.refused(f"{self.dir} has the hash {content_of(self.dir)[:16]}…, and not {self.hash[:16]}… of the config")
        self.assertNotIn("Traceback", log)
        self.nats.end()
        self.refused("case healthy: other servers are not known (NATS")
        self.assertEqual(self.left(), ["healthy"])

    def test_a_server_alone_refuses_another_content(self):
        shutil.copytree(os.path.join(self.cases, "arthrosis"), self.dir)
        self.server_config(self.stations)
        words = ("--set", f"case healthy.dir={self.dir}", "--set", f"case healthy.hash={self.hash}")
        done = call("arthron-server", "run", "--config", self.path("server.ini"), *words, code=1)
        self.assertIn(f"case healthy: {self.dir} has the hash {content_of(self.dir)[:16]}…", done.stderr)

    def tell_of(self, name, pages, secret="00ff" * 16):
        """Writes a server's key into the bucket, as NATS' own clients do."""
        value = json.dumps({"stations": "", "pages": pages, "secret": secret, "life": "0f", "write": 1})
        with socket.create_connection(("127.0.0.1", self.nats_port), timeout=10) as s:
            message = f"CONNECT {{}}\r\nPUB $KV.arthron-lease.server.{name} {len(value)}\r\n{value}\r\nPING\r\n"
            s.sendall(message.encode())
            answer = b""
            while b"PONG" not in answer:
                answer += s.recv(4096)

    def test_who_lies_is_not_believed(self):
        """The bucket is there once a server was. The right one is asked too."""
        self.start_named("a")
        self.servers["a"].end()
        for fault, why in (("wrong bytes", "anatomy.glb came otherwise than it was told"),
                           ("half a file", "anatomy.glb came otherwise than it was told"),
                           ("another case", "its list is of another case"),
                           ("a path", "its list of the case's files is none"),
                           ("a file is missing", "its list of the case's files is none"),
                           ("a huge file", "its list of the case's files is none"),
                           ("no list", "its list of the case's files is none"),
                           ("an endless list", "the answer has more than 4096 bytes"),
                           ("an endless file", "the answer has more than"),
                           ("elsewhere", "status 302"),
                           ("a file hangs", "Operation too slow")):
            with self.subTest(fault=fault):
                liar = Liar(self.keys, self.folder_of_a, fault)
                self.tell_of("liar", f"127.0.0.1:{liar.server_address[1]}")
                log = self.refused("case healthy: no other server gave it")
                self.assertIn(f"case healthy: server liar: https://127.0.0.1:{liar.server_address[1]}: {why}", log)
                self.assertEqual(self.left(), [])
                self.assertEqual(liar.asked[0], ("/api/v1/peer/cases", [self.hash], "Bearer " + "00ff" * 16))
                liar.end()
        self.assertFalse(os.path.exists(self.path("stolen")))
        liar = Liar(self.keys, self.folder_of_a, "wrong bytes")
        self.tell_of("liar", f"127.0.0.1:{liar.server_address[1]}")
        self.start_named("a")
        self.launch_b().wait_for_log("ready on port")
        self.assert_fetched()
        liar.end()

    def test_who_cannot_show_the_authoritys_certificate_is_told_no_secret(self):
        self.start_named("a")
        self.servers["a"].end()
        call("arthron-server", "keys", "init", self.path("other-keys"))
        for keys, host, why in ((self.path("other-keys"), "127.0.0.1", "certificate"),
                                (self.keys, "127.0.0.2", "127.0.0.2")):
            liar = Liar(keys, self.folder_of_a, host=host)
            self.tell_of("liar", f"{host}:{liar.server_address[1]}")
            log = self.refused("no other server gave it")
            self.assertIn(why, next(line for line in log.splitlines() if "server liar" in line))
            self.assertEqual(liar.asked, [])
            liar.end()


TASK = """
[task]
title = A look
briefing = Look at the notch.
limit_s = 300
[pass]
time_s = 50
source = for a test
[goal notch]
see = notch
hold_s = 10
"""


class Relayed(Several):
    """Who is signed in at one server asks there what another one has to answer."""

    def setUp(self):
        super().setUp()
        os.mkdir(self.path("tasks"))
        self.write("tasks/look.ini", TASK)

    def settings_of(self, name):
        return {**super().settings_of(name), "server.tasks": self.path("tasks")}

    def keys_of(self, name):
        """One authority, and lists of its own for each server."""
        folder = self.path("keys-of-" + name)
        if not os.path.exists(folder):
            shutil.copytree(self.keys, folder)
        return folder

    def enrol_at(self, name):
        keys, self.keys, self.port = self.keys, self.keys_of(name), self.ports[name]
        self.enrol("room-1")
        self.keys = keys

    def run_station(self):
        self.at("a")
        self.enrol_at("a")
        self.start_mockup()
        self.start_station()
        self.at("a")
        wait_until("the session at a", lambda: self.session()["state"] == "running")
        wait_until("b to know", lambda: self.servers_at("b")[1]["stations"] == 1)

    def test_a_command_reaches_the_station_through_any_server(self):
        self.begin()
        self.run_station()
        at = "/stations/room-1/attempt"
        self.at("b")
        self.ask("POST", at, {"task": "look"}, self.token, 204)
        refused = self.ask("POST", at, {"task": "look"}, self.token, 409).json["error"]
        self.assertEqual(refused, {"code": "conflict", "text": "station room-1: an attempt runs: look."})
        self.ask("DELETE", at, None, self.token, 204)
        self.ask("POST", at, {"task": "look"}, "0" * 64, 401)
        self.assertEqual(self.ask("POST", at, {"wrong": "look"}, self.token, 400).json["error"]["code"], "wrong_field")
        # One that says it was passed on is not passed on: there is no session at b.
        self.ask("POST", at, {"task": "look"}, self.token, 409, {"Via": "1.1 arthron-server"})
        # A server that hangs is told, and holds up nothing else.
        self.servers["a"].process.send_signal(signal.SIGSTOP)
        self.away = []
        waits = [threading.Thread(target=self.ask_away, args=(at,)) for _ in range(8)]
        for one in waits:
            one.start()
        self.get("/servers", self.token)
        self.assertTrue(any(one.is_alive() for one in waits))
        for one in waits:
            one.join()
        self.assertEqual({code for code, _ in self.away}, {"away", "busy"}, self.away)
        self.assertIn("Server a has this, and does not answer.", [text for _, text in self.away])

    def ask_away(self, at):
        error = self.ask("POST", at, {"task": "look"}, self.token, 503).json["error"]
        self.away.append((error["code"], error["text"]))

    def test_a_station_that_is_revoked_at_one_server_is_out_at_all(self):
        """Its certificate was issued at a, and it would go on at b."""
        self.begin()
        self.run_station()
        self.at("b")
        self.ask("POST", "/stations/room-1/revoke", {}, self.token, 204)
        for name in self.names:
            self.assertEqual(len(text_of(os.path.join(self.keys_of(name), "revoked")).splitlines()), 1, name)
        wait_until("the station to be out", lambda: not any(
            s["connected"] for name in self.names for s in self.sessions_at(name)))
        self.enrol_at("b")
        wait_until("it to be in again", lambda: any(
            s["connected"] for name in self.names for s in self.sessions_at(name)))
        self.servers["b"].end()
        wait_until("b to be away", lambda: not self.servers_at("a")[1]["lives"])
        error = self.ask("POST", "/stations/room-1/revoke", {}, self.token, 503).json["error"]
        self.assertEqual(error["text"], "Station room-1 is revoked, but not yet at these servers, which are away: b. "
                                        "Revoke it again once they are back.")
        self.start_named("b")
        wait_until("b to be back", lambda: self.servers_at("a")[1]["lives"])
        self.ask("POST", "/stations/room-1/revoke", {}, self.token, 204)
        lists = [sorted(line.split()[0] for line in text_of(os.path.join(self.keys_of(name), "revoked")).splitlines())
                 for name in self.names]
        self.assertEqual(lists[0], lists[1])
        self.assertEqual(len(lists[0]), 2)
        wait_until("the station to be out", lambda: not any(
            s["connected"] for name in self.names for s in self.sessions_at(name)))

    def test_a_trace_and_a_report_come_through_any_server(self):
        self.begin()
        self.run_station()
        self.at("a")
        self.wait_for_steps(100)
        self.servers["a"].end(signal.SIGUSR1)
        self.at("b")
        wait_until("the session at b", lambda: self.session()["state"] == "running")
        self.wait_for_steps(100)
        self.start_named("a")
        self.at("b")
        self.session_command("stop", "room-1")
        self.at("a")
        closed = wait_until("the closed session with its results", lambda: next(
            (s for s in self.get("/sessions", self.token)["sessions"]
             if s["state"] == "closed" and s["trace_xxh3"] and s["server"] == "b"), None))
        at = "/sessions/" + closed["id"]
        self.assertEqual(closed["part"], 2)
        self.assertEqual([(p["number"], p["server"]) for p in self.get(at, self.token)["parts"]], [(1, "a")])
        files = {1: self.trace_at("a"), 2: self.trace_at("b")}
        for name in self.names:
            self.at(name)
            whole = self.ask("GET", at + "/trace", who=self.token)
            self.assertEqual(whole.bytes, bytes_of(files[2]))
            self.assertEqual(whole.headers["Content-Disposition"], f'attachment; filename="{closed["id"]}.trace"')
            first = self.ask("GET", at + "/trace?part=1", who=self.token)
            self.assertEqual(first.bytes, bytes_of(files[1]))
            self.assertEqual(first.headers["Content-Disposition"], f'attachment; filename="{closed["id"]}-p1.trace"')
            self.ask("GET", at + "/trace?part=3", who=self.token, status=404)
            self.ask("GET", at + "/trace?part=x", who=self.token, status=400)
            for status, span in ((206, "bytes=100-299"), (206, "bytes=-50"), (416, "bytes=999999999-")):
                part = self.ask("GET", at + "/trace", who=self.token, status=status, headers={"Range": span})
                size = len(whole.bytes)
                expected = {"bytes=100-299": (f"bytes 100-299/{size}", whole.bytes[100:300]),
                            "bytes=-50": (f"bytes {size - 50}-{size - 1}/{size}", whole.bytes[-50:])}
                self.assertEqual((part.headers["Content-Range"], part.bytes),
                                 expected.get(span, (f"bytes */{size}", b"")), (name, span))
            report = self.ask("GET", at + "/report", who=self.token, headers={"Accept-Encoding": "gzip"})
            self.assertIn("style-src 'unsafe-inline'", report.headers["Content-Security-Policy"])
            self.assertIn(closed["id"], gzip.decompress(report.bytes).decode())
            self.ask("GET", at + "/trace", who="0" * 64, status=401)
        self.assertEqual([name for name in os.listdir(self.path("traces-a")) if not self.is_of_trace(name)], [])
        # Who has come in a moment ago, and who may not.
        self.at("a")
        grace = self.sign_in(name="grace", password=PASSWORD)
        for i in range(5):
            new = self.ask("POST", "/tokens", {"name": f"new {i}"}, grace, 201).json["token"]
            self.ask("GET", at + "/trace", who=new)
        self.ask("POST", "/trainees", {"name": "eve"}, self.token, 201)
        eve = self.sign_in(code=self.ask("POST", "/trainees/eve/code", {}, self.token, 201).json["code"])
        self.ask("GET", at + "/trace", who=eve, status=404)
        self.ask("DELETE", at, None, eve, 403)
        # The server that has it is away.
        self.servers["b"].end()
        self.assertEqual(self.ask("GET", at + "/trace", who=self.token, status=503).json["error"],
                         {"code": "away", "text": "Server b has this, and is away."})
        self.ask("DELETE", at, None, self.token, 503)
        self.start_named("b")
        self.at("a")
        wait_until("b to be back", lambda: self.servers_at("a")[1]["lives"])
        self.ask("DELETE", at, None, self.token, 204)
        self.assertFalse(os.path.exists(files[2]))
        wait_until("the first part to be gone", lambda: not os.path.exists(files[1]))
        wait_until("a to forget it", lambda: closed["id"] not in [
            s["id"] for s in self.get("/sessions", self.token)["sessions"]])

    def is_of_trace(self, name):
        return name.endswith((".trace", ".state", ".life", ".lock"))

    def trace_at(self, name):
        folder = self.path("traces-" + name)
        return next(os.path.join(folder, file) for file in os.listdir(folder) if file.endswith(".trace"))

    def sessions_at(self, name):
        self.at(name)
        return self.sessions()


if __name__ == "__main__":
    unittest.main()
