#!/usr/bin/env python3
"""/api/v1 of real servers, beside its description (server/api/openapi.yaml): every operation is called as it is meant
and in each way that it refuses, and every answer must be as described."""

import os
import re
import sqlite3
import ssl
import sys
import unittest

from arthron import SOURCE, SystemTest, free_port
from described import Asker, Described, faults
from hall import PASSWORD
from openapi_calls import STATIONS, Calls, bearer
from openapi_peers import Peers
from openapi_refusals import Refusals

sys.dont_write_bytecode = True  # nothing is written beside the source
sys.path.insert(0, os.path.join(SOURCE, "server/api"))
import describe  # noqa: E402

class Description(unittest.TestCase):
    def test_it_is_openapi_and_whole_in_itself(self):
        self.assertEqual(faults(describe.whole()), [])


class OpenApi(Calls, Refusals, Peers, SystemTest):
    def setUp(self):
        super().setUp()
        self.web_port = free_port()
        self.ports = {"alone": self.port}  # where a station finds its server
        self.origin = {"Origin": f"https://127.0.0.1:{self.web_port}"}
        self.whole = describe.whole()
        shared = {(row["status"], code) for row in describe.Source().top["x-errors"] for code in row["codes"]
                  if row.get("with") in ("all", "change")}
        self.described = Described(self.whole, shared)
        trust = ssl.create_default_context(cafile=os.path.join(self.keys, "authority.pem"))
        self.asker = Asker(self, self.described, self.web_port, trust)
        self.addCleanup(self.asker.close)
        self.ask = self.asker.ask

    def test_every_operation_and_every_refusal_is_as_described(self):
        self.prepare_files()
        web = f"records = records.db\ntasks = tasks\n[web]\naddress = 127.0.0.1\nport = {self.web_port}\n" \
            "[sign_on]\nissuer = https://127.0.0.1:1\nclient_id = arthron\nname = Sign on\nclaim = email"
        self.server = self.start_server(STATIONS, web)
        self.call_all()
        self.refuse_all()
        self.server.end()
        self.asker.close()
        self.ask_as_another_server()
        self.tell()

    def tell(self):
        """How much of the description was seen; all of it must be."""
        operations = {(method, path) for method, path, _ in self.described.operations()}
        errors, seen = self.described.errors(), self.described.seen
        print(f"operations: {len(self.described.answered & operations)} of {len(operations)} called")
        print(f"errors: {len(seen)} of {len(errors)} seen; {self.asker.asked} requests")
        self.assertEqual(operations - self.described.answered, set())
        self.assertEqual(errors - seen, set())

    # ---- for the parts

    def cookie(self, answer):
        """Headers with the cookie of an answer."""
        return {"Cookie": answer.headers.get_all("Set-Cookie")[0].split(";")[0], **self.origin}

    def make_first(self, server):
        """Headers with a token of the first instructor."""
        self.secret = re.search(r"/#/first/([0-9a-f]{64})", server.log())[1]
        first = {"secret": self.secret, "name": "grace", "password": PASSWORD}
        cookie = self.cookie(self.ask("POST", "/first", first, status=201))
        return bearer(self.ask("POST", "/tokens", {"name": "day"}, cookie, 201).json["token"])

    def change(self, sql, *values, file="records.db"):
        """Changes the records as no request can. The number of the new row."""
        with sqlite3.connect(self.path(file), timeout=60) as db:
            row = db.execute(sql, values).lastrowid
        db.close()
        return row


if __name__ == "__main__":
    unittest.main(verbosity=2)
