#!/usr/bin/env python3
"""Records what a station and its server say to each other: the messages inside TLS and inside the datagrams.

Usage: record.py BUILD CASE OUT   (Debian's Python; ARTHRON_SOURCE and PYTHONPATH as ctest sets them)

BUILD is the build folder of the release whose station is recorded. The recorder stands between both as a relay:
it shows the server's certificate to the station, and the station's to the server. tests/system/conversation.py plays
the station's side of the file.
"""

import json
import lzma
import os
import select
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time

from cryptography.hazmat.primitives.ciphers.aead import AESGCM

BUILD, CASE, OUT = sys.argv[1:4]
os.environ.update(ARTHRON_BIN=os.path.join(BUILD, "bin"), ARTHRON_CASES=CASE)
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "../../system"))
from arthron import Process, call, free_port, program, wait_until  # noqa: E402

made = tempfile.mkdtemp()
subprocess.run(["protoc", "--proto_path", HERE, "--python_out", made, "arthron.proto"], check=True)
sys.path.insert(0, made)
import arthron_pb2 as pb  # noqa: E402

STATION, SERVER = "127.0.0.2", "127.0.0.1"  # the relay's address to the station, and the server's
SECONDS = 7

MOTION = """
[motion]
rate_hz = 100
speed_mm_s = 120
joint_speed_deg_s = 60
tremor_mm = 0.05
seed = 1
[steps]
flex = 10
valgus = 8
approach = probe anteromedial
trace = probe meniscus_medial
withdraw = probe
approach = punch anterolateral
bite = punch meniscus_medial
bite = punch meniscus_medial
withdraw = punch
"""


class Record:
    def __init__(self):
        self.lines, self.lock, self.keys = [], threading.Lock(), None

    def add(self, sender, way, data):
        with self.lock:
            self.lines.append({"ns": time.monotonic_ns(), "from": sender, "by": way, "message": data.hex()})

    def control(self, sender, data):
        message = pb.Control.FromString(data)
        if message.HasField("udp_keys"):
            self.keys = message.udp_keys
        if message.HasField("mesh_chunk"):
            message.mesh_chunk.data = b""
            data = message.SerializeToString()
        self.add(sender, "tcp", data)

    def datagram(self, sender, data):
        to_server = sender == "station"
        key = self.keys.key_to_server if to_server else self.keys.key_to_station
        iv = self.keys.iv_to_server if to_server else self.keys.iv_to_station
        nonce = iv[:4] + bytes(a ^ b for a, b in zip(iv[4:], data[8:16]))
        self.add(sender, "udp", AESGCM(key).decrypt(nonce, data[16:], data[:16]))


class Messages:
    """Takes the WebSocket messages out of one direction's bytes."""

    def __init__(self, record, sender):
        self.record, self.sender, self.data, self.opened = record, sender, b"", False

    def take(self, data):
        self.data += data
        if not self.opened:
            if b"\r\n\r\n" not in self.data:
                return
            self.data, self.opened = self.data.split(b"\r\n\r\n", 1)[1], True
        while len(self.data) >= 2:
            masked, size, start = self.data[1] >> 7, self.data[1] & 127, 2
            if size >= 126:
                start = 4 if size == 126 else 10
                size = int.from_bytes(self.data[2:start], "big")
            if len(self.data) < start + 4 * masked + size:
                return
            mask = self.data[start:start + 4] if masked else bytes(4)
            body = self.data[start + 4 * masked:start + 4 * masked + size]
            if self.data[0] == 0x82:
                self.record.control(self.sender, bytes(b ^ mask[i % 4] for i, b in enumerate(body)))
            self.data = self.data[start + 4 * masked + size:]


