"""For the test openapi: what servers that share stations ask each other, and another server that is only told of and
does not answer."""

import base64
import json
import os
import re
import socket

from arthron import call_json, free_port, wait_until
from openapi_calls import STATIONS, bearer
from with_nats import WithNats


class Peers(WithNats):
    names, stations = ("a",), STATIONS

    def settings_of(self, name):
        return {**super().settings_of(name), "web.port": self.web_port}

    def talk_to_nats(self, lines, pattern):
        """What NATS answers, as soon as the pattern is there."""
        with socket.create_connection(("127.0.0.1", self.nats_port), timeout=60) as nats:
            nats.sendall(b"CONNECT {}\r\n" + lines.encode() + b"PING\r\n")
            told = b""
            while not re.search(pattern, told):
                more = nats.recv(65536)
                self.assertTrue(more, told)
                told += more
        return re.search(pattern, told)

    def secret_of(self, name):
        """By which the others ask this server."""
        last = json.dumps({"last_by_subj": f"$KV.arthron-lease.server.{name}"})
        asked = f"SUB answer 1\r\nPUB $JS.API.STREAM.MSG.GET.KV_arthron-lease answer {len(last)}\r\n{last}\r\n"
        return json.loads(base64.b64decode(self.talk_to_nats(asked, rb'"data": ?"([^"]+)"')[1]))["secret"]

    def put(self, key, **value):
        text = json.dumps({**value, "life": "0f", "write": 1})
        self.talk_to_nats(f"PUB $KV.arthron-lease.{key} {len(text)}\r\n{text}\r\n", b"PONG")

    def ask_as_another_server(self):
        self.prepare_servers()
        self.grace = self.make_first(self.start_named("a"))
        self.peer = bearer(self.secret_of("a"))
        self.ask("GET", "/servers", who=self.grace, status=200)
        for path in ("/sign-on/start", "/sign-on/back"):
            self.ask("GET", path, None, None, 404, "not_found")
        query = "?hash=" + call_json("arthron-case", "info", os.path.join(self.cases, "healthy"))["sha256"]
        self.ask("GET", "/peer/cases", who=self.peer, status=200, query=query)
        for file in ("case.json", "anatomy.glb"):
            answer = self.ask("GET", "/peer/cases/{file}", who=self.peer, status=200, query=query, file=file)
            same = {**self.peer, "If-None-Match": answer.headers["ETag"]}
            self.ask("GET", "/peer/cases/{file}", who=same, status=304, query=query, file=file)
        told = {"station": "room-1", "serials": "0f"}
        self.ask("POST", "/peer/revocations", told, self.peer, 200)
        self.refuse_peers()
        self.away()

    def refuse_peers(self):
        for method, path, names in (("GET", "/peer/cases", {}), ("GET", "/peer/cases/{file}", {"file": "case.json"}),
                                    ("POST", "/peer/revocations", {})):
            body = {} if method == "POST" else None
            self.ask(method, path, body, None, 401, "not_signed_in", **names)
            self.ask(method, path, body, self.grace, 403, "not_allowed", **names)
            if body is None:
                self.ask(method, path, None, self.peer, 400, "wrong_query", "?nothing=1", **names)
                self.ask(method, path, None, self.peer, 404, "not_found", "?hash=0", **names)
        self.ask("POST", "/peer/revocations", "no JSON", self.peer, 400, "wrong_body")
        self.ask("POST", "/peer/revocations", {"nothing": ""}, self.peer, 400, "wrong_field")

    def away(self):
        """Server b is known to have a station and a trace, and nobody is there where its pages are."""
        ask, grace = self.ask, self.grace
        self.put("server.b", stations="127.0.0.1:1", pages=f"127.0.0.1:{free_port()}", secret="00ff" * 16)
        self.put("station.room-2", server="b")
        session = "b" * 32
        for sql, *values in (("INSERT INTO station (name) VALUES ('room-2')",),
                             ("INSERT INTO knee_case (name, hash) VALUES ('healthy', '0f')",),
                             ("INSERT INTO session (uuid, station_id, case_id, start_utc_ns, end_utc_ns, state, steps, "
                              "missing, trace, server) VALUES (?, 1, 1, 1, 2, 'closed', 9, 0, 'none', 'b')", session)):
            self.change(sql, *values, file="records-a.db")
        wait_until("server b to be known", lambda: len(ask("GET", "/servers", who=grace).json["servers"]) == 2)
        for method, body in (("POST", {"task": "look"}), ("DELETE", None)):
            wait_until("the station at b", lambda: ask(method, "/stations/{name}/attempt", body, grace,
                                                       name="room-2").status == 503)
        for method, path in (("GET", "/sessions/{id}/trace"), ("GET", "/sessions/{id}/report"),
                             ("DELETE", "/sessions/{id}")):
            ask(method, path, None, grace, 503, "away", id=session)
        ask("POST", "/stations/{name}/revoke", {}, grace, 503, "away", name="room-1")
