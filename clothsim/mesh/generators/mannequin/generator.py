"""Mannequin: a shipped template mesh, warped to proportions and posed by linear blend skinning.

z is up, the feet are on z = 0, the face looks along -y, and so the left hand is at +x; the rest pose is an A.
`template.npz`, a closed triangle surface with skinning weights in the rest pose, is shipped with the package.
`python -m tests.benchmarks.make_mannequin` makes it from the limbs that the garments are cut from (`body_limbs`); a
test compares the two.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from clothsim.base.arrays import Floats, Ints, as_vector
from clothsim.base.errors import InputError
from clothsim.keys.generator_keys import Mannequin, Proportions
from clothsim.keys.key_table import by_keywords
from clothsim.mesh.body import rotation_matrix

ARM_FALL = np.radians(50.0)
"""Angle of the arms of the A-pose below the horizontal."""
ARM = np.array([np.cos(ARM_FALL), 0.0, -np.sin(ARM_FALL)])
"""Direction of the left arm, from the shoulder to the hand."""

_SHOULDER = np.array([0.166, 0.014, 1.362])
_HIP, _ANKLE = np.array([0.086, 0.004, 0.875]), np.array([0.108, 0.016, 0.075])
_LEFT: dict[str, tuple[str, Floats]] = {
    "shoulder": ("chest", _SHOULDER),
    "elbow": ("shoulder", _SHOULDER + 0.27 * ARM),
    "wrist": ("elbow", _SHOULDER + 0.51 * ARM),
    "hip": ("pelvis", _HIP),
    "knee": ("hip", 0.5 * (_HIP + _ANKLE)),
    "ankle": ("knee", _ANKLE),
}
_MIDDLE: dict[str, tuple[str, Floats]] = {
    "pelvis": ("", np.array([0.0, 0.0, 0.930])),
    "spine": ("pelvis", np.array([0.0, 0.008, 1.050])),
    "chest": ("spine", np.array([0.0, 0.012, 1.180])),
    "neck": ("chest", np.array([0.0, 0.022, 1.410])),
    "head": ("neck", np.array([0.0, 0.008, 1.500])),
}


def mirrored(points: Floats) -> Floats:
    """Return `points (..., 3)` mirrored about the plane x = 0."""
    return points * (-1.0, 1.0, 1.0)


def _joints() -> dict[str, tuple[str, Floats]]:
    table = dict(_MIDDLE)
    for side in ("left", "right"):
        for name, (parent, position) in _LEFT.items():
            own = parent if parent in _MIDDLE else f"{side}_{parent}"
            table[f"{side}_{name}"] = (own, position if side == "left" else mirrored(position))
    return table


_TABLE = _joints()
JOINTS: tuple[str, ...] = tuple(_TABLE)
"""Names of the joints; a parent comes before its children."""
PARENTS: Ints = np.array([JOINTS.index(parent) if parent else -1 for parent, _ in _TABLE.values()], np.int64)
"""Parent of each joint (j,), -1 for the root."""
JOINT_POSITIONS: Floats = np.array([position for _, position in _TABLE.values()])
"""Position of each joint in the rest pose (j, 3) [m]."""


def joint(name: str) -> int:
    """Return the row of the joint `name`."""
    return JOINTS.index(name)


def other_side(name: str) -> str:
    """Return the name of the joint on the other side; that of a middle joint is its own."""
    if name.startswith("left_"):
        return "right_" + name.removeprefix("left_")
    return "left_" + name.removeprefix("right_") if name.startswith("right_") else name


TEMPLATE_HEIGHT = 1.69085
"""From the soles to the crown of the template [m]; a test measures it."""
TEMPLATE_SOLE = 0.00413
"""Height of its lowest point [m]."""
LEVELS = {
    "ankle": 0.075,
    "knee": 0.475,
    "hips": 0.880,
    "waist": 1.065,
    "chest": 1.225,
    "shoulders": 1.362,
    "neck": 1.43,
}
"""Heights on the template [m] at which the factors of the proportions hold, with smooth steps in between."""
ARMS_WITH_CHEST = 0.8
"""Fraction of the growth of the chest that the shoulders follow, so that the arms stay outside of it."""
TRUNK_AXIS = 0.006
"""y of the axis from which depths grow [m]."""
CROTCH = 0.7415
"""Height of the crotch, above which longer legs shorten the trunk [m]."""
LENGTHS_UP_TO = 1.40
"""Height from which on the lengths of legs and trunk move nothing [m]."""
THIGH, CALF = (0.70, 0.17), (0.36, 0.20)
"""Height of the thigh and of the calf [m], and the distance from it at which their factors end."""


def warped(points: Floats, weights: Floats, proportions: Proportions) -> Floats:
    """Warp `points (n, 3)` of the template [m] with skinning `weights (n, j)` to proportions, in the rest pose.

    Trunk and legs grow about the middle plane by factors of their height above the ground, arms about their axes; head,
    hands and feet keep their shape. The weights blend these maps; then all is scaled to their height.
    """
    moved = np.zeros_like(points)
    for name, weight in zip(JOINTS, weights.T, strict=True):
        near = np.flatnonzero(weight)
        moved[near] += weight[near, None] * _choose_warp(name)(points[near], proportions)
    return (moved - (0.0, 0.0, TEMPLATE_SOLE)) * (proportions.height / TEMPLATE_HEIGHT)


def warped_joints(proportions: Proportions) -> Floats:
    """Return the joints of a mannequin, (j, 3) [m]."""
    return warped(JOINT_POSITIONS, np.eye(len(JOINTS)), proportions)


def _choose_warp(name: str) -> Callable[[Floats, Proportions], Floats]:
    """Warp of the part of the body that the joint `name` moves."""
    part = name.removeprefix("left_").removeprefix("right_")
    side = name.removesuffix(part)
    if part in ("shoulder", "elbow"):
        return partial(_arm, side=side)
    if part == "wrist":
        return partial(_follow_joint, joint(name), partial(_arm, side=side))
    if part in ("neck", "head"):
        return _neck if part == "neck" else partial(_follow_joint, joint("neck"), _column)
    return partial(_follow_joint, joint(name), _column) if part == "ankle" else _column


def _follow_joint(
    row: int, warp: Callable[[Floats, Proportions], Floats], points: Floats, proportions: Proportions
) -> Floats:
    """`points` translated with the joint in row `row`."""
    return points + warp(JOINT_POSITIONS[row : row + 1], proportions) - JOINT_POSITIONS[row]


def _neck(points: Floats, proportions: Proportions) -> Floats:
    """Neck: it moves with its joint, its section times `neck` up to the chin."""
    moved = _follow_joint(joint("neck"), _column, points, proportions)
    if proportions.neck != 1:
        axis = _follow_joint(joint("neck"), _column, JOINT_POSITIONS[joint("neck")][None], proportions)[0]
        chin = np.clip((points[:, 2] - 1.47) / 0.07, 0.0, 1.0)
        factor = proportions.neck + (1 - proportions.neck) * chin * chin * (3 - 2 * chin)
        moved[:, :2] = axis[:2] + factor[:, None] * (moved[:, :2] - axis[:2])
    return moved


def _column(points: Floats, proportions: Proportions) -> Floats:
    """Trunk and legs: x and y times factors of z, calves about their own axis; z by the length of the legs."""
    shoulders = proportions.shoulder_width + ARMS_WITH_CHEST * (proportions.chest - 1)
    wide = [
        proportions.limb_girth,
        proportions.limb_girth,
        proportions.hips,
        proportions.waist,
        proportions.chest,
        shoulders,
        proportions.neck,
    ]
    deep = [*wide[:5], 0.5 * (1 + proportions.chest), proportions.neck]
    z = points[:, 2]
    thigh = 1 + (proportions.thigh - 1) * _bump(z, *THIGH)
    moved = points.copy()
    moved[:, 0] *= _steps(z, wide) * thigh
    moved[:, 1] = TRUNK_AXIS + (points[:, 1] - TRUNK_AXIS) * _steps(z, deep) * thigh
    if proportions.calf != 1:
        down = (_HIP[2] - z) / (_HIP[2] - _ANKLE[2])
        axis = np.sign(points[:, 0]) * (_HIP[0] + down * (_ANKLE[0] - _HIP[0]))
        factor = 1 + (proportions.calf - 1) * _bump(z, *CALF)
        moved[:, 0] += (factor - 1) * (points[:, 0] - axis) * _steps(z, wide)
        moved[:, 1] += (factor - 1) * (points[:, 1] - _ANKLE[1]) * _steps(z, deep)
    if (proportions.leg_length, proportions.waist_height) != (1, 1):
        # the crotch at leg_length CROTCH, the waist at waist_height of what follows from that
        ankle, waist, top = LEVELS["ankle"], LEVELS["waist"], LENGTHS_UP_TO
        crotch = proportions.leg_length * CROTCH
        mid = proportions.waist_height * (crotch + (waist - CROTCH) / (top - CROTCH) * (top - crotch))
        knots, onto = (ankle, CROTCH, waist, top), (ankle, crotch, mid, top)
        inside = (z > ankle) & (z < top)
        moved[:, 2] = np.where(inside, PchipInterpolator(knots, onto)(np.clip(z, ankle, top)), z)
    return moved


def _bump(z: Floats, middle: float, reach: float) -> Floats:
    """1 at a height, 0 from a distance of it on, smooth (n,)."""
    t = np.clip(1 - np.abs(z - middle) / reach, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _arm(points: Floats, proportions: Proportions, side: str) -> Floats:
    """Arm: moved with its shoulder, its length times arm_length, its section times limb_girth and arm_girth.

    The factor arm_girth ends at the wrist, as hands keep their shape.
    """
    shoulder, wrist = JOINT_POSITIONS[joint(f"{side}shoulder")], JOINT_POSITIONS[joint(f"{side}wrist")]
    along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    offset = points - shoulder
    axial = (offset @ along)[:, None] * along
    fraction = np.clip(2 * (offset @ along) / np.linalg.norm(wrist - shoulder) - 1, 0.0, 1.0)  # from the elbow on
    upper = 1 + (proportions.arm_girth - 1) * (1 - fraction * fraction * (3 - 2 * fraction))[:, None]
    section = proportions.limb_girth * upper * (offset - axial)
    return _column(shoulder[None], proportions) + proportions.arm_length * axial + section


def _steps(z: Floats, factors: list[float]) -> Floats:
    """Factors at LEVELS, with smooth steps in between (n,)."""
    levels, values = np.array(list(LEVELS.values())), np.array(factors)
    k = np.clip(np.searchsorted(levels, z) - 1, 0, len(levels) - 2)
    t = np.clip((z - levels[k]) / (levels[k + 1] - levels[k]), 0.0, 1.0)
    return values[k] + t * t * (3 - 2 * t) * (values[k + 1] - values[k])


Turns = Mapping[str, Floats]
"""Rotation vectors [rad] by the name of the joint, in the axes of the rest pose."""


def _to(direction: Sequence[float]) -> Floats:
    """Shortest rotation from the left arm of the A-pose to `direction`."""
    aim = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    axis = np.cross(ARM, aim)
    return np.arctan2(np.linalg.norm(axis), ARM @ aim) * axis / max(float(np.linalg.norm(axis)), 1e-12)


def _mirrored(turns: Turns) -> dict[str, Floats]:
    """Rotations of the other side: a rotation vector is an axial vector."""
    return {other_side(name): turn * (1.0, -1.0, -1.0) for name, turn in turns.items()}


def _both(turns: Turns) -> dict[str, Floats]:
    return {**turns, **_mirrored(turns)}


def _about_x(degrees: float) -> Floats:
    return np.radians(degrees) * np.array([1.0, 0.0, 0.0])


_BACK = {"left_shoulder": _to((0.30, 0.30, -0.90)), "left_hip": _about_x(-24), "left_knee": _about_x(8)}
_FORTH = {"left_shoulder": _to((0.30, -0.35, -0.88)), "left_elbow": _about_x(-18), "left_hip": _about_x(16)}
POSES: dict[str, dict[str, Floats]] = {
    "a": {},
    "t": _both({"left_shoulder": _to((1, 0, 0))}),
    "walk": {**_BACK, **_mirrored({**_FORTH, "left_knee": _about_x(26), "left_ankle": _about_x(-4)})},
    "reach": _both({"left_shoulder": _to((0.25, -0.92, -0.20))}),
    "arms_down": _both({"left_shoulder": _to((0.30, 0.02, -0.95))}),
}
"""Named poses: only the joints that rotate."""


def turns_of(pose: str, joints_degrees: Mapping[str, Sequence[float]] | None) -> dict[str, Floats]:
    """Return the rotations of a named pose, with those of `joints_degrees` in their place.

    joints_degrees: rotation vectors [degrees] by joint, in the axes of the rest pose: x to the left, y back, z up.
    InputError names an unknown pose or joint.
    """
    if not isinstance(pose, str) or pose not in POSES:
        raise InputError(f"pose must be one of {', '.join(POSES)}, not {pose!r}.")
    turns = dict(POSES[pose])
    if joints_degrees is None:
        return turns
    if not isinstance(joints_degrees, Mapping):
        raise InputError(f"joints_degrees must be a table of joints, not {joints_degrees!r}.")
    for name, degrees in joints_degrees.items():
        if name not in JOINTS:
            raise InputError(f"joints_degrees has no joint {name!r}.", f"Known: {', '.join(JOINTS)}.")
        turns[name] = np.radians(as_vector(f"joints_degrees.{name}", degrees))
    return turns


def posed(points: Floats, weights: Floats, joints: Floats, turns: Turns) -> Floats:
    """Pose `points (n, 3)` of the rest pose [m] by linear blend skinning: sum_j w_j G_j p.

    weights (n, j); joints (j, 3): positions of the joints in the rest pose [m]. G_j rotates about joint j, after its
    parents.
    """
    rotations, moves = np.empty((len(JOINTS), 3, 3)), np.empty((len(JOINTS), 3))
    for j, parent in enumerate(PARENTS):
        own = rotation_matrix(np.asarray(turns.get(JOINTS[j], np.zeros(3))))
        before, moved = (rotations[parent], moves[parent]) if parent >= 0 else (np.eye(3), np.zeros(3))
        rotations[j] = before @ own
        moves[j] = before @ (joints[j] - own @ joints[j]) + moved
    return np.einsum("nj,njk->nk", weights, np.einsum("jkl,nl->njk", rotations, points) + moves)


TEMPLATE_FILE = Path(__file__).with_name("template.npz")
"""Arrays positions, triangles and weights, the fields of `Template`; NumPy's archive format, without pickle."""


