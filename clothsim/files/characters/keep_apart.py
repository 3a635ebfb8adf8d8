"""Limbs kept apart: a motion whose shoulders and hips are turned by the least angles that leave room between its parts.

At key times the rotation vectors w of all limbs about their first joints solve

    min |w|^2   subject to   d_i + n_i . ((w_a - w0_a) x r_a - (w_b - w0_b) x r_b) >= gap,

linearised again a few times, for the vertices of a part near another: d the signed distance, n the direction away from
the other part, r the arms from the joints (least distance programming, Lawson and Hanson 1974, chapter 23). A key time
begins with the turns of the one before, the first with those of poses between the first pose and its own, so that no
limb is ever deep in another part. In time the vectors are the largest of a window, averaged over it, and interpolated.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import nnls

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.character import Character
from clothsim.files.characters.clip import SkeletonMotion, blended
from clothsim.files.characters.motion_check import LIMB_ROOTS, PartPair, part_pairs
from clothsim.files.characters.skeleton import Pose, from_rotation_vectors, joint_roles, orthonormal, product

GAP = 0.012
"""Room between two parts [of the body's height]: 2 cm of 1.7 m, for the sleeve and the shirt between them."""
RATE = 20.0
"""Key times a second [1/s]."""
WINDOW = 2
"""Key times to either side over which turns are spread, so that they begin and end softly."""
STEPS, ROWS = 8, 24
"""Linearisations of a key time; nearest vertices of a pair taken."""
BEYOND, LARGEST_STEP, ENOUGH = 0.02, 0.15, 0.1
"""Vertices up to this beyond the gap are rows too [m]; longest turn of a step [rad]; part of the gap that may lack."""
APPROACH = 8
"""Poses between the first pose and that of the first key time."""


@dataclass(frozen=True, eq=False)
class ApartMotion:
    """A motion with turns of limbs added.

    Attributes
    ----------
    motion : SkeletonMotion
    joints : (l,) ndarray
        First joint of each limb.
    turns : callable
        Rotation vectors of the limbs in the axes of their parents by the time [s], (l, 3) [rad].
    largest : (l,) ndarray [rad]
        Largest turn of each limb.
    """

    motion: SkeletonMotion
    joints: Ints
    turns: Any
    largest: Floats

    @property
    def duration(self) -> float:
        """Time of the last key frame [s]."""
        return self.motion.duration

    def pose(self, time: float) -> Pose:
        """Pose at `time` [s]."""
        pose = self.motion.pose(time)
        return _turned(pose, self.joints, np.asarray(self.turns(time)))


def kept_apart(
    character: Character, motion: SkeletonMotion, first: Pose, span: tuple[float, float], loop: bool
) -> ApartMotion:
    """A motion whose limbs are turned outwards where they come near another part.

    Parameters
    ----------
    character : Character
    motion : SkeletonMotion
    first : Pose
        Pose in which all parts are apart; what is near another part there may be so at all times.
    span : (float, float)
        Part of the motion that is used [s].
    loop : bool
        That part is repeated.
    """
    names, parents = character.skeleton.names, character.skeleton.parents.tolist()
    roles = joint_roles(names, parents)
    limbs = [limb for limb, root in LIMB_ROOTS.items() if root in roles]
    joints = np.array([roles[LIMB_ROOTS[limb]] for limb in limbs], np.int64)
    rest = character.vertices(first)
    pairs, gap = part_pairs(character, rest), GAP * float(np.ptp(rest, axis=0).max())
    times = np.linspace(*span, max(int(np.ceil((span[1] - span[0]) * RATE)), 1) + 1)
    apart = _Apart(character, pairs, tuple(limbs), joints, gap)
    start, turns, found = motion.pose(span[0]), np.zeros((len(joints), 3)), []
    for part in np.linspace(0, 1, APPROACH + 1)[1:-1]:
        turns = apart.turns(blended(first, start, float(part)), turns)
    for time in times:
        turns = apart.turns(motion.pose(float(time)), turns)
        found.append(turns)
    smooth = _spread(np.array(found).reshape(len(times), len(joints), 3), loop)
    curve = PchipInterpolator(times, smooth, axis=0)
    largest = np.linalg.norm(smooth, axis=2).max(axis=0) if len(joints) else np.zeros(0)
    return ApartMotion(motion, joints, lambda time: curve(np.clip(time, *span)), largest)


@dataclass(frozen=True, eq=False)
class _Apart:
    """What the least turns of a pose are found with: pairs of parts, limbs, their first joints (l,), the gap [m]."""

    character: Character
    pairs: tuple[PartPair, ...]
    limbs: tuple[str, ...]
    joints: Ints
    gap: float

    def turns(self, pose: Pose, start: Floats) -> Floats:
        """Rotation vectors (l, 3) of the limbs in the axes of their parents [rad] that leave the gap in a pose."""
        turns = start
        for _ in range(STEPS):
            turned = _turned(pose, self.joints, turns)
            points, transforms = self.character.vertices(turned), self.character.skeleton.transforms(turned)
            centres = transforms[self.joints, :3, 3]
            # rows (r, 3 l) in the axes of space, and what the distances lack of the gap (r,) [m]
            found, lacks = [], []
            for pair in self.pairs:
                if pair.boxes_apart(points) >= self.gap + BEYOND:
                    continue
                signed, closest = pair.closest(points)
                near = np.argsort(signed)[:ROWS]
                for k in near[(signed[near] < self.gap + BEYOND) & (np.abs(signed[near]) > 1e-9)]:
                    x = points[pair.vertices[k]]
                    away = (x - closest[k]) / signed[k]  # outwards also from inside, where the distance is negative
                    row = np.zeros(3 * len(self.limbs))
                    for part, sign, at in ((pair.names[0], 1.0, x), (pair.names[1], -1.0, closest[k])):
                        if part in self.limbs:
                            limb = self.limbs.index(part)
                            row[3 * limb : 3 * limb + 3] = sign * np.cross(at - centres[limb], away)
                    found.append(row)
                    lacks.append(self.gap - signed[k])
            rows, lack = np.array(found).reshape(len(found), 3 * len(self.limbs)), np.array(lacks)
            if not len(rows):
                return np.zeros_like(turns) if not turns.any() else self._relaxed(pose, turns)
            parents = self.character.skeleton.parents[self.joints]
            axes = np.where((parents < 0)[:, None, None], np.eye(3), orthonormal(transforms[parents, :3, :3]))
            own = np.einsum("rla,lab->rlb", rows.reshape(len(rows), -1, 3), axes).reshape(len(rows), -1)
            wanted = _least(own, lack + own @ turns.ravel()).reshape(-1, 3)
            step = wanted - turns
            length = float(np.linalg.norm(step, axis=1).max(initial=0.0))
            turns = turns + step * min(1.0, LARGEST_STEP / max(length, 1e-300))
            if length < 0.1 * LARGEST_STEP and lack.max() < ENOUGH * self.gap:
                break
        return turns

    def _relaxed(self, pose: Pose, turns: Floats) -> Floats:
        """Half the turns where nothing is near: a later step finds what they should be."""
        half = turns / 2
        points = self.character.vertices(_turned(pose, self.joints, half))
        near = any(pair.boxes_apart(points) < self.gap and pair.distance(points)[0] < self.gap for pair in self.pairs)
        return turns if near else half if np.linalg.norm(half, axis=1).max() > 0.01 else np.zeros_like(turns)


def _least(rows: Floats, bounds: Floats) -> Floats:
    """The shortest vector w (n,) with rows w >= bounds (r,); where there is none, least squares of those violated."""
    if (bounds <= 0).all():
        return np.zeros(rows.shape[1])
    stacked = np.vstack([rows.T, bounds])
    unit = np.zeros(len(stacked))
    unit[-1] = 1.0
    rest = stacked @ nnls(stacked, unit)[0] - unit
    if abs(rest[-1]) < 1e-6:
        held = bounds > 0
        return np.asarray(np.linalg.lstsq(rows[held], bounds[held], rcond=1e-2)[0], np.float64)
    return np.asarray(-rest[:-1] / rest[-1], np.float64)


def _turned(pose: Pose, joints: Ints, turns: Floats) -> Pose:
    """`pose` with joints turned by rotation vectors (l, 3) [rad] in the axes of their parents."""
    rotations = pose.rotations.copy()
    if len(joints):
        rotations[joints] = product(from_rotation_vectors(turns), rotations[joints])
    return replace(pose, rotations=rotations)


def _spread(turns: Floats, loop: bool) -> Floats:
    """Turns (k, l, 3): of each window the largest, averaged over windows with Hann's weights."""
    width = 2 * WINDOW + 1
    source = turns[:-1] if loop and len(turns) > 1 else turns  # a loop's last key time is its first
    padded = np.pad(source, ((2 * WINDOW, 2 * WINDOW), (0, 0), (0, 0)), mode="wrap" if loop else "edge")
    sizes = np.linalg.norm(padded, axis=2)
    count = len(padded) - width + 1
    picked = np.array([sizes[k : k + width].argmax(axis=0) + k for k in range(count)])
    largest = padded[picked, np.arange(turns.shape[1])]
    hann = np.sin(np.pi * np.arange(1, width + 1) / (width + 1)) ** 2
    smooth = sum(w * largest[i : i + len(source)] for i, w in enumerate(hann / hann.sum()))
    return np.concatenate([smooth, smooth[:1]]) if len(source) < len(turns) else np.asarray(smooth)
