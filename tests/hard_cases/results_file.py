"""Results file of the hard cases, {case: {form: summary of its results}}."""

from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from tests.benchmarks.stored_tables import Record, markdown_table, read_record, when, write_record
from tests.hard_cases.case import Case, Result

FORMS = ("small", "full")
"""The form that the tests run, and the one of real size."""

COLUMNS = ("passed", "smallest gap", "Newton iterations", "CPU s")


def summary(results: Sequence[Result]) -> dict[str, Any]:
    """Seeds passed, the smallest gap of all [m], the mean of Newton iterations and CPU seconds, what went wrong."""
    count, gap = len(results), min(result.gap for result in results)
    return {
        "date": date.today().isoformat(),
        "seeds": count,
        "passed": sum(result.passed for result in results),
        "gap": gap if gap < float("inf") else None,
        "newton_iterations": sum(result.newton_iterations for result in results) / count,
        "seconds": sum(result.seconds for result in results) / count,
        "wrong": {str(result.seed): result.wrong for result in results if not result.passed},
    }


def cells(seen: dict[str, Any] | None) -> tuple[str, ...]:
    """The cells of COLUMNS; blank where nothing was seen."""
    if seen is None:
        return ("",) * len(COLUMNS)
    gap = "-" if seen["gap"] is None else f"{seen['gap']:.1e} m"
    passed = f"{seen['passed']} of {seen['seeds']}"
    return passed, gap, f"{seen['newton_iterations']:,.0f}", f"{seen['seconds']:.1f}"


def keep(file: Path, case: str, form: str, results: Sequence[Result]) -> None:
    """Put what was seen of a case into the record in `file`."""
    record = read_record(file)
    record.setdefault(case, {})[form] = summary(results)
    write_record(file, record)


def markdown(cases: Iterable[Case], record: Record) -> str:
    """The table of all cases in Markdown, dated: a row a case, COLUMNS for each form."""
    header = ("case", "scene", *(f"{form}: {column}" for form in FORMS for column in COLUMNS))
    rows = []
    for case in cases:
        seen = record.get(case.name, {})
        rows.append((case.name, case.title, *(cell for form in FORMS for cell in cells(seen.get(form)))))
    dates = [seen["date"] for forms in record.values() for seen in forms.values()]
    return f"Measured {when(dates)} with `python -m tests.hard_cases`.\n\n{markdown_table(header, rows)}"
