"""Stored tables: rows in a JSON file, updated a few at a time, and a table between two marks of a text."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from clothsim.base.file_writing import write_atomically

Record = dict[str, dict[str, Any]]
"""{row: what was seen of it}."""


def read_record(file: Path) -> Record:
    """The record in `file`; empty where there is none."""
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def write_record(file: Path, record: Record) -> None:
    """Replace the record in `file`."""
    write_atomically(file, (json.dumps(record, indent=1, sort_keys=True) + "\n").encode())


def when(dates: Iterable[str]) -> str:
    """The day, or the first and the last of several, of ISO dates."""
    days = sorted(set(dates))
    return f"{days[0]} to {days[-1]}" if len(days) > 1 else "".join(days)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (header, ("---",) * len(header), *rows))


def write_between(file: Path, mark: str, text: str) -> None:
    """Replace what stands between `<!-- mark -->` and `<!-- /mark -->` in a file."""
    begin, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
    old = file.read_text(encoding="utf-8")
    if begin not in old or end not in old:
        raise SystemExit(f"{file} has no {begin} and {end}: add both lines where the table shall stand.")
    head, tail = old.split(begin)[0], old.split(end)[1]
    write_atomically(file, f"{head}{begin}\n{text}\n{end}{tail}".encode())
