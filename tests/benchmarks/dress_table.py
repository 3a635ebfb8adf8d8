"""Table of sewn garments: each shared pattern dressed on its body, with seams, strains, ease, CPU seconds and pictures.

`python -m tests.benchmarks.dress_table [--size 2cm] [--only r000 shirt_mean ...] [--on BODY] [-o DIR] [--page FILE]`.
Each pattern runs in a process of its own and leaves DIR/NAME.json; one that is there is not run again, unless --redo.
DIR/table.md and DIR/sheet.png show all that are there. --page replaces what is between the marks of a page, those of
the 25 patterns or, in a folder of random designs alone (--draw), those of these. --on grades each to a second body.
--stored FILE adds the rows to those of earlier sweeps; the page then lists what is not completed and welded throughout.
"""

import argparse
import json
import os
import random
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

import clothsim
from clothsim.base.errors import ClothsimError
from clothsim.base.file_writing import write_atomically
from clothsim.cli.garment_command import as_length
from clothsim.garments.dressed import Dress
from clothsim.garments.pictures import WORN, draw_dress
from clothsim.patterns.pattern_mesh import largest_gap
from tests.benchmarks.stored_tables import markdown_table, write_between
from tests.support.real_data import DATA
from tests.support.sewing_patterns import PATTERN_FILES, body_of

HEADER = (
    "pattern",
    "body",
    "status",
    "seams welded",
    "widest gap [mm]",
    "vertices",
    "stretch: percentiles 1 / 50 / 99",
    "ease of chest, waist, hip, hem [cm]",
    "CPU s",
)
GIRTHS = ("chest", "waist", "hip", "hem")
TILE = (340, 255)
"""Largest picture of one garment on the sheet [pixels]."""
CAPTION = 16
COLUMNS = 5
PASSING = ("notes", "stages", "counts")
"""Entries of a row that are not stored for later sweeps."""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def short_name(file: str) -> str:
    """Name of a pattern file in the table: "r004", "shirt_mean"."""
    return Path(file).stem.removesuffix("_specification")


FILES = {short_name(file): file for file in PATTERN_FILES}
DESIGNS = {f"d{number:03}": f"random160/r{number:03}.json" for number in range(160)}
"""Random designs that nothing was tuned on, by name in the table; each names the body that it was drawn for."""
BODIES = ("mean_all", "mean_all_tpose", "mean_female", "f_smpl_average_A40")


def drawn(seed: int, count: int) -> list[str]:
    """Names of `count` random designs in the order of their draw by a seed: a run cut short leaves a sample."""
    return random.Random(seed).sample([*DESIGNS], count)


def file_and_body(name: str) -> tuple[str, str]:
    """File of a pattern, and the shared body that it was made for: with the legs apart it is the one without."""
    if name in FILES:
        return FILES[name], body_of(FILES[name])
    made_for = json.loads((DATA / "patterns" / DESIGNS[name]).read_text(encoding="utf-8"))["made_for"]
    return DESIGNS[name], str(made_for).removesuffix("_apart")


def measured(name: str, size: float, folder: Path, budget: float, second: str = "") -> dict[str, Any]:
    """Dress one pattern in `folder` and return its row; "refused" where the input is refused.

    budget: CPU seconds; second: another body, to which the pattern is graded from its own.
    """
    file, own = file_and_body(name)
    row: dict[str, Any] = {"pattern": name, "body": second or own, "size": size}
    bodies = DATA / "bodies"
    graded = {"made_for": bodies / f"{own}.obj"} if second else {}
    started = process_time()
    try:
        on = bodies / f"{row['body']}.obj"
        done = clothsim.dress(DATA / "patterns" / file, on, folder, size=size, overwrite=True, budget=budget, **graded)
    except ClothsimError as error:
        return {**row, "status": "refused", "reason": str(error), "cpu_seconds": process_time() - started}
    row |= {"cpu_seconds": process_time() - started, **garment_entries(done)}
    draw_dress(done)
    return row


