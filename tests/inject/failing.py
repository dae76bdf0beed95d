"""The other side of failing.h: which call of the operating system fails in a program, and what was called."""

import mmap
import os
import re
import struct
import subprocess
import tempfile

with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "doors.def")) as f:
    DOORS = tuple(name.lower() for name in re.findall(r"^DOOR\((\w+),", f.read(), re.M))
CALLERS_MAX, FRAMES_MAX, NAME = 48, 16, 32
HEAD = "<iiiiqqq"
PATH_AT = struct.calcsize(HEAD)
FRAMES_AT = PATH_AT + NAME
NAMES_AT = FRAMES_AT + 8 * FRAMES_MAX
COUNTS_AT = NAMES_AT + NAME * CALLERS_MAX
SIZE = COUNTS_AT + 8 * CALLERS_MAX * len(DOORS)


class Plan:
    """One for each program that runs at a time."""

    def __init__(self, folder):
        fd, self.path = tempfile.mkstemp(dir=folder, prefix="failing-")
        os.ftruncate(fd, SIZE)
        self.memory = mmap.mmap(fd, SIZE)
        os.close(fd)
        self.calm()

    def environment(self):
        return {"LD_PRELOAD": os.environ["ARTHRON_FAILING_LIBRARY"], "ARTHRON_FAILING": self.path}

    def fail(self, door, n=1, on=False, caller="program", error=0, path=""):
        """The n-th call from now on fails, with `on` each after it, too. path: of those that open a file, only those
        whose path has it count."""
        names = self.callers()
        number = -1 if caller is None else names.index(caller) if caller in names else 0
        self.calm()
        self.memory[PATH_AT:FRAMES_AT] = path.encode().ljust(NAME, b"\0")
        self.memory[FRAMES_AT:NAMES_AT] = bytes(8 * FRAMES_MAX)
        struct.pack_into("<iiiqq", self.memory, 4, on, error, number, n - 1, 0)
        struct.pack_into("<i", self.memory, 0, DOORS.index(door))

    def calm(self):
        struct.pack_into("<i", self.memory, 0, -1)

    def step_clock(self, seconds):
        struct.pack_into("<q", self.memory, 32, int(seconds * 1e9))

    def failed(self):
        return struct.unpack_from("<q", self.memory, 24)[0]

    def callers(self):
        names = (self.memory[NAMES_AT + NAME * i:NAMES_AT + NAME * (i + 1)] for i in range(CALLERS_MAX))
        return [name.split(b"\0")[0].decode() for name in names]

    def counts(self):
        """{(door, caller): calls} since the file was made."""
        numbers = struct.unpack_from(f"<{CALLERS_MAX * len(DOORS)}q", self.memory, COUNTS_AT)
        names = self.callers()
        return {(door, names[c] or "other"): numbers[c * len(DOORS) + d] for c in range(CALLERS_MAX)
                for d, door in enumerate(DOORS) if numbers[c * len(DOORS) + d]}

    def forget_counts(self):
        self.memory[COUNTS_AT:SIZE] = bytes(SIZE - COUNTS_AT)

    def place(self, program):
        """The functions of the program that led to the first failure, the innermost first."""
        frames = [f for f in struct.unpack_from(f"<{FRAMES_MAX}Q", self.memory, FRAMES_AT) if 0 < f < 1 << 32]
        if not frames:
            return ""
        told = subprocess.run(["addr2line", "-s", "-f", "-e", program, *(hex(f - 1) for f in frames)],
                              capture_output=True, text=True).stdout.splitlines()
        pairs = [f"{name} {line}" for name, line in zip(told[::2], told[1::2]) if name != "??"]
        return " < ".join(pairs[:5])
