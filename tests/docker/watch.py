"""What servers tell of their sessions, a few times a second, through whatever happens to them."""

import json
import subprocess
import threading
import time

from hall import SOCKET, part_of, session_of
from history import Seen

PAUSE_S = 0.5
LOOK_AGAIN_S = 0.5
SILENT_S = 10  # on a busy machine a round takes seconds
# In the server's container, as each command from outside costs as much as many here, but with the right clock. Only
# the sessions that it serves are asked for. A line is: the time before, the time after, the station that was asked for,
# and what was answered.
TELL = """
ask() {
    local begun
    begun=$(date +%s.%N)
    answer=$(arthron-server session --socket "$SOCKET" "$@" --json) || return 0
    printf '%s %s %s %s\\n' "$begun" "$(date +%s.%N)" "${2:--}" "${answer//$'\\n'/ }"
}
for ((round = 0; ; round++)); do
    ask list
    list=$answer
    for room in $ROOMS; do
        served='"station":"'$room'",[^{}]*"state":"(running|paused)"'
        ((round % 4)) || [[ ! $list =~ $served ]] || ask show "$room"
    done
    sleep "$PAUSE_S"
done
"""


class Watch(threading.Thread):
    """Of one server, until `end`. What was seen is added to the history."""

    def __init__(self, server, container, rooms, seen):
        super().__init__(daemon=True)
        self.server, self.container, self.rooms, self.seen = server, container, rooms, seen
        self.listed = (0, [])  # the newest answers, and from when they are
        self.shown = {room: (0, None) for room in rooms}
        self.process = None
        self.ended = threading.Event()
        self.start()

    def run(self):
        while not self.ended.wait(LOOK_AGAIN_S):
            command = ["docker", "exec", "-e", "LD_PRELOAD=", "-e", f"SOCKET={SOCKET}", "-e",
                       f"ROOMS={' '.join(self.rooms)}", "-e", f"PAUSE_S={PAUSE_S}", self.container, "bash", "-c", TELL]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
                self.process = process
                for line in process.stdout:
                    if line.endswith("\n"):
                        self.note(*line.split(" ", 3))

    def note(self, begun, ended, room, answer):
        begun, ended, answer = float(begun), float(ended), json.loads(answer)
        tissue = {part["group"]: (part["mesh_number"], part["mesh_hash"], part["cuts"])
                  for part in answer["resections"]}
        for s in answer["sessions"]:
            if s["connected"] and s["state"] in ("running", "paused") and s["trace"]:
                self.seen.append(Seen(self.server, begun, ended, s["station"], session_of(s["trace"]),
                                      part_of(s["trace"]), s["steps"], not s["unprotected"], tissue))
        if room == "-":
            self.listed = (begun, answer["sessions"])
        else:
            self.shown[room] = (begun, answer)

    def sessions(self):
        """The newest answer, and from when it is. None of a server that does not answer."""
        begun, sessions = self.listed
        return (begun, sessions) if time.time() - begun < SILENT_S else (0, [])

    def show(self, room, since):
        """What was asked for since then; None: not yet."""
        begun, answer = self.shown[room]
        return answer if begun >= since else None

    def end(self):
        self.ended.set()
        if self.process:
            self.process.terminate()
        self.join()
