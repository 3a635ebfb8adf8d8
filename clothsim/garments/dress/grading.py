"""Grading of a pattern from the body that it was cut for to another.

Each panel is widened by the factor of girth at the height at which it is worn on the trunk, or along its limb, and
lengthened by the factor of length there, about the middle of the body or of the arm. Side seams, darts and waists
follow; where panels of two parts meet (armholes) both sides of a seam then get one factor, so that its ease stays what
it was.

The crotch seam of trousers runs down the front of the body, back between the legs and up behind. It grows as that line
on the body, whose depth need not grow with its girth, nor its rise with the length of the trunk. The line passes where
cloth can lie between the legs: above, thighs that touch leave no room for it. Trousers are lengthened above that level
by the factor that this takes, and below it as the legs are.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from clothsim import Pattern
from clothsim.base.arrays import Floats, as_positive
from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.garments.dress.limbs import form_a_tube, height_of_parting
from clothsim.garments.dress.placement import ACROSS, chosen_origin, height_of_origin, is_of_arm, is_of_leg
from clothsim.garments.dress.worn_levels import DRAWN, Levels, WornLevels
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns import Panel, PlaneMap, mesh_pattern, seams_alike
from transfer.body_parts import BodyParts
from transfer.errors import TransferError
from transfer.part_warp import CHEST, HIPS, WAIST, SizeFactors, arm_axis, size_factors

LEVELS = {"hips": HIPS, "waist": WAIST, "chest": CHEST}
"""Heights of the named girths of the trunk, as fractions of the height from crotch to armpit."""
TOP_OF_RISE = 0.45
"""Height of the upper edge of trousers, as such a fraction."""
NAMES = (*LEVELS, "thigh", "arm", "trunk_length", "rise", "leg_length", "arm_length")
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
    parting : float
        Height on it at which cloth can lie between the thighs [m].
    lower : float
        Ratio of the heights of that level and of the crotch, of the other body over this one's.
    """

    parts: BodyParts
    factors: SizeFactors
    parting: float
    lower: float

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

    def height_on_trousers(self, heights: Floats) -> Floats:
        """The same of trousers: below the level at which the thighs part by that of the legs, above by the rise."""
        below, above = np.minimum(heights, self.parting), np.maximum(heights - self.parting, 0.0)
        return self.lower * float(self.factors.lengths[1]) * below + self.factors.named["rise"] * above


def sizes_between(source: BodyMesh, target: BodyMesh, given: Mapping[str, float]) -> BodySizes:
    """Factors from one body to another; `given` ones, by name, replace those of the bodies.

    Raises
    ------
    InputError
        For a body that does not stand on two legs with two arms, an unknown name, and a factor that is not positive.
    """
    for name, factor in given.items():
        if name not in NAMES:
            raise InputError(
                f"There is no factor {name!r} to grade by.", f"{did_you_mean(name, NAMES)} Known: {', '.join(NAMES)}."
            )
        as_positive(f"The factor {name}", factor)
    parts, partings = [], []
    for body in (source.bare, target.bare):
        try:
            parts.append(body.parts)
            partings.append(height_of_parting(body))
        except TransferError as error:
            raise InputError(
                f"{body.name} has no girths to grade by: {error}", "Give the pattern as it is cut."
            ) from error
    factors = size_factors(*parts)
    (down, depth), (other_down, other_depth) = (_crotch_line(*each) for each in zip(parts, partings, strict=True))
    rise = (other_down + other_depth - float(factors.trunk[0]) * depth) / down
    named = {**factors.named, "rise": rise}
    # with the factors that are given: girths of the trunk change between the named levels in proportion
    crotch, armpit = parts[0].landmarks["crotch"], parts[0].landmarks["armpit"]
    change = {name: given.get(name, named[name]) / named[name] for name in NAMES}
    at = [crotch + part * (armpit - crotch) for part in LEVELS.values()]
    trunk = np.exp(np.interp(parts[0].trunk.levels, at, np.log([change[name] for name in LEVELS])))
    factors = replace(
        factors,
        named={**named, **given},
        trunk=factors.trunk * trunk,
        legs=factors.legs * change["thigh"],
        arms=factors.arms * change["arm"],
        lengths=factors.lengths * np.array([change[f"{part}_length"] for part in ("trunk", "leg", "arm")]),
    )
    own, other = (level / each.landmarks["crotch"] for level, each in zip(partings, parts, strict=True))
    return BodySizes(parts[0], factors, partings[0], other / own)


