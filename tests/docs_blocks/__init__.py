"""Code blocks of the documentation, and why some of them are not run.

A block is fenced by three backticks. The comment `<!-- not run: REASON -->` before it names a reason of REASONS. A TOML
block that opens with a comment `# NAME.toml` is a file of that name beside the blocks of its page.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RUN = [ROOT / "README.md", *(page for top in ("start", "howto") for page in sorted((DOCS / top).glob("*.md")))]
"""Pages whose blocks are run, each page in one folder."""
PARSED = [*RUN, *(page for top in ("", "reference", "results") for page in sorted((DOCS / top).glob("*.md")))]
"""Pages whose commands the parser of the command line reads."""
PAGE_REASONS = {"gallery.md": "long"}
"""Pages with one reason for all of their blocks."""
REASONS = {
    "file": "needs a file of the reader's",
    "long": "takes more than a few CPU seconds: `python -m tests.docs_blocks --all` runs it",
    "extra": "needs an extra: `python -m tests.docs_blocks --all` runs it",
    "install": "changes the environment",
    "serves": "serves a page until Ctrl-C",
    "elsewhere": "runs in another program, or on another machine",
    "shown": "shows what a program looks like: a part of it, or what it prints",
}
LATER = {"long", "extra"}
"""Reasons that `--all` lifts."""

_FENCE = re.compile(r"^ *(?:\d+\. )?```(?P<language>\w+)[^\n]*\n(?P<text>.*?)^ *```[ ]*$", re.DOTALL | re.MULTILINE)
_REASON = re.compile(r"<!-- not run: ([\w ]+) -->\s*\Z")
_NAME = re.compile(r"# ([\w-]+\.toml)$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A block of a page: its line, language, text, the reason why it is not run or "", the name of its file."""

    page: Path
    line: int
    language: str
    text: str
    reason: str
    file: str

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}"


def blocks_of(page: Path) -> Iterator[Block]:
    """The blocks of a page in their order."""
    text = page.read_text(encoding="utf-8")
    for found in _FENCE.finditer(text):
        before, code = text[: found.start()], dedent(found["text"])
        reason = _REASON.search(before)
        named = _NAME.match(code)
        yield Block(
            page,
            before.count("\n") + 1,
            found["language"],
            code,
            reason[1] if reason else PAGE_REASONS.get(page.name, ""),
            named[1] if named else "",
        )
