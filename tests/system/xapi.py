#!/usr/bin/env python3
"""Statements reach a learning record store once each, whatever the store, the network and the server do."""

import base64
import http.server
import json
import os
import signal
import socket
import sqlite3
import ssl
import subprocess
import threading
import time
import unittest
import uuid

from arthron import call, free_port, text_of, wait_until
from asking import Asking

PASSWORD = "correct horse"

TASK = """
[task]
title = A look
briefing = Look at the notch.
limit_s = 60
[pass]
time_s = 50
source = for a test
[goal notch]
see = notch
"""


class Store(http.server.ThreadingHTTPServer):
    """A learning record store as xAPI 1.0.3 describes POST statements: all of a batch or nothing; 409 where it has
    another statement of this id. `faults` are done one by one, before it behaves."""

    daemon_threads = True

    def __init__(self, folder, port, statements=None, faults=(), address="127.0.0.1"):
        self.statements = {} if statements is None else statements
        self.faults, self.requests, self.received, self.wrong = list(faults), 0, 0, []
        self.password = PASSWORD
        self.released = threading.Event()
        super().__init__((address, port), Answer)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(os.path.join(folder, "server.pem"), os.path.join(folder, "server.key"))
        self.socket = context.wrap_socket(self.socket, server_side=True, do_handshake_on_connect=False)
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def handle_error(self, request, client_address):
        pass  # the other side went away

    def end(self):
        self.released.set()
        self.shutdown()
        self.server_close()


class Answer(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def say(self, status, body=b"[]"):
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self):
        store = self.server
        store.requests += 1
        sent = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if self.path != "/lrs/xapi/statements" or self.headers["X-Experience-API-Version"] != "1.0.3" or \
                self.headers["Content-Type"] != "application/json":
            store.wrong.append((self.path, dict(self.headers)))
        wanted = "Basic " + base64.b64encode(f"arthron:{store.password}".encode()).decode()
        if self.headers["Authorization"] != wanted:
            return self.say(401)
        store.received += len(sent)
        return getattr(self, store.faults.pop(0) if store.faults else "take")(sent)

    def take(self, sent):
        had = self.server.statements
        if any("refused" in statement for statement in sent):
            return self.say(400, b"this statement has no verb")
        if any(had.get(statement["id"], statement) != statement for statement in sent):
            return self.say(409)
        for statement in sent:
            had.setdefault(statement["id"], statement)
        return self.say(200, json.dumps([statement["id"] for statement in sent]).encode())

    def hang(self, sent):
        self.server.released.wait()

    def fail(self, sent):
        self.say(500, b"<html>out of order")

    def wait(self, sent):
        self.say(429)

    def die(self, sent):
        self.connection.shutdown(socket.SHUT_RDWR)  # close() would wait for the files that read and write it
        self.close_connection = True

    def die_when_taken(self, sent):
        for statement in sent:
            self.server.statements.setdefault(statement["id"], statement)
        self.die(sent)

    def move(self, sent):
        self.send_response(302)
        self.send_header("Location", "https://127.0.0.1:1/elsewhere")
        self.send_header("Content-Length", "0")
        self.end_headers()


