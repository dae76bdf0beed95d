"""Every fault that the mock-up knows, injected into the running path: noticed, nothing false taken for good, over."""

import re
import unittest

from arthron import SystemTest, call, call_json, wait_until

FAULT_S = 0.6
PAUSE_S = 2.2
FIRST_S = 3
MODBUS_OFF_DEG = 1.5
TRACKER_OFF_MM = 6

FAULTS = (
    # what, value for the encoders, value for the tracker; None: it has no such fault, "": it takes none
    ("dropout", "", ""),
    ("freeze", "", ""),
    ("jump", 60, 200),
    ("noise", 12, 12),
    ("nan", "", ""),
    ("late", 150, 400),
    ("stale", 2000, 2000),
    ("junk", "", ""),
    ("wrong-slave", "", None),
    ("unplug", "", ""),
    ("clock-step", None, 3),
    ("clock-drift", None, 0.5),
    ("newer-version", "", ""),
    ("half-message", "", ""),
)


def begin_of(i):
    return FIRST_S + i * (FAULT_S + PAUSE_S)


class Faults(SystemTest):
    """Flexion and the probe's x are straight lines over time, so that a value tells its own time."""

    def write_motion(self, seconds):
        names = ["t_seconds", "flexion_deg", "varus_deg", "internal_deg", "shift_mm", "drawer_mm", "distraction_mm"]
        names += ["probe_" + n for n in ("tx_mm", "ty_mm", "tz_mm", "qw", "qx", "qy", "qz", "valid")]
        rows = (f"{i / 100},{0.024 * i},0,0,0,0,0,{0.2 * i},60,0,1,0,0,0,1" for i in range(int(seconds * 100)))
        return self.write("line.csv", "\n".join([",".join(names), *rows]) + "\n")

    def script(self):
        faults = []
        for i, (what, *values) in enumerate(FAULTS):
            for who, value in zip(("modbus", "tracker"), values):
                if value is not None:
                    faults.append((who, what, begin_of(i), FAULT_S, {"value": value} if value != "" else {}))
        return self.faults(*faults)

    def rows(self, trace):
        lines = call("arthron-trace", "export", trace, "--csv", "-", code=None).stdout.splitlines()
        names = lines[0].split(",")
        return [dict(zip(names, line.split(","))) for line in lines[1:]]

    def run_the_path(self):
        seconds = begin_of(len(FAULTS)) + 1
        self.motion = self.write_motion(70)
        server = self.start_server("[station room-1]\ncase = healthy")
        self.enrol("room-1")
        mockup = self.start_mockup("--faults", self.script())
        station = self.start_station("room-1", "--seconds", str(seconds))
        self.assertEqual(station.process.wait(timeout=seconds + 30), 0)
        self.assertIsNone(server.process.poll())
        trace = self.session()["trace"]
        self.start_station("room-1", label="again")
        wait_until("the server takes it again", lambda: self.session()["connected"])
        return mockup, station, self.rows(trace)

    def test_faults_are_noticed_and_nothing_false_is_taken_for_good(self):
        mockup, station, rows = self.run_the_path()
        offset = self.start_of_the_motion(rows)
        for i, (what, *values) in enumerate(FAULTS):
            for who, value in zip(("modbus", "tracker"), values):
                if value is not None:
                    with self.subTest(who=who, what=what):
                        self.check(rows, offset, who, begin_of(i), what)
        self.assertEqual(mockup.log().count("begins"), 25)
        self.check_log(station.log())

    def validity(self, row, who):
        return row["joint_validity" if who == "modbus" else "probe_validity"] or "lost"

    def time_of(self, row, who):
        """The time of the motion that the value belongs to."""
        return float(row["flexion_deg"]) / 2.4 if who == "modbus" else float(row["probe_tx_mm"]) / 20

    def start_of_the_motion(self, rows):
        """From a row's time to the motion's, learnt while all is well."""
        learnt = []
        for row in rows:
            if self.validity(row, "modbus") == self.validity(row, "tracker") == "ok":
                learnt.append(float(row["t_seconds"]) - self.time_of(row, "modbus"))
            if len(learnt) == 100:
                break
        return sorted(learnt)[50]

    def check(self, rows, offset, who, begin, what):
        during, after = [], []
        for row in rows:
            t = float(row["t_seconds"]) - offset
            if begin <= t < begin + FAULT_S:
                during.append((t, row))
            elif begin + FAULT_S <= t < begin + FAULT_S + PAUSE_S - 0.1:
                after.append((t, row))
        # A clock that goes ahead costs one message; that it is put back at the end costs more.
        rows_of_it = during + after if what.startswith("clock") else during
        self.assertTrue(any(self.validity(row, who) != "ok" for _, row in rows_of_it), "not noticed")
        off_s = MODBUS_OFF_DEG / 2.4 if who == "modbus" else TRACKER_OFF_MM / 20
        wrong = [t for t, row in during + after
                 if self.validity(row, who) == "ok" and abs(self.time_of(row, who) - t) > off_s]
        # Noise cannot be told from a first sample: a few may pass before it is known.
        self.assertLessEqual(len(wrong), 4 if what == "noise" else 0, wrong[:5])
        last = [self.validity(row, who) for _, row in after][-40:]
        self.assertGreater(last.count("ok"), 30, "not recovered")

    def check_log(self, log):
        lost = [line for line in log.splitlines() if re.search(r"warning device: (encoders|tracker): \w+ lost", line)]
        self.assertGreater(len(lost), 20)
        for line in lost:
            self.assertRegex(line, r"lost: \S+")
        for reason in ("encoders: refused: .*sequence went back", "tracker: refused: .*clock went ahead",
                       "tracker: refused: .*ms late", "probe lost: probe: jumped", "joint lost: joint: jumped",
                       "shakes more than a hand", "no reply within", "out of range"):
            self.assertRegex(log, reason)


if __name__ == "__main__":
    unittest.main(verbosity=2)
