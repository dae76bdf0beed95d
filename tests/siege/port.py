"""The stations' port is full of connections that prove nothing. Stations come back and enrol as if nobody was there."""

import asyncio
import os
import signal
import socket
import ssl
import sys
import time
import unittest

from siege import FULL, Siege, end, seconds_until

ENEMY, HOME = "127.0.0.66", "127.0.0.1"  # stations are at the second one
SECONDS = 60
BACK_S = 5  # what a person waits
UPGRADE = ("GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
           "Sec-WebSocket-Protocol: arthron-enrol.1\r\n\r\n").encode()

# ---- the attackers ---------------------------------------------------------------------------------


def no_trust():
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


async def come_again_and_again(kind, source, port, until, pause_s, counts):
    """Opens a connection, goes as far as its kind does, is silent until the server ends it."""
    context = no_trust() if kind != "tcp" else None
    while time.monotonic() < until:
        writer = None
        try:
            reader, writer = await asyncio.wait_for(
                asyncio.open_connection(HOME, port, ssl=context, local_addr=(source, 0)), 10)
            counts[kind] = counts.get(kind, 0) + 1
            if kind == "websocket":
                writer.write(UPGRADE)
            while await asyncio.wait_for(reader.read(4096), max(0.1, until - time.monotonic())):
                pass
        except (OSError, asyncio.TimeoutError, ssl.SSLError):
            pass
        finally:
            if writer:
                writer.transport.abort()
        await asyncio.sleep(pause_s)


async def besiege(source, port, seconds, pause_s, kinds):
    counts, until = {}, time.monotonic() + seconds
    loops = [come_again_and_again(kind, source, port, until, pause_s, counts)
             for kind, count in kinds.items() for _ in range(count)]
    attack = asyncio.gather(*loops)
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, attack.cancel)
    print("begun", flush=True)
    try:
        await attack
    except asyncio.CancelledError:
        pass
    print(counts, flush=True)


def hold_silent(source, port, count, seconds):
    """So many connections at once that say nothing, for as long as the server lets them."""
    held = []
    for _ in range(count):
        try:
            held.append(socket.create_connection((HOME, port), timeout=5, source_address=(source, 0)))
        except OSError:
            break
    print(len(held), "begun", flush=True)
    time.sleep(seconds)


def attack(kind, source, port, seconds, *counts):
    port, seconds = int(port), float(seconds)
    if kind == "silent":
        hold_silent(source, port, int(counts[0]), seconds)
    else:
        kinds = dict(zip(("tcp", "tls", "websocket"), map(int, counts)))
        asyncio.run(besiege(source, port, seconds, 0.05 if FULL else 0.2, kinds))


# ---- the siege -------------------------------------------------------------------------------------

ROOMS = "".join(f"[station room-{i}]\ncase = healthy\n" for i in range(1, 8))


class Port(Siege):
    def setUp(self):
        super().setUp()
        self.server = self.start_server(ROOMS)
        self.start_mockup()
        for room in ("room-1", "room-2"):
            self.enrol(room)
        self.back = self.start_station("room-1")
        self.wait_for_steps()

    def besiege(self, kind, source, *counts):
        attacker = self.attack(kind, source, self.port, SECONDS, *counts)
        self.assertIn("begun", attacker.stdout.readline())
        time.sleep(1)  # a moment to fill the port
        return attacker

    def come_back(self):
        """How long the station takes from its start to the server's Welcome."""
        self.back.end()
        self.back = self.start_station("room-1", label=f"room-1-{time.monotonic_ns()}")
        return seconds_until(lambda: "welcomed by" in self.back.log(), SECONDS + 30)

    def enrol_another(self, room):
        begun = time.monotonic()
        self.enrol(room)
        return time.monotonic() - begun

    def hold(self, name, room, kind, source, *counts):
        others = self.start_station("room-2", "--seconds", "30" if FULL else "4", label=f"room-2-{room}")
        log_bytes = os.path.getsize(self.server.log_path)
        attacker = self.besiege(kind, source, *counts)
        back_s, enrolled_s = self.come_back(), self.enrol_another(room)
        others.process.wait(timeout=90)
        if FULL:
            attacker.wait(timeout=SECONDS + 30)
        self.figure(f"{name}: connections made", end(attacker).strip() or counts[0])
        self.figure(f"{name}: back after", back_s if back_s is not None else "not at all", "s")
        self.figure(f"{name}: enrolled after", enrolled_s, "s")
        steps = self.summary(others)
        self.figure(f"{name}: round trip of another station, p50 and p99",
                    f"{steps['rtt_us']['p50']:.0f} and {steps['rtt_us']['p99']:.0f}", "us")
        self.figure(f"{name}: its poses sent, unanswered", f"{steps['poses_sent']}, {steps['unanswered']}")
        self.figure(f"{name}: growth of the log", os.path.getsize(self.server.log_path) - log_bytes, "bytes")
        self.assertIsNotNone(back_s, self.back.log())
        self.assertLess(back_s, BACK_S)
        self.assertLess(enrolled_s, BACK_S)

    def test_three_hundred_connections_of_all_kinds_that_come_again(self):
        if FULL:
            calm = self.start_station("room-2", "--seconds", "30", label="calm")
            calm.process.wait(timeout=60)
            self.figure("calm: round trip of a station, p50 and p99", "{p50:.0f} and {p99:.0f}".format(
                **self.summary(calm)["rtt_us"]), "us")
        self.hold("300 that come again", "room-3", "again", ENEMY, 100, 100, 100)

    def test_two_thousand_silent_connections(self):
        self.hold("2000 silent", "room-4", "silent", ENEMY, 2000)

    @unittest.skipUnless(FULL, "as the test before")
    def test_two_thousand_silent_connections_of_the_stations_own_address(self):
        self.hold("2000 silent, own address", "room-5", "silent", HOME, 2000)

    @unittest.skipUnless(FULL, "as the first test")
    def test_a_hundred_and_forty_that_seem_to_enrol(self):
        self.hold("140 to enrol, own address", "room-6", "again", HOME, 0, 0, 140)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--attack"]:
        attack(*sys.argv[2:])
    else:
        unittest.main(verbosity=2)
