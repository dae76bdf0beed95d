"""A page of the server's, on sockets alone: signs in, and follows /live as PROTOCOL.md says."""

import http.client
import json
import math
import os
import re
import socket
import ssl
import struct
import time

from websocket import Connection, fields, one

WALL, STATION, RECORDED = 1, 2, 3
NOT_THERE, FAILED = 1, 2  # kinds of Trouble
LIST, START, PAUSE, STOP, NOTE, UNDO, ASSIGN = 0, 1, 2, 3, 9, 7, 10
PATIENCE_S = 60


def varint(value):
    out = b""
    while value >= 128:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def number(tag, value):
    return varint(tag << 3) + varint(value)


def piece(tag, data):
    data = data.encode() if isinstance(data, str) else data
    return varint(tag << 3 | 2) + varint(len(data)) + data


def double(data):
    return struct.unpack("<d", data or bytes(8))[0]


def long(data):
    return struct.unpack("<q", data or bytes(8))[0]


def text(data):
    return (data or b"").decode()


def varints(data):
    value = shift = 0
    for byte in data:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            yield value
            value = shift = 0


def mismatch(data):
    """How far touch and sight differ at each vertex, mm."""
    step, *numbers = varints(data)
    found, vertex = {}, -1
    for gap, code in zip(numbers[::2], numbers[1::2]):
        vertex += gap + 1
        found[vertex] = (code >> 1 ^ -(code & 1)) * step / 1000
    return found


def group(data):
    v = one(data)
    return {"name": text(v.get(1)), "kind": v.get(2, 0), "label": text(v.get(3)),
            "colour": struct.unpack("<I", v.get(4, bytes(4)))[0], "own_colour": bool(v.get(5, 0)), "side": v.get(6, 0),
            "cuttable": bool(v.get(7, 0)), "has_zones": bool(v.get(8, 0))}


class Browser:
    """Who signed in: with the cookie that the server gave."""

    def __init__(self, port, authority):
        self.port, self.cookie, self.address = port, None, "127.0.0.1"
        self.tls = ssl.create_default_context(cafile=authority)

    def request(self, method, path, body=None):
        connection = http.client.HTTPSConnection("localhost", self.port, context=self.tls, timeout=20)
        headers = {"Content-Type": "application/json", "Origin": f"https://localhost:{self.port}"}
        if self.cookie:
            headers["Cookie"] = self.cookie
        connection.request(method, "/api/v1" + path, json.dumps(body) if body is not None else None, headers)
        answer = connection.getresponse()
        cookie = answer.getheader("Set-Cookie")
        if cookie:
            self.cookie = cookie.split(";")[0]
        data = answer.read()
        connection.close()
        if answer.status >= 300:
            raise ConnectionError(f"{method} {path}: {answer.status} {data.decode()}")
        return json.loads(data) if data else None

    def first(self, log, name="otto", password="a long one, of words"):
        secret = re.search(r"/#/first/(\S+)", log).group(1)
        self.request("POST", "/first", {"secret": secret, "name": name, "password": password})

    def page(self):
        return Page(self)


