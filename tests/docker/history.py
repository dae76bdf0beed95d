"""Whether what servers said while parts of a centre were lost, and the traces afterwards, can be one history: one
server at a time made the steps of a station, nothing that another server could go on from was lost, and the tissue was
the same everywhere. No clock but one: all times are seconds on the clock of this machine."""

import collections
import itertools
from typing import NamedTuple

PROTECTED_S = 2  # a session counts as protected for so long after another server could have gone on with it
SLACK_S = 0.1  # of times in traces
NEVER = float("-inf")


class Seen(NamedTuple):
    """A session as a server told of it, some time from `begun` to `ended`."""
    server: str
    begun: float
    ended: float
    station: str
    session: str
    part: int
    steps: int
    protected: bool  # another server could go on with it
    tissue: dict  # group: (number of the mesh, its hash, cuts); empty: it was not asked for


class Said(NamedTuple):
    """A note that a server has taken, by then."""
    at: float
    session: str
    text: str


class Part(NamedTuple):
    """A trace, and the times of its first and last step."""
    server: str
    station: str
    session: str
    number: int
    token: int
    begun: float
    ended: float
    notes: frozenset
    cuts: int


def grouped(items, key):
    groups = collections.defaultdict(list)
    for item in items:
        groups[key(item)].append(item)
    return groups


def rises(seen):
    """Times from, to between which the server made steps, of what was seen of one part in order."""
    return [(a.begun, b.ended) for a, b in zip(seen, seen[1:]) if b.steps > a.steps]


def who_steps(seen):
    """A server that made steps before and after another one did, in one and the same part."""
    faults = []
    for station, all_of_it in grouped(seen, lambda s: s.station).items():
        parts = {key: rises(sorted(of_part, key=lambda s: s.begun))
                 for key, of_part in grouped(all_of_it, lambda s: (s.server, s.session, s.part)).items()}
        parts = {key: times for key, times in parts.items() if times}
        for (one, times), (other, others) in itertools.permutations(parts.items(), 2):
            first, last = min(end for _, end in times), max(begin for begin, _ in times)
            if any(first < begin and end < last for begin, end in others):
                faults.append(f"{station}: {one} made steps before and after {other}")
    return faults


def when_parts(parts):
    """Parts of one station that have steps at one time, and parts of one session that do not follow each other."""
    faults = []
    for station, of_station in grouped(parts, lambda p: p.station).items():
        in_order = sorted(of_station, key=lambda p: p.begun)
        for one, other in zip(in_order, in_order[1:]):
            if one.ended > other.begun + SLACK_S:
                faults.append(f"{station}: {one.server} and {other.server} made steps at one time: parts "
                              f"{one.number} to {one.ended:.2f}, {other.number} from {other.begun:.2f}")
    for session, of_session in grouped(parts, lambda p: p.session).items():
        in_order = sorted(of_session, key=lambda p: p.number)
        if [part.number for part in in_order] != list(range(1, len(in_order) + 1)):
            faults.append(f"{session}: has the parts {[part.number for part in in_order]}")
        if any(a.token >= b.token for a, b in zip(in_order, in_order[1:])):
            faults.append(f"{session}: its tokens do not rise: {[part.token for part in in_order]}")
    return faults


def safe_from(seen):
    """session: the time up to which all that was seen or said of it is safe, in each part that was seen."""
    safe = {}
    for s in seen:
        if s.protected:
            for key in ((s.session, s.part), s.session):
                safe[key] = max(safe.get(key, NEVER), s.begun - PROTECTED_S)
    return safe


def is_safe(seen, safe):
    return seen.ended <= safe.get((seen.session, seen.part), NEVER)


def what_is_lost(seen, said, parts, safe):
    faults = []
    last = {session: max(of_session, key=lambda p: p.number)
            for session, of_session in grouped(parts, lambda p: p.session).items()}
    for session in sorted({s.session for s in seen if is_safe(s, safe)} - set(last)):
        faults.append(f"{session}: has no trace")
    for note in said:
        if note.at <= safe.get(note.session, NEVER) and note.session in last and note.text not in last[note.session].notes:
            faults.append(f"{note.session}: the note {note.text!r} is lost")
    for s in seen:
        cuts = sum(of_group[2] for of_group in s.tissue.values())
        if s.session in last and is_safe(s, safe) and cuts > last[s.session].cuts:
            faults.append(f"{s.session}: {s.server} had {cuts} cuts, the last trace has {last[s.session].cuts}")
    return faults


def whose_session(seen, safe):
    """A station that got another session, though nobody ended the one that it had."""
    faults = []
    for station, of_station in grouped(seen, lambda s: s.station).items():
        in_order = sorted(of_station, key=lambda s: s.begun)
        for one, other in zip(in_order, in_order[1:]):
            if one.session != other.session and one.session in safe:
                faults.append(f"{station}: {other.session} at {other.server} came after {one.session}")
    return faults


def which_tissue(seen, safe):
    """A mesh that is not the same wherever and whenever it was shown."""
    faults = []
    shown = {}
    for s in sorted(seen, key=lambda s: s.begun):
        for group, (number, of_mesh, _) in s.tissue.items():
            wheres = [(s.session, s.part, group, number)]
            if is_safe(s, safe):
                wheres.append((s.session, "any", group, number))
            for where in wheres:
                if shown.setdefault(where, of_mesh) != of_mesh:
                    faults.append(f"{s.session}: mesh {number} of {group} is another one at {s.server}")
    return faults


def faults_of(seen, said, parts):
    """What contradicts, as sentences. seen: of sessions that their station was connected to."""
    safe = safe_from(seen)
    return (who_steps(seen) + when_parts(parts) + what_is_lost(seen, said, parts, safe) + whose_session(seen, safe)
            + which_tissue(seen, safe))
