"""What the sieges share: a length, figures, and attackers that end with the test."""

import os
import subprocess
import sys
import time

from arthron import SystemTest

FULL = os.environ.get("ARTHRON_SIEGE") == "full"


class Siege(SystemTest):
    """A test of whole programs under attack. It is long by hand (FULL) and short in ./check."""

    def figure(self, name, value, unit=""):
        """Prints what the siege measured. A time is a figure; assert only what must hold on a busy machine too."""
        shown = f"{value:.3f}".rstrip("0").rstrip(".") if isinstance(value, float) else value
        print(f"{type(self).__name__}: {name}: {shown} {unit}".rstrip(), flush=True)

    def attack(self, *arguments):
        """Runs this siege's own file with --attack and these arguments, in another process. It is ended with the
        test, if it has not ended before."""
        process = subprocess.Popen([sys.executable, sys.modules[type(self).__module__].__file__, "--attack",
                                    *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        self.addCleanup(end, process)
        return process


def end(process):
    """What the attacker printed."""
    if process.poll() is None:
        process.terminate()
    try:
        return process.communicate(timeout=20)[0]
    except subprocess.TimeoutExpired:
        process.kill()
        return process.communicate()[0]
    except ValueError:  # it was read before
        return ""


def seconds_until(condition, at_most_s):
    """How long it took until the condition was true; None: it did not become true."""
    begun = time.monotonic()
    while time.monotonic() - begun < at_most_s:
        if condition():
            return time.monotonic() - begun
        time.sleep(0.02)
    return None


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else float("nan")
