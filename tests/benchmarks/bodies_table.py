"""Table of fits on twelve bodies: real ones, a character, the mannequin in shapes and poses, a figure in pieces.

`python -m tests.benchmarks.bodies_table [--garments shirt ..] [--bodies mean_all ..] -o DIR [--docs]`: a line of JSON
for each fit in DIR/rows.jsonl, where a row that is there is not computed again, front and back of each, and a contact
sheet for each garment; `--docs` writes the table into docs/results/fit.md.
"""

import argparse
import datetime
import json
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import clothsim
from clothsim.mesh.generators.table import GENERATORS
from tests.benchmarks.fit_table import DATA, DOCS, FILES, LARGE, draw
from tests.benchmarks.stored_tables import markdown_table, when, write_between
from tests.support.pieced_figures import figure

EDGE = 0.028
"""Edges of the garments [m]."""
SHAPES = {
    "mannequin_large": LARGE,
    "mannequin_slim": {"height": 1.74, "chest": 0.92, "waist": 0.88, "hips": 0.94},
    "mannequin_short": {"height": 1.55, "chest": 1.08, "waist": 1.18, "hips": 1.1},
    "mannequin_t": {"pose": "t"},
    "mannequin_walk": {"pose": "walk"},
}
IN_FILES = {
    **{name: DATA / "bodies" / f"{name}.obj" for name in FILES},
    "makehuman": DATA / "bodies" / "makehuman_hm08_base.obj",
    "CesiumMan": DATA / "characters" / "CesiumMan.glb",
}
BODIES = (*IN_FILES, *SHAPES, "pieces")
SEED = 7
"""Of the figure in pieces."""
FLARE, LENGTH, ROWS = 0.5, 0.36, 13
"""Skirt of the dress: widening of its hem over that of the shirt, its length [m], its rows."""
HEADER = (
    *("garment", "body", "status", "edge ratios: percentiles 1 to 99", "hem shift [%]", "intersecting pairs"),
    *("stages", "parts too tight", "CPU s"),
)


def dress() -> tuple[np.ndarray, np.ndarray]:
    """The shirt of the mannequin with a flared skirt to the knee: positions (n, 3) [m] and triangles (m, 3)."""
    positions, triangles = GENERATORS["shirt"](edge=EDGE)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, inverse, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    following = dict(directed[count[inverse.ravel()] == 1].tolist())
    first = min(following, key=lambda row: positions[row, 2])
    ring = [first]
    while following[ring[-1]] != first:
        ring.append(following[ring[-1]])
    hem = positions[ring]
    centre = hem.mean(axis=0)
    down = np.linspace(0, 1, ROWS + 1)[1:, None, None]
    rows = centre + (hem - centre) * np.array([1, 1, 0]) * (1 + FLARE * down)
    rows = rows + np.array([0, 0, 1]) * ((hem - centre)[:, 2:] - LENGTH * down)
    numbers = np.concatenate([[ring], len(positions) + np.arange(ROWS * len(ring)).reshape(ROWS, -1)])
    a, b = numbers[:-1], np.roll(numbers, -1, axis=1)[:-1]
    c, d = numbers[1:], np.roll(numbers, -1, axis=1)[1:]
    skirt = np.concatenate([np.stack([b, a, c], axis=-1).reshape(-1, 3), np.stack([b, c, d], axis=-1).reshape(-1, 3)])
    return np.concatenate([positions, rows.reshape(-1, 3)]), np.concatenate([triangles, skirt])


GARMENTS = {
    "shirt": lambda: GENERATORS["shirt"](edge=EDGE),
    "trousers": lambda: GENERATORS["trousers"](edge=EDGE),
    "dress": dress,
}


def body_named(name: str) -> Path | clothsim.Body:
    """The file of a body, or the body."""
    if name in IN_FILES:
        return IN_FILES[name]
    mesh = figure(SEED)[:2] if name == "pieces" else GENERATORS["mannequin"](**SHAPES[name])
    return clothsim.Body(*mesh, name=name)


