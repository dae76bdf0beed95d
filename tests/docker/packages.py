"""A machine with Debian and systemd, on which a newcomer makes a centre with two stations out of the packages."""

import json
import time
import unittest

from engine import docker, say
from hall import wait_until

SOCKET = "/run/arthron/server.sock"
NEWEST = "/root/new"
BEFORE = "/root/before"
# Another PC would have files of the same names. The second station of this one has a config of its own.
SECOND_ROOM = ("sed 's/room-1/room-2/; s/:5020/:5021/; s/:18944/:18945/; s,station/keys,station/room-2-keys,; s,calibration.ini,room-2-calibration.ini,' "
               "/etc/arthron/station.ini >/etc/arthron/room-2.ini")
MOTION = ("arthron-case motion /usr/share/arthron/recipes/motions/palpation.ini "
          "--case /usr/share/arthron/cases/healthy --out /root/motion.csv")


def enrol(room, keys):
    return (f"code=$(runuser -u arthron -- arthron-server keys enrol /var/lib/arthron/keys {room}) && "
            f"runuser -u arthron-station -- arthron-station enrol localhost:4810 $code --name {room} "
            f"--keys /var/lib/arthron-station/{keys}")


NEWCOMER = [
    "apt-get update",
    f"apt-get install -y --no-install-recommends {BEFORE}/arthron-*.deb",
    SECOND_ROOM,
    enrol("room-1", "keys"),
    enrol("room-2", "room-2-keys"),
    "systemctl enable --now arthron-station@station arthron-station@room-2",
]
MOCKUPS = [MOTION] + [
    f"systemd-run --quiet --unit=mockup-{i} arthron-mockup --motion /root/motion.csv "
    f"--modbus-tcp 127.0.0.1:{5020 + i} --tracker 127.0.0.1:{18944 + i}" for i in (0, 1)]

machine = None  # the one that all tests share; run makes it


class Machine:
    """A container in which systemd is the first process."""

    def __init__(self, tag):
        self.image = f"arthron/machine:{tag}"
        self.injected, self.recovered = [], {}

    def open(self):
        # Not --privileged: where the engine itself lacks a capability, that fails.
        self.id = docker("run", "--detach", "--cap-add", "ALL", "--cap-drop", "SYS_RESOURCE", "--security-opt",
                         "seccomp=unconfined", "--security-opt", "apparmor=unconfined", "--tmpfs", "/run", "--tmpfs",
                         "/tmp", self.image).stdout.strip()
        wait_until("systemd", lambda: self.run("systemctl is-system-running", check=False).strip()
                   in ("running", "degraded"))

    def close(self):
        docker("rm", "--force", "--volumes", self.id, check=False)

    def run(self, command, check=True):
        return docker("exec", self.id, "bash", "-c", command, check=check, timeout=300).stdout

    def compose(self, *_):
        """What the log says, as of other stands."""
        return docker("exec", self.id, "journalctl", "--no-pager", "-n", "60", check=False)

    def sessions(self):
        listed = self.run(f"arthron-server session list --json", check=False)
        return {s["station"]: s for s in json.loads(listed)["sessions"]} if listed else {}

    def run_both(self, more=100):
        """The sessions, once both stations have made so many more steps."""
        before = {room: session["steps"] for room, session in self.sessions().items()}

        def go_on():
            now = self.sessions()
            return now if all(room in now and now[room]["state"] == "running" and
                              now[room]["steps"] >= before.get(room, 0) + more
                              for room in ("room-1", "room-2")) else None
        return wait_until("steps of both stations", go_on)


class Packages(unittest.TestCase):
    """One after the other, by their names: each goes on where the one before ended."""

    @staticmethod
    def stand():
        return machine

    def test_1_a_newcomer_gets_a_centre_with_two_stations(self):
        whole = time.monotonic()
        for number, command in enumerate(NEWCOMER + MOCKUPS, 1):
            begun = time.monotonic()
            machine.run(command)
            say(f"{number:2} {time.monotonic() - begun:5.1f} s  {command}")
        machine.run_both()
        say(f"{len(NEWCOMER)} commands, and {len(MOCKUPS)} for emulated mock-ups: two stations run after "
            f"{time.monotonic() - whole:.0f} s")

    def test_2_lines_of_the_log_have_fields(self):
        entries = [json.loads(line) for line in machine.run(
            "journalctl -u arthron-server -o json ARTHRON_STATION=room-2").splitlines()]
        self.assertTrue([entry for entry in entries if "room-2 joined" in entry["MESSAGE"]])

    def test_3_an_upgrade_hands_the_sessions_over(self):
        before = machine.run_both()
        server = machine.run("systemctl show -P MainPID arthron-server")
        machine.injected.append("upgrade")
        machine.run(f"apt-get install -y --no-install-recommends {NEWEST}/arthron-*.deb")
        self.assertNotEqual(machine.run("systemctl show -P MainPID arthron-server"), server)
        self.assertNotIn("before", machine.run("dpkg-query -W 'arthron-*'"))
        after = machine.run_both()
        for room, session in before.items():
            self.assertEqual(after[room]["id"], session["id"])
            self.assertGreater(after[room]["steps"], session["steps"])

    def test_4_a_removal_keeps_what_was_made_and_a_purge_leaves_nothing(self):
        machine.run("apt-get remove -y 'arthron-*'")
        kept = machine.run("ls /var/lib/arthron/keys/authority.key /var/lib/arthron/records.db /etc/arthron/server.ini")
        self.assertEqual(len(kept.splitlines()), 3)
        self.assertEqual(machine.run("pgrep -a arthron", check=False), "".join(
            line + "\n" for line in machine.run("pgrep -a arthron-mockup", check=False).splitlines()))
        machine.run("systemctl stop 'mockup-*'; rm -f /etc/arthron/room-2.ini; apt-get purge -y 'arthron-*'")
        left = machine.run("find / -xdev -name '*arthron*' -not -path '/root/*' -not -path '/proc/*' "
                           "-not -path '/var/log/*' -not -path '/var/cache/*'")
        self.assertEqual(left, "")
        self.assertEqual(machine.run("getent passwd | grep arthron", check=False), "")
