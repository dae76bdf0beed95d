#!/usr/bin/env python3
"""What `cmake --install` puts into a folder: programs that run there, their manual, what systemd starts, and of what
they are made."""

import gzip
import hashlib
import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest

from arthron import BIN, SOURCE, Process, call, call_json, free_port, text_of

PACKAGES = {"arthron-server": ["arthron-server"], "arthron-station": ["arthron-station"],
            "arthron-tools": ["arthron-case", "arthron-mockup", "arthron-trace"]}
PROGRAMS = [program for programs in PACKAGES.values() for program in programs]
EXPOSURE = {"arthron-server.service": 15, "arthron-station@.service": 25}  # at most, in tenths


def install(folder, *options):
    subprocess.run(["cmake", "--install", os.path.dirname(BIN), "--prefix", "/usr", "--strip", *options], check=True,
                   stdout=subprocess.DEVNULL, env={**os.environ, "DESTDIR": folder})


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.keep = tempfile.TemporaryDirectory(prefix="arthron-installed-")
        cls.addClassCleanup(cls.keep.cleanup)
        install(cls.keep.name)

    def path(self, *names):
        return os.path.join(self.keep.name, *names)

    def run_bash(self, script):
        done = subprocess.run(["bash", "-euc", script], capture_output=True, text=True, timeout=60,
                              env={**os.environ, "PATH": f"{self.path('usr/bin')}:{os.environ['PATH']}"})
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return done.stdout.split()

    def test_one_version_is_told_everywhere(self):
        version = re.search(r"^project\(arthron VERSION (\S+)", text_of(f"{SOURCE}/CMakeLists.txt"), re.MULTILINE)[1]
        for program in PROGRAMS:
            said = subprocess.run([self.path("usr/bin", program), "--version"], capture_output=True, text=True)
            self.assertEqual(said.stdout, f"{program} {version}\n")
        self.assertEqual(re.search(r"^## (\S+)", text_of(f"{SOURCE}/CHANGELOG.md"), re.MULTILINE)[1], version)

    def test_a_manual_page_explains_each_command_of_each_program(self):
        for program in PROGRAMS:
            with gzip.open(self.path(f"usr/share/man/man1/{program}.1.gz"), "rt") as file:
                page = file.read()
            commands = re.findall(r"^  ([a-z][a-z-]+) ", call(program, "--help").stdout, re.MULTILINE)
            told = re.findall(r"^\.SS \S+ (\S+)", page, re.MULTILINE)
            self.assertEqual([command.replace("-", "\\-") for command in commands], told)
            self.assertEqual(bool(commands), program != "arthron-mockup")
            self.assertIn(f".SH NAME\n{program} \\- ".replace(program, program.replace("-", "\\-")), page)

    def test_bash_completes_commands_and_options(self):
        def completed(*words):
            script = self.path("usr/share/bash-completion/completions", words[0])
            return self.run_bash(f"""source {script}
                [[ $(complete -p {words[0]}) == *_arthron* ]]
                COMP_WORDS=({' '.join(repr(word) for word in words)}) COMP_CWORD={len(words) - 1}
                _arthron {words[0]} {words[-1]!r}; echo "${{COMPREPLY[@]}}" """)

        self.assertEqual(completed("arthron-server", "se"), ["session"])
        self.assertEqual(completed("arthron-server", "keys", "en"), ["encrypt", "enrol"])
        self.assertIn("--config", completed("arthron-station", "run", "--c"))
        self.assertIn("--motion", completed("arthron-mockup", "--mo"))
        self.assertEqual(completed("arthron-trace", "ver"), ["verify"])
        self.assertIn("--case", completed("arthron-case", "motion", "x.ini", "--"))

    def test_the_config_and_the_cases_that_come_with_it_serve(self):
        config = text_of(self.path("etc/arthron/server.ini"))
        folder = self.path("serves")
        os.mkdir(folder)
        for old, new in (("/var/lib/arthron", folder), ("/run/arthron", folder), ("/usr/share", self.path("usr/share")),
                         ("[server]\n", f"[server]\nport = {free_port()}\nudp_port = 0\n"),
                         ("port = 4880", f"port = {free_port()}")):
            self.assertIn(old, config)
            config = config.replace(old, new)
        with open(f"{folder}/server.ini", "w") as file:
            file.write(config)
        call("arthron-server", "keys", "init", f"{folder}/keys")
        server = Process(folder, "server", self.path("usr/bin/arthron-server"), "run", "--config", f"{folder}/server.ini")
        self.addCleanup(lambda: self.assertEqual(server.wrong_end(), ""))
        server.wait_for_log("ready on port")
        stations = call_json("arthron-server", "session", "--socket", f"{folder}/server.sock", "list")["sessions"]
        self.assertEqual({station["station"]: station["case"] for station in stations},
                         {"room-1": "arthrosis", "room-2": "healthy"})

    def test_a_config_that_was_changed_stays(self):
        changed = self.path("etc/arthron/station.ini")
        with open(changed, "a") as file:
            file.write("; ours\n")
        install(self.keep.name, "--component", "arthron-station")
        self.assertTrue(text_of(changed).endswith("; ours\n"))

    # ---- systemd

    def units(self):
        return [self.path("usr/lib/systemd/system", unit) for unit in EXPOSURE]

    @unittest.skipUnless(shutil.which("systemd-analyze"), "systemd-analyze is missing")
    def test_systemd_understands_the_units(self):
        with tempfile.TemporaryDirectory() as folder:
            for unit in self.units():  # with programs that this machine has
                text = re.sub(r"^(ExecStart=)arthron-\w+", r"\1/bin/true", text_of(unit), flags=re.MULTILINE)
                with open(os.path.join(folder, os.path.basename(unit)), "w") as file:
                    file.write(text)
            done = subprocess.run(["systemd-analyze", "verify", "--man=no", f"{folder}/arthron-server.service",
                                   f"{folder}/arthron-station@.service"], capture_output=True, text=True,
                                  env={**os.environ, "SYSTEMD_UNIT_PATH": f"{folder}:"})
        self.assertNotIn("arthron-", done.stdout + done.stderr)

    @unittest.skipUnless(shutil.which("systemd-analyze"), "systemd-analyze is missing")
    def test_the_sandboxes_leave_little_open(self):
        for unit, most in EXPOSURE.items():
            done = subprocess.run(["systemd-analyze", "security", "--offline=true", f"--threshold={most}", "--no-pager",
                                   self.path("usr/lib/systemd/system", unit)], capture_output=True, text=True)
            self.assertIn("Overall exposure level", done.stdout)
            self.assertEqual(done.returncode, 0, done.stdout)

    # ---- the bill of materials

    def bill(self, package):
        return json.loads(text_of(self.path("usr/share/doc", package, f"{package}.cdx.json")))

    def owners_of_libraries(self, programs):
        """The packages that have a file of the name of each library that the programs load."""
        loaded = subprocess.run(["ldd", *(self.path("usr/bin", program) for program in programs)], check=True,
                                capture_output=True, text=True).stdout
        names = sorted(set(re.findall(r"(\S+) => /", loaded)))
        self.assertIn("libssl.so.3", names)
        found = subprocess.run(["dpkg-query", "-S", *("*/" + name for name in names)], capture_output=True,
                               text=True).stdout.splitlines()
        return {name: {line.split(":")[0] for line in found if line.endswith("/" + name)} for name in names}

    def test_a_bill_names_each_library_that_a_program_loads_and_the_programs_themselves(self):
        for package, programs in PACKAGES.items():
            bill = self.bill(package)
            self.assertEqual((bill["bomFormat"], bill["specVersion"]), ("CycloneDX", "1.4"))
            named = {part["name"]: part["version"] for part in bill["components"]}
            for library, owners in self.owners_of_libraries(programs).items():
                self.assertTrue(owners & set(named), f"{package}: {library}, of {owners}")
            files = {part["name"]: part["hashes"][0]["content"] for part in bill["metadata"]["component"]["components"]}
            for program in programs:
                with open(self.path("usr/bin", program), "rb") as file:
                    self.assertEqual(files[program], hashlib.sha256(file.read()).hexdigest())

    def test_references_of_a_bill_are_unique_and_those_of_its_dependencies_exist(self):
        for package in PACKAGES:
            bill = self.bill(package)
            refs = [part["bom-ref"] for part in bill["components"]]
            self.assertEqual(len(refs), len(set(refs)))
            self.assertEqual([part["purl"] for part in bill["components"]], refs)
            self.assertEqual(bill["dependencies"], [{"ref": package, "dependsOn": refs}])

    def test_libraries_that_are_linked_statically_are_in_the_bill(self):
        build = text_of(os.path.join(os.path.dirname(BIN), "build.ninja"))
        archives = set(re.findall(r"/usr/lib/\S+?/(lib\w[\w-]*)\.a\b", build)) - {"libpthread", "libdl", "librt"}
        self.assertEqual(archives, {"libprotobuf-nanopb"})
        for package in ("arthron-server", "arthron-station"):
            self.assertIn("libnanopb-dev", [part["name"] for part in self.bill(package)["components"]])

    def test_the_bill_of_the_server_names_what_its_pages_are_made_of(self):
        lock = json.loads(text_of(f"{SOURCE}/web/package-lock.json"))["packages"]
        wanted = {place.rpartition("node_modules/")[2]: package["version"] for place, package in lock.items()
                  if place and not package.get("dev")}
        self.assertIn("preact", wanted)
        told = {part["name"]: part["version"] for part in self.bill("arthron-server")["components"]
                if part["purl"].startswith("pkg:npm/")}
        self.assertEqual(told, wanted)
        self.assertFalse([part for part in self.bill("arthron-station")["components"] if "npm" in part["purl"]])


if __name__ == "__main__":
    unittest.main(verbosity=2)
