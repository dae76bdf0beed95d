"""What a browser or a program asks /api/v1 of a real server."""

import http.client
import json
import os
import re
import ssl

from arthron import SystemTest, free_port

PASSWORD = "correct horse battery"


class Asking(SystemTest):
    def setUp(self):
        super().setUp()
        self.web_port = free_port()
        self.origin = f"https://127.0.0.1:{self.web_port}"
        self.trust = ssl.create_default_context(cafile=os.path.join(self.keys, "authority.pem"))

    def serve_web(self, stations, extra=""):
        web = f"records = records.db\n{extra}\n[web]\naddress = 127.0.0.1\nport = {self.web_port}"
        return self.start_server(stations, web)

    def ask(self, method, path, body=None, who=None, status=200, headers=None):
        """The answer, its JSON in `json` where it is some. who: a cookie, or a token that is no dictionary."""
        more = headers or {}
        headers = {"Origin": self.origin, **more}
        if isinstance(who, dict):
            headers["Cookie"] = "arthron=" + who["cookie"]
        elif who:
            headers = {"Authorization": "Bearer " + who, **more}
        connection = http.client.HTTPSConnection("127.0.0.1", self.web_port, context=self.trust, timeout=30)
        connection.request(method, "/api/v1" + path, None if body is None else json.dumps(body), headers)
        answer = connection.getresponse()
        answer.bytes = answer.read()
        connection.close()
        self.assertEqual(answer.status, status, (method, path, answer.bytes[:300]))
        is_json = answer.headers.get("Content-Type", "").startswith("application/json") and answer.bytes
        answer.json = json.loads(answer.bytes) if is_json and "Content-Encoding" not in answer.headers else None
        return answer

    def get(self, path, who, **more):
        return self.ask("GET", path, None, who, **more).json

    def cookie(self, answer):
        value = answer.headers["Set-Cookie"]
        self.assertRegex(value, "; Path=/; HttpOnly; SameSite=Strict; Secure$")
        return {"cookie": re.match("arthron=([0-9a-f]{64});", value)[1]}

    def make_first(self, server):
        secret = re.search(r"https://\S+/#/first/([0-9a-f]{64})", server.log())[1]
        body = {"secret": secret, "name": "grace", "password": PASSWORD}
        answer = self.ask("POST", "/first", body, status=201)
        self.ask("POST", "/first", body, status=401)
        return self.cookie(answer)

    def sign_in(self, **body):
        return self.cookie(self.ask("POST", "/sign-in", body))
