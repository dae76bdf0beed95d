"""A server has its records and its traces for itself: a second one is refused and changes nothing."""

import fcntl
import os
import signal
import unittest

from arthron import SystemTest, call_json, free_port, wait_until

STATION = "[station room-1]\ncase = arthrosis"


class SecondServer(SystemTest):
    def start_room(self):
        self.server = self.start_server(STATION, "records = records.db")
        self.start_mockup()
        self.enrol("room-1")
        self.start_station()
        wait_until("a running session", lambda: self.session()["state"] == "running")
        self.wait_for_steps(20)

    def refused(self, label, **values):
        """The log of a server that ends without having been ready. Its values are its own, unless named."""
        values = {"port": free_port(), "udp_port": free_port(), "socket": self.path("s2"), **values}
        settings = [word for key, value in values.items() for word in ("--set", f"server.{key}={value}")]
        second = self.start(label, "arthron-server", "run", "--config", self.path("server.ini"), *settings,
                            statuses=(1,))
        wait_until("the second server's end", lambda: second.process.poll() is not None)
        self.assertEqual(second.process.returncode, 1)
        self.assertNotIn("ready", second.log())
        return second.log()

    def states(self):
        rows = call_json("arthron-server", "records", "--file", self.path("records.db"), "list", "sessions")
        return [row["state"] for row in rows]

    def test_a_second_server_is_refused_and_marks_nothing(self):
        self.start_room()
        wait_until("the session in the records", lambda: self.states() == ["open"])
        os.mkdir(self.path("other"))
        log = self.refused("same-records", traces=self.path("other"))
        self.assertIn(f"records.db: another arthron-server (process {self.server.process.pid}) uses these "
                      "records", log)
        os.symlink(self.path("records.db"), self.path("link.db"))
        self.assertIn("uses these records", self.refused("link", traces=self.path("other"), records="link.db"))
        log = self.refused("same-traces", records=self.path("other.db"))
        self.assertIn("traces: another arthron-server writes its traces into this folder", log)
        self.assertEqual(self.states(), ["open"])
        self.wait_for_steps(20)
        self.server.end(signal.SIGKILL)  # and what it had is free
        self.start_server(STATION, "records = records.db")

    def test_a_server_is_not_ready_while_another_program_writes_a_trace(self):
        self.server_config(STATION, "records = records.db")
        os.mkdir(self.traces)
        with open(os.path.join(self.traces, "room-1-20260102T030405Z-01234567.trace"), "wb") as trace:
            fcntl.flock(trace, fcntl.LOCK_EX)
            self.assertIn("01234567.trace: another program is still writing this trace", self.refused("locked"))


if __name__ == "__main__":
    unittest.main()
