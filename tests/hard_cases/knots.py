"""Knots of ribbons pulled tight: an overhand knot, a reef knot, a fishing knot.

After scenes of C-IPC (Li, Kaufman & Jiang 2021) and of ppf-contact-solver (Ando 2024). Each ribbon starts along a
curve through given points, its rest shape flat and straight. What is tied is told by the determinant of the link of the
ribbons' middle lines, closed far away: a number that no deformation without crossing changes (Livingston 1993, Knot
theory, chapter 3): 1 for what is not tied, 3 for an overhand knot, 9 for two.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from clothsim.base.arrays import Floats, Ints
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, Check, all_of, scene_of
from tests.hard_cases.twist import ELASTIC

WIDTH, D_HAT = 0.006, 1.5e-3
RIBBON = {"density": 0.2, "thickness": 3e-4, "youngs_modulus": 2e7, "poisson_ratio": 0.3, "bending_stiffness": 1e-5}
"""Satin ribbon of 6 mm."""


def along(points: Floats, count: int) -> Floats:
    """count + 1 points (count + 1, 3) [m], evenly spaced along the spline through `points`."""
    spline = CubicSpline(np.linspace(0, 1, len(points)), points)
    fine = spline(np.linspace(0, 1, 4000))
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    even = np.linspace(0, length[-1], count + 1)
    return np.column_stack([np.interp(even, length, fine[:, axis]) for axis in range(3)])


def across(line: Floats, first: Floats) -> Floats:
    """Unit vectors (n, 3) across a line, carried along it without turning about it, from `first`."""
    tangents = np.gradient(line, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    made = [np.asarray(first, float)]
    for tangent in tangents:
        side = made[-1] - (made[-1] @ tangent) * tangent
        made.append(side / np.linalg.norm(side))
    return np.array(made[1:])


def tied(*curves: Sequence[Sequence[float]], cells: int) -> Mapping[str, str]:
    """OBJ files of ribbons: each flat at rest, and all of them along the splines through `curves` [m]."""
    made, starts, triangles = {}, [], []
    for number, points in enumerate(curves):
        line = along(np.asarray(points, float), cells)
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        rest, faces = rectangle((length, WIDTH), (cells, 2))
        sides = WIDTH * np.array([-0.5, 0, 0.5])[:, None] * across(line, np.array([0.0, 0, 1]))[:, None]
        made[f"ribbon{number}.obj"] = obj_text(rest, faces)
        starts.append((line[:, None] + sides).reshape(-1, 3))
        triangles.append(faces + number * len(rest))
    return made | {"tied.obj": obj_text(np.concatenate(starts), np.concatenate(triangles))}


def determinant(curves: Sequence[Floats]) -> int:
    """|det| of the link of closed polygons (n, 3): of the colouring matrix of a projection, less a row and a column."""
    turn = rotation_matrix(np.array([0.31, -0.47, 0.19]))
    starts, ends, curve = [], [], []
    for number, points in enumerate(curves):
        seen = points @ turn.T
        starts.append(seen)
        ends.append(np.roll(seen, -1, axis=0))
        curve += [number] * len(seen)
    a, b, of = np.concatenate(starts), np.concatenate(ends), np.array(curve)
    i, j = np.triu_indices(len(a), 1)
    e, f, r = (b - a)[i], (b - a)[j], a[j] - a[i]
    area = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (r[:, 0] * f[:, 1] - r[:, 1] * f[:, 0]) / area
        t = (r[:, 0] * e[:, 1] - r[:, 1] * e[:, 0]) / area
    met = (s > 0) & (s < 1) & (t > 0) & (t < 1)
    i, j, s, t, first_over = i[met], j[met], s[met], t[met], (s * e[:, 2] > r[:, 2] + t * f[:, 2])[met]
    over, under = np.where(first_over, i + s, j + t), np.where(first_over, j + t, i + s)
    if set(of) - set(of[under.astype(int)]):
        return 1 if len(curves) == 1 else 0  # no crossing at all, or a curve that lies above all others
    order = np.sort(under)

    def arc(place: Floats, after: bool) -> Ints:
        """Number of the crossing in which the arc at a place ends; at an under-crossing the arc before or after it."""
        number = np.searchsorted(order, place, side="right" if after else "left")
        whose = of[place.astype(int)]
        inside = (number < len(order)) & (of[order[np.minimum(number, len(order) - 1)].astype(int)] == whose)
        first = np.searchsorted(of[order.astype(int)], whose)  # past the last one of a curve its first arc begins
        return np.where(inside, number, first)

    matrix = np.zeros((len(order), len(order)))
    rows = np.arange(len(order))
    for place, after, weight in ((over, False, 2), (under, False, -1), (under, True, -1)):
        np.add.at(matrix, (rows, arc(place, after)), weight)
    return round(abs(np.linalg.det(matrix[1:, 1:])))


def middles(run: Run, frame: int) -> list[Floats]:
    """Middle line (n, 3) [m] of each ribbon."""
    x = run.positions(frame)
    return [x[surface.rows][1::3] for surface in run.trajectory.surfaces if surface.role == "cloth"]


FAR = 10.0
"""Where ends are joined [m]."""


def of_one(run: Run, frame: int) -> int:
    """Determinant of one ribbon whose ends lie left and right, joined far above."""
    (line,) = middles(run, frame)
    sides = [[FAR, 0, 0], [FAR, FAR, 0], [-FAR, FAR, 0], [-FAR, 0, 0]]
    return determinant([np.concatenate([line, sides])])


def of_two(run: Run, frame: int) -> int:
    """Determinant of two ribbons, one with both ends left, one right: their upper and their lower ends are joined."""
    a, b = middles(run, frame)
    upper, lower = [[FAR, FAR, 0], [-FAR, FAR, 0]], [[-FAR, -FAR, 0], [FAR, -FAR, 0]]
    return determinant([np.concatenate([a, lower, b[::-1], upper])])


def of_each(run: Run, frame: int) -> int:
    """Product of the determinants of two ribbons, each joined far above from where it is held to its free end."""
    a, b = middles(run, frame)
    left, right = (
        [[FAR, 0, 0], [FAR, FAR, 0], [-FAR, FAR, 0], [-FAR, 0, 0]],
        [[-FAR, 0, 0], [-FAR, FAR, 0], [FAR, FAR, 0], [FAR, 0, 0]],
    )
    return determinant([np.concatenate([a, left])]) * determinant([np.concatenate([b, right])])


def stays_tied(count: Any, expected: int) -> Check:
    """The determinant is that of the knot in every frame."""

    def check(run: Run) -> str:
        for frame, time in enumerate(run.times):
            found = count(run, frame)
            if found != expected:
                return f"at {time:.3g} s the determinant is {found}, not {expected}"
        return ""

    return check


def tight(run: Run) -> str:
    """The knot holds: at the end each ribbon is pulled longer than it is at rest, by half a percent at least."""
    for number, cloth in enumerate(build(scene_of(run)).world.cloths):
        rest, last = (
            float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
            for line in (cloth.rest_positions[1::3], middles(run, -1)[number])
        )
        if last < 1.005 * rest:
            return f"ribbon{number} is {last:.4g} m long, at rest {rest:.4g} m: nothing pulls at it"
    return ""


def pulled(names: int, cells: int, ends: Sequence[tuple[int, bool, Sequence[float]]], duration: float) -> Scene:
    """Ribbons tied, whose ends (ribbon, last, velocity [m/s]) are drawn apart."""
    row = 3 * (cells + 1)
    groups = [
        {"select": [number * row + (row - 1 - k if last else k) for k in range(6)], "motion": {"velocity": velocity}}
        for number, last, velocity in ends
    ]
    return Scene(
        cloth=[RIBBON | {"name": f"ribbon{k}", "mesh": f"ribbon{k}.obj"} for k in range(names)],
        effects=ELASTIC
        | {"self_contact": {"d_hat": D_HAT}, "friction": {"coefficient": 0.4}, "damping": {"rate": 2.0}}
        | {"pins": {"group": groups}},
        solver={"dt": 0.01},
        run={"duration": duration, "frames_per_second": 25},
        seed={"from": "file", "file": "tied.obj"},
    )


def coil(tail: float) -> Floats:
    """A line from x = -.15 m that ends in an overhand knot about itself and its neighbour y < 0; tail: x of its end."""
    angle = np.linspace(0, 2 * np.pi, 9)
    turn = np.column_stack([62 - 16 * angle / np.pi, 17 * np.cos(angle), 17 * np.sin(angle)])
    core = [(-150, 3, 0), (-100, 3, 0), (-50, 3, 0), (0, 3, 0), (40, 3, 0), (60, 4, 0), (72, 10, 0)]
    through = [
        (24, 13, 3),
        (28, 3, 9),
        (40, 0, 9),
        (60, 0, 9),
        (80, 0, 9),
        *((x, 0, 9) for x in np.arange(110, 1e3 * tail, 30)),
    ]
    return 1e-3 * np.concatenate([core, turn, through])


def overhand(small: bool) -> Mapping[str, str]:
    """One ribbon with its end tied about itself."""
    return tied(coil(0.15), cells=60 if small else 180)


def fishing(small: bool) -> Mapping[str, str]:
    """Two ribbons side by side, the end of each tied about the other one by an overhand knot."""
    return tied(coil(0.2), coil(0.2) * (-1, -1, 1), cells=75 if small else 240)


BIGHT = 0.0025 * np.array([(-60, 4, 0), (-30, 4, 0), (-12, 4, 3), (0, 7, -3), (8, 10, 0), (12, 4, 3)])
"""Upper end of the left half of a reef knot [m]."""


def reef(small: bool) -> Mapping[str, str]:
    """Two bights, each of which goes through the other one with both its ends on one side."""
    bight = np.concatenate([BIGHT, BIGHT[::-1] * (1, -1, 1)])
    return tied(bight, bight * (-1, 1, -1), cells=60 if small else 160)


LEFT, RIGHT = (-0.3, 0, 0), (0.3, 0, 0)
"""Velocities of ends [m/s]."""

CASES = (
    Case(
        "B29a",
        "overhand knot pulled tight",
        lambda small: pulled(1, 60 if small else 180, [(0, False, LEFT), (0, True, RIGHT)], 0.48),
        all_of(stays_tied(of_one, 3), tight),
        files=overhand,
        slow=True,
    ),
    Case(
        "B29b",
        "reef knot pulled tight",
        lambda small: pulled(
            2, 60 if small else 160, [(0, False, LEFT), (0, True, LEFT), (1, False, RIGHT), (1, True, RIGHT)], 0.2
        ),
        all_of(stays_tied(of_two, 9), tight),
        files=reef,
        slow=True,
    ),
    Case(
        "B29c",
        "fishing knot pulled tight",
        lambda small: pulled(2, 75 if small else 240, [(0, False, LEFT), (1, False, RIGHT)], 0.9),
        all_of(stays_tied(of_each, 9), tight),
        files=fishing,
        slow=True,
    ),
)