@dataclass(frozen=True)
class Template:
    """Mesh and skinning weights of the mannequin.

    Parameters
    ----------
    positions : (n, 3) float64
        Vertices in the rest pose [m]; mirror-symmetric about x = 0.
    triangles : (m, 3) int64
        Closed surface, facing outward.
    weights : (n, j) float64
        Skinning weight of each joint of `skeleton.JOINTS`; each row sums to 1.
    """

    positions: Floats
    triangles: Ints
    weights: Floats


@lru_cache(maxsize=1)
def template() -> Template:
    """Load the shipped template; the arrays are read-only, since every caller gets the same ones."""
    with np.load(TEMPLATE_FILE, allow_pickle=False) as file:
        arrays = file["positions"], file["triangles"], file["weights"]
    for array in arrays:
        array.setflags(write=False)
    return Template(*arrays)


@by_keywords(Mannequin)
def mannequin(keys: Mannequin) -> tuple[Floats, Ints]:
    """Closed human figure: z is up, it stands on z = 0 and faces -y, its left hand is at +x.

    Every figure in every pose has the same triangles.
    """
    turns = turns_of(keys.pose, keys.joints_degrees)
    made = template()
    positions = posed(warped(made.positions, made.weights, keys), made.weights, warped_joints(keys), turns)
    positions[:, 2] -= positions[:, 2].min()
    return positions, made.triangles.copy()