def garment_entries(done: Dress) -> dict[str, Any]:
    """Seams, strains and ease of a dressed garment."""
    state = done.state
    positions = state.positions[state.number]
    gaps = {seam.name: largest_gap(positions, seam) for seam in state.mesh.seams}
    worst = max(gaps, key=lambda seam: gaps[seam], default="")
    measurements = json.loads((done.directory / "summary.json").read_text(encoding="utf-8"))["measurements"]
    return {
        "status": done.status,
        "reason": done.reason,
        "notes": list(done.notes),
        "seams": len(gaps),
        "welded": len(state.welded),
        "worst_gap": gaps.get(worst, 0.0),
        "worst_seam": worst,
        "vertices": len(state.positions),
        "stretch": np.percentile(state.stretches(), (1, 50, 99)).tolist(),
        "ease": {girth["name"]: girth["ease"] for girth in measurements["girths"] if girth["garment"] > 0},
        "counts": str(done.counts),
        "stages": {stage.name: stage.seconds for stage in done.stages},
    }


def run_one(name: str, size: str, output: Path, limit: int, second: str = "") -> dict[str, Any]:
    """Row of one pattern, made by a process that has a budget of `limit` CPU seconds; stored.

    The process is killed at twice that: a step, a weld or the pictures may come after it.
    """
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "tests.benchmarks.dress_table", "--one", name, "--size", size, "-o", str(output)]
    command += ["--limit", str(limit), *(["--on", second] if second else [])]
    limited = ["bash", "-c", f'ulimit -t {2 * limit}; exec "$@"', "bash", *command]
    with (folder / "log.txt").open("w", encoding="utf-8") as log:
        code = subprocess.run(limited, env={**os.environ, **ONE_THREAD}, stdout=log, stderr=log, check=False).returncode
    if code:
        last = (folder / "log.txt").read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1:]
        reason = ": ".join([f"The process ended with exit code {code} (limit {limit} CPU s)", *last])
        row = {
            "pattern": name,
            "body": second or file_and_body(name)[1],
            "size": as_length("--size", size),
            "status": "stopped",
        }
        store(output, {**row, "reason": reason})
    return read_row(output, name)


def store(output: Path, row: Mapping[str, Any]) -> None:
    """Write the row of a pattern."""
    write_atomically(output / f"{row['pattern']}.json", (json.dumps(row, indent=1) + "\n").encode())


def read_row(output: Path, name: str) -> dict[str, Any]:
    """Row of a pattern; empty where it was not run."""
    file = output / f"{name}.json"
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def closed(row: Mapping[str, Any]) -> bool:
    """True where a garment is at rest with every seam welded."""
    return bool(row["status"] == "completed" and row["welded"] == row["seams"])


def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Line of the table."""
    head = (row["pattern"], row["body"])
    seconds = f"{row['cpu_seconds']:.0f}" if "cpu_seconds" in row else ""
    if "stretch" not in row:
        return (*head, f"{row['status']}: {row['reason']}", *[""] * (len(HEADER) - 4), seconds)
    said = row["status"] if row["status"] == "completed" else f"{row['status']}: {row['reason']}"
    return (
        *head,
        said,
        f"{row['welded']} of {row['seams']}",
        f"{1e3 * row['worst_gap']:{'.0f' if row['worst_gap'] > 0.01 else '.2g'}}",
        f"{row['vertices']:,}",
        " / ".join(f"{value:.2f}" for value in row["stretch"]),
        ", ".join(f"{100 * row['ease'][name]:.0f}" if name in row["ease"] else "-" for name in GIRTHS),
        seconds,
    )


def summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line on all rows: how many are completed with every seam welded, median and 95th percentile of CPU time."""
    seconds = [row["cpu_seconds"] for row in rows if "cpu_seconds" in row]
    median, high = np.percentile(seconds, (50, 95)) if seconds else (np.nan, np.nan)
    size = ", ".join(sorted({f"{100 * row['size']:g} cm" for row in rows}))
    return (
        f"{sum(map(closed, rows))} of {len(rows)} completed with every seam welded, at a mesh size of {size}. "
        f"CPU time: median {median:.0f} s, 95th percentile {high:.0f} s."
    )


