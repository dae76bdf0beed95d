"""The Markdown files of the source: their headings, links, code and commands."""

import os
import pathlib
import re
import shlex

from markdown_it import MarkdownIt

SOURCE = pathlib.Path(os.environ["ARTHRON_SOURCE"]).resolve()
# What stands before a program in a command.
BEFORE = re.compile(r"^(\$ |sudo |runuser -u arthron(-station)? -- |docker(-compose -f \S+)? exec \S+ |(build/release|run)/bin/)+")


def paths():
    """Of all documents."""
    for folder, below, files in os.walk(SOURCE):
        below[:] = sorted(name for name in below
                          if not name.startswith((".", "build")) and name not in ("run", "node_modules"))
        yield from (pathlib.Path(folder, name) for name in sorted(files) if name.endswith(".md"))


def slug(heading):
    """The anchor that GitHub gives to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


class Manual:
    def __init__(self, path):
        self.path = pathlib.Path(path)
        tokens = MarkdownIt("commonmark").enable("table").parse(self.path.read_text())
        self.anchors, self.links, self.spans, self.chapters = set(), [], [], {"": []}
        chapter = ""
        for token, after in zip(tokens, tokens[1:] + [None]):
            if token.type == "heading_open":
                text = "".join(child.content for child in after.children)
                chapter = self.add_anchor(text)
                self.chapters[chapter] = []
            elif token.type in ("code_block", "fence"):
                self.chapters[chapter].append(token)
            self.look_into(token.children or ())

    def add_anchor(self, heading):
        anchor, again = slug(heading), 0
        while anchor in self.anchors:
            again += 1
            anchor = f"{slug(heading)}-{again}"
        self.anchors.add(anchor)
        return anchor

    def look_into(self, children):
        for child in children:
            if child.type == "code_inline":
                self.spans.append(child.content)
            for name in ("href", "src"):
                if name in child.attrs:
                    self.links.append(child.attrs[name])

    def blocks(self, *chapters, language=None):
        """The code of these chapters, by the anchors of their headings; of all without any."""
        return [token.content for chapter in chapters or self.chapters for token in self.chapters[chapter]
                if language in (None, token.info)]

    def commands(self, *chapters):
        return [line for block in self.blocks(*chapters, language="") for line in lines(block)]


def lines(block):
    """Of code: those that end in a backslash are one with the next."""
    return [line.rstrip() for line in re.sub(r" *\\\n\s*", " ", block).splitlines() if line.strip()]


def words(line):
    """Of a command, without what stands before its program and what follows a comment, a pipe or a redirection."""
    try:
        found = shlex.split(BEFORE.sub("", line.strip()), comments=True)
    except ValueError:
        return []
    ends = [i for i, word in enumerate(found) if re.match(r"[|<>&;]", word)]
    return found[:min(ends, default=len(found))]
