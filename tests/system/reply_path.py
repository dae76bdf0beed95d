"""A station proves its address by what arrives there. Who sends its datagrams on from elsewhere gets few replies."""

import socket
import time
import unittest

from arthron import SystemTest, call, wait_until
from share import example, pb

UNCONFIRMED = 1024  # server/net/datagram.h


class ReplyPath(SystemTest):
    def setUp(self):
        super().setUp()
        self.start_server("[station room-1]\ncase = healthy")
        code = call("arthron-server", "keys", "enrol", self.keys, "room-1").stdout.strip()
        example.enrol("127.0.0.1", self.port, code, "room-1", self.path("keys-room-1"))
        self.station = example.Station("127.0.0.1", self.port, "room-1", self.path("keys-room-1"))
        self.addCleanup(self.station.close)
        self.asked_by_tcp, self.challenges = [], []
        hear_message, show = self.station.hear_message, self.station.show

        def note_message(message, received_ns):
            if message.WhichOneof("message") == "udp_path":
                self.asked_by_tcp.append(message.udp_path.challenge)
            return hear_message(message, received_ns)

        def note_reply(reply):
            if reply.path_challenge:
                self.challenges.append(reply.path_challenge)
            return show(reply)
        self.station.hear_message, self.station.show = note_message, note_reply
        wait_until("its session", lambda: self.station.hear(0.01) or (
            self.station.state == pb.RUNNING and self.station.datagrams))

    def exchange(self, frames):
        """Sends so many, each when the one before was answered."""
        for _ in range(frames):
            self.station.send(example.samples_at(1))
            end = time.monotonic() + 1
            while not self.station.hear(0.001) and time.monotonic() < end:
                pass

    def move(self):
        """Another source port; the one before stays with the caller."""
        datagrams = self.station.datagrams
        before = datagrams.socket
        datagrams.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        datagrams.socket.connect(before.getpeername())
        self.addCleanup(before.close)
        return before

    def test_an_address_is_confirmed_by_what_replies_to_it_say(self):
        self.exchange(20)
        self.assertEqual(len(set(self.challenges)), 1)
        time.sleep(0.2)  # the pause between two challenges
        self.move()
        self.exchange(30)
        self.assertEqual(len(set(self.challenges)), 2)
        told = len(self.challenges)
        self.exchange(20)
        self.assertEqual(len(self.challenges), told)
        self.assertEqual(self.asked_by_tcp, [])

    def test_who_sends_datagrams_on_from_elsewhere_gets_few_replies(self):
        self.exchange(20)
        thief = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.addCleanup(thief.close)
        datagrams, got = self.station.datagrams, 0
        thief.connect(datagrams.socket.getpeername())
        thief.setblocking(False)
        own, datagrams.socket = datagrams.socket, thief
        for i in range(UNCONFIRMED + 300):
            self.station.number += 1
            datagrams.send(pb.Frame(number=self.station.number, time_ns=time.monotonic_ns(),
                                    samples=example.samples_at(1)))
            datagrams.socket = own
            self.station.hear(0)
            datagrams.socket = thief
            time.sleep(0.0005)
            got += self.drain(thief)
        time.sleep(0.3)
        got += self.drain(thief)
        self.assertGreater(got, 100)
        self.assertLessEqual(got, UNCONFIRMED)
        self.assertEqual(self.asked_by_tcp, [])
        datagrams.socket, before = own, self.station.by_datagram
        self.exchange(20)
        self.assertGreater(self.station.by_datagram - before, 15)

    @staticmethod
    def drain(thief):
        count = 0
        try:
            while thief.recv(2048):
                count += 1
        except BlockingIOError:
            return count


if __name__ == "__main__":
    unittest.main(verbosity=2)
