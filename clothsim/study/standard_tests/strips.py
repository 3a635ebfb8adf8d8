"""Strip tests: bending length of a cantilever (ASTM D1388), and a strip pulled or sheared between clamps.

A cantilever is a strip of 25 mm that hangs over an edge under its weight; its overhang L is that at which the line from
edge to tip falls by 41.5 degrees, and the bending length is L/2 = (D (1 - nu^2)/(rho g))^(1/3) (Peirce 1930).

A pull is a strip of 50 mm between clamps 200 mm apart (ISO 13934-1), cut along warp, weft, or at 45 degrees. Shear is a
strip of 200 mm between clamps 50 mm apart, the moving one parallel to the other, as in KES. The strips stay in their
plane: what a tester's pretension does.
"""

import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

import clothsim
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError

FALL_DEGREES = 41.5
CANTILEVER_WIDTH, CELLS_ALONG, CELLS_ACROSS = 0.025, 32, 4
GAUGE, WIDTH = 0.2, 0.05
"""Distance of the clamps and width of a pulled strip [m]; of a sheared one the reverse."""
STEPS = 5
"""Steps of a pull, and rows of its table."""
DIRECTIONS: Mapping[str, float] = {"warp": 0.0, "weft": 90.0, "bias": 45.0}
"""Directions in the plane of the fabric from the warp, a cloth's first axis [degrees]."""


def bending_length(cloth: Mapping[str, Any], degrees: float, seed: int = 0) -> float:
    """Bending length of a strip along a direction of the fabric [m].

    Parameters
    ----------
    cloth : mapping
        Keys of the section [cloth] that are not about its mesh.
    degrees : float
        Direction of the strip in the plane of the fabric, from the warp.
    seed : int
        Of the mesh: inner points off by chance; 0: a regular one.

    Raises
    ------
    ClothsimError
        Where a run fails, or no overhang of 2 mm to 2 m falls by 41.5 degrees.

    Notes
    -----
    Regula falsi (Illinois) on the logarithm of the overhang, at most 20 runs, to 1e-3.
    """
    low, high = np.log(2e-3), np.log(2.0)
    target = np.radians(FALL_DEGREES)

    def excess(overhang: float) -> float:
        return _fall_angle(cloth, float(np.exp(overhang)), degrees, seed) - target

    first, last = -target, np.pi / 2 - target  # of a strip of no length, and of a limp one
    guess = np.log(0.04)
    for _ in range(20):
        value = excess(guess)
        if value < 0:
            low, first, last = guess, value, last / 2
        else:
            high, last, first = guess, value, first / 2
        new = (low * last - high * first) / (last - first)
        if abs(new - guess) < 1e-3:
            return float(np.exp(new)) / 2
        guess = new
    raise ClothsimError(
        f"No overhang of 2 mm to 2 m falls by {FALL_DEGREES} degrees.", "Check density and bending stiffness."
    )


def pull(cloth: Mapping[str, Any], degrees: float, stretch: float, seed: int = 0) -> tuple[Floats, Floats]:
    """Strip pulled along its length.

    Parameters
    ----------
    cloth, degrees, seed
        As in `bending_length`.
    stretch : float
        Strain of the gauge at the end.

    Returns
    -------
    strains, forces : (5,) float64
        Strain of the gauge, and force over the width [N/m].
    """
    points, triangles = _strip(GAUGE, WIDTH, 24, 6, seed)
    held = [np.flatnonzero(np.isclose(points[:, 0], end)).tolist() for end in (0.0, GAUGE)]
    forces = _pull_ends(cloth, (points, triangles), _turn_to_fabric(points, degrees), held, (stretch * GAUGE, 0.0, 0.0))
    return np.linspace(0, stretch, STEPS + 1)[1:], forces[:, 0] / WIDTH


def shear(cloth: Mapping[str, Any], degrees: float, angle: float, seed: int = 0) -> tuple[Floats, Floats]:
    """Strip between long clamps, of which one moves parallel to the other.

    Parameters
    ----------
    cloth, seed
        As in `bending_length`; degrees: direction of the clamps.
    angle : float
        Shear angle at the end [rad].

    Returns
    -------
    angles, forces : (5,) float64
        Shear angle [rad], and force along the clamps over their length [N/m].
    """
    points, triangles = _strip(GAUGE, WIDTH, 24, 6, seed)
    held = [np.flatnonzero(np.isclose(points[:, 1], end)).tolist() for end in (0.0, WIDTH)]
    way = np.tan(angle) * WIDTH
    forces = _pull_ends(cloth, (points, triangles), _turn_to_fabric(points, degrees), held, (way, 0.0, 0.0))
    return np.arctan(np.linspace(0, np.tan(angle), STEPS + 1)[1:]), forces[:, 0] / GAUGE


