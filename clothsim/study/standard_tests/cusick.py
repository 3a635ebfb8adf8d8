"""Cusick drape test, ISO 9073-9: a disc of cloth laid on a plate by a ring that falls away, many lays.

The cloth is held between plate and lid and leaves them level: only the ring of cloth beyond the plate is simulated,
its inner border pinned with its slope. It starts flat, a little uneven, on a supporting ring that sinks at `FALL`; the
folds form while it does. The slower the ring, the fewer and deeper the folds (at 30, 100, 250 mm/s and with the ring
gone at once 5.8, 6.6, 9.4 and 9.9 effective folds of the cotton of 2026-11-23): the laying is a part of the test.

Every lay has a mesh of its own, with points off by chance, so that the spread of lays has the mesh's scatter in it.
The shape of an outline is its drape coefficient, effective number of folds, and their depth.
"""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

import clothsim
from clothsim.base.arrays import Floats, Ints, as_finite
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.triangles import unique_edges

RADIUS, PLATE = 0.15, 0.09
"""Radii of the specimen and of the plate of a Cusick tester, ISO 9073-9 and BS 5058 [m]."""
FOLDS = range(2, 16)
"""Fourier numbers of an outline that count as folds; 1 is a shift of its centre."""
ANGLES = 360


@dataclass(frozen=True)
class OutlineShape:
    """Three numbers of an outline.

    Attributes
    ----------
    coefficient : float
        Drape coefficient: area of the shadow beyond the plate over that of the flat specimen, 0 to 1.
    folds : float
        Effective number of folds sqrt(sum n^2 a_n^2 / sum a_n^2) over the amplitudes a_n of r(theta), n of `FOLDS`; 0
        for a circle.
    depth : float
        Standard deviation of r over the angles [m].
    """

    coefficient: float
    folds: float
    depth: float


def outline_shape(radii: Floats, radius: float = RADIUS, plate: float = PLATE) -> OutlineShape:
    """Shape of an outline r(theta) about the centre of the plate.

    Parameters
    ----------
    radii : (k,) array
        r at the angles 2 pi j/k [m].
    radius, plate : float
        Radii of the flat specimen and of the plate [m].

    Returns
    -------
    OutlineShape
        The area is that of the polygon's limit, the mean of r^2 times pi.

    Raises
    ------
    InputError
        For fewer than 32 angles, which do not resolve 15 folds.

    Examples
    --------
    >>> theta = 2 * np.pi * np.arange(360) / 360
    >>> shape = outline_shape(0.12 + 0.01 * np.cos(7 * theta))
    >>> round(shape.coefficient, 4), round(shape.folds, 6), round(shape.depth, 6)
    (0.441, 7.0, 0.007071)
    """
    r = as_finite("radii", radii)
    if r.ndim != 1 or len(r) < 2 * FOLDS.stop:
        raise InputError(f"An outline has radii of shape {r.shape}.", f"Give {2 * FOLDS.stop} or more, by angle.")
    squares = np.abs(np.fft.rfft(r)[FOLDS.start : FOLDS.stop]) ** 2
    n = np.array(FOLDS)
    wavy = squares.sum() > (1e-12 * len(r) * r.mean()) ** 2
    folds = float(np.sqrt((n**2 * squares).sum() / squares.sum())) if wavy else 0.0
    coefficient = (np.mean(r**2) - plate**2) / (radius**2 - plate**2)
    return OutlineShape(float(coefficient), folds, float(r.std()))


