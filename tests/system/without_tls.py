#!/usr/bin/env python3
"""Pages without TLS, as the demo has them: for this machine alone, whatever else it is called."""

import http.client
import json
import re
import unittest

from arthron import call
from asking import PASSWORD, Asking


class WithoutTls(Asking):
    def serve(self, **settings):
        keys = {"address": "127.0.0.1", "port": self.web_port, "plain": "yes", **settings}
        web = "\n".join(f"{key} = {value}" for key, value in keys.items())
        return f"records = records.db\n[web]\n{web}"

    def setUp(self):
        super().setUp()
        self.server = self.start_server("", self.serve())

    def plain(self, method, path, body=None, host="localhost", **headers):
        """The answer to a request for the name `host`."""
        connection = http.client.HTTPConnection("127.0.0.1", self.web_port, timeout=30)
        self.addCleanup(connection.close)
        here = f"{host}:{self.web_port}"
        connection.request(method, path, body and json.dumps(body), {"Host": here, "Origin": f"http://{here}", **headers})
        return connection.getresponse()

    def test_the_first_account_signs_in_with_a_cookie_that_comes_back(self):
        link = re.search(r"(http://localhost:[0-9]+/)#/first/([0-9a-f]{64})", self.server.log())
        self.assertEqual(link[1], f"http://localhost:{self.web_port}/")
        made = self.plain("POST", "/api/v1/first", {"secret": link[2], "name": "demo", "password": PASSWORD})
        self.assertEqual(made.status, 201)
        cookies = made.headers.get_all("Set-Cookie")
        self.assertEqual(len(cookies), 2)
        for cookie in cookies:
            self.assertNotIn("secure", cookie.lower())  # a browser would not send it
        me = self.plain("GET", "/api/v1/me", Cookie=cookies[0].split(";")[0])
        self.assertEqual(json.load(me)["account"]["name"], "demo")

    def test_it_has_no_name_but_those_of_this_machine_for_itself(self):
        for host in ("localhost", "127.0.0.1", "127.1.2.3", "LOCALHOST"):
            self.assertEqual(self.plain("GET", "/", host=host).status, 200, host)
        for host in ("hall.example", "10.0.0.1", "localhost.example", "128.0.0.1", "0.0.0.0"):
            self.assertEqual(self.plain("GET", "/", host=host).status, 421, host)

    def test_only_its_own_pages_may_ask_for_something(self):
        body = {"name": "demo", "password": PASSWORD}
        own = self.plain("POST", "/api/v1/sign-in", body)
        self.assertEqual(own.status, 401)
        for origin in (f"https://localhost:{self.web_port}", "http://localhost:1", "http://hall.example"):
            self.assertEqual(self.plain("POST", "/api/v1/sign-in", body, Origin=origin).status, 403, origin)

    def test_a_server_that_others_could_reach_does_not_start(self):
        config = self.server_config("", self.serve(address="0.0.0.0"))
        done = call("arthron-server", "run", "--config", config, code=2)
        self.assertIn("[web] plain: passwords would cross the network", done.stderr)


if __name__ == "__main__":
    unittest.main()
