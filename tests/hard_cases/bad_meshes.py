"""Invalid meshes, refused before the first step with the face, vertex or line named."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case


def flat(points: Sequence[Sequence[float]]) -> Floats:
    """Points (n, 2) of the plane z = 0, as (n, 3)."""
    return np.column_stack([np.asarray(points, np.float64), np.zeros(len(points))])


SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
HALVES = ((0, 1, 2), (0, 2, 3))
OFF_POINTS = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 {bad} 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
OFF_FACES = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 {bad}\n"

KINDS: dict[str, tuple[str, tuple[str, ...]]] = {
    "coincident vertices": (
        obj_text(
            flat([*SQUARE, (2, 0), (2, 1), (0.5, 0.5), (0.5, 0.5)]),
            [(0, 1, 6), (1, 2, 6), (2, 3, 6), (3, 0, 6), (1, 4, 7), (4, 5, 7), (5, 2, 7), (2, 1, 7)],
        ),
        ("coincident inside the surface", "vertices 6 and 7"),
    ),
    "collinear triangle": (
        obj_text(flat([*SQUARE, (0.5, 0.5)]), [(0, 1, 2), (0, 4, 3), (4, 2, 3), (0, 2, 4)]),
        ("no area", "triangle 3"),
    ),
    "duplicate triangle": (obj_text(flat(SQUARE), [*HALVES, (1, 2, 0)]), ("given twice", "triangle 2")),
    "duplicate triangle, reversed": (
        obj_text(flat(SQUARE), [*HALVES, (2, 1, 0)]),
        ("given twice with opposite winding", "triangle 2"),
    ),
    "repeated corner": (obj_text(flat(SQUARE), [*HALVES, (1, 2, 2)]), ("same vertex twice", "triangle 2")),
    "negative index": (OFF_FACES.format(bad=-3), ("face 1", "vertex -3")),
    "index out of range": (OFF_FACES.format(bad=4), ("face 1", "vertex 4")),
    "NaN": (OFF_POINTS.format(bad="nan"), ("nan", "vertex 2")),
    "infinity": (OFF_POINTS.format(bad="inf"), ("inf", "vertex 2")),
    "no triangles": (obj_text(flat(SQUARE), [])[:-1], ("no faces", "4 vertices")),
    "isolated vertex": (obj_text(flat([*SQUARE, (3, 3)]), HALVES), ("in no triangle", "vertex 4")),
    "three triangles at an edge": (
        obj_text([*flat(SQUARE).tolist(), (0.5, 0.5, 1)], [*HALVES, (0, 2, 4)]),
        ("three or more triangles at one edge", "edge 0-2"),
    ),
    "bow-tie": (
        obj_text(flat([*SQUARE, (2, 1), (2, 2)]), [*HALVES, (2, 4, 5)]),
        ("touch only in a vertex", "vertex 2"),
    ),
    "Moebius strip": (
        obj_text(
            [(1, 0, 0), (0.3, 1, 0), (-0.8, 0.6, 0.5), (-0.8, -0.6, 0), (0.3, -1, 0.5)],
            [(k, (k + 1) % 5, (k + 2) % 5) for k in range(5)],
        ),
        ("non-orientable", "over edge"),
    ),
    "triangle soup": (obj_text(flat([*SQUARE[:3], *SQUARE[:1], *SQUARE[2:]]), [(0, 1, 2), (3, 4, 5)]), ("soup",)),
}


def sheet_of(file: str) -> Scene:
    """A sheet from a file that falls."""
    return Scene(
        cloth={"mesh": file, "weld": 0.0},
        effects={"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}},
        run={"duration": 0.1},
    )


def case(number: int, kind: str) -> Case:
    """The case of a kind of bad mesh."""
    text, words = KINDS[kind]
    file = "cloth.off" if text.startswith("OFF") else "cloth.obj"
    return Case(
        f"B15{chr(ord('a') + number)}",
        f"bad mesh: {kind}",
        lambda small: sheet_of(file),
        refused=("cloth", *words),
        jitters=False,
        files=lambda small: {file: text},
    )


CASES = tuple(case(number, kind) for number, kind in enumerate(KINDS))