def _crotch_line(parts: BodyParts, parting: float) -> tuple[float, float]:
    """Length of a line down front and back of a body from the top of trousers to a level, and its depth there [m].

    A panel grows along the first by the factor of the rise, and along the second by that of the girth.
    """
    crotch, armpit, trunk = parts.landmarks["crotch"], parts.landmarks["armpit"], parts.trunk
    heights = np.linspace(trunk.levels[0], crotch + TOP_OF_RISE * (armpit - crotch), 24)
    middle, half = trunk.at(heights, trunk.centres)[:, 2], trunk.at(heights, trunk.extents)[:, 1]
    down = sum(float(np.hypot(np.diff(heights), np.diff(line)).sum()) for line in (middle + half, middle - half))
    return down + 2 * (float(heights[0]) - parting), 2 * float(half[0])


LOW = 0.02
"""Least distance by which a crotch is lowered that a note names [m]."""
LEVEL = 0.3
"""Part of the direction of the trunk or the limb in the plane of a panel below which it lies across it: no direction
of the panel is along the body, and it grows alike in both."""


@dataclass(frozen=True)
class Grading:
    """A graded pattern.

    Attributes
    ----------
    pattern : Pattern
        The pattern for the other body.
    cut_for : str
        Name of the body that the pattern was cut for.
    factors : mapping of str to float
        Factors of girth and length by name.
    seams : mapping of str to (float, float)
        Factor of the length of both sides of each seam.
    moved : float
        Largest displacement of a corner that made the seams alike [m].
    before : float
        Largest difference of both factors of a seam before that.
    origin : str
        Level y = 0 of both patterns, "floor" or "waist".
    worn : WornLevels
        Heights at which the panels are worn, by which they were widened.
    dropped : float
        Distance by which the crotch of trousers lies lower than that of the body, for its thighs touch above [m].
    crotch : float
        Height of that crotch; inf where it is that of the body [m].
    """

    pattern: Pattern
    cut_for: str
    factors: Mapping[str, float]
    seams: Mapping[str, tuple[float, float]]
    moved: float
    before: float
    origin: str
    worn: WornLevels = DRAWN
    dropped: float = 0.0
    crotch: float = np.inf

    @property
    def mismatch(self) -> tuple[float, str]:
        """Largest difference of both factors of a seam, and its name."""
        found = [(abs(first - second), name) for name, (first, second) in self.seams.items()]
        return max(found, default=(0.0, "none"))

    @property
    def notes(self) -> tuple[str, ...]:
        """Factors and the mismatch of the seams in words."""
        named = ", ".join(f"{name.replace('_', ' ')} {factor:.3f}" for name, factor in self.factors.items())
        largest, name = self.mismatch
        seams = (
            f"both sides of every seam have one factor; corners moved by up to {1e3 * self.moved:.2g} mm for it, as the"
            f" factors differed by {self.before:.2g}"
        )
        if largest > 1e-6:
            seams = f"the two sides of {name} are graded by factors that differ by {largest:.2g}"
        low = f"graded: the crotch lies {1e3 * self.dropped:.0f} mm lower, as the thighs leave no room for cloth above"
        return (
            f"graded from {self.cut_for}: {named}",
            self.worn.note,
            f"graded: {seams}",
            *([low] if self.dropped > LOW else []),
        )

    def as_dict(self) -> dict[str, Any]:
        """Entries in summary.json."""
        largest, name = self.mismatch
        seams = {"largest": largest, "seam": name, "before": self.before, "moved": self.moved}
        return {"cut_for": self.cut_for, "factors": dict(self.factors), "seam_mismatch": seams}


