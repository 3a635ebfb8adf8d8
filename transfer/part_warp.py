"""Warp of one body towards another part by part, and the size factors between them.

Each part is mapped by the sections along it: axis to axis, and across it by the ratio of the extents. The maps are
blended where parts meet. It brings a body of any pose, size and orientation near another one; a registration
(`correspond`) then finds what is left.

Size factors are the ratios of girths and lengths of trunk, legs and arms, as a pattern maker grades by: a garment
graded by them is as wide about each part of the other body, and as long along it, as it was on its own.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from transfer.body_parts import BodyParts, BodyTube, smoothed
from transfer.triangle_surface import Floats, Ints, unit, vertex_normals

LEVELS = ("crotch", "armpit", "neck", "crown")
"""Landmarks between which heights are mapped linearly."""
SHOULDER_BAND, CROTCH_BAND = 0.35, 0.10
"""Widths of the blends: fractions of the length of an arm, and of the height of the crotch."""


@dataclass(frozen=True)
class PartWeights:
    """Weights of the parts at points, of sum 1: trunk (k,), legs (2, k), arms (2, k)."""

    trunk: Floats
    legs: Floats
    arms: Floats

    def combined(self, trunk: Floats, legs: Floats, arms: Floats) -> Floats:
        """Weighted sum of values of the parts: trunk (k, ...), legs and arms (2, k, ...)."""
        shape = (-1,) + (1,) * (trunk.ndim - 1)
        result = self.trunk.reshape(shape) * trunk
        for own, values in ((self.legs, legs), (self.arms, arms)):
            for weight, value in zip(own, values, strict=True):
                result = result + weight.reshape(shape) * value
        return result


def part_weights(parts: BodyParts, local: Floats) -> PartWeights:
    """Weights at the body's own vertices, `local` (n, 3) in its frame."""
    hands = np.where(np.isfinite(parts.hands), parts.hands, np.inf)
    arms = step((1.0 - hands) / SHOULDER_BAND + 0.5)
    crotch = parts.landmarks["crotch"]
    below = step((crotch - local[:, 1]) / (CROTCH_BAND * crotch)) * (1.0 - arms.sum(axis=0).clip(0.0, 1.0))
    left = step(local[:, 0] / (0.04 * crotch) + 0.5)
    legs = np.stack([left * below, (1.0 - left) * below])
    arms = arms / np.maximum(arms.sum(axis=0), 1.0)
    return PartWeights(1.0 - arms.sum(axis=0) - legs.sum(axis=0), legs, arms)


NEAR = 0.011
"""Vertices of a body among which one that faces to the same side is looked for, as a fraction of all: within about 5 cm
on the trunk, however fine the mesh is."""


def nearest_facing_alike(surface: tuple[Floats, Ints], body: tuple[Floats, Ints]) -> Ints:
    """The vertex of a body near each of another surface that faces to the same side, (n,): the nearest, if none does.

    What lies on the trunk under a hanging arm may be nearer to the arm. Each is given by its positions [m] and
    triangles.
    """
    positions, others = surface[0], body[0]
    tree = cKDTree(others)
    nearest = tree.query(positions)[1]
    own, other = vertex_normals(*surface), vertex_normals(*body)
    turned = np.flatnonzero(np.einsum("ij,ij->i", own, other[nearest]) < 0)
    near = tree.query(positions[turned], k=range(1, int(np.ceil(NEAR * len(others))) + 1))[1]
    alike = np.einsum("ij,ikj->ik", own[turned], other[near]) > 0
    nearest[turned] = near[np.arange(len(turned)), alike.argmax(axis=1)]  # the first: the nearest
    return np.asarray(nearest, np.int64)


def step(t: Floats) -> Floats:
    """Smooth step from 0 at t = 0 to 1 at t = 1."""
    clipped = np.clip(t, 0.0, 1.0)
    return np.asarray(clipped**2 * (3.0 - 2.0 * clipped))


def warped_onto(source: BodyParts, target: BodyParts, positions: Floats) -> Floats:
    """Vertices of the source body (n, 3) [m] in the pose and the proportions of the target."""
    local = source.frame.local(positions)
    weights = part_weights(source, local)
    trunk = upright(source, target, source.trunk, target.trunk, local)
    legs = np.stack([upright(source, target, source.legs[k], target.legs[k], local) for k in (0, 1)])
    arms = np.stack([along_arm(source, target, k, local) for k in (0, 1)])
    return target.frame.world(weights.combined(trunk, legs, arms))


