"""Frames of a station that come late, twice, or with an impossible number: counted as what they are, and used."""

import csv
import io
import time
import unittest

from arthron import SystemTest, call, wait_until
from share import example, pb

LAST_NUMBER = 2**64 - 6


class LateFrames(SystemTest):
    def setUp(self):
        super().setUp()
        self.start_server("[station room-1]\ncase = healthy")
        code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        example.enrol("127.0.0.1", self.port, code, "room-1", self.path("keys-room-1"))
        self.station = example.Station("127.0.0.1", self.port, "room-1", self.path("keys-room-1"))
        self.addCleanup(self.station.close)
        wait_until("a session", lambda: self.station.hear(0.01) or self.station.state == pb.RUNNING)

    def frame(self, number, buttons=0):
        now = time.monotonic_ns()
        return pb.Frame(number=number, time_ns=now, samples=[
            pb.Sample(channel=6, device=0, time_ns=now, pose=pb.Pose(qw=1, x=number, y=200)),
            pb.Sample(channel=6, device=0, time_ns=now, handle=pb.Handle(opening=0, buttons=buttons))])

    def send(self, frames):
        """Each is made when its turn comes, if they come from a generator."""
        for frame in frames:
            self.station.say(frame=frame)
            self.station.hear(0.005)

    def rows(self):
        """By number of the frame."""
        def read():
            table = call("arthron-trace", "export", self.session()["trace"], "--csv", "-", code=None).stdout
            return {row["frame_number"]: row for row in csv.DictReader(io.StringIO(table))}
        return wait_until("the trace is on the disk", lambda: (rows := read()) and "40" in rows and rows)

    def counts(self):
        return {name: self.session()["frames_" + name] for name in ("lost", "late", "old", "invalid")}

    def test_what_a_late_frame_alone_told_is_used(self):
        self.send(self.frame(number) for number in range(1, 20))
        told = {number: self.frame(number, buttons=1 if number == 21 else 0) for number in range(20, 24)}
        self.send(told[number] for number in (22, 20, 21, 20, 23))  # 21 alone has the press; 20 comes twice
        self.send(self.frame(number) for number in (*range(24, 31), LAST_NUMBER, *range(31, 41)))
        self.assertEqual(self.counts(), {"lost": 0, "late": 2, "old": 1, "invalid": 1})
        rows = self.rows()
        pressed = [number for number, row in rows.items() if row["shaver_buttons"] not in ("", "0")]
        self.assertEqual(pressed, ["23"])
        self.assertEqual(float(rows["23"]["shaver_tx_mm"]), 23)
        self.assertNotIn("21", rows)

    def test_a_number_that_never_comes_is_lost(self):
        self.send(self.frame(number) for number in range(1, 41) if number % 10 or number == 40)

        def all_counted():
            self.station.hear(0.05)
            return self.counts()["lost"] == 3
        wait_until("they are counted", all_counted)
        self.assertEqual(self.counts(), {"lost": 3, "late": 0, "old": 0, "invalid": 0})


if __name__ == "__main__":
    unittest.main(verbosity=2)
