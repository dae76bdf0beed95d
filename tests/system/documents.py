#!/usr/bin/env python3
"""What the documents say is there: files and headings that they link to, programs with their commands and options,
paths of the source, and messages."""

import functools
import os
import re
import subprocess
import sys
import unittest
import urllib.parse

from arthron import program
from manuals import SOURCE, Manual, lines, paths, words

ROOMS = re.compile(r"(\./)?(\.ci|cases|docker|docs|server|shared|station|tests|web)(/[\w.-]+)*/?|\./(check|demo)")
MADE = ("web/node_modules", "web/dist")  # by a build
NAMELESS = re.compile(r"/[A-Z]+\b")  # tests/fuzz/NAME.c
OPTION = re.compile(r"--?[A-Za-z][\w-]*")


@functools.cache
def help_of(*command):
    """What a program, or one of its commands, says of itself; "" if there is none."""
    try:
        done = subprocess.run([program(command[0]), *command[1:], "--help"], capture_output=True, text=True, timeout=60)
    except FileNotFoundError:
        return ""
    return done.stdout if done.returncode == 0 else ""


def commands_of(text):
    """The words of a list of commands in a help, each with a line of its own."""
    return set(re.findall(r"^  ([a-z][\w-]*) ", text, re.MULTILINE))


def words_of_usage(text):
    """The lower-case words of its usage that choose what a command does, as in "start|undo STATION"."""
    usage = text.split("\n\n")[0]
    usage = re.sub(r"(?<!\w)--?\w[\w-]* \S+", "", re.sub(r"\[[^\]]*\]", "", usage))
    found = [re.match(r"(?:Usage:)?\s+arthron-\S+ \S+\s+([a-z|-]+)(?:\s|$)", line) for line in usage.splitlines()]
    return {word for match in found if match for word in match[1].split("|")}


def unknown_in(command):
    """What is wrong with a command of a program; "" if nothing is."""
    name, *rest = command
    text = help_of(name)
    if not text:
        return f"no program {name}"
    asked, known = [name], commands_of(text)
    if known and rest and not rest[0].startswith("-") and not rest[0].isupper():
        if rest[0] not in known:
            return f"{name} has no command {rest[0]}"
        asked.append(rest.pop(0))
        text = help_of(*asked)
    rest = [word for word in rest if word not in ("…", "...")]
    wanted, told = [], words_of_usage(text)
    for word, before in zip(rest, ["", *rest]):
        option = word.split("=")[0]
        if OPTION.fullmatch(option):
            if not re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", text):
                return f"{' '.join(asked)} has no option {option}"
        elif not re.search(rf"(?<![\w-]){re.escape(before)} [A-Z\"]", text) or not OPTION.fullmatch(before):
            wanted.append(word)
    if told and len(asked) > 1 and wanted and wanted[0] not in told and wanted[0].islower():
        return f"{' '.join(asked)} does not know {wanted[0]}"
    return ""


@functools.cache
def said_by_programs():
    """The source of programs and pages, with texts of several lines joined."""
    files = [path for folder in ("server", "shared", "station") for path in (SOURCE / folder).rglob("*.c")]
    text = "\n".join(path.read_text() for path in [*files, SOURCE / "web/src/text.ts"])
    return re.sub(r'"\s*\n\s*"', "", text)


class Documents(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.manuals = [Manual(path) for path in paths()]

    def nothing_wrong(self, what, count, least, wrong):
        print(f"{count} {what} in {len(self.manuals)} documents", file=sys.stderr)
        self.assertFalse(wrong, "\n" + "\n".join(wrong))
        self.assertGreater(count, least)

    def test_each_link_leads_to_a_file_and_to_a_heading(self):
        anchors = {manual.path: manual.anchors for manual in self.manuals}
        count, wrong = 0, []
        for manual in self.manuals:
            for link in manual.links:
                url = urllib.parse.urlsplit(link)
                if url.scheme:
                    continue
                count += 1
                path = manual.path
                if url.path:
                    path = (path.parent / urllib.parse.unquote(url.path)).resolve()
                if not path.is_file() or url.fragment and url.fragment not in anchors.get(path, ()):
                    wrong.append(f"{manual.path.relative_to(SOURCE)}: {link}")
        self.nothing_wrong("links", count, 300, wrong)

    def test_each_command_is_known_to_its_program(self):
        count, wrong = 0, []
        for manual in self.manuals:
            code = [line for block in manual.blocks() for line in lines(block)] + manual.spans
            for line in code:
                command = words(line)
                if not command or not re.fullmatch(r"arthron-[a-z]+", command[0]) or line == command[0]:
                    continue
                count += 1
                problem = unknown_in(command)
                if problem:
                    wrong.append(f"{manual.path.relative_to(SOURCE)}: {line}: {problem}")
        self.nothing_wrong("commands", count, 100, wrong)

    def test_each_path_of_the_source_is_there(self):
        count, wrong = 0, []
        for manual in self.manuals:
            for code in [*manual.blocks(), *manual.spans]:
                for word in re.split(r"[\s`'\"(){}=:,]+", code):
                    word = word.rstrip(".")
                    if not ROOMS.fullmatch(word) or word.startswith(MADE):
                        continue
                    count += 1
                    if not (SOURCE / word).exists() and not NAMELESS.search(word):
                        wrong.append(f"{manual.path.relative_to(SOURCE)}: {word}")
        self.nothing_wrong("paths", count, 200, wrong)

    def test_each_message_of_the_troubleshooting_is_in_the_source(self):
        text = (SOURCE / "docs/TECHNICIAN.md").read_text()
        rows = [row.split(" | ")[1] for row in text[text.index("## Troubleshooting"):].splitlines()
                if row.count(" | ") == 2]
        messages = [message for row in rows for message in re.findall("`([^`]+)`", row)]
        wrong = [message for message in messages if message not in said_by_programs()]
        self.nothing_wrong("messages of the troubleshooting", len(messages), 20, wrong)

    def test_each_option_of_a_script_is_in_it(self):
        count, wrong = 0, []
        for manual in self.manuals:
            code = [line for block in manual.blocks() for line in lines(block)] + manual.spans
            for line in code:
                command = words(line)
                if not command or not ROOMS.fullmatch(command[0]) or not os.path.isfile(SOURCE / command[0]):
                    continue
                text = (SOURCE / command[0]).read_text()
                for option in filter(OPTION.fullmatch, command[1:]):
                    count += 1
                    if option not in text:
                        wrong.append(f"{manual.path.relative_to(SOURCE)}: {line}: {command[0]} has no {option}")
        self.nothing_wrong("options of scripts", count, 10, wrong)


if __name__ == "__main__":
    unittest.main()
