"""DRAPE's place in a fit: the stages before the drape as they are, without DRAPE, and with it before the contours.

`python -m tests.benchmarks.drape_order [--garments casualsuit ..] [--bodies mean_all ..] [-o FILE]`. A fit whose
garment is clear of the body after its size stage never comes to either stage: all three are then the same, and it is
seeded once. FILE keeps the rows; one that is there is not computed again.
"""

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any
from unittest import mock

import numpy as np

from clothsim.base.text import text_table
from clothsim.garments.fit import pipeline
from clothsim.garments.fit.pipeline import SEEDING, FitState, Task, seed_fit
from clothsim.garments.fit.wear_check import cost_of
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.garments.stages import PlannedStage
from tests.benchmarks.fit_table import BODIES, GARMENTS, figure_named, garment_named
from tests.benchmarks.stored_tables import read_record, write_record

AS_IT_IS, WITHOUT, BEFORE = "as it is", "without", "before the contours"
FABRIC = "cotton"
HEADER = ("garment", "body", "DRAPE", "stages", "clear", "edges 1 %", "99 %", "mm apart", "CPU s")


def _orders() -> Mapping[str, tuple[PlannedStage, ...]]:
    """The stages of each variant."""
    refine = next(stage for stage in SEEDING if stage.name == "refine")
    others = tuple(stage for stage in SEEDING if stage is not refine)
    clear = next(k for k, stage in enumerate(others) if stage.name == "clear")
    first = replace(refine, needed=lambda task, state: bool(state.last.counts.body_pairs))
    return {AS_IT_IS: SEEDING, WITHOUT: others, BEFORE: (*others[:clear], first, *others[clear:])}


def seeded(garment: Garment, source: BodyMesh, target: BodyMesh, order: str) -> tuple[FitState, float]:
    """The state before the drape, and its CPU seconds."""
    started = process_time()
    with (
        tempfile.TemporaryDirectory(prefix="clothsim-order-") as folder,
        mock.patch.object(pipeline, "SEEDING", _orders()[order]),
    ):
        found = seed_fit(Task(garment, source, target, FABRIC, True, Path(folder), lambda stage: None))
    return found, process_time() - started


def rows_of(garment: Garment, source: BodyMesh, target: BodyMesh) -> list[dict[str, Any]]:
    """A row for each order; one alone where the garment comes to neither stage."""
    rows, first = [], None
    for order in _orders():
        found, seconds = seeded(garment, source, target, order)
        first = found.last.positions if first is None else first
        cost = cost_of(garment, found.last.positions)
        names = [stage.name for stage in found.stages if stage.name not in ("garment", "transfer", "size")]
        rows.append(
            {
                "order": order,
                "stages": names,
                "clear": not found.failure and found.last.counts.clean,
                "low": cost.low,
                "high": cost.high,
                "apart": float(np.sqrt(((found.last.positions - first) ** 2).sum(axis=1).mean())),
                "cpu_seconds": seconds,
            }
        )
        if not {"clear", "refine", "grow"} & set(names):
            break
    return rows


def as_text(record: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """The table for people to read."""
    cells = [
        (
            *name.split(" on "),
            row["order"] if len(rows) > 1 else "not called",
            ", ".join(row["stages"]) or "none",
            "yes" if row["clear"] else "NO",
            f"{row['low']:.2f}",
            f"{row['high']:.2f}",
            f"{1e3 * row['apart']:.1f}",
            f"{row['cpu_seconds']:.0f}",
        )
        for name, rows in record.items()
        for row in rows
    ]
    return text_table(HEADER, cells)


def main(argv: Sequence[str] | None = None) -> None:
    """Compute the rows that are missing, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.drape_order", description=__doc__)
    parser.add_argument("--garments", nargs="+", default=[*GARMENTS], choices=GARMENTS)
    parser.add_argument("--bodies", nargs="+", default=[*BODIES], choices=BODIES)
    parser.add_argument("-o", "--output", type=Path, required=True, help="a file for the rows (.json)")
    arguments = parser.parse_args(argv)
    for name in arguments.garments:
        garment, own = garment_named(name)
        source = figure_named(own)
        for body in (body for body in arguments.bodies if body != own):
            key = f"{name} on {body}"
            record = read_record(arguments.output)
            if key not in record:
                found: Any = rows_of(garment, source, figure_named(body))
                write_record(arguments.output, record | {key: found})
                print(as_text({key: found}), flush=True)
    print(as_text(read_record(arguments.output)))


if __name__ == "__main__":
    main()