def heights_onto(source: BodyParts, target: BodyParts, heights: Floats) -> Floats:
    """Heights of the source as those of the target: linear between the landmarks, and beyond them."""
    own, other = (np.array([0.0, *(parts.landmarks[name] for name in LEVELS)]) for parts in (source, target))
    mapped = np.interp(heights, own, other)
    return mapped + np.where(heights > own[-1], heights - own[-1], 0.0) + np.minimum(heights, 0.0)


def upright(source: BodyParts, target: BodyParts, tube: BodyTube, onto: BodyTube, local: Floats) -> Floats:
    """Map of the trunk or a leg: heights by landmarks, across by the ratio of the extents."""
    heights = heights_onto(source, target, local[:, 1])
    ratio = onto.at(heights, onto.extents) / tube.at(local[:, 1], tube.extents)
    offset = (local - tube.at(local[:, 1], tube.centres))[:, [0, 2]]
    across = onto.at(heights, onto.centres)[:, [0, 2]] + ratio * offset
    return np.column_stack([across[:, 0], heights, across[:, 1]])


def along_arm(source: BodyParts, target: BodyParts, side: int, local: Floats) -> Floats:
    """Map of an arm: from the nearest point of one axis to the same fraction of the other, turned and scaled."""
    axes = [arm_axis(parts, side) for parts in (source, target)]
    fraction = nearest_fraction(axes[0], local)
    (base, frames), (onto, turned) = (framed(axis, fraction) for axis in axes)
    ratio = np.interp(fraction, np.linspace(0, 1, 9), arm_ratio(source.arms[side], target.arms[side]))
    offset = np.einsum("kab,kb->ka", frames, local - base)
    # Beyond the ends the offset along the axis counts; within it is nothing but the curvature of the axis.
    return onto + np.einsum("kab,ka->kb", turned, ratio[:, None] * offset)


def arm_ratio(source: BodyTube, target: BodyTube) -> Floats:
    """Ratio of the girths at nine stations from the hand to the shoulder."""
    stations = np.linspace(source.levels[0], source.levels[-1], 9)
    return target.at(stations, target.girths) / source.at(stations, source.girths)


def arm_axis(parts: BodyParts, side: int, stations: int = 25) -> Floats:
    """Axis of an arm from the finger tip to the shoulder at equal lengths, (stations, 3)."""
    line = np.concatenate([parts.tips[side][None], parts.arms[side].centres])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], stations)
    return np.stack([np.interp(at, length, column) for column in line.T], axis=1)


def nearest_fraction(axis: Floats, points: Floats) -> Floats:
    """Fraction of the length of `axis` (k, 3) at the point of it that is nearest to each of `points` (n, 3), (n,)."""
    starts, along = axis[:-1], np.diff(axis, axis=0)
    t = np.einsum("nka,ka->nk", points[:, None] - starts, along) / (along**2).sum(axis=1)
    t = np.clip(t, 0.0, 1.0)
    squared = ((points[:, None] - starts - t[..., None] * along) ** 2).sum(axis=2)
    nearest = squared.argmin(axis=1)
    return (nearest + t[np.arange(len(points)), nearest]) / len(along)


