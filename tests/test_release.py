"""Version, date and authors: the package, CITATION.cff and CHANGELOG.md say the same."""

import re
import tomllib
from pathlib import Path

import clothsim

ROOT = Path(__file__).parents[1]
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
VERSION, DATE = re.search(
    r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE
).groups()


def test_there_is_one_version():
    (cited,) = re.findall(r"^version: (\S+)$", CITATION, re.MULTILINE)
    assert cited == VERSION == clothsim.__version__


def test_a_version_has_a_date_where_it_is_released():
    dates = re.findall(r'^date-released: "(\d{4}-\d\d-\d\d)"$', CITATION, re.MULTILINE)
    assert dates == ([] if DATE == "unreleased" else [DATE])


def test_the_authors_are_those_that_are_cited():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    cited = re.findall(r"^  - name: (.+)$", CITATION, re.MULTILINE)
    assert [author["name"] for author in project["authors"]] == cited
