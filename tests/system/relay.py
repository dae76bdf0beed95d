"""Between a real station and a real server: a network that loses, delays, reorders, repeats, forges, cuts and stalls.

A relay has an address of its own, 127.0.0.N, and the server's ports there. UP is from the station to the server.
"""

import collections
import heapq
import itertools
import random
import selectors
import socket
import threading
import time

UP, DOWN = "up", "down"


class Network:
    """What happens to what passes; to be changed at any time. Times are in ms."""

    def __init__(self, **faults):
        self.loss = self.twice = self.reorder = 0  # shares of the datagrams
        # Shares with a copy before them: of one of the last, with another bit, too long, back to its sender.
        self.old = self.flipped = self.long = self.reflected = 0
        self.port_s = 0                            # after so long the station has another source port; 0: never
        self.delay_ms = (0, 0)                     # of everything, evenly between
        self.no_udp = set()                        # ways
        self.stalled = set()                       # ways on which TCP is not read
        self.cut = False                           # nothing passes, and no connection is made
        self.change(**faults)

    def change(self, **faults):
        for name, value in faults.items():
            assert hasattr(self, name), name
            setattr(self, name, value)


class Half:
    """One way of a connection."""

    def __init__(self, source, sink, way):
        self.source, self.sink, self.way = source, sink, way
        self.unsent, self.over, self.last = b"", False, 0


class Relay:
    def __init__(self, address, port, udp_port, server="127.0.0.1", seed=1):
        self.address, self.server, self.port, self.udp_port = address, server, port, udp_port
        self.network = Network()
        self.random = random.Random(seed)
        self.selector = selectors.DefaultSelector()
        self.due, self.order = [], itertools.count()  # (time, order, action)
        self.halves, self.outs = {}, {}
        self.last = {way: collections.deque(maxlen=100) for way in (UP, DOWN)}  # datagrams
        self.passed = self.dropped = 0
        self.listener = socket.create_server((address, port))
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind((address, udp_port))
        for s, take in ((self.listener, self.accept), (self.udp, self.from_station)):
            s.setblocking(False)
            self.selector.register(s, selectors.EVENT_READ, take)
        self.ends = False
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def close(self):
        self.ends = True
        self.thread.join()
        for key in list(self.selector.get_map().values()):
            key.fileobj.close()
        self.selector.close()

    def cut_connections(self):
        """As a router that forgets: both ends see a reset at once."""
        self.at(0, lambda: [self.drop_pair(s) for s in list(self.halves)])

    # ---- the thread

    def run(self):
        while not self.ends:
            now = time.monotonic()
            while self.due and self.due[0][0] <= now:
                heapq.heappop(self.due)[2]()
            left = self.due[0][0] - time.monotonic() if self.due else 0.02
            for key, _ in self.selector.select(max(0, min(left, 0.02))):
                key.data(key.fileobj)

    def at(self, delay_s, action):
        heapq.heappush(self.due, (time.monotonic() + delay_s, next(self.order), action))

    def delay_s(self):
        return self.random.uniform(*self.network.delay_ms) / 1000

    # ---- datagrams

    def from_station(self, s):
        data, station = s.recvfrom(2048)
        out, made = self.outs.get(station, (None, 0))
        now, port_s = time.monotonic(), self.network.port_s
        if not out or port_s and now - made > port_s:
            out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            out.bind((self.address, 0))
            out.connect((self.server, self.udp_port))
            out.setblocking(False)
            self.selector.register(out, selectors.EVENT_READ, lambda o: self.from_server(o, station))
            self.outs[station] = out, now  # the one before still takes what comes
        self.pass_on(UP, data, out.send, lambda copy: self.udp.sendto(copy, station))

    def from_server(self, s, station):
        try:
            data = s.recv(2048)
        except OSError:
            return  # nobody listens there now
        self.pass_on(DOWN, data, lambda copy: self.udp.sendto(copy, station), s.send)

    def forgeries(self, way, data):
        """Each as (what, whether it goes back)."""
        n, last = self.network, self.last[way]
        last.append(data)
        if self.random.random() < n.old:
            yield self.random.choice(last), False
        if self.random.random() < n.flipped:
            at = self.random.randrange(len(data))
            yield data[:at] + bytes([data[at] ^ 1 << self.random.randrange(8)]) + data[at + 1:], False
        if self.random.random() < n.long:
            yield data + self.random.randbytes(self.random.randrange(1, 9000)), False
        if self.random.random() < n.reflected:
            yield data, True

    def pass_on(self, way, data, send, send_back):
        n = self.network
        if n.cut or way in n.no_udp or self.random.random() < n.loss:
            self.dropped += 1
            return

        def act(send=send, data=data):
            try:
                send(data)
                self.passed += 1
            except OSError:
                self.dropped += 1
        for copy, back in self.forgeries(way, data):
            act(send_back if back else send, copy)
        for _ in range(2 if self.random.random() < n.twice else 1):
            late_s = 0.03 if self.random.random() < n.reorder else 0
            self.at(self.delay_s() + late_s, act)

    # ---- connections

    def accept(self, listener):
        station, _ = listener.accept()
        try:
            if self.network.cut:
                raise OSError
            server = socket.create_connection((self.server, self.port), timeout=1, source_address=(self.address, 0))
        except OSError:
            station.close()
            return
        for s, other, way in ((station, server, UP), (server, station, DOWN)):
            s.setblocking(False)
            s.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.halves[s] = Half(s, other, way)
            self.read_on(s)

    def read_on(self, s):
        if s in self.halves:
            self.selector.register(s, selectors.EVENT_READ, self.from_either)

    def from_either(self, s):
        half = self.halves[s]
        if self.network.cut or half.way in self.network.stalled:
            self.selector.unregister(s)
            self.at(0.05, lambda: self.read_on(s))
            return
        try:
            data = s.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.selector.unregister(s)
        # In order, whatever the delays.
        half.last = max(time.monotonic() + self.delay_s(), half.last)
        heapq.heappush(self.due, (half.last, next(self.order), lambda: self.write(half, data)))

    def write(self, half, data):
        half.unsent += data
        half.over |= not data
        self.flush(half)

    def flush(self, half):
        if half.source not in self.halves:
            return
        try:
            while half.unsent:
                half.unsent = half.unsent[half.sink.send(half.unsent):]
            if half.over:
                self.drop_pair(half.source)
        except BlockingIOError:
            self.at(0.01, lambda: self.flush(half))
        except OSError:
            self.drop_pair(half.source)

    def drop_pair(self, s):
        half = self.halves.get(s)
        for end in (half.source, half.sink) if half else ():
            self.halves.pop(end, None)
            if end in self.selector.get_map():
                self.selector.unregister(end)
            end.close()
