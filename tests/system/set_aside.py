#!/usr/bin/env python3
"""What cannot be read or had while a server starts costs no session that an earlier one left open: it goes on with
this start, or with the next."""

import lzma
import os
import shutil
import signal
import socket
import unittest

from arthron import SOURCE, SystemTest, call_json
from old_traces import unpack

STATIONS = """
[station demo]
case = tear-radial
[station room-2]
case = tear-radial
[case tear-radial]
dir = case
"""
OPEN = {"demo-20261122T153400Z-fe965edd.trace": 4, "room-2-20261122T153400Z-5a5a5a5a.trace": 5}


class SetAside(SystemTest):
    more_cases = ("healthy",)  # without any case a server ends

    def setUp(self):
        super().setUp()
        unpack(self.folder)
        os.makedirs(self.traces)
        for name, version in OPEN.items():
            with lzma.open(f"{SOURCE}/tests/corpus/trace/version{version}/cuts.trace.xz") as packed:
                with open(os.path.join(self.traces, name), "wb") as f:
                    f.write(packed.read(60000))  # amid a record, as kill -9 leaves it
        self.write("records.db.begun", "".join(name + "\n" for name in OPEN))

    def run_server(self, extra="records = records.db", **options):
        return self.start("server", "arthron-server", "run", "--config", self.server_config(STATIONS, extra), **options)

    def assert_all_go_on(self):
        server = self.run_server()
        server.wait_for_log("ready")
        self.assertEqual({os.path.basename(s["trace"]) for s in self.sessions()}, set(OPEN))
        server.end()
        for name in OPEN:
            info = call_json("arthron-trace", "info", os.path.join(self.traces, name))
            self.assertEqual((info["resumes"], info["whole"]), (1, True))

    def test_sessions_wait_for_a_case_that_cannot_be_read(self):
        shutil.move(self.path("case"), self.path("away"))
        server = self.run_server()
        server.wait_for_log("ready")
        for station in ("demo", "room-2"):
            self.assertIn(f"station {station}: its session is set aside, and the next start tries again", server.log())
        self.assertEqual(self.sessions_that_run(), [])
        server.end()
        shutil.move(self.path("away"), self.path("case"))
        self.assert_all_go_on()

    def sessions_that_run(self):
        return [s["station"] for s in self.sessions() if s.get("trace")]

    def test_sessions_wait_for_a_list_that_cannot_be_read(self):
        shutil.move(self.path("records.db.begun"), self.path("away"))
        os.mkdir(self.path("records.db.begun"))
        server = self.run_server()
        server.wait_for_log("ready")
        self.assertIn("open sessions that only this list names wait for the next start", server.log())
        server.end()
        os.rmdir(self.path("records.db.begun"))
        shutil.move(self.path("away"), self.path("records.db.begun"))
        self.assert_all_go_on()

    def test_a_server_that_cannot_open_its_pages_leaves_the_sessions_to_the_next_start(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            web = f"records = records.db\n[web]\naddress = 127.0.0.1\nport = {taken.getsockname()[1]}\n"
            server = self.run_server(web, statuses=(1,))
            self.assertEqual(server.process.wait(60), 1)
        for name in OPEN:
            self.assertFalse(call_json("arthron-trace", "info", os.path.join(self.traces, name), code=None)["whole"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
