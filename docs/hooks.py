"""Generated parts of the site: the scene reference from the schema, line numbers, TeX as MathML."""

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.structure.files import File

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)

CHANGE = re.compile(r"(\| `(?P<text>[^`]+)` \| `(?P<file>clothsim/[^`]+\.py))` \|$", re.MULTILINE)
"""The end of a row of the page's ten changes: what is searched for, and the file that has it."""


def on_files(files, config):
    """Add the pages that are generated from the package."""
    from clothsim.scene.reference import markdown

    files.append(File.generated(config, "reference/scene.md", content=markdown()))
    return files


def on_page_markdown(markdown, page, **_):
    """The line beside each file of the ten changes."""
    if page.file.src_uri != "contributing.md":
        return markdown
    return CHANGE.sub(lambda found: f"{found[1]}:{line_of(found['text'], Path(found['file']))}` |", markdown)


def line_of(text, file):
    """Number of the first line of a file that has the text."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return next(number for number, line in enumerate(lines, 1) if text in line)


def on_page_content(content, **_):
    """TeX formulas as MathML, which browsers draw by themselves."""
    return FORMULA.sub(
        lambda found: convert(html.unescape(found[3]), display="inline" if found[2] == "(" else "block"), content
    )
