"""Scans with fewer triangles, so that tests of whole knees are quick."""
import collections
import math
import struct


def read_ply(path):
    """(points, triangles) of a binary PLY of floats and triangles."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = {line.split()[1]: int(line.split()[2]) for line in data[:end].decode().splitlines()
              if line.startswith("element")}
    points = list(struct.iter_unpack("<3f", data[end:end + 12 * counts["vertex"]]))
    triangles = [row[1:] for row in struct.iter_unpack("<B3i", data[end + 12 * counts["vertex"]:])]
    assert len(triangles) == counts["face"]
    return points, triangles


def edges_of(triangles):
    return collections.Counter(edge for a, b, c in triangles for edge in
                               ((min(a, b), max(a, b)), (min(b, c), max(b, c)), (min(c, a), max(c, a))))


def thin(points, triangles, grid_mm):
    """Fewer triangles: the vertices of one cell of a grid become one, where no edge gets more than two triangles."""
    cells = [tuple(math.floor(v / grid_mm) for v in p) for p in points]
    closed = 1 not in edges_of(triangles).values()
    whole = set()  # cells that keep all their vertices
    while True:
        places, kept = {}, []
        for i, cell in enumerate(cells):
            if places.setdefault(i if cell in whole else cell, len(kept)) == len(kept):
                kept.append(i)
        becomes = [places[i if cell in whole else cell] for i, cell in enumerate(cells)]
        faces = [t for t in (tuple(becomes[v] for v in t) for t in triangles) if len(set(t)) == 3]
        bad = {v for edge, count in edges_of(faces).items() if count > 2 or (closed and count == 1) for v in edge}
        if not bad:
            return [points[i] for i in kept], faces
        whole |= {cells[kept[v]] for v in bad}
