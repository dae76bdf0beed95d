"""A thief has a station's certificate and wants the whole server with it. It is revoked in the middle."""

import glob
import json
import os
import socket
import ssl
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from arthron import SOURCE, call
from siege import FULL, Siege, end

VISITS = 64
FRAMES_PER_S = 50000 if FULL else 10000  # over each way; Python may not get that far
ASKS_PER_S = 200
BEFORE_S, AFTER_S = (20, 10) if FULL else (2.5, 2.5)  # the revocation
PATIENCE_S = 60  # for it
END_OF_STEPS_S = 1
LOG_BYTES_MAX = 1 << 20

# ---- the attacker ----------------------------------------------------------------------------------


def load_example():
    """The example station's WebSocket and messages."""
    made = tempfile.mkdtemp(prefix="arthron-siege-")
    subprocess.run(["protoc", "--proto_path", os.path.join(SOURCE, "shared/wire"), "--python_out", made,
                    "arthron.proto"], check=True)
    sys.dont_write_bytecode = True
    sys.path[:0] = [made, os.path.join(SOURCE, "docs/examples")]
    import station
    return station


class Thief:
    def __init__(self, port, keys):
        self.example = load_example()
        self.pb, self.port = self.example.pb, port
        with open(os.path.join(keys, "authority.pem")) as f:
            self.context = self.example.tls_context(f.read(), keys)
        self.socket = self.greet(visit=False)
        self.keys, self.number = None, 0
        self.sent = {"udp": 0, "tcp": 0, "asks": 0}
        self.last_reply_s, self.closed_s = 0, 0

    def greet(self, visit):
        socket_ = self.example.WebSocket("127.0.0.1", self.port, self.context, "arthron.1")
        hello = self.pb.Hello(version_min=1, version_max=1, capabilities=["datagrams", "meshes"], station="room-2",
                              software="thief", devices=[self.pb.Device(name="hands", driver="thief")], connection=1,
                              visit=visit)
        socket_.send(self.pb.Control(hello=hello).SerializeToString())
        return socket_

    def visit(self):
        """How many of many visits are still open at the end."""
        visits = []
        for _ in range(VISITS):
            try:
                visits.append(self.greet(visit=True))
            except (OSError, ConnectionError):
                pass
            self.hear(0)
        time.sleep(0.5)
        return sum(map(self.is_open, visits))

    def is_open(self, visit):
        visit.socket.settimeout(0.05)
        try:
            while True:
                visit.read()
                while (data := visit.message()) is not None:
                    if self.pb.Control.FromString(data).HasField("refusal"):
                        return False
        except TimeoutError:
            return True
        except (OSError, ConnectionError):
            return False

    def renew(self):
        """What the server says to a wish for a new certificate, for which there is no code."""
        socket_ = self.example.WebSocket("127.0.0.1", self.port, self.context, "arthron-enrol.1")
        socket_.send(self.pb.Control(enrol=self.pb.Enrol(request_der=b"no request")).SerializeToString())
        return self.pb.Control.FromString(socket_.receive(15)).refusal.text

    def hear(self, seconds):
        if not self.socket.poll([], seconds):
            while (data := self.socket.message()) is not None:
                message = self.pb.Control.FromString(data)
                if message.HasField("ping"):
                    now = time.monotonic_ns()
                    pong = self.pb.Pong(sent_ns=message.ping.sent_ns, received_ns=now, answered_ns=now)
                    self.socket.send(self.pb.Control(pong=pong).SerializeToString())
                elif message.HasField("udp_keys"):
                    self.keys = message.udp_keys
                elif message.HasField("udp_path"):
                    self.socket.send(data)

    def template(self):
        now = time.monotonic_ns()
        pose = self.pb.Pose(qw=1, x=10, y=5, z=5)
        frame = self.pb.Frame(number=1, time_ns=now, padding=bytes(380), samples=[
            self.pb.Sample(channel=4, validity=self.pb.OK, time_ns=now, pose=pose)])
        return bytearray(frame.SerializeToString())

    def next_frame(self, frame):
        self.number += 1
        struct.pack_into("<Q", frame, 1, self.number)  # the fields of fixed size begin the message
        struct.pack_into("<Q", frame, 10, time.monotonic_ns())
        return bytes(frame)

    def goes_on(self):
        """Until some time after the server ended the connection."""
        now = time.monotonic()
        return now < self.closed_s + AFTER_S if self.closed_s else now < self.until

    def flood_udp(self):
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM
        cipher, iv = AESGCM(self.keys.key_to_server), self.keys.iv_to_server
        tail = int.from_bytes(iv[4:], "big")
        out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        out.setblocking(False)
        out.connect(("127.0.0.1", self.keys.port))
        frame, sequence, begun = self.template(), 0, time.monotonic()
        while self.goes_on():
            for _ in range(50):
                header = struct.pack(">BBBBIQ", 1, 1, self.keys.epoch, 0, self.keys.connection, sequence)
                nonce = iv[:4] + (tail ^ sequence).to_bytes(8, "big")
                try:
                    out.send(header + cipher.encrypt(nonce, self.next_frame(frame), header))
                except (BlockingIOError, ConnectionRefusedError):
                    pass
                sequence += 1
            self.sent["udp"] = sequence
            self.take_replies(out)
            time.sleep(max(0, begun + sequence / FRAMES_PER_S - time.monotonic()))

    def take_replies(self, out):
        try:
            while out.recv(2048):
                self.last_reply_s = time.monotonic()
        except (BlockingIOError, ConnectionRefusedError):
            pass

    def flood_tcp(self):
        """Frames and asks, and answers to pings, until the server ends the connection."""
        frame, begun, head = self.template(), time.monotonic(), b""
        control = self.pb.Control(frame=self.pb.Frame.FromString(bytes(frame))).SerializeToString()
        head = control[:len(control) - len(frame)]
        ask = self.pb.Control(mesh_ask=self.pb.MeshAsk(have=[self.pb.MeshState(group="meniscus_medial", number=7,
                                                                               hash=7)])).SerializeToString()
        try:
            while self.goes_on():
                batch = [head + self.next_frame(frame) for _ in range(50)]
                asks = int((time.monotonic() - begun) * ASKS_PER_S) - self.sent["asks"]
                self.socket.socket.settimeout(10)
                self.socket.socket.sendall(b"".join(map(framed, batch + [ask] * asks)))
                self.sent["tcp"] += len(batch)
                self.sent["asks"] += asks
                self.hear(0)
                time.sleep(max(0, begun + self.sent["tcp"] / FRAMES_PER_S - time.monotonic()))
        except (OSError, ConnectionError, ssl.SSLError):
            self.closed_s = time.monotonic()