def graded(
    pattern: Pattern,
    source: BodyMesh,
    target: BodyMesh,
    origin: str = "auto",
    factors: Mapping[str, float] | None = None,
    worn: WornLevels = DRAWN,
) -> Grading:
    """Grade a pattern.

    Parameters
    ----------
    pattern : Pattern
        Pattern as it is placed round `source`.
    source, target : BodyMesh
        The body that it was cut for, and the other one.
    origin : str
        Level y = 0 of the pattern (see `placement.placed_on`).
    factors : mapping of str to float, optional
        Factors by name in place of those between the bodies.
    worn : WornLevels
        Heights at which the panels are worn, by which they are widened.

    Raises
    ------
    InputError
        As `sizes_between`.
    """
    sizes = sizes_between(source, target, factors or {})
    heights = np.concatenate([panel.placed(panel.vertices)[:, 1] for panel in pattern.panels.values()])
    origin = chosen_origin(heights, origin)
    levels = [height_of_origin(body, origin) for body in (source, target)]
    middle = np.mean([panel.placed(panel.vertices).mean(axis=0) for panel in pattern.panels.values()], axis=0)
    panels, trousers = {}, _panels_of_trousers(pattern)
    for name, panel in pattern.panels.items():
        if is_of_arm(panel):
            panels[name] = _grade_along_arm(panel, pattern, sizes, levels, float(middle[0]))
        else:
            heights_of = sizes.height_on_trousers if name in trousers else sizes.height
            panels[name] = _grade_along_trunk(panel, sizes, levels, heights_of, worn.of(name))
    legs = float(sizes.factors.lengths[1])
    dropped = sizes.parting * (1 - sizes.lower) * legs if trousers else 0.0
    crotch = sizes.parting * sizes.lower * legs if dropped > LOW else np.inf
    alike = seams_alike(replace(pattern, panels=panels), pattern)
    made = alike.pattern, source.name, sizes.named, alike.factors, alike.moved, alike.before
    return Grading(*made, origin, worn, dropped, crotch)


def sewn_together(pattern: Pattern, names: Collection[str]) -> list[set[str]]:
    """Sets of those panels that are joined by stitches between them."""
    pieces = [{name} for name in sorted(names)]
    for stitch in pattern.stitches:
        sides = {side.panel for side in stitch.sides}
        if sides <= set(names):
            joined = [piece for piece in pieces if piece & sides]
            pieces = [piece for piece in pieces if not piece & sides] + [set().union(*joined)]
    return pieces


COARSE = 0.05
"""Distance of neighbouring vertices at which it is seen what goes round a leg [m]."""


def _panels_of_trousers(pattern: Pattern) -> set[str]:
    """Names of the panels that go round one leg; the gores of a skirt do not."""
    if not any(is_of_leg(panel) for panel in pattern.panels.values()):
        return set()
    mesh, found = mesh_pattern(pattern, COARSE), set()
    for side in (1.0, -1.0):
        names = {
            name
            for name, panel in pattern.panels.items()
            if is_of_leg(panel) and (side * panel.placed(panel.vertices)[:, 0]).min() > -ACROSS
        }
        for piece in sewn_together(pattern, names):
            found |= piece if form_a_tube(mesh, sorted(piece), mesh.up) else set()
    return found


