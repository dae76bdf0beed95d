#!/usr/bin/env python3
"""Reads traces of versions 2 to 7, with Python's standard library alone. server/trace/FORMAT.md describes the bytes.

  docs/examples/trace.py FILE

Prints the figures of `arthron-trace info FILE --json`. Trace(bytes).records() gives a program of yours every record."""

import hashlib
import json
import math
import struct
import sys
from collections import Counter

# The fields of each part in the order of their bytes: name:type, then the first and the last version that have it.
# A type is in TYPES, or of Python's struct (Q u64, q i64, I u32, i i32, B u8, d f64, 7d a pose).
LAYOUTS = {
    "header": """session:16s parent:32s:3 parent_session:16s:4 station:text trainee:text case_name:text case_dir:text
        case_hash:Q start_utc_ns:q start_ns:q rules:B:5 field:B unit_mm:d radius_mm:d background_per_mm:d skin_mm:d
        strength:d adaptive:B:3 avatar:B:3 bodies:bodies:3 hold_ns:q ease_share:d ease_mm_s:d tilt_deg:d:4
        field_deg:d:4 build:text libc:text cpu:text tools:tools:6 loose_bodies:B:6 part:H:7
        server:text:7 token:Q:7""",
    "input": "kind:B time_ns:q more:more", "frame": "number:Q time_ns:q samples:samples", "result": "job:Q done:B",
    "sample": "channel:B kind:B validity:B device:B time_ns:q value:value",
    "step": """input:input step:Q frame_number:Q time_ns:q state:B events:I joint:6d joint_validity:B bones:bones
        torn:torn:3 instruments:instruments job:job landed:landed loose:loose:6 hash:Q""",
    "instrument": """validity:B tip:7d warped:7d displacement:3d gradient:9d trust_radius_mm:d nearest:i nearest_mm:d
        old_gain:d:2:2 lead:lead:3 penetration_mm:d:3 tip_gap_mm:d:3 offset_mm:d:3 tilt_deg:d:3 gain:d:3 gain_least:d:3
        turn_deg:d:3 opening:d buttons:I handle_validity:B""",
    "job": "id:Q kind:B tissue:B cut:cut", "cut": "stroke:I:4 blade:B moves:moves",
    "landed": """job:Q outcome:B tissue:B mesh_number:I cuts:I refused:I pieces:I volume_mm3:d blades_mm3:d pieces_mm3:d
        warped_mm3:d left_mm3:d distance_mm:d all_mm3:d planned_mm3:d over_mm3:d under_mm3:d damage_mm3:d rim_mm:d
        step_mm:d zones:27d hash:Q differ:differ""",
    "remark": "number:I time_ns:q author:text text:text withdrawn:B has_marker:B body:B point:3d", "gap": "missing:Q",
    "end": "records:Q missing:Q certificate:bytes:3 signature:bytes:3", "resume": "utc_ns:q", "fault": "utc_ns:q",
    "touch": "job:Q tissue:B size:I offset:I", "marker": "run:Q number:Q time_ns:q name:text device:text value:d",
    "begun": """number:I purpose:B hand:B task:text mark_version:I pass_time_s:d pass_errors:I file:file""",
    "state": "size:I offset:I", "taken": "time_ns:q job:job landed:landed",
    "ended": "number:I end:B verdict:B goals_met:I errors:I first_step:Q last_step:Q time_ns:q"}
RECORDS = {1: "step", 2: "gap", 3: "end", 4: "input", 5: "resume", 6: "remark", 7: "fault", 8: "touch", 9: "marker",
           10: "begun", 11: "ended", 12: "state", 13: "taken"}
EVENTS = "state device_lost device_back contact release cut piece refused undone grasped dropped taken_out".split()
STATES = "waiting running paused closed".split()
TOOLS, BODIES = "probe punch shaver knife scope".split(), "femur tibia patella".split()
TYPES = {
    "bytes": lambda t: t.take(f"{t.take('H')}s"),
    "text": lambda t: t.take(f"{t.take('H')}s").decode(),
    "file": lambda t: t.take(f"{t.take('I')}s"),
    "tools": lambda t: TOOLS + [(TYPES["text"](t), t.take("3B4dI"), t.take(f"{4 * t.take('B')}d"))[0]
                                for _ in range(t.take("B"))],
    "bodies": lambda t: [t.take(f"{4 * t.take('B')}d") for _ in TOOLS],
    "input": lambda t: t.read("input"),
    "more": lambda t: {0: lambda: t.read("frame"), 6: lambda: t.read("result")}.get(t.data[t.at - 9], dict)(),
    "samples": lambda t: [t.read("sample") for _ in range(t.take("B"))],
    "value": lambda t: t.take(("6d", "7d", "dI", "d")[t.data[t.at - 11]]),  # joint, pose, handle or force
    "bones": lambda t: [(t.take("7d"), t.take("7d") if t.version > 2 and t.take("B") else None) for _ in BODIES],
    "loose": lambda t: [t.take("BB7d") for _ in range(t.header["loose_bodies"])],
    "torn": lambda t: [t.take("2d") for _ in range(t.take("B"))],
    "instruments": lambda t: {tool: t.read("instrument") for tool in t.header.get("tools", TOOLS) if t.take("B")},
    "lead": lambda t: t.take("33d") if t.take("B") else None,
    "job": lambda t: t.read("job") if any(t.data[t.at:t.at + 8]) else t.take("Q"),
    "cut": lambda t: t.read("cut") if t.data[t.at - 2] == 1 else None,
    "moves": lambda t: [t.take("16d") for _ in range(t.take("B") if t.header["rules"] > 1 else 1)],
    "landed": lambda t: t.read("landed") if any(t.data[t.at:t.at + 8]) else t.take("Q"),
    "differ": lambda t: t.take("ddQ") if t.header["rules"] > 2 else (0, 0, 0)}


