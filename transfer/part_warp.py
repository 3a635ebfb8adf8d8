"""Warp of one body towards another part by part: pose, proportions and girths of trunk, legs and arms.

Each part is mapped by the sections along it: axis to axis, and across it by the ratio of the extents. The maps are
blended where parts meet. It brings a body of any pose, size and orientation near another one; a registration
(`overlay`) then finds what is left.
"""

from dataclasses import dataclass

import numpy as np

from transfer.body_parts import BodyParts, Tube
from transfer.triangle_surface import Floats, unit

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


def upright(source: BodyParts, target: BodyParts, tube: Tube, onto: Tube, local: Floats) -> Floats:
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


def arm_ratio(source: Tube, target: Tube) -> Floats:
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