def outline_radii(positions: Floats, border: Ints) -> Floats:
    """Radii of a border seen along z, by angle.

    Parameters
    ----------
    positions : (n, 3) array
        Vertices of the cloth about the centre of the plate [m].
    border : (k, 2) int array
        The border's edges.

    Returns
    -------
    (360,) float64
        Distance from the centre of the outermost crossing of the border and a ray at each angle [m]: where folds hang
        over one another the shadow has the outer one.

    Raises
    ------
    InputError
        Where a ray meets no border: the centre is outside the cloth.
    """
    turn = 2 * np.pi * np.arange(ANGLES) / ANGLES
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    ahead, aside = positions[:, :2] @ along, positions[:, :2] @ across
    start, end = border.T
    crosses = (aside[start] > 0) != (aside[end] > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = aside[start] / (aside[start] - aside[end])
        distance = ahead[start] + share * (ahead[end] - ahead[start])
    radii = np.where(crosses, distance, -np.inf).max(axis=0)
    if not (radii > 0).all():
        raise InputError(f"No border lies at {np.argmin(radii) * 360 / ANGLES:g} degrees.", "Check the centre.")
    return radii


def shadow_radii(positions: Floats, triangles: Ints) -> Floats:
    """Radii of the shadow of a cloth that lies on a plate and hangs over it, by angle.

    The shadow is no smaller than the plate, where soft cloth hangs under it.

    Parameters
    ----------
    positions : (n, 3) array
        Vertices about the centre of the plate [m]; those that the plate holds are among them.
    triangles : (m, 3) int array
        The cloth outside the plate.

    Returns
    -------
    (360,) float64
        See `outline_radii`.
    """
    return outline_radii(positions, unique_edges(triangles))


FALL = 0.1
"""Speed of the supporting ring [m/s]; see `docs/results/reality.md` for how it was chosen."""
DROP, GAP = 0.08, 1.5e-3
"""Way of the ring, beyond the reach of the cloth, and its distance at the start [m]."""
UNEVEN = 2e-4
"""Standard deviation of the cloth's height at its rim as laid [m], in waves of 2 to 12 around it."""
LIMIT, DT, REST_SPEED, RATE = 8.0, 0.04, 5e-3, 8.0
"""Longest time [s], step [s], speed that counts as rest [m/s], rate of damping [1/s]."""


@dataclass(frozen=True)
class Lay:
    """One laid specimen: its mesh at rest, what its outline says, and whether it came to rest."""

    positions: Floats
    triangles: Ints
    radii: Floats
    shape: OutlineShape
    at_rest: bool


def lay(cloth: Mapping[str, Any], size: float, seed: int, fall: float = FALL) -> Lay:
    """Lay a specimen and let it come to rest.

    Parameters
    ----------
    cloth : mapping
        Keys of the section [cloth] that are not about its mesh: fabric, density, ...
    size : float
        Distance of neighbouring vertices [m].
    seed : int
        Of mesh and unevenness.
    fall : float
        Speed of the ring [m/s].

    Raises
    ------
    ClothsimError
        Where the run fails.
    """
    rng = np.random.default_rng(seed)
    flat, triangles, held = ring_mesh(size, rng)
    # height over the plane, of unit variance at the rim: waves around it, level at the plate
    waves = np.arange(2, 13)
    turn = np.arctan2(flat[:, 1], flat[:, 0])[:, None] * waves
    height = np.cos(turn) @ rng.standard_normal(len(waves)) + np.sin(turn) @ rng.standard_normal(len(waves))
    height = height / np.sqrt(len(waves)) * ((np.hypot(*flat.T) - PLATE) / (RADIUS - PLATE)) ** 2
    start = np.column_stack([flat, UNEVEN * height])
    specimen = clothsim.Cloth(start, triangles, rest=flat, name="specimen", **cloth)
    scene = clothsim.Scene(
        cloth=specimen,
        body=[_support(fall)],
        effects={
            "pins": {"select": list(range(held)), "clamp": True},
            "inertia": {},
            "membrane": {},
            "bending": {},
            "gravity": {},
            "damping": {"rate": RATE},
            "body_contact": {"d_hat": 1e-3},
        },
        solver={"dt": DT},
        run={"duration": DROP / fall + LIMIT, "until": "rest", "rest_speed": REST_SPEED, "frames_per_second": 5},
    )
    with tempfile.TemporaryDirectory(prefix="clothsim-") as folder:
        run = clothsim.simulate(scene, folder, overwrite=True)
        if run.status != "completed":
            raise ClothsimError(f"Lay {seed} failed: {run.reason}", "Try another --size.")
        positions = run.positions(-1)[: len(flat)]
        at_rest = bool(run.summary["certificate"]["at_rest"])
    radii = shadow_radii(positions, triangles)
    return Lay(positions, triangles, radii, outline_shape(radii), at_rest)


def lays(
    cloth: Mapping[str, Any], count: int, size: float, message: Callable[[str], None] | None = None, fall: float = FALL
) -> list[Lay]:
    """`count` lays, with the seeds 0, 1, ...; `message` gets a line for each."""
    done = []
    for seed in range(count):
        done.append(lay(cloth, size, seed, fall))
        c, n, d = (getattr(done[-1].shape, name) for name in ("coefficient", "folds", "depth"))
        if message is not None:
            rest = "" if done[-1].at_rest else ", NOT at rest"
            message(
                f"lay {seed + 1} of {count}: coefficient {100 * c:.1f} %, n_eff {n:.1f}, sd r {1e3 * d:.1f} mm{rest}"
            )
    return done


def ring_mesh(size: float, rng: np.random.Generator) -> tuple[Floats, Ints, int]:
    """The cloth beyond the plate, flat: points on circles that are turned and moved by chance, Delaunay.

    Returns
    -------
    points : (n, 2) float64
        [m]; those of the plate's rim first.
    triangles : (m, 3) int64
        Facing up.
    held : int
        Number of points at the rim of the plate.
    """
    across = max(2, round((RADIUS - PLATE) / size))
    circles = []
    for k in range(across + 1):
        r = PLATE + (RADIUS - PLATE) * k / across
        count = round(2 * np.pi * r / size)
        turn = 2 * np.pi * (np.arange(count) + rng.random()) / count
        points = r * np.column_stack([np.cos(turn), np.sin(turn)])
        inside = 0 < k < across
        circles.append(points + 0.12 * size * rng.uniform(-1, 1, points.shape) * inside)
    points, held = np.concatenate(circles), len(circles[0])
    triangles = Delaunay(points).simplices.astype(np.int64)
    triangles = triangles[(triangles >= held).any(axis=1)]
    first, second = (points[triangles[:, k]] - points[triangles[:, 0]] for k in (1, 2))
    down = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    triangles[down] = triangles[down][:, ::-1]
    return points, triangles, held


def _support(fall: float) -> clothsim.Body:
    """The ring under the cloth, which sinks by `DROP` and stays there."""
    sectors = np.arange(72)
    turn, following = 2 * np.pi * sectors / len(sectors), (sectors + 1) % len(sectors)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    flat = np.concatenate([(PLATE + 2e-3) * circle, (RADIUS + 1e-2) * circle])
    inner = np.column_stack([sectors, sectors + len(sectors), following + len(sectors)])
    outer = np.column_stack([sectors, following + len(sectors), following])
    frames = np.stack([np.column_stack([flat, np.full(len(flat), z)]) for z in (-GAP, -GAP - DROP)])
    return clothsim.Body(
        frames[0], np.concatenate([inner, outer]), frames=frames, frames_per_second=fall / DROP, name="ring"
    )
