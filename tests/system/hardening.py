#!/usr/bin/env python3
"""The installed programs have what the compiler and the linker do against faults of memory."""

import json
import os
import re
import subprocess
import unittest

from arthron import BIN, program

PROGRAMS = ("arthron-server", "arthron-case", "arthron-trace", "arthron-station", "arthron-mockup")


def readelf(name, *options):
    return subprocess.run(["readelf", "-W", *options, program(name)], check=True, capture_output=True,
                          text=True).stdout


class Hardening(unittest.TestCase):
    def each(self):
        for name in PROGRAMS:
            with self.subTest(name):
                yield name

    def test_they_lie_anywhere(self):
        for name in self.each():
            self.assertRegex(readelf(name, "-h"), r"Type:\s+DYN")
            self.assertRegex(readelf(name, "-d"), r"FLAGS_1\).*\bPIE\b")

    def test_the_tables_of_the_linker_are_full_and_then_read_only(self):
        for name in self.each():
            self.assertRegex(readelf(name, "-l"), r"GNU_RELRO")
            self.assertRegex(readelf(name, "-d"), r"FLAGS_1\).*\bNOW\b")

    def test_no_stack_is_run_as_code(self):
        for name in self.each():
            self.assertRegex(readelf(name, "-l"), r"GNU_STACK\s+(\S+\s+){5}RW ")

    def test_the_compiler_guards_the_stack_and_the_length_of_copies(self):
        for name in self.each():
            symbols = readelf(name, "--dyn-syms")
            self.assertIn("__stack_chk_fail", symbols)
            self.assertRegex(symbols, r"__(v?snprintf|memcpy|strcpy|read)_chk")

    def test_every_file_of_theirs_was_compiled_so(self):
        with open(os.path.join(os.path.dirname(BIN), "compile_commands.json")) as f:
            commands = [c["command"] for c in json.load(f) if re.search(r"/(server|station|shared|Unity)/", c["file"])]
        self.assertGreater(len(commands), 300)
        wanted = ["-fPIE", "-fstack-protector-strong", "-fstack-clash-protection", "-D_FORTIFY_SOURCE=2"]
        if os.uname().machine == "x86_64":
            wanted.append("-fcf-protection")
        for command in commands:
            self.assertFalse([flag for flag in wanted if flag not in command.split()], command)


if __name__ == "__main__":
    unittest.main()
