"""Ten changes of docs/contributing.md: each is found by one folder and one search."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "contributing.md"
ROW = re.compile(
    r"^\| (?P<change>[^|]+) \| `(?P<folder>[^`]+)` \| `(?P<text>[^`]+)` \| `(?P<file>[^`]+)` \|$", re.MULTILINE
)
ROWS = [found.groupdict() for found in ROW.finditer(PAGE.read_text(encoding="utf-8"))]


def files_with(text, folder):
    """Files of a folder that have a text, as `grep -rlF` lists them."""
    files = sorted((ROOT / folder).rglob("*.py"))
    return [file.relative_to(ROOT).as_posix() for file in files if text in file.read_text(encoding="utf-8")]


def test_there_are_ten():
    assert len(ROWS) == 10


@pytest.mark.parametrize("row", ROWS, ids=[row["change"] for row in ROWS])
def test_a_change_is_found_where_the_page_says(row):
    assert (ROOT / row["folder"]).is_dir()
    assert files_with(row["text"], row["folder"]) == [row["file"]]
