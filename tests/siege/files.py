"""Hostile files in the server's folders: forged traces are played, reported, copied and found at a start; cases ask for
all memory. The server goes on, and nothing forged becomes a result."""

import hashlib
import json
import os
import resource
import shutil
import signal
import struct
import subprocess
import unittest

from arthron import call, program, wait_until
from hostile_cases import read_anatomy, write_anatomy
from hostile_traces import STEP, WIDE, Places, mend, records
from old_traces import unpack
from page import RECORDED, Browser
from siege import FULL, Siege

SESSION_ID = slice(14, 30)  # in a trace's header
END = 3
MEMORY = 4 << 30
CASE_BYTES = (512 << 20) - 4096 if FULL else 140 << 20
CASE_MEMORY_MB = 1024 if FULL else 300


def without_end(data):
    start = next(start for start, _, kind in records(data) if kind == END)
    return data[:start]


def limits(data):
    """(name, data) with each index of two steps at the limit of its type."""
    steps = [Places(data, start) for start, _, kind in records(data) if kind == STEP]
    cuts = [step for step in steps if "job.blade" in step.at]
    for step in (cuts[3], [step for step in steps if step.landed][3]):
        for name, at in step.at.items():
            wide = name.startswith(WIDE)
            for value in (0xffffffff, 0x80000000) if wide else (255, 128):
                forged = bytearray(data)
                struct.pack_into("<I" if wide else "<B", forged, at, value)
                yield f"{name} = {value}", forged


