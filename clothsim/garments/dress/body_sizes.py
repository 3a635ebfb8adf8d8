"""Factors of girth and length between two bodies along trunk, legs and arms, by a pattern maker's names."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError
from clothsim.engine import nearest
from clothsim.garments.inputs import Figure
from transfer.body_parts import BodyParts
from transfer.errors import TransferError
from transfer.part_warp import arm_axis
from transfer.size_factors import CHEST, HIPS, WAIST, SizeFactors, size_factors

LEVELS = {"hips": HIPS, "waist": WAIST, "chest": CHEST}
"""Heights of the named girths of the trunk, as fractions of the way from crotch to armpit."""
NAMES = (*LEVELS, "thigh", "arm", "trunk_length", "leg_length", "arm_length")
"""Factors by which a pattern is graded."""


@dataclass(frozen=True)
class BodySizes:
    """Factors from the body that a pattern was cut for to another.

    Attributes
    ----------
    parts : BodyParts
        Of the body that the pattern was cut for.
    factors : SizeFactors
        Factors along it.
    """

    parts: BodyParts
    factors: SizeFactors

    @property
    def named(self) -> dict[str, float]:
        """The factors by name, in the order of `NAMES`."""
        return {name: self.factors.named[name] for name in NAMES}

    def trunk_girth(self, heights: Floats) -> Floats:
        """Factor of girth of the trunk at heights (k,) [m] above the ground; below the crotch that at the crotch."""
        return np.interp(heights, self.parts.trunk.levels, self.factors.trunk)

    def leg_girth(self, heights: Floats) -> Floats:
        """Factor of girth of a leg at heights (k,) [m]; above the crotch that of the trunk, met smoothly below it."""
        crotch, levels = self.parts.landmarks["crotch"], self.parts.legs[0].levels
        thigh = 0.8 * crotch
        legs = np.interp(heights, levels, self.factors.legs.mean(axis=0))
        weight = np.clip((heights - thigh) / (crotch - thigh), 0.0, 1.0)
        return (1 - weight) * legs + weight * self.trunk_girth(heights)

    def arm_girth(self, below_shoulder: Floats) -> Floats:
        """Factor of girth of an arm at distances (k,) [m] from its shoulder."""
        fractions = 1.0 - below_shoulder / self.arm_length
        return np.interp(fractions, self.parts.arms[0].levels, self.factors.arms.mean(axis=0))

    @property
    def arm_length(self) -> float:
        """Length of an arm, shoulder to finger tip, of the body that the pattern was cut for [m]."""
        lengths = [np.linalg.norm(np.diff(arm_axis(self.parts, k), axis=0), axis=1).sum() for k in (0, 1)]
        return float(np.mean(lengths))

    def height(self, heights: Floats) -> Floats:
        """Heights (k,) [m] on the other body: by the factors of length of legs and trunk, above the neck as in it."""
        crotch = self.parts.landmarks["crotch"]
        trunk, legs, _ = self.factors.lengths
        return np.where(heights < crotch, legs * heights, legs * crotch + trunk * (heights - crotch))


def sizes_between(source: Figure, target: Figure, given: Mapping[str, float]) -> BodySizes:
    """Factors from one body to another; `given` ones, by name, replace those of the bodies.

    Raises
    ------
    InputError
        For a body that does not stand on two legs with two arms, an unknown name, and a factor that is not positive.
    """
    for name, factor in given.items():
        if name not in NAMES:
            raise InputError(
                f"There is no factor {name!r} to grade by.", f"{nearest(name, NAMES)} Known: {', '.join(NAMES)}."
            )
        as_positive(f"The factor {name}", factor)
    parts = []
    for body in (source, target):
        try:
            parts.append(body.parts)
        except TransferError as error:
            raise InputError(
                f"{body.name} has no girths to grade by: {error}", "Give the pattern as it is cut."
            ) from error
    return BodySizes(parts[0], _with(size_factors(*parts), parts[0], given))


def _with(factors: SizeFactors, parts: BodyParts, given: Mapping[str, float]) -> SizeFactors:
    """The factors with those that are given: girths of the trunk change between the named levels in proportion."""
    crotch, armpit = parts.landmarks["crotch"], parts.landmarks["armpit"]
    change = {name: given.get(name, factors.named[name]) / factors.named[name] for name in NAMES}
    at = [crotch + part * (armpit - crotch) for part in LEVELS.values()]
    trunk = np.exp(np.interp(parts.trunk.levels, at, np.log([change[name] for name in LEVELS])))
    lengths = np.array([change[f"{part}_length"] for part in ("trunk", "leg", "arm")])
    return replace(
        factors,
        named={**factors.named, **given},
        trunk=factors.trunk * trunk,
        legs=factors.legs * change["thigh"],
        arms=factors.arms * change["arm"],
        lengths=factors.lengths * lengths,
    )
