"""A viewer of a station's own poses, on sockets alone: WebSocket and protobuf, as much as it takes."""

import base64
import os
import socket
import struct

POSE = ("qw", "qx", "qy", "qz", "x", "y", "z")
VALIDITIES = ("ok", "held", "lost")


def fields(data):
    """A protobuf message as (number, value): integers, bytes; 8 and 4 bytes as they are."""
    at = 0

    def varint():
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    while at < len(data):
        key = varint()
        kind = key & 7
        if kind == 0:
            yield key >> 3, varint()
            continue
        size = {1: 8, 5: 4}.get(kind) or varint()
        yield key >> 3, data[at:at + size]
        at += size


def one(data):
    return dict(fields(data))


def pose(data):
    values = one(data)
    return {name: struct.unpack("<d", values.get(i + 1, bytes(8)))[0] for i, name in enumerate(POSE)}


def instrument(data):
    values = one(data)
    return {
        "validity": VALIDITIES[values.get(2, 0)],
        "tip": pose(values[4]) if 4 in values else None,
        "warp_validity": VALIDITIES[values.get(5, 0)],
        "warped": pose(values[6]) if 6 in values else None,
        "age_ms": struct.unpack("<f", values.get(7, bytes(4)))[0],
        "clamped": bool(values.get(8, 0)),
    }


def loose(data):
    values = one(data)
    return {"state": ("lying", "held", "out")[values.get(2, 0)], "on": values.get(3, 0),
            "pose": pose(values[4]) if 4 in values else None}


def attempt(data):
    values = one(data)
    goals = [one(v) for n, v in fields(data) if n == 8]
    errors = [one(v) for n, v in fields(data) if n == 9]
    return {
        "number": values.get(1, 0), "task": values.get(2, b"").decode(), "title": values.get(3, b"").decode(),
        "purpose": values.get(4, 0), "hand": values.get(5, 0),
        "time_ns": struct.unpack("<q", values.get(6, bytes(8)))[0],
        "limit_s": struct.unpack("<d", values.get(7, bytes(8)))[0],
        "goals": {goal[1].decode(): 2 in goal for goal in goals},
        "errors": {error[1].decode(): error.get(2, 0) for error in errors},
        "end": values.get(10, 0), "verdict": values.get(11, 0),
    }


def view(data):
    """A View message: the parts that tests look at."""
    values = one(data)
    bodies = [one(v) for n, v in fields(data) if n == 6]
    return {
        "number": struct.unpack("<Q", values[1])[0],
        "state": ("waiting", "running", "paused", "closed")[values.get(3, 0)],
        "case": values.get(4, b"").decode(),
        "server": values.get(11, b"").decode(),
        "bodies": [{"validity": VALIDITIES[b.get(2, 0)], "pose": pose(b[3]), "virtual": pose(b[4])} for b in bodies],
        "instruments": {one(v).get(1, 0): instrument(v) for n, v in fields(data) if n == 7},
        "attempt": attempt(values[10]) if 10 in values else None,
        "loose": {one(v).get(1, 0): loose(v) for n, v in fields(data) if n == 9},
    }


class Connection:
    """A WebSocket on a connected socket; ConnectionError with the answer's first line where it is not let in."""

    def __init__(self, connected, path, host, subprotocol, headers=()):
        self.socket = connected
        self.buffer = b""
        lines = [f"GET {path} HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade",
                 "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Protocol: {subprotocol}",
                 "Sec-WebSocket-Key: " + base64.b64encode(os.urandom(16)).decode(), *headers]
        self.socket.sendall("\r\n".join(lines + ["", ""]).encode())
        while b"\r\n\r\n" not in self.buffer:
            self.more()
        head, self.buffer = self.buffer.split(b"\r\n\r\n", 1)
        if head.split()[1] != b"101":
            self.close()
            raise ConnectionError(head.split(b"\r\n")[0].decode())

    def more(self):
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError("closed")
        self.buffer += data

    def take(self, size):
        while len(self.buffer) < size:
            self.more()
        data, self.buffer = self.buffer[:size], self.buffer[size:]
        return data

    def frame(self):
        opcode, size = self.take(2)
        if size == 126:
            size = struct.unpack(">H", self.take(2))[0]
        elif size == 127:
            size = struct.unpack(">Q", self.take(8))[0]
        return opcode, self.take(size)

    def close(self):
        self.socket.close()


class Viewer(Connection):
    def __init__(self, port, token, origin=None, host=None):
        super().__init__(socket.create_connection(("127.0.0.1", port), timeout=20), f"/view?token={token}",
                         host or f"localhost:{port}", "arthron-view.1", [f"Origin: {origin}"] if origin else [])

    def next(self):
        opcode, data = self.frame()
        if opcode != 0x82:
            raise ConnectionError("closed")
        return view(data)
