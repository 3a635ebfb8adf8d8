"""Garments cut out of offset surfaces of the mannequin: they fit it in its "a" pose, with a given ease."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.generator_keys import GarmentKeys, Shirt, Skirt, Trousers
from clothsim.keys.key_table import by_keywords
from clothsim.keys.schema import keys_of
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
from clothsim.mesh.generators.mannequin.generator import ARM, JOINT_POSITIONS, joint, warped
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


def garment_mesh(pattern: Construction, keys: GarmentKeys) -> tuple[Floats, Ints]:
    """Mesh a garment on the mannequin of its proportions.

    Parameters
    ----------
    pattern : Construction
        Construction on the template.
    keys : GarmentKeys
        Proportions to which the mesh is warped, the ease on the template, which grows with the figure, and the edge.

    Returns
    -------
    positions : (n, 3) float64
        [m].
    triangles : (m, 3) int64
        Facing outward.
    """
    ease, edge = keys.ease, keys.edge
    least = LEAST_EASE + SAGITTA * edge * edge
    if not least <= ease <= MOST_EASE:
        raise InputError(
            f"ease must be from {least:.4f} to {MOST_EASE:g} m where edge is {edge:g} m, not {ease:g}.",
            "With less ease its triangles would cut into the body.",
        )
    limbs = [one.limb for one in body_limbs() if set(one.joints) & set(pattern.joints)] + list(pattern.limbs)
    cell, room = 1.12 * edge, ease + 4 * edge
    x = np.arange(-0.5 * cell, pattern.high[0] + room, cell)
    y, z = (np.arange(pattern.low[k] - room, pattern.high[k] + room, cell) for k in (1, 2))
    nodes = x, y, z
    values = lattice_union(limbs, nodes, SMOOTHING, ease + 3 * (keys_of(GarmentKeys)["edge"].key.most or edge)) - ease
    for axis in range(3):  # closes the surface at the box; that part is cut away
        for side in (0, -1) if axis else (-1,):
            np.moveaxis(values, axis, 0)[side] = edge
    border = Edge(pattern.cuts)
    positions, triangles = trimmed(*half_surface(values, nodes), border)

    def field(points: Floats) -> tuple[Floats, Floats]:
        return smooth_union(limbs, points, SMOOTHING)

    positions, triangles = both_halves(*relaxed(positions, triangles, field, ease, cut=border))
    return warped(positions, skinning_weights(positions), keys), triangles


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


@by_keywords(Shirt)
def shirt(keys: Shirt) -> tuple[Floats, Ints]:
    """Shirt with sleeves, straight from chest to hip, open at the neck, the hem and the cuffs; or a jacket, a hoody."""
    trunk = tube_limb((0.83, 0.010, 0.164, 0.114), (1.04, 0.010, 0.150, 0.105), (1.25, 0.010, 0.143, 0.103))
    wide = [(0.0, 0.050, 0.048), (0.5, 0.056, 0.052), (1.0, 0.050, 0.048)]
    tip = _SHOULDER + 0.54 * ARM
    sleeve_limb = limb(_SHOULDER, tip, _Y, wide, (0.03, 0.03))
    neck = cut(((0, -0.36, 0.93), (0, 0.02, 1.452)))
    cuts = [
        cut((DOWN, (0, 0, 0.84))),
        cut((_FORWARD, (0, -0.050, 0)), ((0, -0.30, 1.0), (0, -0.060, 1.480))) if keys.hood else neck,
        cut((ARM, _SHOULDER + keys.sleeve * ARM), ((1, 0, 0), (0.195, 0, 0))),
    ]
    if keys.opening:
        if keys.opening < keys.edge:
            raise InputError(f"opening must be at least edge = {keys.edge:g} m, not {keys.opening:g}.")
        half = 0.5 * keys.opening
        cuts.append(cut(((-1, 0, 0), (half, 0, 0)), (_FORWARD, (0, 0, 0)), (DOWN, (0, 0, 1.5))))
    limbs = [trunk, *both_sides(sleeve_limb), *(_HOOD if keys.hood else ())]
    wrist = _SHOULDER + (keys.sleeve + 0.02) * ARM
    box = (0, -0.13, 0.82), (wrist[0] + 0.05, 0.17 if keys.hood else 0.14, 1.74 if keys.hood else 1.50)
    return garment_mesh(Construction(_TRUNK + _ARMS, tuple(limbs), tuple(cuts), *box), keys)


@by_keywords(Skirt)
def skirt(keys: Skirt) -> tuple[Floats, Ints]:
    """Flared skirt from the waist to the hem."""
    low = keys.hem
    cone = tube_limb((0.12, 0.010, 0.290, 0.240), (0.78, 0.010, 0.180, 0.135), (1.10, 0.010, 0.112, 0.080))
    cuts = (cut((DOWN, (0, 0, low))), cut((UP, (0, 0, 1.055))))
    pattern = Construction(("pelvis", "spine", *_LEGS), (cone,), cuts, (0, -0.24, low - 0.02), (0.30, 0.26, 1.08))
    return garment_mesh(pattern, keys)


@by_keywords(Trousers)
def trousers(keys: Trousers) -> tuple[Floats, Ints]:
    """Trousers from the waist to the hem."""
    low = keys.hem
    profile = [(0.0, 0.060, 0.070), (0.5, 0.056, 0.064), (1.0, 0.054, 0.058)]
    leg = limb(
        JOINT_POSITIONS[joint("left_hip")], (0.115, 0.012, 0.05), np.array([1.0, 0.0, 0.0]), profile, (0.03, 0.03)
    )
    cuts = (cut((DOWN, (0, 0, low))), cut((UP, (0, 0, 1.045))))
    pattern = Construction(
        ("pelvis", "spine", *_LEGS), both_sides(leg), cuts, (0, -0.13, low - 0.02), (0.19, 0.15, 1.07)
    )
    return garment_mesh(pattern, keys)
