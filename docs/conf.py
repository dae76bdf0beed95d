"""How docs/build-site makes the site: every Markdown file of the source is a page at its own relative address."""

import pathlib
import re

project = "Arthron"
copyright = "the Arthron maintainers"
extensions = ["myst_parser"]
root_doc = "docs/index"
source_suffix = {".md": "markdown"}
exclude_patterns = [".*", "build*", "run", "**/node_modules"]
myst_heading_anchors = 6
myst_ref_domains = ["std"]
html_theme = "furo"
html_title = "Arthron"
html_copy_source = False
highlight_language = "text"


def add_contents(app, docname, source):
    """docs/index.md is plain Markdown: each of its chapters becomes a part of the navigation."""
    if docname != root_doc:
        return
    for chapter in source[0].split("\n## ")[1:]:
        caption = chapter.splitlines()[0]
        documents = re.findall(r"\]\(([^)#]+)\.md\)", chapter)
        entries = "\n".join(documents)
        source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{entries}\n```\n"


def setup(app):
    app.connect("source-read", add_contents)
