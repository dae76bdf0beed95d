"""A server with pages, and requests to its API from any address of the loopback and as anybody."""

import http.client
import json
import os
import random
import re
import ssl

from arthron import BIN, Process, free_port

PASSWORD = "correct horse battery"


def some_address():
    """One of the loopback's 16 million: what counts by address does not count for the next request."""
    return f"127.{random.randrange(1, 255)}.{random.randrange(256)}.{random.randrange(1, 255)}"


class Answer:
    def __init__(self, response):
        self.status, self.headers, self.bytes = response.status, response.headers, response.read()

    @property
    def json(self):
        return json.loads(self.bytes)

    @property
    def code(self):
        return self.json["error"]["code"]

    @property
    def cookie(self):
        for value in self.headers.get_all("Set-Cookie", []):
            found = re.match("arthron=([0-9a-f]{64});", value)
            if found:
                return found[1]
        raise AssertionError(f"no cookie: {self.status} {self.bytes[:200]}")


class Hall:
    """For a SystemTest: its server's pages are at web_port."""

    def serve(self, stations="", off_s=0):
        """off_s: how far the server's time of day is off."""
        self.web_port = getattr(self, "web_port", None) or free_port()
        self.origin = f"https://127.0.0.1:{self.web_port}"
        self.trust = ssl.create_default_context(cafile=os.path.join(self.keys, "authority.pem"))
        self.db = self.path("records.db")
        web = f"records = records.db\n[web]\naddress = 127.0.0.1\nport = {self.web_port}"
        if not off_s:
            return self.start_server(stations, web)
        clock = os.path.join(BIN, "../tests/libwrong_clock.so")
        server = Process(self.folder, f"server-{off_s}", "env", f"LD_PRELOAD={clock}", f"WRONG_CLOCK_S={off_s}",
                         os.path.join(BIN, "arthron-server"), "run", "--config", self.server_config(stations, web))
        self.processes.append(server)
        server.wait_for_log("ready")
        return server

    def ask(self, method, path, body=None, cookie=None, token=None, headers=None, source=None, timeout=60):
        """headers: instead of Origin, which a page sends; a key with the value None leaves that header out."""
        sent = {"Origin": self.origin}
        if cookie:
            sent["Cookie"] = "arthron=" + cookie
        if token:
            sent["Authorization"] = "Bearer " + token
        sent.update(headers or {})
        connection = http.client.HTTPSConnection("127.0.0.1", self.web_port, context=self.trust, timeout=timeout,
                                                 source_address=(source, 0) if source else None)
        try:
            text = None if body is None else body if isinstance(body, str) else json.dumps(body)
            connection.request(method, "/api/v1" + path, text, {k: v for k, v in sent.items() if v is not None})
            return Answer(connection.getresponse())
        finally:
            connection.close()

    def done(self, method, path, body=None, cookie=None, **more):
        """The same, for what must succeed."""
        answer = self.ask(method, path, body, cookie, **more)
        self.assertIn(answer.status, (200, 201, 204), (method, path, answer.bytes[:300]))
        return answer

    def make_first(self, server, name="grace"):
        """The cookie of the first instructor."""
        secret = re.search(r"/#/first/([0-9a-f]{64})", server.log())[1]
        return self.done("POST", "/first", {"secret": secret, "name": name, "password": PASSWORD}).cookie

    def sign_in(self, name, password=PASSWORD, **more):
        return self.ask("POST", "/sign-in", {"name": name, "password": password}, **more)

    def make_account(self, boss, name, role, **more):
        self.done("POST", "/accounts", {"name": name, "role": role, "password": PASSWORD, **more}, boss)
        return self.sign_in(name).cookie