class Files(Siege):
    def setUp(self):
        super().setUp()
        self.web_port = self.port + 1
        path, self.case = unpack(self.folder)
        with open(path, "rb") as f:
            self.whole = f.read()
        os.mkdir(self.traces, 0o700)
        self.forged = {}  # path: its bytes

    def stations(self, *broken):
        return f"""
[case tear-radial]
dir = {self.case}
[station demo]
case = tear-radial
start = command
""" + "".join(f"[case {name}]\ndir = {name}\n[station {name}]\ncase = {name}\n" for name in broken)

    def start_hall(self, *broken, **keys):
        extra = "\n".join(["records = records.db", *(f"{key} = {value}" for key, value in keys.items()),
                           f"[web]\nport = {self.web_port}\naddress = 127.0.0.1\nnames = localhost"])
        return self.start_server(self.stations(*broken), extra)

    def put(self, name, data, stamp="20261122T153400Z"):
        """As a session of its own. Returns its id."""
        data = bytearray(data)
        data[SESSION_ID] = hashlib.sha256(name.encode()).digest()[:16]
        mend(data)
        session = bytes(data[SESSION_ID]).hex()
        path = os.path.join(self.traces, f"demo-{stamp}-{session[:8]}.trace")
        with open(path, "wb") as f:
            f.write(data)
        os.utime(path, (0, 0))  # nobody waits for it
        self.forged[path] = bytes(data)
        return session

    def rows(self):
        listed = call("arthron-server", "records", "--file", self.path("records.db"), "list", "sessions", "--json",
                      code=None)
        return {row["id"]: row for row in json.loads(listed.stdout)} if not listed.returncode else {}

    def assert_nothing_forged_is_a_result(self, sessions):
        def read():
            rows = self.rows()
            return rows if all(rows.get(s, {}).get("trace_xxh3") for s in sessions) else None
        wait_until("all traces are in the records", read, 120)
        for session in sessions:
            shown = call("arthron-server", "records", "--file", self.path("records.db"), "show", "session", session,
                         "--json")
            self.assertEqual(json.loads(shown.stdout)["results"], [], sessions[session])
        for path, data in self.forged.items():
            with open(path, "rb") as f:
                self.assertEqual(f.read(), data, f"{path} was changed, or signed")

    def self_signed(self):
        """Signed by the server of another hall, whose keys anybody can make."""
        keys, path = self.path("other-keys"), self.path("other.trace")
        call("arthron-server", "keys", "init", keys)
        with open(path, "wb") as f:
            f.write(without_end(self.whole))
        traces = self.path("other-traces")
        os.mkdir(traces)
        shutil.copy(path, os.path.join(traces, "demo-20261122T153400Z-fe965edd.trace"))
        config = self.write("other.ini", f"[server]\nkeys = {keys}\ntraces = {traces}\nsocket = o\nport = {self.port}\n"
                                         f"address = 127.0.0.1\nudp_port = {self.udp_port}\n" + self.stations())
        os.utime(os.path.join(traces, "demo-20261122T153400Z-fe965edd.trace"), (0, 0))
        other = self.start("other", "arthron-server", "run", "--config", config)
        other.wait_for_log("closed, its end was missing")
        other.end()
        with open(os.path.join(traces, "demo-20261122T153400Z-fe965edd.trace"), "rb") as f:
            return f.read()

    def test_forged_traces_through_start_play_report_copy_and_restart(self):
        forged = list(limits(self.whole))
        forged = forged if FULL else forged[::len(forged) // 6]
        sessions = {self.put(name, data): name for name, data in forged}
        sessions[self.put("whole", self.whole)] = "of another authority"
        sessions[self.put("open", without_end(self.whole), "20991231T235959Z")] = "left open"
        signed = self.self_signed()
        path = os.path.join(self.traces, "demo-20261122T153401Z-fe965edd.trace")
        with open(path, "wb") as f:
            f.write(signed)
        self.forged[path] = signed
        sessions[bytes(signed[SESSION_ID]).hex()] = "signed by another hall"
        server = self.start_hall()
        self.assert_nothing_forged_is_a_result(sessions)
        browser = Browser(self.web_port, os.path.join(self.keys, "authority.pem"))
        browser.first(server.log())
        page, answers = browser.page(), {}
        for session in sessions:
            page.watch(RECORDED, session=session)
            page.read_until(lambda: page.done or page.troubles)
            try:
                browser.request("GET", f"/sessions/{session}/report")
                answers["reports"] = answers.get("reports", 0) + 1
            except ValueError:  # a page, no JSON
                answers["reports"] = answers.get("reports", 0) + 1
            except ConnectionError as error:
                self.assertRegex(str(error), ": (404|422|500|503) ")
            copied = call("arthron-server", "session", "--socket", self.socket, "copy", "demo", "--from", session,
                          "--at", "5", code=None)
            self.assertIn(copied.returncode, (0, 1))
            answers["copies"] = answers.get("copies", 0) + (copied.returncode == 0)
        page.socket.close()
        self.assertIsNone(server.process.poll())
        self.figure("forged traces", len(sessions))
        self.figure("of them reported", answers["reports"])
        self.figure("copied up to 5 s", answers["copies"])
        server.end(signal.SIGKILL)
        self.processes.remove(server)
        for path in self.forged:
            os.utime(path)  # as if their server had just been killed
        server = self.start_hall()
        self.assert_nothing_forged_is_a_result(sessions)

    def make_large(self, name):
        """A right case, but for its size: bytes behind those that its meshes use."""
        shutil.copytree(self.case, self.path(name))
        more = CASE_BYTES - os.path.getsize(os.path.join(self.path(name), "anatomy.glb"))
        scene, body = read_anatomy(self.path(name))
        scene["buffers"][0]["byteLength"] = len(body) + more
        write_anatomy(self.path(name), json.dumps(scene), body, more)

    def test_large_cases_take_no_memory_from_the_server(self):
        names = [f"large-{i}" for i in range(4 if FULL else 1)]
        for name in names:
            self.make_large(name)
        before = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, before[1]))  # the server inherits it
        try:
            server = self.start_hall(*names, case_memory_mb=CASE_MEMORY_MB)
        finally:
            resource.setrlimit(resource.RLIMIT_AS, before)
        for name in names:
            self.assertRegex(server.log(), f"error sessions: case {name}: .*memory.*no session opens on it")
        grades = {s["station"]: s["case_grade"] for s in self.sessions()}
        self.assertEqual(grades, {"demo": "not checked", **{name: "broken" for name in names}})
        browser = Browser(self.web_port, os.path.join(self.keys, "authority.pem"))
        browser.first(server.log())
        cases = {c["name"]: c["grade"] for c in browser.request("GET", "/cases")["cases"]}
        for name in names:
            self.assertEqual(cases[name], "broken")
        with open(f"/proc/{server.process.pid}/status") as f:
            peak_kb = int(next(line for line in f if line.startswith("VmHWM")).split()[1])
        self.figure("bytes of each case", CASE_BYTES)
        self.figure("most memory of the server", peak_kb / 1024, "MB")
        self.assertLess(peak_kb, 400 << 10)

    def test_large_scans_take_no_memory_from_the_import(self):
        scan = self.path("femur.obj")
        with open(scan, "wb") as f:
            f.write(b"v 1 2 3\n" * ((500 << 20) // 8 if FULL else 100000))
        done = subprocess.run([program("arthron-case"), "import", "--name", "large", "--group", f"tibia={scan}",
                               "--group", f"femur={scan}", "--out", self.path("large")], capture_output=True,
                              text=True, timeout=600)
        self.assertEqual(done.returncode, 1)
        self.figure("what the import said", done.stderr.replace(self.folder, "").strip()[-120:])
        self.assertFalse(os.path.exists(self.path("large")))


if __name__ == "__main__":
    unittest.main()
