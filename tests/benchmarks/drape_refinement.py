"""Repairs by DRAPE refinement alone.

`python -m tests.benchmarks.drape_refinement [--body FILE] [--depths 10,30] [--chain]`.

The garment is the torso of a body, 5 mm outside it; the body is then inflated along its vertex normals, so that all of
the garment is inside. Checked by the exact test. --chain adds what a fit makes of it before its drape: DRAPE and, where
that does not free the garment, the guaranteed path, which takes minutes on a body of thousands of vertices.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.text import text_table
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.garments.fit.pipeline import Task, seed_fit
from clothsim.garments.fit.wear_check import Distortion, cost_of
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.garments.penetration import Counts, count_penetrations
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.generators.shapes import capsule
from clothsim.mesh.topology import components
from clothsim.mesh.winding import bow_tie_vertices, joined_half_edges
from transfer.refine import refine
from transfer.signed_distance import BodySurface, body_surface

CLEARANCE = 5e-3
"""Initial distance of the garment from the body [m]."""
HEIGHTS, REACH = (0.47, 0.80), 0.115
"""The torso of a standing body: fractions of its height from below, and how far from its axis."""
METHODS: Mapping[str, Mapping[str, Any]] = {
    "vertices, 3 passes": {"samples": False, "passes": 3},
    "vertices": {"samples": False},
    "edges and triangles too": {},
}


CHAIN = "the whole chain"
FABRIC = "cotton"
"""Fabric of the garment of the whole chain."""


@dataclass(frozen=True)
class Row:
    """One refinement: how far the body was inflated [m], what was left, what it cost, passes and seconds.

    said: of the whole chain its stages, or why it failed.
    """

    depth: float
    method: str
    left: Counts
    cost: Distortion
    passes: int
    seconds: float
    said: str = ""


def torso(body: BodySurface) -> Garment:
    """The triangles of the body round its middle, up to REACH from its axis, CLEARANCE outside it, clear of both."""
    x = body.positions
    low, size = x.min(axis=0), np.ptp(x, axis=0)
    up = int(np.argmax(size))
    middles = x[body.triangles].mean(axis=1)
    height = (middles[:, up] - low[up]) / size[up]
    aside = np.delete(np.abs(middles - np.median(x, axis=0)), up, axis=1).max(axis=1) / size[up]
    kept = body.triangles[(height > HEIGHTS[0]) & (height < HEIGHTS[1]) & (aside < REACH)]
    if not len(kept):
        raise InputError("The body has no torso: nothing round its axis at mid height.", "Give a standing body.")
    garment = _used(x + CLEARANCE * body.vertex_normals, kept)
    return _without_faults(garment, body)


def _without_faults(garment: Garment, body: BodySurface) -> Garment:
    """The largest piece of what is clear of the body and of itself: an armpit has no room for cloth on both sides."""
    x, triangles = garment.positions, garment.triangles
    both = np.concatenate([x, body.positions])
    for _ in range(len(triangles)):
        with_body = intersecting_pairs(both, triangles, body.triangles + len(x))[:, 0]
        meeting = triangles[np.concatenate([intersecting_pairs(x, triangles).ravel(), with_body])]
        pinched = bow_tie_vertices(triangles, joined_half_edges(triangles), len(x))
        inside = np.flatnonzero(body.closest(x).inside)
        bad = np.isin(triangles, np.concatenate([meeting.ravel(), pinched, inside])).any(axis=1)
        if not bad.any():
            break
        triangles = triangles[~bad]
    piece = components(triangles, len(x))[triangles[:, 0]]
    return _used(x, triangles[piece == np.bincount(piece).argmax()])


def _used(positions: Floats, triangles: Ints) -> Garment:
    used, renumbered = np.unique(triangles, return_inverse=True)
    return Garment("torso", positions[used], renumbered.reshape(-1, 3).astype(np.int64))


def measure(
    positions: Floats,
    triangles: Ints,
    depths: Sequence[float],
    chain: bool = False,
    announce: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """Refine the torso of the body (n, 3) [m], (m, 3) against the body inflated by each of `depths` [m].

    chain: a row for the whole chain too; announce: called with that row as it ends.
    """
    body = body_surface(positions, triangles)
    garment = torso(body)
    rows = []
    for depth in depths:
        inflated = body_surface(body.positions + depth * body.vertex_normals, body.triangles)
        start = count_penetrations(garment.positions, garment.triangles, inflated)
        rows.append(Row(depth, "before", start, cost_of(garment, garment.positions), 0, 0.0))
        for method, settings in METHODS.items():
            started = perf_counter()
            refined = refine(garment.positions, garment.triangles, inflated.positions, inflated.triangles, **settings)
            seconds = perf_counter() - started
            left = count_penetrations(refined.positions, garment.triangles, inflated)
            rows.append(Row(depth, method, left, cost_of(garment, refined.positions), refined.passes, seconds))
        if chain:
            rows.append(chained(garment, inflated, depth))
            announce(rows[-1])
    return rows


def chained(garment: Garment, body: BodySurface, depth: float) -> Row:
    """Result of the stages of a fit before its drape, for the body inflated by `depth` [m]."""
    figure = BodyMesh(f"the body {1e3 * depth:g} mm wider", body.positions, body.triangles, 1.0, ())
    started = perf_counter()
    with tempfile.TemporaryDirectory(prefix="clothsim-study-") as folder:
        found = seed_fit(Task(garment, figure, figure, FABRIC, False, Path(folder), lambda stage: None))
    seconds = perf_counter() - started
    stages = ", ".join(f"{stage.name} {stage.seconds:.1f} s" for stage in found.stages)
    said = f"{stages}{f'; failed: {found.failure}' if found.failure else ''}"
    cost = cost_of(garment, found.last.positions)
    return Row(depth, CHAIN, found.last.counts, cost, 0, seconds, said)


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


def _say(row: Row) -> None:
    """Each stage of a chain takes minutes: its result is printed at once."""
    print(f"{1e3 * row.depth:g} mm, {row.method}: {row.left}; {row.said}", file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None) -> int:
    """Read the arguments, measure, print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.drape_refinement", description=__doc__)
    parser.add_argument("--body", type=Path, metavar="FILE", help="a standing body in metres (default: a capsule)")
    parser.add_argument("--depths", default="10,30,60,100", metavar="MM,MM", help="how far it is inflated [mm]")
    parser.add_argument("--chain", action="store_true", help="the whole chain of a fit too, without its drape")
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
        print(as_text(measure(positions, triangles, depths, arguments.chain, _say)))
    except (ClothsimError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
