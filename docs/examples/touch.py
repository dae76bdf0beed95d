#!/usr/bin/env python3
"""Prints where the touched surface is after each job of a trace. server/trace/FORMAT.md describes the bytes.

  docs/examples/touch.py FILE

A line for each vertex that moved: the job, the tissue, the vertex, and its offset from the warped physical surface
before all cuts, in mm."""

import hashlib
import struct
import sys

HASH = 32
TOUCH = 8
UNITS_PER_MM = 1 << 20


def records(data):
    """(type, payload) of each whole record of a trace of version 5 or 6, its hash checked."""
    magic, version, size = struct.unpack_from("<8sHI", data)
    if magic != b"ARTHRTRC" or version not in (5, 6, 7):
        sys.exit("this is no trace of version 5 or 6")
    at, end, before = 0, 14 + size, bytes(HASH)
    while end + HASH <= len(data):
        before = hashlib.sha256(before + data[at:end]).digest()
        if before != data[end:end + HASH]:
            sys.exit(f"byte {at}: the checksum is wrong")
        if at:
            yield data[at + 4], data[at + 5:end]
        at = end + HASH
        if at + 5 > len(data):
            return
        end = at + 5 + struct.unpack_from("<I", data, at)[0]


def touches(data):
    """(job, tissue, bytes) of each touch, put together from its parts."""
    gathered = b""
    for kind, payload in records(data):
        if kind != TOUCH:
            continue
        job, tissue, whole, offset = struct.unpack_from("<QBII", payload)
        gathered = gathered[:offset] + payload[17:]
        if len(gathered) == whole:
            yield job, tissue, gathered


def numbers(data):
    value = shift = 0
    for byte in data:
        value |= (byte & 0x7f) << shift
        shift += 7
        if byte < 0x80:
            yield value
            value = shift = 0


def offsets(data):
    """(vertex, [x, y, z]) of each vertex."""
    values, vertex = numbers(data), -1
    for skipped in values:
        vertex += 1 + skipped
        signed = (next(values) for _ in range(3))
        yield vertex, [(-(n + 1) // 2 if n & 1 else n // 2) / UNITS_PER_MM for n in signed]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as file:
        for job, tissue, found in touches(file.read()):
            for vertex, (x, y, z) in offsets(found):
                print(job, tissue, vertex, "%.17g %.17g %.17g" % (x, y, z))