def _fall_angle(cloth: Mapping[str, Any], overhang: float, degrees: float, seed: int) -> float:
    """Angle under the horizontal of the line from edge to tip [rad]."""
    points, triangles = _strip(overhang, min(CANTILEVER_WIDTH, overhang / 2), CELLS_ALONG, CELLS_ACROSS, seed)
    start = np.column_stack([points, np.zeros(len(points))])
    held, tip = np.flatnonzero(points[:, 0] == 0), np.isclose(points[:, 0], overhang)
    effects = {
        "pins": {"select": held.tolist(), "clamp": True},
        "inertia": {},
        "membrane": {},
        "bending": {},
        "gravity": {},
        "damping": {"rate": 8.0},
    }
    settings = {"duration": 8.0, "until": "rest", "rest_speed": 1e-3 * overhang, "frames_per_second": 2.5}
    made = clothsim.Cloth(start, triangles, rest=_turn_to_fabric(points, degrees), name="strip", **cloth)
    run = _run(clothsim.Scene(cloth=made, effects=effects, solver={"dt": 0.04}, run=settings))
    x, _, z = run[0][: len(points)][tip].mean(axis=0)
    return float(np.arctan2(-z, x))


def _pull_ends(
    cloth: Mapping[str, Any], mesh: tuple[Floats, Ints], rest: Floats, held: list[list[int]], way: tuple[float, ...]
) -> Floats:
    """Reaction of the second of two clamps at each of `STEPS` steps of its way, (STEPS, 3) [N]."""
    points, triangles = mesh
    made = clothsim.Cloth(np.column_stack([points, 0 * points[:, :1]]), triangles, rest=rest, name="strip", **cloth)
    groups = [{"select": held[0]}, {"select": held[1], "motion": {"velocity": list(way)}}]
    scene = clothsim.Scene(
        cloth=made,
        effects={"pins": {"group": groups}, "membrane": {}},
        solver={"dt": 1.0 / STEPS, "unstable_equilibrium": "keep"},
        run={"duration": 1.0, "frames_per_second": STEPS, "forces": True},
    )
    return np.asarray(_run(scene)[1])


def _run(scene: "clothsim.Scene") -> tuple[Floats, Floats | None]:
    """Last positions [m], and where the scene records forces those of the second clamp at each step [N]."""
    with tempfile.TemporaryDirectory(prefix="clothsim-") as folder:
        run = clothsim.simulate(scene, folder, overwrite=True)
        if run.status != "completed":
            raise ClothsimError(f"A strip failed: {run.reason}", "Try a smaller --stretch.")
        return run.positions(-1), run.forces().pins["pins.group[1]"] if scene.run_settings.forces else None


def _strip(length: float, width: float, along: int, across: int, seed: int) -> tuple[Floats, Ints]:
    """A strip 0 <= x <= length, 0 <= y <= width of alternating cells, (n, 2) [m] and (m, 3); seed: see above."""
    x, y = np.linspace(0, length, along + 1), np.linspace(0, width, across + 1)
    points = np.column_stack([np.tile(x, across + 1), np.repeat(y, along + 1)])
    if seed:
        away = 0.2 * min(x[1], y[1]) * np.random.default_rng(seed).uniform(-1, 1, points.shape)
        inside = (points > 0) & (points < (1 - 1e-9) * np.array([length, width]))
        points = points + away * inside.all(axis=1, keepdims=True)
    corner = (np.arange(along) + (along + 1) * np.arange(across)[:, None]).ravel()
    right, above = corner + 1, corner + along + 1
    even = ((corner % (along + 1) + corner // (along + 1)) % 2 == 0)[:, None]
    one = np.where(even, np.column_stack([corner, right, above + 1]), np.column_stack([corner, right, above]))
    two = np.where(even, np.column_stack([corner, above + 1, above]), np.column_stack([right, above + 1, above]))
    return points, np.concatenate([one, two])


def _turn_to_fabric(points: Floats, degrees: float) -> Floats:
    """Material coordinates of points of a strip that lies at `degrees` from the warp, (n, 2) [m]."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return points @ np.array([[c, s], [-s, c]])
