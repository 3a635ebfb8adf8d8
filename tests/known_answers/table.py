"""All rows in the order of docs/results/validation.md, and their results as text, JSON and Markdown."""

from collections.abc import Iterable, Sequence
from datetime import date
from typing import Any

from tests.benchmarks.stored_tables import Record, markdown_table, when
from tests.known_answers import (
    a1_membrane,
    a2_catenary,
    a3_bending,
    a4_time,
    a5_contact,
    a6_inflation,
    a7_drape,
    a8_wrinkles,
    a9_plates,
    a10_rigid,
    a11_strips,
    a12_sheets,
    a13_rigid_scenes,
    a14_rods,
    a15_bending_scenes,
    a16_curled_strip,
)
from tests.known_answers.row import Outcome, Row, Seen

ROWS: tuple[Row, ...] = (
    *a1_membrane.ROWS,
    *a2_catenary.ROWS,
    *a3_bending.ROWS,
    *a4_time.ROWS,
    *a5_contact.ROWS,
    *a6_inflation.ROWS,
    *a7_drape.ROWS,
    *a8_wrinkles.ROWS,
    *a9_plates.ROWS,
    *a10_rigid.ROWS,
    *a11_strips.ROWS,
    *a12_sheets.ROWS,
    *a13_rigid_scenes.ROWS,
    *a14_rods.ROWS,
    *a15_bending_scenes.ROWS,
    *a16_curled_strip.ROWS,
)

HEADER = (
    "row",
    "quantity",
    "simulated",
    "exact",
    "error",
    "error, coarser meshes",
    "bound",
    "order",
    "error with hinges",
    "CPU s",
    "passed",
)


def chosen(names: Iterable[str], rows: Sequence[Row] = ROWS) -> list[Row]:
    """The rows called so: A1a itself, or all of A1."""
    wanted = list(names)
    return [
        row
        for row in rows
        if not wanted or row.name in wanted or row.name.rstrip("abcdefghijklmnopqrstuvwxyz") in wanted
    ]


def entry(seen: Seen) -> dict[str, Any]:
    """Record entry of a row."""
    kept: dict[str, Any] = {"date": date.today().isoformat(), "seconds": seen.seconds, "wrong": seen.wrong}
    outcome = seen.outcome
    if outcome is not None:
        kept |= {"value": outcome.value, "exact": outcome.exact, "deviation": outcome.deviation, "bar": outcome.bar}
        kept |= {"unit": outcome.unit, "order": outcome.order, "orders": asked(outcome)}
        kept["hinges"] = outcome.deviation_of_hinges
        kept["coarser"] = list(outcome.coarser)
    return kept


def cells(row: Row, kept: dict[str, Any]) -> tuple[str, ...]:
    """The cells of HEADER."""
    passed = f"no: {row.why or kept['wrong']}" if kept["wrong"] else "yes"
    seconds = f"{kept['seconds']:.1f}"
    if "value" not in kept:
        return (row.name, row.what, *[""] * 7, seconds, passed)
    unit, order, hinges = kept["unit"], kept["order"], kept.get("hinges")
    return (
        row.name,
        row.what,
        f"{kept['value']:.8g}",
        f"{kept['exact']:.8g}",
        off(kept["deviation"], unit),
        ", ".join(off(each, unit) for each in kept.get("coarser", ())),
        off(kept["bar"], unit),
        "" if order is None else f"{order:.2f} ({kept['orders']})",
        "" if hinges is None else off(hinges, unit),
        seconds,
        passed,
    )


def asked(outcome: Outcome) -> str:
    """The orders that pass, in words."""
    low, high = outcome.orders
    if low < 0:
        return "no bound"
    return f">= {low:g}" if high > 2.5 else f"{low:g} to {high:g}"


def off(deviation: float, unit: str) -> str:
    """A deviation with its unit; a fraction in percent."""
    return f"{deviation:.2g} {unit}" if unit else f"{100 * deviation:.2g} %"


def markdown(rows: Iterable[Row], record: Record) -> str:
    """The rows of a record in Markdown, dated, with how many pass."""
    there = [row for row in rows if row.name in record]
    passed = sum(not record[row.name]["wrong"] for row in there)
    seconds = sum(record[row.name]["seconds"] for row in there)
    days = when(record[row.name]["date"] for row in there)
    head = (
        f"Measured {days} with `python -m tests.known_answers`: {passed} of {len(there)} pass, in {seconds:.0f} CPU s."
    )
    return f"{head}\n\n{markdown_table(HEADER, [cells(row, record[row.name]) for row in there])}"
