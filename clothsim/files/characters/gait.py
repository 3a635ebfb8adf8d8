"""Procedural clips of the mannequin's skeleton: a walk and a turn."""

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.characters.character import mannequin_character
from clothsim.files.characters.clip import Clip, uniform_clip
from clothsim.files.characters.quaternions import from_matrices, from_rotation_vectors, to_matrices, to_rotation_vectors
from clothsim.files.characters.skeleton import Pose, Skeleton

CYCLE = 1.1
"""Time of two steps [s]; a comfortable walk has 1.0 to 1.2."""
KEYS = 110
"""Key frames of a cycle."""
STEP = 0.62
"""Length of a step of a figure of 1.7 m [m]."""
TURN_SECONDS, TURN_DEGREES = 2.0, 180.0
"""Time and angle of the turn on the spot."""
ARMS_DOWN = 20.0
"""Angle by which the arms of the walk hang below those of the A-pose [degrees]."""
CLIPS = ("walk", "turn")
"""Names of the shipped clips."""


def shipped_clip(name: str) -> Clip:
    """The clip "walk" or "turn" on the skeleton of the mannequin of 1.7 m, z up and facing -y.

    Examples
    --------
    >>> shipped_clip("walk").duration
    1.1
    """
    return {"walk": walk, "turn": turn}[name](mannequin_character().skeleton)


def walk(skeleton: Skeleton) -> Clip:
    """Two steps forward, to be looped: legs as sinusoids, arms against them, the lower foot on the ground."""
    phases = np.linspace(0, 2 * np.pi, KEYS + 1)
    turns = [_stride(phase) for phase in phases]
    advance = np.outer(np.linspace(0, 2 * STEP, KEYS + 1), [0.0, -1.0, 0.0])
    return _clip("walk", skeleton, KEYS / CYCLE, turns, advance)


def turn(skeleton: Skeleton) -> Clip:
    """Half a turn to the left on the spot, the feet stepping in between, from standing to standing."""
    seconds = np.linspace(0, TURN_SECONDS, 61)
    t = seconds / TURN_SECONDS
    smooth = t**3 * (10 - 15 * t + 6 * t**2)
    strength = np.sin(np.pi * t) ** 2
    turns = []
    for angle, s, second in zip(np.radians(TURN_DEGREES) * smooth, strength, seconds, strict=True):
        stepping = _stride(2 * np.pi * second / CYCLE, 0.35 * s)
        turns.append({**stepping, "pelvis": np.array([0.0, 0.0, angle])})
    return _clip("turn", skeleton, 60 / TURN_SECONDS, turns, np.zeros((61, 3)))


def _stride(phase: float, strength: float = 1.0) -> dict[str, Floats]:
    """Rotation vectors [rad] of the joints in a phase of the walk [rad], in the axes of the rest pose.

    A positive turn about x brings a leg back, for the figure faces -y.
    """
    turned: dict[str, Floats] = {}
    for side, sign, at in (("left", 1.0, phase), ("right", -1.0, phase + np.pi)):
        swing = np.sin(at)
        bend = 4 + strength * 46 * max(0.0, np.sin(at - 0.9 * np.pi / 2)) ** 2
        turned[f"{side}_hip"] = _degrees(22 * strength * swing - 5 * strength, 0, 0)
        turned[f"{side}_knee"] = _degrees(bend, 0, 0)
        turned[f"{side}_ankle"] = _degrees(-0.35 * bend - 9 * strength * swing, 0, 0)
        arm = _matrix(_degrees(-18 * strength * swing, 0, 0)) @ _matrix(_degrees(0, sign * ARMS_DOWN, 0))
        turned[f"{side}_shoulder"] = to_rotation_vectors(from_matrices(arm))
        turned[f"{side}_elbow"] = _degrees(-14 - 6 * strength * (1 - swing), 0, 0)
    turned["spine"] = _degrees(0, 0, 3 * strength * np.sin(phase))
    turned["chest"] = _degrees(0, 0, 4 * strength * np.sin(phase))
    turned["pelvis"] = _degrees(0, 2 * strength * np.cos(phase), -4 * strength * np.sin(phase))
    return turned


def _clip(name: str, skeleton: Skeleton, rate: float, turns: list[dict[str, Floats]], advance: Floats) -> Clip:
    """Clip whose lower ankle keeps its height."""
    ankles = [skeleton.names.index(f"{side}_ankle") for side in ("left", "right")]
    standing = skeleton.rest_positions()[ankles, 2].min()
    rotations, root = [], []
    for turned, move in zip(turns, advance, strict=True):
        pose = skeleton.turned(turned)
        low = skeleton.transforms(pose)[ankles, 2, 3].min()
        rotations.append(pose.rotations)
        root.append(pose.translations[0] + move + (0.0, 0.0, standing - low))
    return uniform_clip(name, skeleton, rate, np.array(rotations), np.array(root))


def standing(skeleton: Skeleton) -> Pose:
    """Arms hanging, as the walk holds them."""
    return skeleton.turned(_stride(0.0, 0.0))


def _degrees(x: float, y: float, z: float) -> Floats:
    return np.radians([x, y, z])


def _matrix(vector: Floats) -> Floats:
    return to_matrices(from_rotation_vectors(vector))