def relay_control(record, listener, port, keys, station_keys):
    to_station = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    to_station.load_cert_chain(f"{keys}/server.pem", f"{keys}/server.key")
    to_station.load_verify_locations(f"{keys}/authority.pem")
    to_station.verify_mode = ssl.CERT_REQUIRED
    to_server = ssl.create_default_context(cafile=f"{keys}/authority.pem")
    to_server.load_cert_chain(f"{station_keys}/station.pem",
                              next(p for p in (f"{station_keys}/station.key", f"{station_keys}/station.pem")
                                   if os.path.exists(p)))
    for context in (to_station, to_server):
        context.set_alpn_protocols(["http/1.1"])
    near = to_station.wrap_socket(listener.accept()[0], server_side=True)
    far = to_server.wrap_socket(socket.create_connection((SERVER, port)), server_hostname=SERVER)
    pairs = {near: (far, Messages(record, "station")), far: (near, Messages(record, "server"))}
    while True:
        ready = [s for s in pairs if s.pending()] or select.select(list(pairs), [], [])[0]
        for source in ready:
            data = source.recv(65536)
            if not data:
                return
            target, messages = pairs[source]
            target.sendall(data)
            messages.take(data)


def relay_datagrams(record, near, port):
    far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    far.connect((SERVER, port))
    station = None
    while True:
        for source in select.select([near, far], [], [])[0]:
            data, address = source.recvfrom(2048)
            if source is near:
                station = address
                far.send(data)
            else:
                near.sendto(data, station)
            record.datagram("station" if source is near else "server", data)


def main():
    folder = tempfile.mkdtemp(prefix="arthron-record-")
    keys, port, udp_port = f"{folder}/keys", free_port(), free_port(socket.SOCK_DGRAM)
    call("arthron-server", "keys", "init", keys, SERVER, STATION)
    for name, text in (("motion.ini", MOTION), ("server.ini", f"""
[server]
address = {SERVER}
port = {port}
udp_port = {udp_port}
workers = 1
keys = keys
traces = traces
socket = s
[warp]
hold_ms = 5000
[case case]
dir = {CASE}
[station room-1]
case = case
""")):
        with open(f"{folder}/{name}", "w") as f:
            f.write(text)
    call("arthron-case", "motion", f"{folder}/motion.ini", "--case", CASE, "--out", f"{folder}/motion.csv")
    mockup = Process(folder, "mockup", program("arthron-mockup"), "--motion", f"{folder}/motion.csv", "--modbus-tcp",
                     "127.0.0.1:0", "--tracker", "127.0.0.1:0")
    wait_until("the mock-up's ports", lambda: mockup.out().count("\n") >= 2)
    ports = dict(line.split() for line in mockup.out().splitlines())
    server = Process(folder, "server", program("arthron-server"), "run", "--config", f"{folder}/server.ini")
    server.wait_for_log("ready")
    code = call("arthron-server", "keys", "enrol", keys, "room-1").stdout.strip()
    call("arthron-station", "enrol", f"{SERVER}:{port}", code, "--name", "room-1", "--keys", f"{folder}/station")
    with open(f"{folder}/station.ini", "w") as f:
        f.write(f"""
[station]
name = room-1
server = {STATION}:{port}
keys = station
rate_hz = 60
[device encoders]
driver = modbus
address = {ports["modbus-tcp"]}
rate_hz = 100
sequence = 0
flexion = 1 0.01 0
varus = 2 0.01 0
internal = 3 0.01 0
shift = 4 0.01 0
drawer = 5 0.01 0
distraction = 6 0.01 0
punch.opening = 7 0.0001 0
[device tracker]
driver = tracker
address = {ports["tracker"]}
tool.probe = probe
tool.punch = punch
""")
    record = Record()
    listener = socket.create_server((STATION, port))
    datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    datagrams.bind((STATION, udp_port))
    for target, arguments in ((relay_control, (record, listener, port, keys, f"{folder}/station")),
                              (relay_datagrams, (record, datagrams, udp_port))):
        threading.Thread(target=target, args=arguments, daemon=True).start()
    station = Process(folder, "station", program("arthron-station"), "run", "--config", f"{folder}/station.ini")
    time.sleep(SECONDS)
    for process in (station, server, mockup):
        process.end()
    with lzma.open(OUT, "wt") as out:
        out.writelines(json.dumps(line) + "\n" for line in record.lines)


if __name__ == "__main__":
    main()