class Trace:
    def __init__(self, data):
        magic, self.version, size = struct.unpack_from("<8sHI", data)
        magic == b"ARTHRTRC" and 2 <= self.version <= 7 or sys.exit("this is no trace of versions 2 to 7")
        self.data, self.at, self.end, self.hash, self.whole = data, 14, 14 + size, bytes(32), False
        self.next = self.check(0, 14 + size) or sys.exit("the header is damaged")
        self.header = {"rules": 1, "parent": bytes(32), "adaptive": 0, "avatar": 0, "tilt_deg": 30, "field_deg": 90,
                       "part": 1, "server": "", "token": 0}
        self.header.update(self.read("header"))

    def check(self, begin, end):
        """Where the hash after these bytes ends; 0 if it is wrong. Python has no XXH3 to check version 2."""
        stored = self.data[end:end + (32 if self.version > 2 else 8)]
        self.hash = hashlib.sha256(self.hash + self.data[begin:end]).digest()
        return end + len(stored) if stored == self.hash or self.version == 2 and len(stored) == 8 else 0

    def records(self):
        """(name, fields) of each record, up to the end or to the first damage."""
        while self.next and not self.whole and self.next + 5 <= len(self.data):
            size, kind = struct.unpack_from("<IB", self.data, self.next)
            self.at, self.next = self.next + 5, self.check(self.next, self.next + 5 + size)
            if self.next:
                self.whole = kind == 3
                yield RECORDS[kind], self.read(RECORDS[kind])

    def take(self, form):
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return values if len(values) > 1 else values[0]

    def read(self, layout):
        fields = {}
        for row in LAYOUTS[layout].split():
            name, form, first, last = (row.split(":") + ["2", "7"][row.count(":") - 1:])[:4]
            if int(first) <= self.version <= int(last):
                fields[name] = TYPES[form](self) if form in TYPES else self.take(form)
        return fields


WORST = {"offset_max_mm": (max, "offset_mm", 0), "turn_max_deg": (max, "turn_deg", 0), "gain_max": (max, "gain", 1),
         "gain_min": (min, "gain_least", 1), "penetration_max_mm": (max, "penetration_mm", 0)}
RESECTION = "tissue cuts refused pieces volume_mm3 pieces_mm3 left_mm3 planned_mm3 over_mm3 under_mm3 rim_mm step_mm"
NOTICED, DIFFER = ("turn", "tilt", "gain", "any"), ("touched_unseen_mm3", "seen_untouched_mm3")


def take_instrument(f, o):
    """One step of an instrument. The thresholds are of what people notice (docs/METRICS.md#the-warp)."""
    f["steps"] += 1
    if "gain" in o:
        past = o["turn_deg"] > 4.5, o["tilt_deg"] > 4.5, o["gain"] > 1.07 or o["gain_least"] < 0.88
        f["noticed"] = [n + p for n, p in zip(f.get("noticed", [0] * 4), (*past, any(past)))]
        f |= {key: most(f.get(key, least), o[field]) for key, (most, field, least) in WORST.items()}


def resection(f):
    found = {key: f[key] for key in RESECTION.split()} | {"removed_mm3": f["all_mm3"] - f["pieces_mm3"]}
    return found | (dict(zip(DIFFER, f["differ"])) if any(f["differ"][:2]) else {})


def info(trace):
    count, events, tools, tissues, torn, first, largest = Counter(), dict.fromkeys(EVENTS, 0), {}, {}, [], None, 0
    for name, r in trace.records():
        count[name] += 1
        count["missing"] += r["missing"] if name == "gap" else 0
        if r.get("landed"):  # at a step, or taken over from the server before
            tissues[r["landed"]["tissue"]] = r["landed"]
        if name == "step":
            first, last = first or r, r
            count["frames"] += r["input"]["kind"] == 0
            events = {event: events[event] + (r["events"] >> bit & 1) for bit, event in enumerate(EVENTS)}
            torn = [max(share, *torn[i:i + 1], 0) for i, (_, share) in enumerate(r.get("torn", []))]
            for tool, o in r["instruments"].items():
                take_instrument(tools.setdefault(tool, {"steps": 0}), o)
                largest = max(largest, math.hypot(*o["displacement"]))
    for f in tools.values():
        if "noticed" in f:
            f["noticeable_share"] = dict(zip(NOTICED, (n / f["steps"] for n in f.pop("noticed"))))
    return {"session": trace.header["session"].hex(), "version": trace.version, "whole": trace.whole, "events": events,
            "seconds": (last["time_ns"] - first["time_ns"]) / 1e9 if first else 0, "steps": count["step"],
            "frames": count["frames"], "missing": count["missing"], "past": count["input"], "resumes": count["resume"],
            "taken": count["taken"], **{key: trace.header[key] for key in ("part", "server", "token")},
            "state": STATES[last["state"] if first else 0], "displacement_max_mm": largest, "instruments": tools,
            "torn": [{"share_max": share} for share in torn],
            "resections": [resection(f) for _, f in sorted(tissues.items()) if f["mesh_number"] or f["refused"]]}


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as f:
        print(json.dumps(info(Trace(f.read())), indent=2))