class Page(Connection):
    """What came, by kind; read() takes one batch, draws it and says so."""

    def __init__(self, browser):
        host = f"localhost:{browser.port}"
        plain = socket.create_connection(("127.0.0.1", browser.port), timeout=20, source_address=(browser.address, 0))
        super().__init__(browser.tls.wrap_socket(plain, server_hostname="localhost"), "/live", host, "arthron-live.1",
                         [f"Origin: https://{host}", f"Cookie: {browser.cookie}"])
        self.batches = 0
        self.forget()

    def forget(self):
        self.places, self.sessions, self.moments, self.resections, self.remarks = {}, [], [], {}, {}
        self.replies, self.troubles, self.metrics, self.order = [], [], None, []
        self.meshes, self.payloads, self.done, self.share = {}, {}, False, 0
        self.mismatches = {}  # group: of each mesh that came its number, and by vertices the mm
        self.trouble_kinds, self.beats = [], 0

    # ---- the socket

    def message(self):
        whole = b""
        while True:
            opcode, data = self.frame()
            if opcode & 15 == 8:
                raise ConnectionError(f"closed: {data}")
            if opcode & 15 == 9:
                self.send(0x8a, data)
                continue
            whole += data
            if opcode & 128:
                return whole

    def say(self, tag, data):
        self.send(0x82, piece(tag, data))

    def send(self, opcode, data):
        mask = os.urandom(4)
        size = bytes([128 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(">H", len(data))
        self.socket.sendall(bytes([opcode]) + size + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data)))

    # ---- what it says

    def watch(self, what, station="", session="", case="", rate_hz=30, meshes=True, mismatch=False):
        self.forget()
        self.say(1, number(1, what) + piece(2, station) + piece(3, session) + piece(4, case) + number(5, rate_hz) +
                 number(6, meshes) + number(7, mismatch))

    def command(self, kind, station="room-1", case="", more=b""):
        count = len(self.replies)
        self.say(3, number(1, kind) + piece(2, station) + piece(3, case) + more)
        self.read_until(lambda: len(self.replies) > count)
        return self.replies[-1]

    def note(self, words, marker=None, station="room-1"):
        remark = piece(4, words)
        if marker:
            body, point = marker
            remark += number(5, 1) + number(6, body)
            remark += piece(7, b"".join(varint(i + 1 << 3 | 1) + struct.pack("<d", x) for i, x in enumerate(point)))
        return self.command(NOTE, station, more=piece(11, remark))

    def listed(self):
        """The stations of a LIST."""
        return self.command(LIST, station="")["sessions"]

    # ---- what it hears

    def read(self):
        batch = self.message()
        self.batches += 1
        for _, item in fields(batch):
            for tag, data in fields(item):
                self.hear(tag, data)
        self.say(2, varint(1 << 3 | 1) + struct.pack("<Q", self.batches))
        return self

    def read_until(self, condition, seconds=PATIENCE_S):
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise AssertionError("in vain")
            self.read()

    def hear(self, tag, data):
        names = (None, "place", "session", "moment", "resection", "chunk", "remark", "metrics", "reply", "progress",
                 "trouble", "beat")
        self.order.append(names[tag])
        getattr(self, "hear_" + names[tag])(data)

    def hear_place(self, data):
        v = one(data)
        info = one(v[2])
        devices = [one(d) for n, d in fields(data) if n == 4]
        self.places[text(info.get(2))] = {
            "number": v.get(1, 0), "server": text(v.get(23)), "state": info.get(4, 0), "connected": bool(info.get(5, 0)), "trainee": text(v.get(3)),
            "cuts": v.get(5, 0), "removed_mm3": double(v.get(6)), "warning": text(v.get(9)),
            "urgency": v.get(10, 0), "steps": struct.unpack("<Q", info.get(7, bytes(8)))[0],
            "devices": {text(d.get(1)): {"rate_hz": struct.unpack("<f", d.get(3, bytes(4)))[0],
                                         "dropouts": d.get(4, 0), "lost": bool(d.get(5, 0))} for d in devices}}

    def hear_session(self, data):
        v = one(data)
        self.sessions.append({"id": v.get(2, b"").hex(), "station": text(v.get(3)), "trainee": text(v.get(4)),
                              "case": text(v.get(5)), "length_s": long(v.get(8)) / 1e9, "recorded": bool(v.get(9, 0)),
                              "own_case": text(v.get(10)),
                              "instruments": {one(i).get(1, 0): text(one(i).get(2)) for n, i in fields(data) if n == 14},
                              "groups": [group(g) for n, g in fields(data) if n == 15],
                              "loose": [text(one(b).get(1)) for n, b in fields(data) if n == 16]})
        if self.sessions[-1]["id"].strip("0") and not self.sessions[-1]["recorded"]:
            self.say(4, b"")  # MeshAsk: nothing is here yet

    def hear_moment(self, data):
        v = one(data)
        self.moments.append({"station_number": v.get(1, 0), "step": struct.unpack("<Q", v.get(2, bytes(8)))[0],
                             "s": long(v.get(3)) / 1e9, "state": v.get(4, 0),
                             "instruments": {one(i).get(1, 0): one(i) for n, i in fields(data) if n == 8},
                             "loose": [one(b).get(1, 0) for n, b in fields(data) if n == 12]})

    def hear_resection(self, data):
        v = one(data)
        self.resections[text(v[1])] = {"mesh_number": v.get(2, 0), "cuts": v.get(3, 0), "volume_mm3": double(v.get(6)),
                                       "removed_mm3": double(v.get(7)),
                                       "mesh_hash": f"{struct.unpack('<Q', v.get(21, bytes(8)))[0]:016x}"}

    def hear_chunk(self, data):
        v = one(data)
        group, base, to, size = text(v[1]), v.get(2, 0), v[3], v[4]
        payload = self.payloads[group] = (b"" if v.get(6, 0) == 0 else self.payloads[group]) + v[7]
        if len(payload) < size:
            return
        changes = size - v.get(8, 0)
        if v.get(8, 0):
            self.mismatches.setdefault(group, []).append((to, mismatch(payload[changes:])))
        payload = payload[:changes]
        number_before, chain, last = self.meshes.get(group, (0, [], ""))
        if base not in (0, number_before):
            raise AssertionError(f"{group}: a change of {base}, and here is {number_before}")
        last = f"{struct.unpack('<Q', payload[-8:])[0]:016x}"
        self.meshes[group] = to, chain + [to], last
        if not self.sessions[-1]["recorded"]:
            self.say(5, piece(1, group) + number(2, to) + varint(3 << 3 | 1) + payload[-8:])

    def hear_remark(self, data):
        v = one(data)
        self.remarks[struct.unpack("<Q", v[1])[0]] = {"author": text(v.get(3)), "text": text(v.get(4)),
                                                      "marker": bool(v.get(5, 0)), "body": v.get(6, 0),
                                                      "s": long(v.get(2)) / 1e9}

    def hear_metrics(self, data):
        rows = [one(m) for _, m in fields(data)]
        values = [(m, double(m.get(5))) for m in rows]
        self.metrics = {(text(m.get(1)), text(m.get(2)), m.get(4, 0)):
                        (None if math.isnan(v) else v, text(m.get(3)), bool(m.get(6, 0))) for m, v in values}

    def hear_reply(self, data):
        v = one(data)
        rows = [one(row) for n, row in fields(data) if n == 3]
        self.replies.append({"ok": bool(v.get(1, 0)), "text": text(v.get(2)),
                             "sessions": [{"station": text(row.get(2)), "state": row.get(4, 0),
                                           "server": text(row.get(31))} for row in rows]})

    def hear_progress(self, data):
        v = one(data)
        self.share = struct.unpack("<f", v.get(1, bytes(4)))[0]
        self.done = bool(v.get(2, 0))

    def hear_trouble(self, data):
        v = one(data)
        self.troubles.append(text(v.get(1)))
        self.trouble_kinds.append(v.get(2, 0))

    def hear_beat(self, data):
        self.beats += 1
