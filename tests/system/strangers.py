#!/usr/bin/env python3
"""Who has nothing to do at a server and comes nevertheless: one of the kinds below, on the loopback, for some seconds.

  tests/system/strangers.py KIND SECONDS ...

  datagrams PORT RATE      datagrams for the pose port, RATE a second; true ones to imitate are read as lines of hex
  passwords PORT RATE      wrong passwords for the pages
  slow PORT COUNT          so many requests for pages that never end
  flood PORT KEYS          the enrolled station "flood", which sends without end
"""

import http.client
import json
import random
import select
import socket
import ssl
import sys
import time

HOME = "127.0.0.1"


def paced(rate, seconds):
    """So many times a second."""
    begun, count = time.monotonic(), 0
    while time.monotonic() < begun + seconds:
        yield count
        count += 1
        time.sleep(max(0, begun + count / rate - time.monotonic()))


def forged(true):
    """A datagram of noise, an old one, one of a true station with a later number and a tag of noise."""
    kind, model = random.randrange(3), random.choice(true) if true else random.randbytes(64)
    if kind == 0:
        return random.randbytes(random.randrange(1, 1400))
    if kind == 1:
        return model
    head, number = model[:8], int.from_bytes(model[8:16], "big")
    return head + (number + random.randrange(1, 1000)).to_bytes(8, "big") + random.randbytes(len(model) - 16)


def datagrams(seconds, port, rate):
    true = []
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.connect((HOME, int(port)))
    at_once = 20
    for _ in paced(float(rate) / at_once, seconds):
        while select.select([sys.stdin], [], [], 0)[0] and (line := sys.stdin.readline()):
            true.append(bytes.fromhex(line))
        for _ in range(at_once):
            try:
                out.send(forged(true))
            except OSError:
                pass


def some_address():
    return f"127.{random.randrange(1, 255)}.{random.randrange(256)}.{random.randrange(1, 255)}"


def no_trust():
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


def passwords(seconds, port, rate):
    body = json.dumps({"name": "otto", "password": "a guess"})
    headers = {"Content-Type": "application/json", "Origin": f"https://{HOME}:{port}"}
    for _ in paced(float(rate), seconds):
        connection = http.client.HTTPSConnection(HOME, int(port), context=no_trust(), timeout=20,
                                                 source_address=(some_address(), 0))
        try:
            connection.request("POST", "/api/v1/sign-in", body, headers)
            connection.getresponse().read()
        except OSError:
            pass
        connection.close()


def slow(seconds, port, count):
    open_now, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if len(open_now) < int(count):
                plain = socket.create_connection((HOME, int(port)), timeout=2, source_address=(some_address(), 0))
                open_now.append(no_trust().wrap_socket(plain))
                open_now[-1].sendall(b"GET / HTTP/1.1\r\nHost: ")
                continue
            open_now[0].sendall(b"a")
            open_now.append(open_now.pop(0))
        except OSError:
            open_now = open_now[1:]
        time.sleep(1 / int(count))


def flood(seconds, port, keys):
    from share import Flood, example, pb
    station = example.Station(HOME, int(port), "flood", keys)
    while not (station.state == pb.RUNNING and station.datagrams):
        station.hear(0.01)
    thread = Flood(station)
    thread.start()
    time.sleep(seconds)
    thread.ends = True
    thread.join()
    station.close()


if __name__ == "__main__":
    kind, seconds, *more = sys.argv[1:]
    {f.__name__: f for f in (datagrams, passwords, slow, flood)}[kind](float(seconds), *more)
