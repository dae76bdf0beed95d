"""Each program once from its begin to its end, with one call failing: it ends with 0 or a sentence, and does its
work the next time."""

import json
import lzma
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time

from failing import Plan

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "system"))
from arthron import BIN, CASES, SOURCE, call, free_port, program, text_of  # noqa: E402

PATIENCE_S = 20
CORPUS = os.path.join(SOURCE, "tests/corpus/trace/version4")
ORDERLY = "; the program ends"


class Outcome:
    def __init__(self, status, text, seconds):
        self.status, self.text, self.seconds = status, text, seconds

    def fault(self):
        """"" for a good end or a clean refusal."""
        if self.status is None:
            return "hangs"
        if self.status < 0:
            return f"ended by {signal.Signals(-self.status).name}"
        if self.status not in (0, 1, 2):
            return f"ended with {self.status}"
        if self.status and not self.text.strip():
            return f"ended with {self.status} and without a word"
        return ""


class Scenario:
    """A program and what it works on, in a folder of its own for each run."""
    name, program = "", ""
    in_short = True  # ./check samples it, too
    all_of = ()  # doors of which each call is needed

    def __init__(self, shared):
        self.shared = shared
        self.plan = Plan(shared)

    def prepare(self, folder):
        pass

    def command(self, folder):
        raise NotImplementedError

    def check(self, folder, outcome):
        """What is wrong with what is left, "" if nothing."""
        return ""

    def go(self, folder):
        """Runs it to its end."""
        begun = time.monotonic()
        with open(os.path.join(folder, "log"), "w+") as log:
            process = subprocess.Popen([program(self.program), *self.command(folder)], cwd=folder, stdout=log, stderr=log,
                                       stdin=subprocess.DEVNULL, env={**os.environ, **self.plan.environment()})
            try:
                status = self.meanwhile(process, folder)
            except subprocess.TimeoutExpired:
                status = None
                process.kill()
                process.wait()
        return Outcome(status, text_of(os.path.join(folder, "log")), time.monotonic() - begun)

    def meanwhile(self, process, folder):
        return process.wait(PATIENCE_S)

    def run(self, *failing, **how):
        """One call fails, as Plan.fail says; none without arguments. What is wrong, and the outcome."""
        with tempfile.TemporaryDirectory(dir=self.shared) as folder:
            self.prepare(folder)
            self.plan.calm()
            if failing:
                self.plan.fail(*failing, **how)
            outcome = self.go(folder)
            self.plan.calm()
            fault = outcome.fault() or self.check(folder, outcome) or self.unheeded(failing, how, outcome)
            if not failing and outcome.status:
                fault = f"ended with {outcome.status} though nothing failed"
        return fault, outcome


    def unheeded(self, failing, how, outcome):
        """A read that failed is the end of no file. A library may do without its own."""
        needed = failing and failing[0] in self.all_of and how.get("caller", "program") == "program"
        took = needed and self.plan.failed() and outcome.status == 0
        return f"a call of {failing[0]} failed, and it ended with 0" if took else ""


class Keys(Scenario):
    name, program = "keys init", "arthron-server"

    def command(self, folder):
        return ["keys", "init", folder + "/keys"]

    def check(self, folder, outcome):
        if outcome.status == 0:
            call("arthron-server", "keys", "enrol", folder + "/keys", "room-1")
            return ""
        again = call("arthron-server", "keys", "init", folder + "/keys", code=None)
        whole = call("arthron-server", "keys", "enrol", folder + "/keys", "room-1", code=None)  # all but the last sync
        return "" if 0 in (again.returncode, whole.returncode) else "keys cannot be made afterwards: " + again.stderr


class Enrol(Scenario):
    name, program = "keys enrol", "arthron-server"

    def prepare(self, folder):
        if not os.path.exists(self.shared + "/keys"):
            call("arthron-server", "keys", "init", self.shared + "/keys")
        shutil.copytree(self.shared + "/keys", folder + "/keys")

    def command(self, folder):
        return ["keys", "enrol", folder + "/keys", "room-1"]

    def check(self, folder, outcome):
        if outcome.status == 0 and not outcome.text.strip():
            return "no code though it ended with 0"
        call("arthron-server", "keys", "enrol", folder + "/keys", "room-2")
        return ""


