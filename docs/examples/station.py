#!/usr/bin/env python3
"""A small station for Arthron. shared/wire/GUIDE.md explains it step by step.

  protoc --proto_path=shared/wire --python_out=docs/examples arthron.proto
  docs/examples/station.py enrol HOST:PORT CODE NAME FOLDER
  docs/examples/station.py run HOST:PORT NAME FOLDER [SECONDS]
"""

import base64
import hashlib
import math
import os
import re
import select
import socket
import ssl
import struct
import subprocess
import sys
import time

import arthron_pb2 as pb
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

JOINT, PROBE = 0, 4  # channels

# ---- enrolment -----------------------------------------------------------------------------------


def code_fingerprint(code):
    """The 16 bytes of an enrolment code that name the server's authority."""
    typed = re.sub(r"[-\s]", "", code).upper().translate(str.maketrans("018", "OIB"))
    data = base64.b32decode(typed)
    if len(data) != 30 or hashlib.sha256(data[:29]).digest()[0] != data[29]:
        raise ValueError("the code is mistyped")
    return data[13:29]


def server_chain(host, port):
    """The certificates that the server shows, unchecked. Python 3.11's ssl has no public call for them."""
    shown = subprocess.run(["openssl", "s_client", "-connect", f"{host}:{port}", "-alpn", "http/1.1", "-showcerts"],
                           stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=15).stdout
    return re.findall(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----\n", shown, re.DOTALL)


def authority_of(host, port, code):
    wanted = code_fingerprint(code)
    for certificate in server_chain(host, port):
        if hashlib.sha256(ssl.PEM_cert_to_DER_cert(certificate)).digest()[:16] == wanted:
            return certificate
    raise ConnectionError(f"{host}:{port} is not the server that made this code")


def enrol(host, port, code, name, folder):
    """Exchanges the code for a certificate. Leaves station.key, station.pem and authority.pem in the folder."""
    authority = authority_of(host, port, code)
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    request = x509.CertificateSigningRequestBuilder().subject_name(subject).sign(key, hashes.SHA256())

    socket_ = WebSocket(host, port, tls_context(authority), "arthron-enrol.1")
    ask = pb.Enrol(code=code, request_der=request.public_bytes(serialization.Encoding.DER))
    socket_.send(pb.Control(enrol=ask).SerializeToString())
    answer = pb.Control.FromString(socket_.receive(15))
    socket_.close()
    if not answer.HasField("enrolled"):
        raise ConnectionError(answer.refusal.text)
    certificate = x509.load_der_x509_certificate(answer.enrolled.certificate_der)
    if certificate.public_key().public_numbers() != key.public_key().public_numbers():
        raise ConnectionError("the certificate is for another key")
    if answer.enrolled.authority_der != ssl.PEM_cert_to_DER_cert(authority):
        raise ConnectionError("the certificate is of another authority")

    os.makedirs(folder, mode=0o700, exist_ok=True)
    private = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                                serialization.NoEncryption())
    for file, data in (("station.key", private), ("authority.pem", authority.encode()),
                       ("station.pem", certificate.public_bytes(serialization.Encoding.PEM))):
        with open(os.open(os.path.join(folder, file), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "wb") as out:
            out.write(data)


# ---- connection ----------------------------------------------------------------------------------


def tls_context(authority, folder=None):
    """Trusts this authority (PEM) and no other; shows the folder's certificate."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # checks the chain and the host's name
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.load_verify_locations(cadata=authority)
    context.set_alpn_protocols(["http/1.1"])
    if folder:
        context.load_cert_chain(os.path.join(folder, "station.pem"), os.path.join(folder, "station.key"))
    return context


class WebSocket:
    """As much of RFC 6455 as a station needs: binary messages over TLS."""

    def __init__(self, host, port, context, subprotocol):
        plain = socket.create_connection((host, port), timeout=15)
        plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket = context.wrap_socket(plain, server_hostname=host)
        self.buffer = b""
        self.socket.sendall((f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                             f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {subprotocol}\r\n"
                             f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n").encode())
        while b"\r\n\r\n" not in self.buffer:
            self.read()
        head, self.buffer = self.buffer.split(b"\r\n\r\n", 1)
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise ConnectionError(head.decode())

    def read(self):
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError("the server closed the connection")
        self.buffer += data

    def send(self, data, opcode=2):
        size = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(">H", len(data))
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        self.socket.sendall(bytes([0x80 | opcode]) + size + mask + masked)

    def take(self):
        """The next frame in the buffer as (opcode, data), or None."""
        if len(self.buffer) < 2:
            return None
        start, size = 2, self.buffer[1]
        if size == 126:
            start, size = 4, int.from_bytes(self.buffer[2:4], "big")
        elif size == 127:
            start, size = 10, int.from_bytes(self.buffer[2:10], "big")
        if len(self.buffer) < max(start, start + size):
            return None
        opcode, data = self.buffer[0], self.buffer[start:start + size]
        self.buffer = self.buffer[start + size:]
        return opcode, data

    def message(self):
        """A message that has arrived whole, or None."""
        while True:
            frame = self.take()
            if not frame:
                return None
            opcode, data = frame
            if opcode == 0x82:
                return data
            if opcode == 0x88:
                raise ConnectionError(f"the server closed the connection: {data!r}")
            if opcode == 0x89:
                self.send(data, opcode=10)

    def receive(self, seconds):
        self.socket.settimeout(seconds)
        while True:
            message = self.message()
            if message is not None:
                return message
            self.read()

    def poll(self, others, seconds):
        """Waits for data here or on one of `others`, which come back where they have some."""
        if self.socket.pending():
            seconds = 0
        ready = select.select([self.socket, *others], [], [], seconds)[0]
        if self.socket in ready or self.socket.pending():
            self.read()
        return [other for other in others if other in ready]

    def close(self):
        self.socket.close()


# ---- datagrams -----------------------------------------------------------------------------------


class Datagrams:
    """Sealed frames and replies over UDP."""

    def __init__(self, host, keys):
        self.socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, keys.port))
        self.keys, self.sequence = keys, 0

    @staticmethod
    def crypt(operation, key, iv, header, data):
        nonce = iv[:4] + bytes(a ^ b for a, b in zip(iv[4:], header[8:16]))
        return operation(AESGCM(key), nonce, data, header)

    def seal(self, message):
        header = struct.pack(">BBBBIQ", 1, 1, self.keys.epoch, 0, self.keys.connection, self.sequence)
        self.sequence += 1
        return header + self.crypt(AESGCM.encrypt, self.keys.key_to_server, self.keys.iv_to_server, header, message)

    def open(self, datagram):
        header, data = datagram[:16], datagram[16:]
        version, direction, epoch, _, connection, _ = struct.unpack(">BBBBIQ", header)
        if (version, direction, epoch, connection) != (1, 2, self.keys.epoch, self.keys.connection):
            raise ValueError("another datagram's header")
        return self.crypt(AESGCM.decrypt, self.keys.key_to_station, self.keys.iv_to_station, header, data)

    def send(self, frame):
        """Pads the frame: the server sends no reply that is longer than the frame."""
        instruments = {sample.channel for sample in frame.samples if sample.channel >= PROBE}
        padded = pb.Frame()
        padded.CopyFrom(frame)
        padded.padding = bytes(max(0, 183 + 225 * len(instruments) - padded.ByteSize()))
        self.socket.send(self.seal(padded.SerializeToString()))

    def close(self):
        self.socket.close()


# ---- poses ---------------------------------------------------------------------------------------
# A pose T_a_b is (quaternion, translation): it takes a point from frame b to frame a.


def multiply(p, q):
    return (p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3], p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1], p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0])


def rotate(q, v):
    return multiply(multiply(q, (0, *v)), (q[0], -q[1], -q[2], -q[3]))[1:]


def compose(a, b):
    return multiply(a[0], b[0]), tuple(x + y for x, y in zip(a[1], rotate(a[0], b[1])))


def inverse(a):
    turned_back = (a[0][0], -a[0][1], -a[0][2], -a[0][3])
    return turned_back, tuple(-x for x in rotate(turned_back, a[1]))


def from_message(m):
    return (m.qw, m.qx, m.qy, m.qz), (m.x, m.y, m.z)


def about(axis, degrees):
    half = math.radians(degrees) / 2
    return (math.cos(half), *(math.sin(half) * (axis == i) for i in range(3)))


def tibia_in_femur(knee, joint):
    """T_femur_tibia of a joint's angles, with the joint frames of the session's case."""
    mirror = -1 if knee.side == pb.Knee.LEFT else 1
    turn = multiply(multiply(about(0, -joint.flexion_deg), about(1, mirror * joint.varus_deg)),
                    about(2, mirror * joint.internal_deg))
    e1, e3 = (1, 0, 0), rotate(turn, (0, 0, 1))
    length = math.hypot(e3[2], e3[1])
    e2 = (0, e3[2] / length, -e3[1] / length)  # e3 x e1
    shift = tuple(mirror * joint.shift_mm * a + joint.drawer_mm * b - joint.distraction_mm * c
                  for a, b, c in zip(e1, e2, e3))
    return compose(compose(from_message(knee.femur_joint), (turn, shift)), inverse(from_message(knee.tibia_joint)))


# ---- the station ---------------------------------------------------------------------------------


class Station:
    def __init__(self, host, port, name, folder):
        with open(os.path.join(folder, "authority.pem")) as f:
            authority = f.read()
        self.host = host
        self.socket = WebSocket(host, port, tls_context(authority, folder), "arthron.1")
        self.number, self.knee, self.state, self.datagrams = 0, None, pb.CLOSED, None
        self.heard_datagram = self.tried_datagram = -math.inf
        self.by_tcp = self.by_datagram = 0
        self.bodies, self.warped = {}, {}
        hello = pb.Hello(version_min=1, version_max=1, capabilities=["datagrams", "path"], station=name,
                         software="example station", devices=[pb.Device(name="hands", driver="example")],
                         connection=int.from_bytes(os.urandom(8), "little"))
        self.say(hello=hello)
        answer = pb.Control.FromString(self.socket.receive(15))
        self.welcome = answer.welcome
        if not self.welcome.version:
            raise ConnectionError(answer.refusal.text or "the server does not welcome this station")

    def close(self):
        self.socket.close()
        if self.datagrams:
            self.datagrams.close()

    def say(self, **message):
        self.socket.send(pb.Control(**message).SerializeToString())

    # ---- what the server says

    def hear(self, seconds):
        """Handles what comes within so many seconds; returns the replies."""
        replies, end = [], time.monotonic() + seconds
        while True:
            others = [self.datagrams.socket] if self.datagrams else []
            if self.socket.poll(others, max(0, end - time.monotonic())):
                replies.append(self.hear_datagram())
            while (message := self.socket.message()) is not None:
                replies.append(self.hear_message(pb.Control.FromString(message), time.monotonic_ns()))
            if time.monotonic() >= end:
                return [reply for reply in replies if reply]

    def hear_message(self, message, received_ns):
        kind = message.WhichOneof("message")
        if kind == "ping":
            self.say(pong=pb.Pong(sent_ns=message.ping.sent_ns, received_ns=received_ns,
                                  answered_ns=time.monotonic_ns()))
        elif kind == "session_change":
            self.state = message.session_change.state
            if message.session_change.HasField("knee"):
                self.knee = message.session_change.knee
        elif kind == "udp_keys":
            if self.datagrams:
                self.datagrams.close()
            self.datagrams = Datagrams(self.host, message.udp_keys)
        elif kind == "refusal":
            raise ConnectionError(message.refusal.text)
        elif kind == "reply":
            self.by_tcp += 1
            return self.show(message.reply)

    def hear_datagram(self):
        reply = pb.Reply.FromString(self.datagrams.open(self.datagrams.socket.recv(2048)))
        self.heard_datagram = time.monotonic()
        self.by_datagram += 1
        if reply.path_challenge:  # it shows the server that datagrams to this address arrive
            self.say(udp_path=pb.UdpPath(challenge=reply.path_challenge))
        return self.show(reply)

    # ---- frames and replies

    def send(self, samples):
        """One frame: by datagram while datagrams are answered, else by TCP and once a second by both."""
        self.number += 1
        frame = pb.Frame(number=self.number, time_ns=time.monotonic_ns(), samples=samples)
        now = time.monotonic()
        datagrams_pass = now - self.heard_datagram < 0.3
        if self.datagrams and (datagrams_pass or now - self.tried_datagram >= 1):
            self.datagrams.send(frame)
            self.tried_datagram = now
        if not datagrams_pass:
            self.say(frame=frame)
        self.place_bones(samples)

    def place_bones(self, samples):
        """T_mockup_femur and T_mockup_tibia. Nothing here tracks the femur: it is the mock-up's frame."""
        self.bodies[pb.BODY_FEMUR] = ((1, 0, 0, 0), (0, 0, 0))
        for sample in samples:
            if sample.channel == JOINT and self.knee:
                self.bodies[pb.BODY_TIBIA] = tibia_in_femur(self.knee, sample.joint)

    def show(self, reply):
        """Places the instruments: T_mockup_warped = T_mockup_body · T_body_warped."""
        for instrument in reply.instruments:
            if instrument.validity != pb.LOST and instrument.body in self.bodies:
                self.warped[instrument.channel] = compose(self.bodies[instrument.body], from_message(instrument.pose))
        return reply


def samples_at(seconds):
    """What a real station reads from its devices: the joint's angles and a probe's tip."""
    now = time.monotonic_ns()
    flexion = 45 - 45 * math.cos(seconds)
    return [pb.Sample(channel=JOINT, device=0, time_ns=now, joint=pb.Joint(flexion_deg=flexion)),
            pb.Sample(channel=PROBE, device=0, time_ns=now, pose=pb.Pose(qw=1, x=20, y=30 + 5 * math.sin(seconds)))]


def run(host, port, name, folder, seconds):
    station = Station(host, port, name, folder)
    print(f"welcome to case {station.welcome.case_name}", flush=True)
    while station.state == pb.CLOSED:
        station.hear(0.01)
    start, told = time.monotonic(), 0
    while (elapsed := time.monotonic() - start) < seconds:
        station.send(samples_at(elapsed))
        station.hear(0.01)
        if elapsed >= told:
            told += 1
            place = station.bodies[pb.BODY_TIBIA][1]
            print(f"replies: {station.by_tcp} by TCP, {station.by_datagram} by datagram; "
                  f"tibia at {place[0]:.1f} {place[1]:.1f} {place[2]:.1f} mm; warped: "
                  + ", ".join(f"{'probe' if c == PROBE else c} at {p[1][0]:.1f} {p[1][1]:.1f} {p[1][2]:.1f} mm"
                              for c, p in station.warped.items()), flush=True)
    station.close()


def main(arguments):
    if len(arguments) == 5 and arguments[0] == "enrol":
        host, port = arguments[1].rsplit(":", 1)
        enrol(host, int(port), arguments[2], arguments[3], arguments[4])
    elif len(arguments) in (4, 5) and arguments[0] == "run":
        host, port = arguments[1].rsplit(":", 1)
        run(host, int(port), arguments[2], arguments[3], float((arguments + ["10"])[4]))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
