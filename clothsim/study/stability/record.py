"""What was seen of each hard case, kept in a file: a run of some rows mends those rows and keeps the others."""

import json
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from clothsim.io.atomic import write_atomically
from clothsim.study.stability.case import Case, Result

FORMS = ("small", "full")
"""The form that the tests run, and the one of real size."""

BEGIN, END = "<!-- stability -->", "<!-- /stability -->"
COLUMNS = ("passed", "smallest gap", "Newton", "CPU s")

Record = dict[str, dict[str, Any]]
"""{case: {form: what `summary` makes of its results}}."""


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


def read_record(file: Path) -> Record:
    """The record in `file`; empty where there is none."""
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def keep(file: Path, case: str, form: str, results: Sequence[Result]) -> None:
    """Put what was seen of a case into the record in `file`."""
    record = read_record(file)
    record.setdefault(case, {})[form] = summary(results)
    write_atomically(file, (json.dumps(record, indent=1, sort_keys=True) + "\n").encode())


def markdown(cases: Iterable[Case], record: Record) -> str:
    """The table of all cases in Markdown, dated: a row a case, COLUMNS for each form."""
    header = ("case", "what", *(f"{form}: {column}" for form in FORMS for column in COLUMNS))
    rows = []
    for case in cases:
        seen = record.get(case.name, {})
        rows.append((case.name, case.title, *(cell for form in FORMS for cell in cells(seen.get(form)))))
    dates = sorted(seen["date"] for forms in record.values() for seen in forms.values())
    when = f"{dates[0]} to {dates[-1]}" if dates and dates[0] != dates[-1] else "".join(dates[:1])
    lines = [f"{when}; made by `python -m clothsim.study.stability`.", ""]
    lines += ["| " + " | ".join(line) + " |" for line in (header, ("---",) * len(header), *rows)]
    return "\n".join(lines)


def write_between(file: Path, text: str) -> None:
    """Replace what stands between the two marks of a file."""
    old = file.read_text(encoding="utf-8")
    if BEGIN not in old or END not in old:
        raise SystemExit(f"{file} has no {BEGIN} and {END}: add both lines where the table shall stand.")
    head, tail = old.split(BEGIN)[0], old.split(END)[1]
    write_atomically(file, f"{head}{BEGIN}\n{text}\n{END}{tail}".encode())