def framed(axis: Floats, fraction: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) of the axis at `fraction` (n,), and frames (n, 3, 3): rows along it, to the front, and across."""
    stations = np.linspace(0.0, 1.0, len(axis))
    points = np.stack([np.interp(fraction, stations, column) for column in axis.T], axis=1)
    tangents = unit(np.gradient(axis, axis=0))
    along = unit(np.stack([np.interp(fraction, stations, column) for column in tangents.T], axis=1))
    front = np.array([0.0, 0.0, 1.0]) - along[:, 2:] * along
    front = unit(front)
    return points, np.stack([along, front, np.cross(along, front)], axis=1)


CHEST, WAIST, HIPS = 0.90, 0.64, 0.12
"""Heights of the girths that are named, as fractions of the way from crotch to armpit: the bust, and the least and the
largest girth below. Waists of four bodies lie at .64 to .65, hips at 0 to .12."""
WIDEST = 1.22
"""Largest ratio of a factor to the mean of all, and least its inverse: beyond, a garment would look distorted."""


@dataclass(frozen=True)
class SizeFactors:
    """Ratios of the target body to the source.

    Attributes
    ----------
    named : dict of str to float
        Chest, waist, hips, arm and thigh (girths); trunk_length, arm_length, leg_length; height.
    trunk, legs, arms : ndarray (k,), (2, k), (2, k)
        Girth factors at the sections of the source's parts.
    lengths : ndarray (3,)
        Length factors of trunk, legs and arms.
    mean : float
        Geometric mean of the girths' and of the lengths' means.
    """

    named: dict[str, float]
    trunk: Floats
    legs: Floats
    arms: Floats
    lengths: Floats
    mean: float


def size_factors(source: BodyParts, target: BodyParts) -> SizeFactors:
    """Size factors from one body to another, smoothed along each part and bounded by WIDEST about their mean."""
    trunk = profile(source.trunk, target.trunk, heights_onto(source, target, source.trunk.levels))
    legs = np.mean(
        [profile(a, b, heights_onto(source, target, a.levels)) for a, b in zip(source.legs, target.legs, strict=True)],
        0,
    )
    arms = np.mean([profile(a, b, a.levels) for a, b in zip(source.arms, target.arms, strict=True)], axis=0)
    marks = [parts.landmarks for parts in (source, target)]
    lengths = np.array(
        [
            (marks[1]["neck"] - marks[1]["crotch"]) / (marks[0]["neck"] - marks[0]["crotch"]),
            marks[1]["crotch"] / marks[0]["crotch"],
            np.mean([arm_length(target, k) / arm_length(source, k) for k in (0, 1)]),
        ]
    )
    mean = float(np.sqrt(trunk.mean() * lengths[0]))
    trunk, legs, arms, lengths = (
        np.clip(values, mean / WIDEST, mean * WIDEST) for values in (trunk, legs, arms, lengths)
    )
    crotch, armpit = marks[0]["crotch"], marks[0]["armpit"]
    at = {
        name: float(np.interp(crotch + part * (armpit - crotch), source.trunk.levels, trunk))
        for name, part in (("chest", CHEST), ("waist", WAIST), ("hips", HIPS))
    }
    named = {
        **at,
        "thigh": float(legs[-3]),
        "arm": float(arms[-3]),
        "trunk_length": float(lengths[0]),
        "leg_length": float(lengths[1]),
        "arm_length": float(lengths[2]),
        "height": target.frame.height / source.frame.height,
    }
    return SizeFactors(named, trunk, np.stack([legs, legs]), np.stack([arms, arms]), lengths, mean)


def profile(tube: BodyTube, onto: BodyTube, levels: Floats) -> Floats:
    """Ratio of the girths at the sections of `tube`, whose levels on the other are `levels`, smoothed along it."""
    return np.asarray(smoothed(onto.at(levels, onto.girths) / tube.girths))


def arm_length(parts: BodyParts, side: int) -> float:
    """Length of the axis of an arm [m]."""
    return float(np.linalg.norm(np.diff(arm_axis(parts, side), axis=0), axis=1).sum())


def graded_metric(factors: SizeFactors, parts: BodyParts, body: Floats, points: Floats) -> Floats:
    """Metric tensors (k, 3, 3) of the graded garment at points (k, 3) of it on its own body, vertices `body` (n, 3).

    The squared length of a short vector e becomes e . C e, C the mean of g^2 I + (l^2 - g^2) a a over the parts, with
    girth factor g, length factor l and axis a of each.
    """
    local = parts.frame.local(points)
    used = np.flatnonzero(np.isfinite(parts.hands).all(axis=0))
    distance, near = cKDTree(body[used]).query(points, k=8)
    own = part_weights(parts, parts.frame.local(body))
    share = 1.0 / (distance + 0.02)
    share /= share.sum(axis=1, keepdims=True)
    near = used[near]
    weights = PartWeights(
        (own.trunk[near] * share).sum(axis=1),
        (own.legs[:, near] * share).sum(axis=2),
        (own.arms[:, near] * share).sum(2),
    )
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0]), local.shape)
    trunk = tensor(np.interp(local[:, 1], parts.trunk.levels, factors.trunk), factors.lengths[0], up)
    legs = np.stack(
        [tensor(np.interp(local[:, 1], parts.legs[k].levels, factors.legs[k]), factors.lengths[1], up) for k in (0, 1)]
    )
    arms = []
    for k in (0, 1):
        axis = arm_axis(parts, k)
        fraction = nearest_fraction(axis, local)
        girths = np.interp(fraction, parts.arms[k].levels, factors.arms[k])
        arms.append(tensor(girths, factors.lengths[2], framed(axis, fraction)[1][:, 0]))
    mixed = weights.combined(trunk, legs, np.stack(arms))
    axes = parts.frame.axes
    return np.asarray(np.einsum("ai,kab,bj->kij", axes, mixed, axes))


def tensor(girth: Floats, length: float, axis: Floats) -> Floats:
    """g^2 I + (l^2 - g^2) a a, (k, 3, 3)."""
    squared = girth[:, None, None] ** 2
    return squared * np.eye(3) + (length**2 - squared) * axis[:, :, None] * axis[:, None, :]
