"""Table of known answers: fast rows pass, a wrong one fails, and the page is written."""

import json
from dataclasses import replace

import pytest

from clothsim.base.errors import ClothsimError
from tests.known_answers.__main__ import main
from tests.known_answers.row import Outcome, Row, agrees, seen
from tests.known_answers.table import ROWS, chosen, markdown

FAST = ("A1b", "A2a", "A3s", "A5a")


def row(name):
    return next(row for row in ROWS if row.name == name)


def mutated(name, **changes):
    return replace(row(name), run=lambda: replace(row(name).run(), **changes))


def test_fast_rows_pass_and_are_kept(tmp_path, capsys):
    record = tmp_path / "validation.json"
    assert main(["--rows", ",".join(FAST), "--record", str(record)]) == 0
    output = capsys.readouterr().out
    kept = json.loads(record.read_text())
    assert sorted(kept) == sorted(FAST)
    for name in FAST:
        assert row(name).what in output
        assert kept[name]["wrong"] == ""
        assert kept[name]["value"] == pytest.approx(kept[name]["exact"], rel=2e-3)
    assert kept["A3s"]["order"] > 1.9


@pytest.mark.parametrize(
    ("name", "changes", "wrong"),
    [
        ("A3s", {"exact": 7.9, "printed": ""}, "off by more than the bar"),
        ("A3s", {"exact": 7.8373484}, "the reference is"),
        ("A3s", {"order": 1.0}, "order"),
        ("A1f", {"value": 1e-9}, "off by more than the bar"),
        ("A5a", {"value": float("nan")}, "off by more than the bar"),
    ],
)
def test_a_row_made_wrong_fails(name, changes, wrong, capsys):
    result = seen(mutated(name, **changes))
    assert not result.passed
    assert wrong in result.wrong
    assert main([], [mutated(name, **changes)]) == 1
    assert "no: " in capsys.readouterr().out


def test_a_row_that_ends_with_a_sentence_fails_and_the_others_go_on(capsys):
    def ends():
        raise ClothsimError("It did not come to rest.")

    assert main([], [Row("A9a", "ends", ends), row("A1b")]) == 1
    output = capsys.readouterr().out
    assert "no: It did not come to rest." in output
    assert row("A1b").what in output


def test_the_table_is_written_between_its_marks(tmp_path):
    readme, record = tmp_path / "README.md", tmp_path / "validation.json"
    readme.write_text("before\n<!-- validation -->\nold\n<!-- /validation -->\nafter\n")
    assert main(["--rows", "A1b,A5a", "--record", str(record), "--page", str(readme)]) == 0
    text = readme.read_text()
    assert text.startswith("before\n<!-- validation -->\n")
    assert text.endswith("\n<!-- /validation -->\nafter\n")
    assert "old" not in text
    assert "2 of 2 pass" in text
    assert "| A1b | stress of a strip at a stretch of 1.5, sides free [N/m] | 1.046334 | 1.046334 |" in text
    # a run of one row mends that row and keeps the other
    assert main(["--rows", "A5a", "--record", str(record), "--page", str(readme)]) == 0
    assert "| A1b |" in readme.read_text()


def test_a_row_that_fails_names_the_reason_in_the_table():
    kept = {"date": "2026-01-02", "seconds": 1.0, "wrong": "off by more than the bar"}
    text = markdown([Row("A9a", "misses", lambda: None, why="a known limit")], {"A9a": kept})
    assert "2026-01-02" in text
    assert "0 of 1 pass" in text
    assert "no: a known limit" in text


def test_a_readme_without_marks_and_an_unknown_row_are_refused(tmp_path):
    readme = tmp_path / "README.md"
    readme.write_text("nothing")
    with pytest.raises(SystemExit, match="add both lines"):
        main(["--rows", "A1b", "--page", str(readme)])
    with pytest.raises(SystemExit):
        main(["--rows", "A99"])


def test_names_are_unique_and_a_group_is_chosen_whole():
    names = [row.name for row in ROWS]
    assert len(set(names)) == len(names)
    assert {row.name for row in chosen(["A2"])} == {f"A2{letter}" for letter in "abcdef"}
    assert [row.name for row in chosen(["A2b", "A5a"])] == ["A2b", "A5a"]


def test_a_deviation_is_a_fraction_or_in_the_unit():
    assert Outcome(1.1, 1.0, 0.2).deviation == pytest.approx(0.1)
    assert Outcome(11.0, 10.0, 2.0, unit="mm").deviation == pytest.approx(1.0)
    assert agrees(0.123456789, "0.12345679")
    assert not agrees(0.12345682, "0.12345679")