def fitted(garment: str, body: str, picture: Path) -> dict[str, Any]:
    """Measures of a fit; its picture."""
    started = process_time()
    own = clothsim.Body(*GENERATORS["mannequin"]())
    with tempfile.TemporaryDirectory() as folder:
        fit = clothsim.fit(clothsim.Cloth(*GARMENTS[garment](), name=garment), body_named(body), own, folder)
        seconds = process_time() - started
    draw(picture, fit.garment, fit.positions, fit.target)
    return {
        "garment": garment,
        "body": body,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "status": fit.status,
        "reason": fit.reason,
        "look": fit.look.as_dict(),
        "pairs": fit.counts.body_pairs + fit.counts.self_pairs,
        "vertices": len(fit.positions),
        "stages": [stage.name for stage in fit.stages],
        "tight": {name: each.stretch for name, each in fit.tight.items()},
        "cpu_seconds": seconds,
    }


def line(row: dict[str, Any]) -> tuple[str, ...]:
    """Cells of a row."""
    look = row["look"]
    return (
        row["garment"],
        row["body"],
        row["status"],
        f"{look['edge_low']:.2f} to {look['edge_high']:.2f}",
        f"{100 * look['hem']:+.1f}",
        str(row["pairs"]),
        ", ".join(name for name in row["stages"] if name not in ("garment", "transfer", "size")),
        ", ".join(f"{name} {stretch:.2f}" for name, stretch in row["tight"].items()),
        f"{row['cpu_seconds']:.0f}",
    )


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in the order of garments and bodies, and their sums."""
    order = sorted(rows, key=lambda row: ([*GARMENTS].index(row["garment"]), BODIES.index(row["body"])))
    worn = sum(row["status"] == "completed" for row in rows)
    seconds = np.array([row["cpu_seconds"] for row in rows])
    sums = (
        f"{worn} of {len(rows)} completed. CPU time: median {np.median(seconds):.0f} s, largest {seconds.max():.0f} s"
    )
    return f"{markdown_table(HEADER, map(line, order))}\n\n{sums} (measured {when(row['date'] for row in rows)})."


def contact_sheet(folder: Path, garment: str) -> None:
    """All pictures of a garment in one, four a row."""
    from PIL import Image

    files = [file for body in BODIES if (file := folder / f"{garment}_{body}.png").is_file()]
    pictures = [Image.open(file).convert("RGB").resize((480, 374)) for file in files]
    sheet = Image.new("RGB", (4 * 480, -(-len(pictures) // 4) * 374), "white")
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (480 * (number % 4), 374 * (number // 4)))
    sheet.save(folder / f"{garment}.png")


def main() -> None:
    """Compute the rows that are missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--garments", nargs="+", default=[*GARMENTS], choices=GARMENTS)
    parser.add_argument("--bodies", nargs="+", default=[*BODIES], choices=BODIES)
    parser.add_argument("--docs", action="store_true", help="write the table into docs/results/fit.md")
    parser.add_argument("-o", "--output", type=Path, required=True, help="directory for rows and pictures")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    file = arguments.output / "rows.jsonl"
    rows = [json.loads(text) for text in file.read_text().splitlines()] if file.is_file() else []
    for body in arguments.bodies:
        for garment in arguments.garments:
            if any((row["garment"], row["body"]) == (garment, body) for row in rows):
                continue
            rows.append(fitted(garment, body, arguments.output / f"{garment}_{body}.png"))
            with file.open("a") as out:
                out.write(json.dumps(rows[-1]) + "\n")
            print(" | ".join(line(rows[-1])), flush=True)
    for garment in arguments.garments:
        contact_sheet(arguments.output, garment)
    text = table(rows)
    if arguments.docs:
        write_between(DOCS, "bodies table", text)
    print(text)


if __name__ == "__main__":
    main()
