#!/usr/bin/env python3
"""Cases that ask for all memory, or that are none: their stations are told why, and the others go on."""

import json
import os
import shutil
import struct
import unittest

from arthron import SystemTest, call

LISTED = 2_080_000  # numbers in a list of 4 MB, which take 40 times as much once they are read


def read_anatomy(case):
    """The scene, and the bytes that it points into."""
    with open(os.path.join(case, "anatomy.glb"), "rb") as f:
        data = f.read()
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + size]), data[20 + size + 8:]


def write_anatomy(case, text, body, more=0):
    """The scene as text, and so many zeros behind the bytes. The manifest forgets the old hash."""
    text = text.encode()
    text += b" " * (-len(text) % 4)
    with open(os.path.join(case, "anatomy.glb"), "wb") as f:
        f.write(struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(body) + more, len(text), 0x4e4f534a))
        f.write(text + struct.pack("<II", len(body) + more, 0x004e4942) + body)
        f.truncate(f.tell() + more)
    manifest = os.path.join(case, "case.json")
    with open(manifest) as f:
        about = json.load(f)
    about.pop("anatomy_xxh3", None)
    with open(manifest, "w") as f:
        json.dump(about, f)


def make_greedy(case):
    """Puts a long list into the anatomy, where any program may leave words of its own."""
    scene, body = read_anatomy(case)
    scene["asset"]["extras"] = ["LIST"]
    write_anatomy(case, json.dumps(scene, separators=(",", ":")).replace('"LIST"', ",".join("7" * LISTED)), body)


class HostileCases(SystemTest):
    def setUp(self):
        super().setUp()
        for name in ("greedy", "torn"):
            shutil.copytree(os.path.join(self.cases, "healthy"), self.path(name))
        make_greedy(self.path("greedy"))
        os.truncate(os.path.join(self.path("torn"), "anatomy.glb"), 100000)

    def stations(self, *cases):
        return "".join(f"[case {c}]\ndir = {c}\n[station room-{c}]\ncase = {c}\n" for c in cases)

    def test_a_case_that_cannot_be_read_keeps_out_its_own_stations_alone(self):
        stations = self.stations("greedy", "torn") + "[station room-1]\ncase = arthrosis\n"
        self.more_cases = ("healthy",)
        server = self.start_server(stations, "case_memory_mb = 300")
        self.assertRegex(server.log(), "error sessions: case greedy: .*more (than 300 MB of )?memory")
        self.assertRegex(server.log(), "error sessions: case torn: .*no session opens on it")
        grades = {s["station"]: s["case_grade"] for s in self.sessions()}
        self.assertEqual(grades, {"room-1": "not checked", "room-greedy": "broken", "room-torn": "broken"})
        refused = call("arthron-server", "session", "--socket", self.socket, "case", "room-1", "greedy", code=1)
        self.assertRegex(refused.stdout + refused.stderr, "more (than 300 MB of )?memory")
        self.session_command("case", "room-1", "healthy")
        self.enrol("room-greedy")
        self.start_mockup()
        station = self.start_station("room-greedy", statuses=(0, 1))
        station.wait_for_log("takes more")

    def test_a_server_without_any_case_that_can_be_read_says_why_and_ends(self):
        config = self.write("server.ini", f"[server]\nkeys = keys\ntraces = traces\nsocket = s\n"
                                          f"port = {self.port}\n{self.stations('torn')}")
        done = call("arthron-server", "run", "--config", config, code=1)
        self.assertIn("case torn: ", done.stderr)


if __name__ == "__main__":
    unittest.main()