def contact_sheet(rows: Sequence[Mapping[str, Any]], output: Path) -> Path:
    """Worn garments side by side with their names and status: sheet.png."""
    lines = -(-len(rows) // COLUMNS)
    height = TILE[1] + CAPTION
    sheet = Image.new("RGB", (COLUMNS * TILE[0], lines * height), "white")
    pen = ImageDraw.Draw(sheet)
    for number, row in enumerate(rows):
        left, top = TILE[0] * (number % COLUMNS), height * (number // COLUMNS)
        pen.text((left + 4, top + 2), f"{row['pattern']}: {row['status']}", fill="black")
        picture = output / row["pattern"] / WORN
        if picture.is_file():
            with Image.open(picture) as image:
                image.thumbnail(TILE)
                sheet.paste(image, (left + (TILE[0] - image.width) // 2, top + CAPTION))
    file = output / "sheet.png"
    sheet.save(file, optimize=True)
    return file


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is missing and write the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.dress_table", description=__doc__.splitlines()[0])
    parser.add_argument("--size", default="2cm", metavar="L")
    known = [*FILES, *DESIGNS]
    parser.add_argument("--only", nargs="+", choices=known, metavar="NAME", help="default: the 25 patterns")
    parser.add_argument("--draw", nargs=2, type=int, metavar=("SEED", "COUNT"), help="random designs in their place")
    parser.add_argument("--on", choices=BODIES, default="", metavar="BODY", help="a second body, graded to")
    parser.add_argument("-o", "--output", type=Path, default=Path("results/dress_table"), metavar="DIR")
    parser.add_argument(
        "--limit", type=int, default=1800, metavar="S", help="CPU seconds of one pattern (default 1800)"
    )
    parser.add_argument("--redo", action="store_true", help="run those again that are there")
    parser.add_argument("--stored", type=Path, metavar="FILE", help="rows of earlier sweeps (JSON): not run again")
    parser.add_argument("--page", type=Path, metavar="FILE", help="replace the table of this page")
    parser.add_argument("--one", choices=known, help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    output, size = arguments.output, as_length("--size", arguments.size)
    if arguments.one:
        store(output, measured(arguments.one, size, output / arguments.one, arguments.limit, arguments.on))
        return 0
    output.mkdir(parents=True, exist_ok=True)
    stored: dict[str, dict[str, Any]] = {}
    if arguments.stored is not None and arguments.stored.is_file():
        stored = {row["pattern"]: row for row in json.loads(arguments.stored.read_text(encoding="utf-8"))}
    for name in arguments.only or (drawn(*arguments.draw) if arguments.draw else FILES):
        row = read_row(output, name) or stored.get(name, {})
        if arguments.redo or row.get("size") != size:
            row = run_one(name, arguments.size, output, arguments.limit, arguments.on)
        print(" | ".join(cells(row)), flush=True)
    rows = [row for row in (read_row(output, name) or stored.get(name) for name in known) if row]
    if arguments.stored is not None:
        lasting = [{key: value for key, value in row.items() if key not in PASSING} for row in rows]
        lines = ",\n ".join(json.dumps(row) for row in lasting)
        write_atomically(arguments.stored, f"[{lines}]\n".encode())
    shown = [row for row in rows if not closed(row)] if arguments.stored is not None else rows
    text = "\n\n".join([markdown_table(HEADER, map(cells, shown)), summary(rows)])
    write_atomically(output / "table.md", (text + "\n").encode())
    print(f"{summary(rows)}\n{output / 'table.md'}, {contact_sheet(rows, output)}")
    if arguments.page is not None:
        random_designs = all(row["pattern"] in DESIGNS for row in rows)
        mark = "dress_designs" if random_designs else "dress_table"
        write_between(arguments.page, f"{mark}_stored" if arguments.stored is not None else mark, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