class Generate(Scenario):
    name, program = "case generate", "arthron-case"
    in_short = False

    def prepare(self, folder):
        with open(os.path.join(SOURCE, "cases/healthy/recipe.ini")) as f:
            text = f.read()
        os.mkdir(folder + "/recipe")
        with open(folder + "/recipe/recipe.ini", "w") as f:
            f.write(text)

    def command(self, folder):
        return ["generate", folder + "/recipe", "--out", folder + "/case"]

    def check(self, folder, outcome):
        if outcome.status == 0 and call("arthron-case", "info", folder + "/case", code=None).returncode:
            return "the case cannot be read though it ended with 0"
        return ""


class Show(Scenario):
    name, program = "case info", "arthron-case"
    in_short = False

    def command(self, folder):
        return ["info", CASES + "/healthy"]


class OfTrace(Scenario):
    """The session of tests/corpus, with cuts and an undo."""
    program = "arthron-trace"
    all_of = ("read", "open")

    def __init__(self, shared):
        super().__init__(shared)
        self.trace, self.case = shared + "/cuts.trace", shared + "/case"
        if not os.path.exists(self.trace):
            with lzma.open(CORPUS + "/cuts.trace.xz") as packed, open(self.trace, "wb") as out:
                out.write(packed.read())
            with tarfile.open(CORPUS + "/case.tar.xz") as packed:
                packed.extractall(shared)
        with lzma.open(CORPUS + "/table.csv.xz") as packed:
            self.table = packed.read()


class Verify(OfTrace):
    name = "trace verify"

    def command(self, folder):
        return ["verify", self.trace, "--authority", CORPUS + "/authority.pem"]


class Replay(OfTrace):
    name = "trace replay"
    in_short = False

    def command(self, folder):
        return ["replay", self.trace, "--case", self.case]

    def check(self, folder, outcome):
        return "" if outcome.status or "identical" in outcome.text else "not identical"


class Csv(OfTrace):
    name, in_short = "trace export", False
    all_of = ()  # it does without the case, and says so; the table tells whether it is whole

    def command(self, folder):
        return ["export", self.trace, "--csv", folder + "/out.csv"]

    def check(self, folder, outcome):
        out = folder + "/out.csv"
        if outcome.status == 0 and not os.path.exists(out):
            return "no table though it ended with 0"
        if outcome.status == 0:
            with open(out, "rb") as f:
                return "" if len(f.read()) >= len(self.table) else "the table is cut short though it ended with 0"
        return "leaves a table that is none" if os.path.exists(out) and ORDERLY not in outcome.text else ""


class Picture(OfTrace):
    name = "trace picture"
    in_short = False

    def command(self, folder):
        return ["picture", self.trace, "--case", self.case, "--out", folder + "/out.png"]


class Scene(OfTrace):
    name = "trace scene"
    in_short = False

    def command(self, folder):
        return ["export", self.trace, "--case", self.case, "--gltf", folder + "/out.glb"]


class Report(OfTrace):
    name = "trace report"
    in_short = False

    def command(self, folder):
        return ["report", self.trace, "--case", self.case, "--out", folder + "/out.html"]


class OfRecords(Scenario):
    program = "arthron-server"

    def prepare(self, folder):
        db = self.shared + "/records.db"
        if not os.path.exists(db):
            for name in ("ada", "grace"):
                call("arthron-server", "records", "--file", db, "add", "trainee", name)
            call("arthron-server", "backup", "--file", db, "--out", self.shared + "/backup.db")
        shutil.copy(db, folder + "/records.db")

    def trainees(self, folder):
        listed = call("arthron-server", "records", "--file", folder + "/records.db", "list", "trainees", "--json").stdout
        return sorted(t["name"] for t in json.loads(listed))

    def check(self, folder, outcome):
        there = self.trainees(folder)
        return "" if there in self.allowed(outcome) else f"trainees are {there}"

    def allowed(self, outcome):
        return [["ada", "grace"]]