class Xapi(Asking):
    def setUp(self):
        super().setUp()
        self.outbox = os.path.join(self.folder, "statements.jsonl")
        self.authority = os.path.join(self.keys, "authority.pem")
        self.password = os.path.join(self.folder, "password")
        self.write_password(PASSWORD)
        self.store_port = free_port()
        self.stores, self.senders, self.count = [], [], 0

    def tearDown(self):
        for sender in self.senders:
            if sender.poll() is None:
                self.end(sender)
        for store in self.stores:
            store.end()
        super().tearDown()

    def write_password(self, text):
        with open(self.password, "w") as f:
            f.write(text + "\n")

    def open_store(self, *faults, statements=None, address="127.0.0.1"):
        self.stores.append(Store(self.keys, self.store_port, statements, faults, address))
        return self.stores[-1]

    def close_store(self):
        self.stores.pop().end()

    def start_sender(self, host="127.0.0.1"):
        log = open(os.path.join(self.folder, "sender.log"), "ab")
        self.senders.append(subprocess.Popen(
            [os.environ["ARTHRON_XAPI_SENDER"], self.outbox, f"https://{host}:{self.store_port}/lrs/xapi/", self.password,
             self.authority], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log))
        log.close()
        return self.senders[-1]

    def end(self, sender):
        sender.stdin.close()
        self.assertEqual(0, sender.wait(20))
        sender.stdout.close()

    def log(self):
        return text_of(os.path.join(self.folder, "sender.log"))

    def add(self, sender, count=1, **more):
        """Statements; each is in the file when this returns."""
        ids = []
        for _ in range(count):
            self.count += 1
            ids.append(str(uuid.UUID(int=self.count)))
            sender.stdin.write(json.dumps({"id": ids[-1], "n": self.count, **more}).encode() + b"\n")
            sender.stdin.flush()
            self.assertEqual(b"added\n", sender.stdout.readline())
        return ids

    def wait_for(self, statements, count):
        wait_until(f"{count} statements arrive, not {len(statements)}", lambda: len(statements) >= count, 20)
        self.assertEqual(list(range(1, count + 1)), [s["n"] for s in statements.values()])

    def wait_until_all_is_sent(self):
        size = os.path.getsize(self.outbox)
        wait_until("all is sent", lambda: text_of(self.outbox + ".sent").endswith(f" {size:020}\n"), 20)

    def test_each_arrives_once_through_all_faults(self):
        store = self.open_store("hang", "fail", "die", "move", "wait", "die_when_taken", "hang", "die_when_taken")
        sender = self.start_sender()
        self.add(sender, 130)
        self.wait_for(store.statements, 130)
        self.wait_until_all_is_sent()
        self.assertEqual([], store.faults)
        self.assertEqual([], store.wrong)
        self.assertIn("tries again", self.log())
        self.assertIn("it takes statements again", self.log())

    def test_each_arrives_once_when_the_store_is_away_and_the_server_is_killed(self):
        sender = self.start_sender()
        self.add(sender, 20)
        sender.kill()
        sender.wait()
        store = self.open_store("die_when_taken")
        second = self.start_sender()
        self.add(second, 20)
        self.wait_for(store.statements, 40)
        self.close_store()
        self.add(second, 5)
        second.send_signal(signal.SIGKILL)
        second.wait()
        with open(self.outbox, "a") as f:
            f.write('{"id": "cut')  # as a power cut leaves it
        store = self.open_store(statements=store.statements)
        third = self.start_sender()
        self.add(third)
        self.wait_for(store.statements, 46)
        self.wait_until_all_is_sent()
        self.assertIn("no statement and is left out", self.log())
        received = store.received
        self.end(third)
        self.add(self.start_sender())
        self.wait_for(store.statements, 47)
        self.assertEqual(received + 1, store.received, "what is sent is not sent again")

    def test_a_refused_statement_stops_no_other(self):
        store = self.open_store()
        sender = self.start_sender()
        self.close_store()
        self.add(sender, 7)
        self.add(sender, refused=True)
        self.count -= 1
        statements = {str(uuid.UUID(int=3)): {"id": str(uuid.UUID(int=3)), "n": 3, "other": "content"}}
        store = self.open_store(statements=statements)
        self.add(sender, 7)
        self.wait_until_all_is_sent()
        self.assertEqual(14, len(store.statements))
        self.assertEqual("content", store.statements[str(uuid.UUID(int=3))]["other"])
        self.assertEqual(1, self.log().count("left out, as it was refused"))
        self.assertIn("this statement has no verb", self.log())

    def test_only_the_store_of_the_certificate_gets_anything(self):
        others = os.path.join(self.folder, "others")
        call("arthron-server", "keys", "init", others)
        right, self.authority = self.authority, os.path.join(others, "authority.pem")
        store = self.open_store()
        sender = self.start_sender()
        self.add(sender, 3)
        wait_until("the certificate is refused", lambda: "certificate" in self.log(), 10)
        self.end(sender)
        self.assertEqual(0, store.requests)
        self.authority = right
        elsewhere = self.open_store(address="127.0.0.2")  # the certificate does not name it
        sender = self.start_sender(host="127.0.0.2")
        wait_until("its name is refused", lambda: "127.0.0.2" in self.log(), 10)
        self.end(sender)
        self.assertEqual(0, store.requests + elsewhere.requests)
        last = self.start_sender()
        self.wait_for(store.statements, 3)
        self.end(last)

    def test_a_wrong_password_is_read_again(self):
        self.write_password("wrong")
        store = self.open_store()
        sender = self.start_sender()
        self.add(sender, 2)
        wait_until("the password is refused", lambda: "status 401" in self.log())
        self.assertEqual({}, store.statements)
        self.assertNotIn(PASSWORD, self.log())
        self.write_password(PASSWORD)
        self.wait_for(store.statements, 2)

    def test_it_ends_at_once_while_the_store_hangs(self):
        self.open_store("hang", "hang", "hang", "hang")
        sender = self.start_sender()
        self.add(sender)
        wait_until("it is asked", lambda: self.stores[0].requests)
        begun = time.monotonic()
        self.end(sender)
        self.assertLess(time.monotonic() - begun, 10)

    def section(self, **keys):
        """The config of a server with this outbox."""
        keys = {"file": self.outbox, "server": f"https://127.0.0.1:{self.store_port}/lrs/xapi", "user": "arthron",
                "password": self.password, "authority": self.authority, **keys}
        return "[xapi]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items())

    def server_with(self, **keys):
        return "records = records.db\n" + self.section(**keys)

    def states(self):
        with sqlite3.connect(self.path("records.db")) as records:
            return records.execute("SELECT state FROM session").fetchall()

    def test_the_server_brings_what_waited_and_lives_and_ends_while_the_store_hangs(self):
        with open(self.outbox, "w") as f:
            f.writelines(json.dumps({"id": str(uuid.UUID(int=n)), "n": n}) + "\n" for n in range(1, 61))
        store = self.open_store("fail", "take", "hang")
        server = self.start_server(extra=self.server_with())
        self.wait_for(store.statements, 50)
        self.assertEqual([], store.wrong)
        wait_until("the store hangs", lambda: not store.faults)
        self.assertEqual("room-1", self.session()["station"])  # it answers
        begun = time.monotonic()
        self.assertEqual(0, server.end())
        self.assertLess(time.monotonic() - begun, 15)
        last = self.start_sender()
        self.wait_for(store.statements, 60)
        self.end(last)

    def test_attempts_in_a_session_are_statements_as_they_end_and_exams_as_they_are_released(self):
        os.mkdir(self.path("tasks"))
        self.write("tasks/look.ini", TASK)
        store = self.open_store("fail", "die_when_taken")
        self.start_mockup()
        server = self.serve_web("[station room-1]\ncase = healthy\ntrainee = ada\n",
                                "tasks = tasks\n" + self.section(site="https://hall.example/arthron"))
        self.enrol("room-1")
        self.start_station()
        wait_until("a session", lambda: self.sessions() and self.session()["steps"] > 20)
        session = self.session()["id"]
        with sqlite3.connect(self.path("records.db")) as records:
            records.execute("INSERT INTO exam (trainee_id, title, state, seed, created_utc_ns, begun_utc_ns) "
                            "SELECT id, 'Look', 'begun', 1, 1, 1 FROM trainee WHERE name = 'ada'")
            records.execute("INSERT INTO exam_task (exam_id, position, task, knee_case) VALUES (1, 0, 'look', 'healthy')")
        for more in ((), ("--exam",), ("--left",)):
            self.session_command("begin", "room-1", "look", *more)
            self.session_command("leave", "room-1", "--reason", "It is enough.")
        wait_until("both statements", lambda: len(store.statements) == 2)
        self.session_command("stop", "room-1")
        wait_until("its end", lambda: "'closed'" in str(self.states()))
        self.ask("POST", "/exams/1/release", {}, self.make_first(server))
        wait_until("the exam's", lambda: len(store.statements) == 3)
        server.end()
        self.assertEqual([], store.wrong)
        namespace = uuid.UUID(session[:12] + "4" + session[13:16] + "89ab"[int(session[16], 16) & 3] + session[17:])
        self.assertEqual([str(uuid.uuid5(namespace, f"attempt {n}")) for n in (1, 3, 2)], list(store.statements))
        for statement in store.statements.values():
            self.assertEqual({"homePage": "https://hall.example/arthron", "name": "trainee-1"},
                             statement["actor"]["account"])
            self.assertEqual("http://adlnet.gov/expapi/verbs/failed", statement["verb"]["id"])
            self.assertEqual((False, False), (statement["result"]["success"], statement["result"]["completion"]))
            self.assertEqual("https://hall.example/arthron/tasks/look", statement["object"]["id"])

    def test_a_server_says_what_is_wrong_with_its_store(self):
        for keys, why in (({"password": self.path("none")}, "none: the password of the learning record store"),
                          ({"server": "http://127.0.0.1/xapi"}, "http://127.0.0.1/xapi: not an address like https"),
                          ({"file": "/nowhere/x"}, "/nowhere/x: No such file"),
                          ({"site": "training"}, "training: not an address")):
            done = call("arthron-server", "run", "--config", self.server_config(extra=self.server_with(**keys)), code=1)
            self.assertIn("[xapi] " if "site" not in keys else "training", done.stderr)
            self.assertIn(why, done.stderr)


if __name__ == "__main__":
    unittest.main()
