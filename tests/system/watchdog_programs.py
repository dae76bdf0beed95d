"""A worker that hangs is noticed and named, the server ends, and the next one goes on with the session."""

import ctypes
import os
import signal
import socket
import sqlite3
import time
import unittest

from arthron import SystemTest, call_json, text_of, wait_until

PTRACE_SEIZE, PTRACE_INTERRUPT, ALL_THREADS = 0x4206, 0x4207, 0x40000000
libc = ctypes.CDLL(None, use_errno=True)
libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]


def stop_thread(thread):
    """Only this one: SIGSTOP would stop the whole process."""
    for request in (PTRACE_SEIZE, PTRACE_INTERRUPT):
        if libc.ptrace(request, thread, None, None):
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


class Watchdog(SystemTest):
    def listen(self):
        """Where the server tells its service manager how it is."""
        manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        manager.bind(self.path("notify"))
        manager.settimeout(10)
        self.addCleanup(manager.close)
        os.environ["NOTIFY_SOCKET"] = self.path("notify")
        self.addCleanup(os.environ.pop, "NOTIFY_SOCKET", None)
        return manager

    def start(self, label, name, *arguments, statuses=(0,)):
        process = super().start(label, name, *arguments, statuses=statuses)
        if name == "arthron-server":
            self.server = process
        return process

    def lock_records(self):
        """What is to be written there waits."""
        wait_until("the records", lambda: os.path.exists(self.path("records.db")))
        records = sqlite3.connect(self.path("records.db"), timeout=20, isolation_level=None)
        self.addCleanup(records.close)
        records.execute("BEGIN IMMEDIATE")
        return records

    def hang(self, name):
        """Stops the thread of this name, and no other."""
        folder = f"/proc/{self.server.process.pid}/task"
        [self.traced] = [int(thread) for thread in os.listdir(folder)
                         if text_of(f"{folder}/{thread}/comm").strip() == name]
        try:
            stop_thread(self.traced)
        except PermissionError:
            self.skipTest("threads may not be traced here")

    def has_ended(self):
        """A traced thread that has died stays until its tracer has looked."""
        try:
            os.waitpid(self.traced, os.WNOHANG | ALL_THREADS)
        except ChildProcessError:
            pass
        return self.server.process.poll() is not None

    def test_a_worker_that_hangs_is_named_and_the_next_server_goes_on(self):
        manager = self.listen()
        self.start_server("[station room-1]\ncase = healthy", "records = records.db")
        self.assertEqual(manager.recv(100), b"READY=1")
        self.assertEqual(manager.recv(100), b"WATCHDOG=1")
        self.enrol("room-1")
        self.start_mockup()
        self.start_station()
        self.wait_for_steps()
        before = self.session()
        self.assertRegex(text_of(f"/proc/{self.server.process.pid}/limits"), r"Max core file size +0 +0 ",
                         "it would hold the keys")
        records = self.lock_records()
        self.session_command("pause", "room-1")
        self.hang("worker 0")
        self.server.statuses.add(-signal.SIGABRT)
        wait_until("it ends", self.has_ended)
        self.assertEqual(self.server.process.returncode, -signal.SIGABRT)
        self.assertRegex(self.server.log(), r"error watchdog: worker 0 hangs: nothing for \d\.\d s\. "
                                            r"It last did: [a-z ]+.*\. The server ends, so that it can be started")
        self.assertGreaterEqual(call_json("arthron-trace", "info", before["trace"], code=None)["steps"],
                                before["steps"])
        self.assertIn("\tpause\tstation room-1 ", text_of(self.path("records.db.arrears")))
        records.close()
        self.start_server("[station room-1]\ncase = healthy", "records = records.db")
        wait_until("connected", lambda: self.session()["connected"])
        self.wait_for_steps()
        self.assertEqual(self.session()["id"], before["id"])

    def test_a_station_tells_that_it_runs_whether_or_not_a_server_answers(self):
        server = self.start_server("[station room-1]\ncase = healthy")
        self.enrol("room-1")
        server.end()
        self.start_mockup()
        manager = self.listen()
        station = self.start_station()
        told = [manager.recv(100) for _ in range(3)]
        self.assertEqual(told, [b"READY=1", b"WATCHDOG=1", b"WATCHDOG=1"])
        station.end()
        while told[-1] == b"WATCHDOG=1":
            told.append(manager.recv(100))
        self.assertEqual(told[-1], b"STOPPING=1")

    def test_a_server_that_was_stopped_as_a_whole_goes_on(self):
        self.start_server("[station room-1]\ncase = healthy")
        self.server.process.send_signal(signal.SIGSTOP)
        time.sleep(3)
        self.server.process.send_signal(signal.SIGCONT)
        time.sleep(0.5)
        self.assertIsNone(self.server.process.poll(), self.server.log())


if __name__ == "__main__":
    unittest.main(verbosity=2)
