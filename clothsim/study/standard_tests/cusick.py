"""Cusick drape test, ISO 9073-9: a disc of cloth laid on a plate by a ring that falls away, many lays.

The cloth is held between plate and lid and leaves them level: only the ring of cloth beyond the plate is simulated,
its inner border pinned with its slope. It starts flat, a little uneven, on a supporting ring that sinks at `FALL`; the
folds form while it does. The slower the ring, the fewer and deeper the folds (at 30, 100, 250 mm/s and with the ring
gone at once 5.8, 6.6, 9.4 and 9.9 effective folds of the cotton of 2026-11-23): the laying is a part of the test.

Every lay has a mesh of its own, with points off by chance, so that the spread of lays has the mesh's scatter in it.
"""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

import clothsim
from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.study.standard_tests.outline_shape import PLATE, RADIUS, OutlineShape, outline_shape, shadow_radii

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
    start = np.column_stack([flat, UNEVEN * _unevenness(flat, rng)])
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


def _unevenness(flat: Floats, rng: np.random.Generator) -> Floats:
    """Height over the plane, of unit variance at the rim, (n,): waves around it, level at the plate."""
    waves = np.arange(2, 13)
    turn = np.arctan2(flat[:, 1], flat[:, 0])[:, None] * waves
    height = np.cos(turn) @ rng.standard_normal(len(waves)) + np.sin(turn) @ rng.standard_normal(len(waves))
    return height / np.sqrt(len(waves)) * ((np.hypot(*flat.T) - PLATE) / (RADIUS - PLATE)) ** 2


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
