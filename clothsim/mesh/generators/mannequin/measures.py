"""Body measures of the mannequin, and the figure that has given ones.

Girths are those of a tape: the length of the convex hull of a plane section (ISO 8559-1, in its words below). Sections
lie at fixed places of the template and move with it, so that a girth is a smooth function of the proportions. Each
measure has its factor; those of the given measures m_k minimise, within their bounds,

    sum ((m_k(p) - wanted_k) / m_k(1))^2,

the others are 1: a measure that is not given stays what it is at that height, but for what the others take along.
"""

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import ConvexHull

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.base.inputs import did_you_mean
from clothsim.base.triangles import half_edges
from clothsim.keys.generator_keys import Mannequin, Proportions
from clothsim.keys.schema import keys_of
from clothsim.mesh.generators.mannequin.generator import (
    CALF,
    CROTCH,
    JOINT_POSITIONS,
    JOINTS,
    LEVELS,
    joint,
    mannequin,
    template,
    warped,
)

_TRUNK = ("pelvis", "spine", "chest", "neck", "left_hip", "right_hip")
_SECTIONS: Mapping[str, tuple[tuple[str, ...], float]] = {
    "neck": (("neck", "chest", "head"), 1.47),
    "chest": (_TRUNK, LEVELS["chest"]),
    "waist": (_TRUNK, LEVELS["waist"]),
    "hips": (_TRUNK, LEVELS["hips"]),
    "thigh": (("left_hip",), 0.72),
    "calf": (("left_knee",), CALF[0]),
}
"""Joints that move the part of the body whose level section is measured, and the height of that on the template [m]."""
_UPPER_ARM = 0.25
"""Fraction of the way from shoulder to wrist at which the upper arm is measured, across it."""

MEASURES: Mapping[str, str] = {
    "height": "from the soles to the crown",
    "neck": "neck girth",
    "shoulder_width": "between the shoulder joints",
    "chest": "bust girth",
    "waist": "waist girth",
    "hips": "hip girth",
    "upper_arm": "upper arm girth",
    "arm_length": "from the shoulder joint to the wrist",
    "thigh": "thigh girth, under the crotch",
    "calf": "calf girth",
    "inside_leg": "from the ground to the crotch",
    "waist_height": "from the ground to the waist",
}
"""Measures [m] by name, and what each is."""
ABSURD = 3.0
"""Ratio to the usual measure, or of that to it, from which one is taken for a number in another unit."""
_FACTORS = {name: name for name in MEASURES if name in keys_of(Proportions)} | {
    "upper_arm": "arm_girth",
    "inside_leg": "leg_length",
}
"""The factor of each measure."""


@dataclass(frozen=True)
class MeasuredBody:
    """A body of given measures.

    Attributes
    ----------
    proportions : Proportions
        Keys of the mannequin in a scene.
    wanted : dict of str to float
        Measures as given [m].
    measures : dict of str to float
        All measures of the body [m].
    at_bounds : tuple of str
        Proportions at an end of their range, beyond which the surface would fold.
    """

    proportions: Proportions
    wanted: dict[str, float]
    measures: dict[str, float]
    at_bounds: tuple[str, ...]

    @property
    def residuals(self) -> dict[str, float]:
        """Measure of the body minus the given measure, for each [m]."""
        return {name: self.measures[name] - value for name, value in self.wanted.items()}

    @property
    def keys(self) -> dict[str, float]:
        """Proportions that are not the usual ones, for `[[body]] mesh = "mannequin"`."""
        usual = asdict(Proportions())
        return {name: value for name, value in asdict(self.proportions).items() if value != usual[name]}

    def mesh(self, pose: str = Mannequin.pose) -> tuple[Floats, Ints]:
        """Positions (n, 3) [m] and triangles (m, 3) in a named pose; z is up."""
        return mannequin(pose, **asdict(self.proportions))


