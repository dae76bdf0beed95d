"""Who notices a fault: the trainee at a station's view, the instructor at the pages."""

import re
import threading
import time

from page import WALL, Browser
from websocket import Viewer, fields, instrument

PROBE = 4
OLD_S = 3  # from here on pages call what they show old (web/src/live.ts)
PAGE = "its own connection"


class Watcher(threading.Thread):
    """What a trainee sees: when each pose was shown, and where. Comes again to a view that was started again."""

    def __init__(self, port, token):
        super().__init__(daemon=True)
        self.port, self.token = port, token
        self.shown, self.states, self.ends = [], [], False
        self.start()

    def run(self):
        while not self.ends:
            viewer = None
            try:
                viewer = Viewer(self.port, self.token)
                while not self.ends:
                    self.note(self.probe(viewer))
            except (ConnectionError, OSError):
                time.sleep(0.05)
            if viewer:
                viewer.close()

    @staticmethod
    def probe(viewer):
        """Of the next view. Nothing else of it is decoded: many look at a time."""
        opcode, data = viewer.frame()
        if opcode != 0x82:
            raise ConnectionError("closed")
        for number, part in fields(data):
            if number == 7 and part[:2] == bytes((1 << 3, PROBE)):
                return instrument(part)
        return None

    def note(self, probe):
        now = time.monotonic()
        state = probe["warp_validity"] if probe and probe["tip"] else "lost"
        self.states.append((now, state))
        if state != "lost":
            self.shown.append((now, *(tuple(probe[name][k] for k in "xyz") for name in ("tip", "warped"))))

    def longest_gap_s(self, begin, end):
        times = [begin] + [now for now, *_ in self.shown if begin <= now <= end] + [end]
        return max(b - a for a, b in zip(times, times[1:]))

    def share(self, state, begin, end):
        states = [s for now, s in self.states if begin <= now <= end]
        return states.count(state) / max(1, len(states))


class Instructor(threading.Thread):
    """Looks at the wall, and notes each warning that the pages show, with its station and its time."""

    def __init__(self, port, authority, log):
        super().__init__(daemon=True)
        self.browser = Browser(port, authority)
        self.browser.first(log)
        self.seen, self.now, self.ends = [], {}, False  # (time, station, warning) at each change
        self.start()

    def run(self):
        while not self.ends:
            page = None
            try:
                page = self.browser.page()
                page.watch(WALL, rate_hz=2, meshes=False)
                while not self.ends:
                    self.look(page)
            except (ConnectionError, OSError):
                self.note(time.monotonic(), PAGE, "connection lost")
                time.sleep(0.2)
            if page:
                page.close()

    def look(self, page):
        before = time.monotonic()
        page.read()
        now = time.monotonic()
        if now - before > OLD_S:
            self.note(before + OLD_S, PAGE, f"no data for {now - before:.0f} s")
        self.note(now, PAGE, "")
        for station, place in page.places.items():
            self.note(now, station, place["warning"])

    def note(self, now, station, warning):
        if self.now.get(station, "") != warning:
            self.now[station] = warning
            self.seen.append((now, station, warning))

    def told(self, stations, begin, end):
        """What was new about these since the time `begin`; of those that differ by a number alone, the last."""
        before = {(station, w) for now, station, w in self.seen if now < begin}
        kinds = {}
        for now, station, warning in self.seen:
            if begin <= now <= end and station in stations and warning and (station, warning) not in before:
                kinds[station, re.sub(r"[-\d.]+", "#", warning)] = warning
        return [(station, warning) for (station, _), warning in kinds.items()]
