"""Between a station and the server, in a process of its own: it loses, delays and cuts what goes through, as its
stdin says: lines of JSON {"loss": share, "delay_s": s, "jitter_s": s, "cut": true or false}."""

import heapq
import itertools
import json
import random
import selectors
import socket
import sys
import time


class Relay:
    def __init__(self, near, far, port, udp_port, seed):
        self.far, self.port, self.udp_port = far, port, udp_port
        self.random = random.Random(seed)
        self.rules = {"loss": 0, "delay_s": 0, "jitter_s": 0, "cut": False}
        self.selector = selectors.DefaultSelector()
        self.waiting, self.order = [], itertools.count()
        self.last_s = {}  # of each stream, when its last bytes are due: they stay in order
        self.listener = socket.create_server((near, port))
        self.station_side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.station_side.bind((near, udp_port))
        self.station = None
        self.server_side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.server_side.connect((far, udp_port))
        self.peers = {}
        for source, take in ((self.listener, self.accept), (self.station_side, self.from_station),
                             (self.server_side, self.from_server), (sys.stdin, self.command)):
            self.selector.register(source, selectors.EVENT_READ, take)

    # ---- what it is told

    def command(self, source):
        line = source.readline()
        if not line:
            sys.exit(0)
        self.rules.update(json.loads(line))

    # ---- datagrams

    def later(self, send):
        if self.rules["cut"] or self.random.random() < self.rules["loss"]:
            return
        due_s = time.monotonic() + self.rules["delay_s"] + self.random.random() * self.rules["jitter_s"]
        heapq.heappush(self.waiting, (due_s, next(self.order), send))

    def from_station(self, source):
        data, self.station = source.recvfrom(2048)
        self.later(lambda: self.server_side.send(data))

    def from_server(self, source):
        data, station = source.recv(2048), self.station
        if station:
            self.later(lambda: self.station_side.sendto(data, station))

    # ---- streams

    def accept(self, source):
        near = source.accept()[0]
        try:
            far = socket.create_connection((self.far, self.port), timeout=2)
        except OSError:
            near.close()
            return
        self.peers[near], self.peers[far] = far, near
        for one in (near, far):
            one.settimeout(5)
            self.selector.register(one, selectors.EVENT_READ, self.stream)

    def stream(self, source):
        if self.rules["cut"]:  # nothing arrives; what was sent waits in the kernels
            time.sleep(0.001)
            return
        other = self.peers.get(source)
        try:
            data = source.recv(65536)
        except OSError:
            data = b""
        due_s = time.monotonic() + self.rules["delay_s"] + self.random.random() * self.rules["jitter_s"]
        self.last_s[source] = max(due_s, self.last_s.get(source, 0))
        send = (lambda: other.sendall(data)) if data else (lambda: self.close(source))
        if not data:
            self.selector.unregister(source)
        heapq.heappush(self.waiting, (self.last_s[source], next(self.order), send))

    def close(self, source):
        other = self.peers.pop(source, None)
        self.peers.pop(other, None)
        for one in (source, other):
            self.last_s.pop(one, None)
            try:
                self.selector.unregister(one)
            except (KeyError, ValueError):
                pass
            if one:
                one.close()

    # ---- its turn

    def run(self):
        while True:
            timeout = max(0, self.waiting[0][0] - time.monotonic()) if self.waiting else 1
            for key, _ in self.selector.select(timeout):
                try:
                    key.data(key.fileobj)
                except OSError:
                    pass  # nobody listens there now
            while self.waiting and self.waiting[0][0] <= time.monotonic():
                try:
                    heapq.heappop(self.waiting)[2]()
                except (OSError, ValueError):
                    pass


if __name__ == "__main__":
    Relay(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:6])).run()