def measured_body(**wanted: float) -> MeasuredBody:
    """Body of given measures: the mannequin, its proportions fitted by least squares.

    Parameters
    ----------
    **wanted : float
        Measures by the names of `MEASURES` [m]. `height` is met exactly; default: that of the mannequin.

    Raises
    ------
    InputError
        For an unknown measure, a measure that is not a positive length or is `ABSURD` times the usual one at that
        height, or a height out of range.

    Examples
    --------
    >>> body = measured_body(height=1.68, chest=0.96, inside_leg=0.76)
    >>> {name: round(1e3 * left, 1) + 0.0 for name, left in body.residuals.items()}
    {'height': 0.0, 'chest': 0.0, 'inside_leg': 0.0}
    """
    for name, value in wanted.items():
        if name not in MEASURES:
            known = f"Known: {', '.join(MEASURES)}."
            raise InputError(f"There is no measure {name!r}.", did_you_mean(name, MEASURES) or known)
        wanted[name] = as_positive(name, value)
    _refuse_absurd(wanted, {"height": Proportions.height})
    height = Proportions(height=wanted.get("height", Proportions.height)).height
    aims = [name for name in wanted if name != "height"]
    free = [name for name in keys_of(Proportions) if name in {_FACTORS[aim] for aim in aims}]
    usual = measures_of(Proportions(height=height))
    _refuse_absurd(wanted, usual)

    def residuals(factors: Floats) -> Floats:
        found = measures_of(_proportions(height, free, factors), aims)
        return np.array([(found[name] - wanted[name]) / usual[name] for name in aims])

    bounds = [keys_of(Proportions)[name].key for name in free]
    low, high = np.array([(key.least, key.most) for key in bounds], np.float64).reshape(-1, 2).T
    fitted = np.ones(len(free))
    if aims:
        fitted = least_squares(residuals, fitted, bounds=(low, high), xtol=1e-7, max_nfev=100).x
        fitted = np.clip(np.round(fitted, 5), low, high)
    proportions = _proportions(height, free, fitted)
    ends = np.minimum(fitted - low, high - fitted) < 1e-3 * (high - low)
    at_bounds = tuple(name for name, end in zip(free, ends, strict=True) if end)
    return MeasuredBody(proportions, wanted, measures_of(proportions), at_bounds)


def _refuse_absurd(wanted: Mapping[str, float], usual: Mapping[str, float]) -> None:
    """InputError for a measure that is far from the usual one [m]."""
    for name in usual.keys() & wanted.keys():
        if not usual[name] / ABSURD <= wanted[name] <= usual[name] * ABSURD:
            raise InputError(
                f"{name} is {wanted[name]:g} m, and {usual[name]:.3g} m is usual.",
                f"Give {usual[name] / ABSURD:.2g} to {usual[name] * ABSURD:.2g} m; write its unit: 96cm, 960mm.",
            )


def _proportions(height: float, names: list[str], factors: Floats) -> Proportions:
    return Proportions(height=height, **dict(zip(names, map(float, factors), strict=True)))


def measures_of(proportions: Proportions, names: Collection[str] = tuple(MEASURES)) -> dict[str, float]:
    """Measures of the mannequin of some proportions [m]."""
    joints = warped(JOINT_POSITIONS, np.eye(len(JOINTS)), proportions)
    shoulder, other, wrist = (joints[joint(name)] for name in ("left_shoulder", "right_shoulder", "left_wrist"))
    marks = np.array([[0.0, 0.0, CROTCH], [0.0, 0.0, LEVELS["waist"]]])
    crotch, waist = warped(marks, np.eye(len(JOINTS))[[joint("pelvis")] * 2], proportions)[:, 2]
    measures = {
        "height": proportions.height,
        "shoulder_width": float(np.linalg.norm(shoulder - other)),
        "arm_length": float(np.linalg.norm(wrist - shoulder)),
        "inside_leg": float(crotch),
        "waist_height": float(waist),
    }
    for name in (name for name in names if name not in measures):  # girths of sections, as a tape has them
        section = _sections()[name]
        points = warped(section.points, section.weights, proportions)
        flat = (section.axes @ points.T).T
        measures[name] = float(ConvexHull(flat[:, :2]).area)  # of a plane hull: its length
    return {name: measures[name] for name in names}


@dataclass(frozen=True)
class _Section:
    """Points (k, 3) where a plane cuts edges of the template, their weights (k, j), axes (2, 3) in the plane."""

    points: Floats
    weights: Floats
    axes: Floats


@lru_cache(maxsize=1)
def _sections() -> dict[str, _Section]:
    """The sections of the template, made once."""
    level = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    made = {name: _cut(parts, np.array([0.0, 0.0, z]), level) for name, (parts, z) in _SECTIONS.items()}
    shoulder, wrist = JOINT_POSITIONS[joint("left_shoulder")], JOINT_POSITIONS[joint("left_wrist")]
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    across = np.stack([[0.0, 1.0, 0.0], np.cross(along, (0.0, 1.0, 0.0))])
    middle = shoulder + _UPPER_ARM * (wrist - shoulder)
    arm = ("left_shoulder", "left_elbow")
    return made | {"upper_arm": _cut(arm, middle, across)}


def _cut(parts: tuple[str, ...], point: Floats, axes: Floats) -> _Section:
    """The section through a point, along axes (2, 3), of what `parts` move for the most."""
    made = template()
    own = np.isin(made.weights.argmax(axis=1), [joint(name) for name in parts])
    values = (made.positions - point) @ np.cross(*axes)
    edges = np.sort(half_edges(made.triangles), axis=1)
    edges = np.unique(edges[own[edges].all(axis=1) & ((values[edges] > 0).sum(axis=1) == 1)], axis=0)
    a, b = values[edges].T
    t = (a / (a - b))[:, None]
    points, weights = ((1 - t) * each[edges[:, 0]] + t * each[edges[:, 1]] for each in (made.positions, made.weights))
    return _Section(points, weights, axes)