class Add(OfRecords):
    name = "records add"

    def command(self, folder):
        return ["records", "--file", folder + "/records.db", "add", "trainee", "mary"]

    def allowed(self, outcome):
        more = ["ada", "grace", "mary"]
        return [more] if outcome.status == 0 else [["ada", "grace"], more]


class Backup(OfRecords):
    name = "backup"

    def command(self, folder):
        return ["backup", "--file", folder + "/records.db", "--out", folder + "/copy.db"]

    def check(self, folder, outcome):
        if outcome.status == 0:
            call("arthron-server", "restore", folder + "/copy.db", "--file", folder + "/records.db")
        elif os.path.exists(folder + "/copy.db") and ORDERLY not in outcome.text and "wrote" not in outcome.text:
            return "leaves a backup that is none"
        return super().check(folder, outcome)


class Restore(OfRecords):
    name = "restore"

    def prepare(self, folder):
        super().prepare(folder)
        call("arthron-server", "records", "--file", folder + "/records.db", "add", "trainee", "mary")

    def command(self, folder):
        return ["restore", self.shared + "/backup.db", "--file", folder + "/records.db"]

    def allowed(self, outcome):
        before, after = ["ada", "grace", "mary"], ["ada", "grace"]
        exchanged = any(said in outcome.text for said in ("the replaced file is kept", "wrote", ORDERLY))
        return [after] if outcome.status == 0 else [before, after] if exchanged else [before]


class Serve(Scenario):
    """Starts, is ready, ends."""
    name, program = "server start", "arthron-server"
    ending = signal.SIGTERM
    stations = f"[case healthy]\ndir = {CASES}/healthy\n[station room-1]\ncase = healthy"

    def prepare(self, folder):
        if not os.path.exists(self.shared + "/keys"):
            call("arthron-server", "keys", "init", self.shared + "/keys")
        shutil.copytree(self.shared + "/keys", folder + "/keys")
        with open(folder + "/server.ini", "w") as f:
            f.write(f"""{self.stations}
[server]
wait_s = 86400
address = 127.0.0.1
port = {free_port()}
udp_port = {free_port()}
workers = 1
keys = keys
traces = traces
socket = s
records = records.db
[web]
address = 127.0.0.1
port = {free_port()}
""")

    def command(self, folder):
        return ["run", "--config", folder + "/server.ini"]

    def meanwhile(self, process, folder):
        end = time.monotonic() + PATIENCE_S
        while process.poll() is None and " ready on" not in text_of(folder + "/log"):
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired(self.name, PATIENCE_S)
            time.sleep(0.01)
        if process.poll() is None:
            process.send_signal(self.ending)
        return process.wait(PATIENCE_S)


class Resume(Serve):
    """Starts with two sessions that a killed server left, and hands them over."""
    name = "server resume"
    in_short = False
    ending = signal.SIGUSR1
    stations = "[case tear-radial]\ndir = case\n[station demo]\ncase = tear-radial\n[station room-2]\ncase = tear-radial"
    sessions = {"demo-20261122T153400Z-fe965edd.trace": "version4", "room-2-20261122T153400Z-5a5a5a5a.trace": "version5"}

    def prepare(self, folder):
        super().prepare(folder)
        with tarfile.open(CORPUS + "/case.tar.xz") as packed:
            packed.extractall(folder)
        os.mkdir(folder + "/traces")
        with open(folder + "/records.db.begun", "w") as begun:
            for name, version in self.sessions.items():
                with lzma.open(f"{SOURCE}/tests/corpus/trace/{version}/cuts.trace.xz") as packed:
                    with open(f"{folder}/traces/{name}", "wb") as out:
                        out.write(packed.read(60000))  # amid a record, as kill -9 leaves it
                begun.write(name + "\n")

    def check(self, folder, outcome):
        again = super().go(folder)
        if again.status:
            return f"the next start: {again.text[-300:]}"
        wrong = [name for name in self.sessions if f"station {name.split('-2026')[0]}: its session was open" not in again.text]
        return f"lost: {', '.join(wrong)}" if wrong else ""


SCENARIOS = (Keys, Enrol, Generate, Show, Verify, Replay, Csv, Picture, Scene, Report, Add, Backup, Restore, Serve, Resume)
