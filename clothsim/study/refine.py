"""What DRAPE refinement alone repairs: `python -m clothsim.study.refine [--body FILE] [--depths 10,30,60,100]`.

The garment is the torso of a body, 5 mm outside it; the body is then inflated along its vertex normals, so that all of
the garment is inside. Judged by the exact test. A fit goes on from here by the guaranteed path.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.errors import ClothsimError, InputError
from clothsim.fitting.cost import Cost, cost_of
from clothsim.fitting.counts import Counts, counted
from clothsim.fitting.stage import Garment
from clothsim.io.meshes import read_mesh
from clothsim.mesh.shapes import capsule
from clothsim.study.text_table import text_table
from transfer.distance import BodySurface, body_surface
from transfer.refine import refine

CLEARANCE = 5e-3
"""How far outside the body the garment starts [m]."""
HEIGHTS, REACH = (0.47, 0.80), 0.115
"""The torso of a standing body: shares of its height from below, and how far from its axis."""
METHODS: Mapping[str, Mapping[str, Any]] = {
    "vertices, 3 passes": {"samples": False, "passes": 3},
    "vertices": {"samples": False},
    "edges and triangles too": {},
}


@dataclass(frozen=True)
class Row:
    """One refinement: how far the body was inflated [m], what was left, what it cost, passes and seconds."""

    depth: float
    method: str
    left: Counts
    cost: Cost
    passes: int
    seconds: float


def torso(body: BodySurface) -> Garment:
    """The triangles of the body round its middle, up to REACH from its axis, CLEARANCE outside it."""
    x = body.positions
    low, size = x.min(axis=0), np.ptp(x, axis=0)
    up = int(np.argmax(size))
    middles = x[body.triangles].mean(axis=1)
    height = (middles[:, up] - low[up]) / size[up]
    aside = np.delete(np.abs(middles - np.median(x, axis=0)), up, axis=1).max(axis=1) / size[up]
    kept = body.triangles[(height > HEIGHTS[0]) & (height < HEIGHTS[1]) & (aside < REACH)]
    if not len(kept):
        raise InputError("The body has no torso: nothing round its axis at mid height.", "Give a standing body.")
    used, triangles = np.unique(kept, return_inverse=True)
    positions = (x + CLEARANCE * body.vertex_normals)[used]
    return Garment("torso", positions, triangles.reshape(-1, 3).astype(np.int64))


def measure(positions: Floats, triangles: Ints, depths: Sequence[float]) -> list[Row]:
    """Refine the torso of the body (n, 3) [m], (m, 3) against the body inflated by each of `depths` [m]."""
    body = body_surface(positions, triangles)
    garment = torso(body)
    rows = []
    for depth in depths:
        inflated = body_surface(body.positions + depth * body.vertex_normals, body.triangles)
        start = counted(garment.positions, garment.triangles, inflated)
        rows.append(Row(depth, "before", start, cost_of(garment, garment.positions), 0, 0.0))
        for method, settings in METHODS.items():
            started = perf_counter()
            refined = refine(garment.positions, garment.triangles, inflated.positions, inflated.triangles, **settings)
            seconds = perf_counter() - started
            left = counted(refined.positions, garment.triangles, inflated)
            rows.append(Row(depth, method, left, cost_of(garment, refined.positions), refined.passes, seconds))
    return rows


def as_text(rows: Sequence[Row]) -> str:
    """The table for people to read."""
    header = ("mm", "method", "inside", "mm deep", "with body", "with itself", "1 %", "99 %", "passes", "seconds")
    cells = [
        [
            f"{1e3 * row.depth:g}",
            row.method,
            f"{row.left.penetrating_vertices:,}",
            f"{1e3 * row.left.depth:.1f}",
            f"{row.left.body_pairs:,}",
            f"{row.left.self_pairs:,}",
            f"{row.cost.low:.3f}",
            f"{row.cost.high:.3f}",
            str(row.passes),
            f"{row.seconds:.2f}",
        ]
        for row in rows
    ]
    return text_table(header, cells)


def main(argv: Sequence[str] | None = None) -> int:
    """Read the arguments, measure, print the table."""
    parser = argparse.ArgumentParser(prog="python -m clothsim.study.refine", description=__doc__)
    parser.add_argument("--body", type=Path, metavar="FILE", help="a standing body in metres (default: a capsule)")
    parser.add_argument("--depths", default="10,30,60,100", metavar="MM,MM", help="how far it is inflated [mm]")
    arguments = parser.parse_args(argv)
    try:
        depths = [1e-3 * float(text) for text in arguments.depths.split(",")]
    except ValueError:
        parser.error(f"--depths is {arguments.depths!r}: give numbers in mm, such as 10,30.")
    try:
        if arguments.body is None:
            positions, triangles = capsule(radius=0.1, height=1.2, segments=48)
        else:
            mesh = read_mesh(arguments.body)
            positions, triangles = mesh.positions, mesh.triangles
        print(as_text(measure(positions, triangles, depths)))
    except (ClothsimError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