def _grade_along_trunk(
    panel: Panel,
    sizes: BodySizes,
    levels: list[float],
    heights_of: Levels,
    worn: Levels,
) -> Panel:
    """Panel of the trunk or of a leg, graded about the middle of the body.

    heights_of: heights on the other body of those on this one; worn: those at which the panel is worn, by which its
    girth is graded, of those at which it is drawn.
    """
    girth_at = sizes.leg_girth if is_of_leg(panel) else sizes.trunk_girth

    def girth(drawn: Floats) -> Floats:
        return girth_at(worn(drawn))

    upward = panel.matrix[1, :2]
    slope = float(np.linalg.norm(upward))
    middle = panel.vertices.mean(axis=0)
    if slope < LEVEL:
        height = panel.placed(middle[None])[0, 1] + levels[0]
        factor = float(girth(np.array([height]))[0])
        image = PlaneMap(middle, np.array([0.0, 1.0]), lambda t: np.full(len(t), factor), lambda t: factor * t)
    else:
        along = upward / slope
        across = np.array([along[1], -along[0]])
        aside = float(panel.placed(middle[None])[0] @ panel.matrix[:, :2] @ across)
        middle = middle - aside * across  # where the plane is nearest to the vertical axis
        height = float(panel.placed(middle[None])[0, 1] + levels[0])
        start = heights_of(np.array([height]))
        image = PlaneMap(
            middle,
            along,
            lambda t: girth(height + slope * t),
            lambda t: (heights_of(height + slope * t) - start) / slope,
        )
    before = panel.placed(middle[None])[0]
    wider = max(1.0, float(girth(np.array([height]))[0]))
    above = float(heights_of(np.array([height]))[0]) - levels[1]
    return _translate_to(image.panel(panel), middle, np.array([wider * before[0], above, wider * before[2]]))


def _grade_along_arm(panel: Panel, pattern: Pattern, sizes: BodySizes, levels: list[float], middle: float) -> Panel:
    """Panel of a sleeve, graded along the line from the seams of the sleeve with the trunk to its free edges."""
    side = panel.placed(panel.vertices)[:, 0].mean() > middle
    sleeve = {
        name: each
        for name, each in pattern.panels.items()
        if is_of_arm(each) and (each.placed(each.vertices)[:, 0].mean() > middle) == side
    }
    sewn: set[tuple[str, int]] = set()
    roots, tips = [], []  # middles of its seams with others, and of its free edges, each (3,) [m]
    for stitch in pattern.stitches:
        for here, there in (stitch.sides, stitch.sides[::-1]):
            sewn.add((here.panel, here.edge))
            if here.panel in sleeve and there.panel not in sleeve:
                roots.append(_edge_middle(sleeve[here.panel], here.edge))
    for name, each in sleeve.items():
        tips += [_edge_middle(each, k) for k in range(len(each.edges)) if (name, k) not in sewn]
    if roots and tips:
        root, tip = np.mean(roots, axis=0), np.mean(tips, axis=0)
    else:
        points = np.concatenate([each.placed(each.vertices) for each in sleeve.values()])
        order = np.argsort(np.abs(points[:, 0]))
        root, tip = points[order[0]], points[order[-1]]
    shoulder = float(sizes.height(np.array([root[1] + levels[0]]))[0]) - levels[1]
    wider = float(sizes.trunk_girth(np.array([root[1] + levels[0]]))[0])
    moved = np.array([wider * root[0], shoulder, wider * root[2]]) - root
    along = (tip - root) / np.linalg.norm(tip - root) @ panel.matrix[:, :2]
    slope, length = float(np.linalg.norm(along)), float(sizes.factors.lengths[2])
    origin = (root - panel.translation) @ panel.matrix[:, :2]
    if slope < LEVEL:
        factor = float(sizes.factors.named["arm"])
        image = PlaneMap(origin, np.array([0.0, 1.0]), lambda t: np.full(len(t), factor), lambda t: factor * t)
    else:
        image = PlaneMap(origin, along / slope, lambda t: sizes.arm_girth(slope * t), lambda t: length * t)
    before = panel.placed(origin[None])[0]
    off = (before - root) * max(1.0, float(sizes.factors.named["arm"]))
    return _translate_to(image.panel(panel), origin, root + moved + off)


def _edge_middle(panel: Panel, edge: int) -> Floats:
    return np.asarray(panel.placed(panel.edge_points(edge, np.array([0.5])))[0], np.float64)


def _translate_to(panel: Panel, point: Floats, at: Floats) -> Panel:
    """Panel translated so that `point` (2,) of its plane is at `at` (3,) [m]."""
    return replace(panel, translation=panel.translation + at - panel.placed(point[None])[0])
