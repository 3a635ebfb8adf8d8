"""Generated parts of the site: the scene reference from the schema, line numbers, TeX as MathML."""

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.structure.files import File
from mkdocs.utils import get_relative_url

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)

VIEWER = re.compile(r'<iframe[^>]*"http://127\.0\.0\.1[^>]*></iframe>')
"""The page of a run in a notebook's output, which answers only while the notebook runs."""

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
    """TeX formulas as MathML, which browsers draw by themselves; those on lines of their own scroll."""

    def drawn(found):
        if found[2] == "(":
            return convert(html.unescape(found[3]), display="inline")
        return f'<div class="formula">{convert(html.unescape(found[3]), display="block")}</div>'

    return FORMULA.sub(drawn, content)


def on_post_page(output, page, **_):
    """A picture in place of the page of a run, which is not there on the site."""
    if not VIEWER.search(output):
        return output
    picture = get_relative_url("pictures/viewer.png", page.url)
    return VIEWER.sub(f'<img src="{picture}" alt="The page of a run in the browser">', output)
