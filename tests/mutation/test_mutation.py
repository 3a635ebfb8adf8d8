"""Mutants of a small module, and how the end of a trial is read. (The command begins with one that must be caught.)"""

from pathlib import Path

import pytest

from tests.mutation.__main__ import EQUIVALENT, KNOWN, ROOT, known_mutant, page, reasons
from tests.mutation.mutants import drawn, mutants_of
from tests.mutation.own_tests import MORE, own_tests
from tests.mutation.trial import CAUGHT, NOT_RUN, SURVIVED, TIME_OUT, read_end

MODULE = '''
"""Energy é of a spring."""
LIMIT = 0.5


def value(x, rest=0.3):
    """0.5 k u^2."""
    u = x[3 * 2] - rest * x[0]
    if u < 0.25:
        raise ValueError(f"{u + 1}")
    total = 1e-9
    total += 0.5 * u**2 / (
        1.5 - u
    )
    return -total


def text(x) -> str:
    return "x" * (2 + x)
'''


@pytest.fixture
def mutants(tmp_path):
    (tmp_path / "spring.py").write_text(MODULE, encoding="utf-8")
    return mutants_of(tmp_path, "spring.py")


def test_what_is_broken_and_what_is_left_alone(mutants):
    assert [(each.line, each.old, each.new) for each in mutants] == [
        *((8, "", "0.98 * "), (8, "-", "+"), (8, "", "0.98 * "), (8, "*", "/")),
        *((9, "<", "<="), (9, "0.25", "0.245")),
        *((12, "+=", "-="), (12, "0.5", "0.49"), (12, "*", "/"), (12, "2", "3"), (12, "/", "*")),
        *((13, "1.5", "1.47"), (13, "-", "+"), (13, "", "0.98 * ")),
        (15, "-", "+"),
    ]
    assert {each.inside for each in mutants} == {"value"}
    changed = mutants[2].applied(MODULE)
    assert changed == MODULE.replace("- rest * x[0]", "- 0.98 * rest * x[0]")
    compile(changed, "spring.py", "exec")


def test_a_draw_stays_when_other_lines_come(mutants, tmp_path):
    some = drawn(mutants, 5, seed=1)
    (tmp_path / "spring.py").write_text(MODULE.replace("LIMIT", "MORE = 1.0\nLIMIT"), encoding="utf-8")
    assert {each.key for each in drawn(mutants_of(tmp_path, "spring.py"), 5, seed=1)} == {each.key for each in some}
    assert drawn(mutants, 5, seed=2) != some


def test_how_a_trial_ended():
    failed = "FAILED tests/a/test_b.py::test_c - assert 1 == 2\n"
    assert read_end(0, "") == (SURVIVED, "")
    assert read_end(1, failed) == (CAUGHT, "tests/a/test_b.py::test_c")
    assert read_end(-24, "")[0] == read_end(-14, "")[0] == TIME_OUT
    assert read_end(-11, "") == (CAUGHT, "SIGSEGV")
    assert read_end(70, "tests saw another package")[0] == read_end(5, "")[0] == NOT_RUN


def test_the_map_names_files_that_are_there():
    for module, names in MORE.items():
        assert (ROOT / "clothsim" / f"{module}.py").is_file(), module
        assert [name for name in names if not (ROOT / "tests" / f"{name}.py").is_file()] == []
    assert known_mutant().before in (ROOT / KNOWN).read_text(encoding="utf-8")
    assert own_tests(ROOT, KNOWN)


def test_each_reason_is_of_a_line_that_is_there():
    assert EQUIVALENT.is_file()
    for file, before, _ in reasons():
        assert before in Path(ROOT, file).read_text(encoding="utf-8"), (file, before)


def test_the_page_lists_what_no_test_detects():
    file, before, after = next(iter(reasons()))

    def entry(now, after):
        line = {"file": file, "line": 1, "before": before, "after": after}
        return line | {"first": {"word": SURVIVED, "by": ""}, "last": {"word": now, "by": "tests/a.py"}}

    rows = page({"a": entry(SURVIVED, after), "b": entry(CAUGHT, "0"), "c": entry(SURVIVED, "1")}).split("\n")
    assert [row.split(" | ")[-1].rstrip(" |") for row in rows[-2:]] == [
        reasons()[file, before, after],
        "it has no test",
    ]
    assert not any("`0`" in row for row in rows)
