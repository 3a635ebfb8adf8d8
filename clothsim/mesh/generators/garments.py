"""Garments cut out of offset surfaces of the mannequin: they fit it in its "a" pose, with a given ease."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.mesh.generators.implicit_surface import (
    Limb,
    both_halves,
    half_surface,
    lattice_union,
    limb,
    relaxed,
    smooth_union,
)
from clothsim.mesh.generators.mannequin.body_limbs import SMOOTHING, body_limbs, skinning_weights
from clothsim.mesh.generators.mannequin.generator import ARM, JOINT_POSITIONS, Proportions, joint, warped
from clothsim.mesh.topology import border_edges, components

# Borders of a garment: unions of half spaces to cut away, and the mesh trimmed to them.


@dataclass(frozen=True)
class Cut:
    """Intersection of half spaces that is cut away: points p with normals (k, 3) . p above offsets (k,) [m]."""

    normals: Floats
    offsets: Floats


def cut(*planes: tuple[tuple[float, float, float] | Floats, Floats | tuple[float, float, float]]) -> Cut:
    """Make a cut from planes (normal, point on it): what lies beyond all of them is cut away."""
    normals = np.array([np.asarray(normal, np.float64) / np.linalg.norm(normal) for normal, _ in planes])
    return Cut(normals, np.array([normal @ np.asarray(at) for normal, (_, at) in zip(normals, planes, strict=True)]))


@dataclass(frozen=True)
class Edge:
    """Level-set function of the border, below 0 in the garment: max over cuts of the min over planes."""

    cuts: tuple[Cut, ...]

    def __call__(self, points: Floats) -> tuple[Floats, Floats]:
        """Return its value (n,) [m] and gradient (n, 3) at `points (n, 3)`."""
        rows = np.arange(len(points))
        values, gradients = [], []
        for one in self.cuts:
            beyond = points @ one.normals.T - one.offsets
            nearest = beyond.argmin(axis=1)
            values.append(beyond[rows, nearest])
            gradients.append(one.normals[nearest])
        most = np.argmax(values, axis=0)
        return np.stack(values)[most, rows], np.stack(gradients)[most, rows]


def trimmed(positions: Floats, triangles: Ints, edge: Edge) -> tuple[Floats, Ints]:
    """Remove the triangles of the half mesh whose centres are cut away; its vertices are not yet on the border.

    The largest component remains, without triangles that have two sides on the border: those would be flattened there.
    """
    remaining = triangles[edge(positions[triangles].mean(axis=1))[0] < 0]
    piece = components(remaining, len(positions))[remaining[:, 0]]
    remaining = remaining[piece == np.bincount(piece).argmax()]
    middle = positions[:, 0] == 0
    for _ in range(32):
        ends, half = border_edges(remaining)
        border_sides = np.bincount(half[~middle[ends].all(axis=1)] // 3, minlength=len(remaining))
        if not (border_sides > 1).any():
            break
        remaining = remaining[border_sides < 2]
    used, renumbered = np.unique(remaining, return_inverse=True)
    return positions[used], renumbered.reshape(-1, 3).astype(np.int64)


# Garment meshing: an offset surface of limbs, meshed by surface nets, trimmed to its borders and smoothed.

FINEST, COARSEST = 0.006, 0.040
"""Bounds on the edge length of a garment [m]."""
LEAST_EASE, SAGITTA, MOST_EASE = 0.003, 3.0, 0.06
"""Least ease [m] of tiny triangles, its growth with edge^2 (chords cut into round limbs), and the largest ease [m]."""


@dataclass(frozen=True)
class Construction:
    """Construction of a garment on the template.

    Parameters
    ----------
    joints : tuple of str
        The limbs of the body that these joints move are part of the surface.
    limbs : tuple of Limb
        Further limbs.
    cuts : tuple of Cut
        Parts that are cut away.
    low, high : (3,)
        Box around the garment [m].
    """

    joints: tuple[str, ...]
    limbs: tuple[Limb, ...]
    cuts: tuple[Cut, ...]
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def garment_mesh(pattern: Construction, proportions: Proportions, ease: float, edge: float) -> tuple[Floats, Ints]:
    """Mesh a garment on the mannequin of `proportions`.

    Parameters
    ----------
    pattern : Construction
        Construction on the template.
    proportions : Proportions
        Proportions to which the mesh is warped.
    ease : float
        Distance from the surface of the pattern on the template [m]; it grows with the figure.
    edge : float
        Edge length [m].

    Returns
    -------
    positions : (n, 3) float64
        [m].
    triangles : (m, 3) int64
        Facing outward.
    """
    _refuse(ease, edge)
    limbs = [one.limb for one in body_limbs() if set(one.joints) & set(pattern.joints)] + list(pattern.limbs)
    cell, room = 1.12 * edge, ease + 4 * edge
    x = np.arange(-0.5 * cell, pattern.high[0] + room, cell)
    y, z = (np.arange(pattern.low[k] - room, pattern.high[k] + room, cell) for k in (1, 2))
    nodes = x, y, z
    values = lattice_union(limbs, nodes, SMOOTHING, ease + 3 * COARSEST) - ease
    for axis in range(3):  # closes the surface at the box; that part is cut away
        for side in (0, -1) if axis else (-1,):
            np.moveaxis(values, axis, 0)[side] = edge
    border = Edge(pattern.cuts)
    positions, triangles = trimmed(*half_surface(values, nodes), border)

    def field(points: Floats) -> tuple[Floats, Floats]:
        return smooth_union(limbs, points, SMOOTHING)

    positions, triangles = both_halves(*relaxed(positions, triangles, field, ease, cut=border))
    return warped(positions, skinning_weights(positions), proportions), triangles


def _refuse(ease: float, edge: float) -> None:
    as_positive("ease", ease)
    as_positive("edge", edge)
    if not FINEST <= edge <= COARSEST:
        raise InputError(f"edge must be from {FINEST:g} to {COARSEST:g} m, not {edge:g}.")
    least = LEAST_EASE + SAGITTA * edge * edge
    if not least <= ease <= MOST_EASE:
        raise InputError(
            f"ease must be from {least:.4f} to {MOST_EASE:g} m where edge is {edge:g} m, not {ease:g}.",
            "With less ease its triangles would cut into the body.",
        )


def tube_limb(*rings: tuple[float, float, float, float]) -> Limb:
    """Make an upright limb through rings (z, y, half width, half depth) [m], from below, on one straight axis."""
    (z0, y0, *_), (z1, y1, *_) = rings[0], rings[-1]
    profile = [((z - z0) / (z1 - z0), wide, deep) for z, _, wide, deep in rings]
    return limb((0, y0, z0), (0, y1, z1), np.array([1.0, 0.0, 0.0]), profile, (0.03, 0.03))


def both_sides(left: Limb) -> tuple[Limb, Limb]:
    """Return a limb on the left and its mirror image."""
    return left, left.mirrored()


_TRUNK = ("pelvis", "spine", "chest", "neck", "head")
_ARMS = ("left_shoulder", "right_shoulder")
_LEGS = ("left_hip", "right_hip")
_SHOULDER = JOINT_POSITIONS[joint("left_shoulder")]
_Y = np.array([0.0, 1.0, 0.0])
UP, DOWN, _FORWARD = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, -1.0, 0.0)
_HOOD = (
    limb((0, 0.030, 1.600), (0, 0.030, 1.600), np.array([1.0, 0.0, 0.0]), [(0.0, 0.100, 0.112)], (0.116, 0.116)),
    limb(
        (0, 0.024, 1.420), (0, 0.024, 1.560), np.array([1.0, 0.0, 0.0]), [(0.0, 0.098, 0.100), (1.0, 0.088, 0.100)],
        (0.03, 0.03),
    ),
)  # fmt: skip
"""A hood around the head, and its neck."""


def shirt(
    ease: float = 0.012,
    edge: float = 0.018,
    sleeve: float = 0.20,
    opening: float = 0.0,
    hood: bool = False,
    **figure: float,
) -> tuple[Floats, Ints]:
    """Shirt with sleeves, straight from chest to hip, open at the neck, the hem and the cuffs; or a jacket, a hoody.

    Parameters
    ----------
    ease : float
        Smallest distance from the body [m].
    edge : float
        Edge length [m].
    sleeve : float
        From the shoulder joint to the cuff, for a height of 1.7 m [m].
    opening : float
        Width of the gap down its front [m]; 0 is a closed front.
    hood : bool
        With a hood over the head.
    **figure : float
        The `Proportions` of the mannequin that wears it.

    Raises
    ------
    InputError
        Naming a bad key.
    """
    proportions = Proportions(**figure)
    length = _check_range("sleeve", sleeve, 0.13, 0.46)
    trunk = tube_limb((0.83, 0.010, 0.164, 0.114), (1.04, 0.010, 0.150, 0.105), (1.25, 0.010, 0.143, 0.103))
    wide = [(0.0, 0.050, 0.048), (0.5, 0.056, 0.052), (1.0, 0.050, 0.048)]
    tip = _SHOULDER + 0.54 * ARM
    sleeve_limb = limb(_SHOULDER, tip, _Y, wide, (0.03, 0.03))
    neck = cut(((0, -0.36, 0.93), (0, 0.02, 1.452)))
    cuts = [
        cut((DOWN, (0, 0, 0.84))),
        cut((_FORWARD, (0, -0.050, 0)), ((0, -0.30, 1.0), (0, -0.060, 1.480))) if hood else neck,
        cut((ARM, _SHOULDER + length * ARM), ((1, 0, 0), (0.195, 0, 0))),
    ]
    if opening:
        half = 0.5 * _check_range("opening", opening, edge, 0.2)
        cuts.append(cut(((-1, 0, 0), (half, 0, 0)), (_FORWARD, (0, 0, 0)), (DOWN, (0, 0, 1.5))))
    limbs = [trunk, *both_sides(sleeve_limb), *(_HOOD if hood else ())]
    wrist = _SHOULDER + (length + 0.02) * ARM
    box = (0, -0.13, 0.82), (wrist[0] + 0.05, 0.17 if hood else 0.14, 1.74 if hood else 1.50)
    return garment_mesh(Construction(_TRUNK + _ARMS, tuple(limbs), tuple(cuts), *box), proportions, ease, edge)


def skirt(
    ease: float = 0.008,
    edge: float = 0.018,
    hem: float = 0.50,
    **figure: float,
) -> tuple[Floats, Ints]:
    """Flared skirt from the waist to `hem` [m] above the ground, for a height of 1.7 m; other keys as for `shirt`."""
    proportions = Proportions(**figure)
    low = _check_range("hem", hem, 0.15, 0.75)
    cone = tube_limb((0.12, 0.010, 0.290, 0.240), (0.78, 0.010, 0.180, 0.135), (1.10, 0.010, 0.112, 0.080))
    cuts = (cut((DOWN, (0, 0, low))), cut((UP, (0, 0, 1.055))))
    pattern = Construction(("pelvis", "spine", *_LEGS), (cone,), cuts, (0, -0.24, low - 0.02), (0.30, 0.26, 1.08))
    return garment_mesh(pattern, proportions, ease, edge)


def trousers(
    ease: float = 0.008,
    edge: float = 0.018,
    hem: float = 0.12,
    **figure: float,
) -> tuple[Floats, Ints]:
    """Trousers from the waist to `hem` [m] above the ground, for a height of 1.7 m; other keys as for `shirt`."""
    proportions = Proportions(**figure)
    low = _check_range("hem", hem, 0.10, 0.60)
    profile = [(0.0, 0.060, 0.070), (0.5, 0.056, 0.064), (1.0, 0.054, 0.058)]
    leg = limb(
        JOINT_POSITIONS[joint("left_hip")], (0.115, 0.012, 0.05), np.array([1.0, 0.0, 0.0]), profile, (0.03, 0.03)
    )
    cuts = (cut((DOWN, (0, 0, low))), cut((UP, (0, 0, 1.045))))
    pattern = Construction(
        ("pelvis", "spine", *_LEGS), both_sides(leg), cuts, (0, -0.13, low - 0.02), (0.19, 0.15, 1.07)
    )
    return garment_mesh(pattern, proportions, ease, edge)


def _check_range(name: str, value: float, least: float, most: float) -> float:
    """`value` [m] within its bounds; InputError names it."""
    length = as_positive(name, value)
    if not least <= length <= most:
        raise InputError(f"{name} must be from {least:g} to {most:g} m, not {length:g}.")
    return length
