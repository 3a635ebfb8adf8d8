"""Size factors between two bodies: ratios of girths and lengths of trunk, legs and arms, as a pattern maker grades by.

A garment graded by them is as wide about each part of the other body, and as long along it, as it was on its own.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from transfer.body_parts import BodyParts, Tube
from transfer.part_warp import PartWeights, arm_axis, framed, heights_onto, nearest_fraction, part_weights
from transfer.triangle_surface import Floats

CHEST, WAIST, HIPS = 0.80, 0.45, 0.12
"""Heights of the girths that are named, as fractions of the way from crotch to armpit."""
WIDEST = 1.22
"""Largest ratio of a factor to the mean of all, and least its inverse: beyond, a garment would look distorted."""
BROAD = 4
"""Times that a profile of factors is averaged with its neighbours."""


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
        [
            profile(a, b, heights_onto(source, target, a.levels))
            for a, b in zip(*both_legs(source, target), strict=True)
        ],
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


def both_legs(source: BodyParts, target: BodyParts) -> tuple[tuple[Tube, Tube], tuple[Tube, Tube]]:
    """Legs of both bodies."""
    return source.legs, target.legs


def profile(tube: Tube, onto: Tube, levels: Floats) -> Floats:
    """Ratio of the girths at the sections of `tube`, whose levels on the other are `levels`, averaged along it."""
    ratio = onto.at(levels, onto.girths) / tube.girths
    for _ in range(BROAD):
        padded = np.concatenate([ratio[:1], ratio, ratio[-1:]])
        ratio = (padded[:-2] + 2.0 * padded[1:-1] + padded[2:]) / 4.0
    return np.asarray(ratio)


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
