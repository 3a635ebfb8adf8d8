"""Sewing from jittered starts: the same pattern, each panel moved by a micrometre at random; what differs at the end.

`python -m tests.benchmarks.dress_jitter [--pattern shirt_mean] [--size 4cm] [--starts 10] [-o DIR]`.
Each start leaves DIR/SIZE_N.json; one that is there is not run again.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import clothsim
from clothsim.base.safe_files.atomic import write_atomically
from clothsim.cli.dress_command import as_length
from clothsim.garments.dress.measurements import girths
from clothsim.patterns.pattern import Pattern
from clothsim.patterns.specification import read_specification
from tests.benchmarks.dress_table import FILES
from tests.benchmarks.stored_tables import markdown_table
from tests.support.real_data import DATA
from tests.support.sewing_patterns import body_of

AMPLITUDE = 1e-6
"""Standard deviation of each coordinate of a placement [m], and of each angle [rad]."""


def jittered(pattern: Pattern, seed: int) -> Pattern:
    """Copy of a pattern whose panels are moved and turned by a seeded random amount; seed 0: none."""
    random = np.random.default_rng(seed)
    size = AMPLITUDE * (seed > 0)
    panels = {
        name: replace(
            panel,
            translation=panel.translation + size * random.standard_normal(3),
            rotation=panel.rotation + size * random.standard_normal(3),
        )
        for name, panel in pattern.panels.items()
    }
    return replace(pattern, panels=panels)


def sewn(name: str, seed: int, size: float) -> dict[str, Any]:
    """Status, seams, girths along the cloth and of the outline [m] of one start."""
    pattern = jittered(read_specification(DATA / "patterns" / FILES[name]), seed)
    started = process_time()
    with tempfile.TemporaryDirectory() as folder:
        done = clothsim.dress(pattern, DATA / "bodies" / f"{body_of(FILES[name])}.obj", folder, size=size)
    return {
        "seed": seed,
        "status": done.status,
        "reason": done.reason,
        "seams": len(done.state.mesh.seams),
        "welded": len(done.state.welded),
        "stretch": list(done.stretch),
        "girths": {
            f"{girth.name}{kind}": value
            for girth in girths(done.state, done.body)
            for kind, value in (("", girth.garment), (", outline", girth.outline))
        },
        "cpu_seconds": process_time() - started,
    }


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows and, below, the range of each girth [mm] as Markdown."""
    names = list(rows[0]["girths"])
    header = ("start", "status", "seams welded", "stretch, 1 / 99 %", *(f"{name} [cm]" for name in names), "CPU s")
    lines = [
        (
            str(row["seed"]),
            row["status"],
            f"{row['welded']} of {row['seams']}",
            " / ".join(f"{value:.2f}" for value in row["stretch"]),
            *(f"{100 * row['girths'].get(name, np.nan):.2f}" for name in names),
            f"{row['cpu_seconds']:.0f}",
        )
        for row in rows
    ]
    ranges = [f"{1e3 * np.ptp([row['girths'].get(name, np.nan) for row in rows]):.1f} mm" for name in names]
    return markdown_table(header, [*lines, ("range", "", "", "", *ranges, "")])


def main(argv: Sequence[str] | None = None) -> int:
    """Run the starts that are missing and print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.dress_jitter", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--pattern", default="shirt_mean", choices=[*FILES])
    parser.add_argument("--size", default="4cm", metavar="L")
    parser.add_argument("--starts", type=int, default=10, metavar="N")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/dress_jitter"), metavar="DIR")
    arguments = parser.parse_args(argv)
    arguments.output.mkdir(parents=True, exist_ok=True)
    rows = []
    for seed in range(1, arguments.starts + 1):
        file = arguments.output / f"{arguments.pattern}_{arguments.size}_{seed}.json"
        if not file.is_file():
            row = sewn(arguments.pattern, seed, as_length("--size", arguments.size))
            write_atomically(file, (json.dumps(row, indent=1) + "\n").encode())
        rows.append(json.loads(file.read_text(encoding="utf-8")))
        print(f"{seed}: {rows[-1]['status']}, {rows[-1]['reason']}", file=sys.stderr, flush=True)
    print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