def deaf_flood(port, keys, closes):
    """Sends what it can and reads nothing, so that what the server sends waits, until it is ended or ends itself."""
    thief = Thief(int(port), keys)
    while not thief.keys:
        thief.hear(0.05)
    thief.socket.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    thief.hear = lambda seconds: None
    thief.until = time.monotonic() + PATIENCE_S
    if closes == "closes":
        threading.Timer(BEFORE_S, lambda: thief.socket.socket.sendall(b"\x88\x80" + bytes(4))).start()
    print("it floods", flush=True)
    thief.flood_tcp()


def framed(data):
    """A WebSocket message whose mask is 0."""
    size = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(">H", len(data))
    return b"\x82" + size + bytes(4) + data


def attack(port, keys):
    os.nice(10)  # as if it were at another machine: it takes no processor that the server wants
    thief = Thief(int(port), keys)
    while not thief.keys:
        thief.hear(0.05)
    print(json.dumps({"visits": thief.visit()}), flush=True)
    begun = time.monotonic()
    thief.until = begun + BEFORE_S + PATIENCE_S
    threads = [threading.Thread(target=flood) for flood in (thief.flood_udp, thief.flood_tcp)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print(json.dumps({**thief.sent, "seconds": time.monotonic() - begun, "last_reply_s": thief.last_reply_s,
                      "closed_s": thief.closed_s, "renewed": thief.renew()}), flush=True)


# ---- the siege -------------------------------------------------------------------------------------

ROOMS = "[station room-1]\ncase = arthrosis\n[station room-2]\ncase = arthrosis\n"


class StolenCertificate(Siege):
    def honest(self, label, seconds):
        return self.start_station("room-1", "--seconds", str(seconds), label=label)

    def tell(self, when, station):
        steps = self.summary(station)
        self.figure(f"{when}: poses of the other station on that worker, and how many were not answered",
                    f"{steps['poses_sent']}, {steps['unanswered']}")
        self.figure(f"{when}: its round trip, p50 and p99", "{p50:.0f} and {p99:.0f}".format(**steps["rtt_us"]), "us")
        return steps

    def trace_bytes(self):
        return sum(map(os.path.getsize, glob.glob(os.path.join(self.traces, "room-2*"))))

    def test_the_others_go_on_and_its_steps_end_with_the_revocation(self):
        server = self.start_server(ROOMS)
        self.start_mockup()
        for room in ("room-1", "room-2"):
            self.enrol(room)
        calm = self.honest("calm", BEFORE_S)
        calm.process.wait(timeout=60)
        at_rest = self.tell("calm", calm)

        log_bytes = os.path.getsize(server.log_path)
        thief = self.attack(self.port, self.path("keys-room-2"))
        visits = json.loads(thief.stdout.readline())["visits"]
        others = self.honest("others", BEFORE_S)
        others.process.wait(timeout=60)
        call("arthron-server", "keys", "revoke", self.keys, "room-2")
        revoked_s = time.monotonic()
        thief.wait(timeout=PATIENCE_S + AFTER_S + 20)
        said = json.loads(end(thief))

        during = self.tell("besieged", others)
        self.figure("visits open of 64", visits)
        rates = [said[way] / said["seconds"] for way in ("udp", "tcp")]
        self.figure("frames a second by UDP and TCP", "{:.0f} and {:.0f}".format(*rates))
        self.figure("asks for meshes", said["asks"])
        self.figure("last reply after the revocation", said["last_reply_s"] - revoked_s, "s")
        self.figure("its trace", self.trace_bytes() / 1e6, "MB")
        log_bytes = os.path.getsize(server.log_path) - log_bytes
        self.figure("growth of the log", log_bytes, "bytes")
        self.assertLessEqual(visits, 1)
        self.assertGreater(said["last_reply_s"], 0)
        self.assertLess(said["last_reply_s"], revoked_s + END_OF_STEPS_S)
        self.assertGreater(said["closed_s"], 0)
        self.assertLess(log_bytes, LOG_BYTES_MAX)
        self.assertEqual(said["renewed"], "this certificate is revoked")
        self.assertGreater(during["poses_warped"], 0)
        if FULL:  # the others keep their rate
            self.assertGreater(during["poses_sent"], 0.8 * at_rest["poses_sent"])
            self.assertLess(during["unanswered"], at_rest["unanswered"] + 0.01 * during["poses_sent"])
        else:     # on a busy machine
            self.assertGreater(during["poses_sent"], 0.5 * at_rest["poses_sent"])
            self.assertLess(during["unanswered"], at_rest["unanswered"] + 0.05 * during["poses_sent"])


    def test_a_deaf_one_that_is_ended_holds_up_nobody(self):
        self.start_server(ROOMS)
        for ending in ("revoked", "closes"):
            self.enrol("room-2")
            thief = self.attack("deaf", self.port, self.path("keys-room-2"), ending)
            thief.stdout.readline()
            time.sleep(BEFORE_S)
            if ending == "revoked":
                call("arthron-server", "keys", "revoke", self.keys, "room-2")
            thief.wait(timeout=PATIENCE_S)
            begun = time.monotonic()
            self.enrol("room-1")
            self.figure(f"another one enrols once it {ending}", time.monotonic() - begun, "s")


if __name__ == "__main__":
    if sys.argv[1:3] == ["--attack", "deaf"]:
        deaf_flood(*sys.argv[3:])
    elif sys.argv[1:2] == ["--attack"]:
        attack(*sys.argv[2:])
    else:
        unittest.main(verbosity=2)
