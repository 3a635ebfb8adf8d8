"""Procedural clips of the mannequin's skeleton: a walk, a turn, and clips of six kinds that are drawn from a seed.

A drawn clip is named by its kind and its seed, as "squat:3". The seed draws its tempo, its size, its side and the way
the arms are held; all clips of a kind are of one motion that begins and ends in standing, but the gait, which begins in
a stride. Angles stay within what the mannequin's limbs reach without touching its trunk.
"""

import re
import zlib
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.characters.character import mannequin_character
from clothsim.files.characters.clip import Clip, uniform_clip
from clothsim.files.characters.skeleton import (
    Pose,
    Skeleton,
    from_matrices,
    from_rotation_vectors,
    product,
    to_matrices,
    to_rotation_vectors,
)

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
"""Names of the clips that are not drawn."""
RATE = 60.0
"""Key frames a second of a drawn clip [1/s]."""
SECONDS = (1.0, 1.5)
"""Least and largest length of a drawn clip [s]."""
GRAVITY = 9.81
Turns = dict[str, Floats]
Draw = np.random.Generator


def is_packaged(name: str) -> bool:
    """True where `packaged_clip` knows a name.

    Examples
    --------
    >>> [is_packaged(name) for name in ("walk", "jump:2", "jump", "dance:1")]
    [True, True, False, False]
    """
    kind, _, seed = name.partition(":")
    return name in CLIPS or (kind in KINDS and re.fullmatch(r"[0-9]{1,9}", seed) is not None)


@lru_cache(maxsize=8)  # a scene asks for it twice, a farm for each of its bodies
def packaged_clip(name: str) -> Clip:
    """The clip "walk", "turn" or a drawn one on the skeleton of the mannequin of 1.7 m, z up and facing -y.

    Examples
    --------
    >>> packaged_clip("walk").duration, packaged_clip("jump:2").name
    (1.1, 'jump:2')
    """
    skeleton = mannequin_character().skeleton
    if name in CLIPS:
        return {"walk": walk, "turn": turn}[name](skeleton)
    kind, _, seed = name.partition(":")
    random = np.random.default_rng([zlib.crc32(kind.encode()), int(seed)])
    seconds = random.uniform(*SECONDS)
    times = np.linspace(0.0, seconds, round(RATE * seconds) + 1)
    turns, advance = KINDS[kind](times, seconds, random)
    return _clip(name, skeleton, (len(times) - 1) / seconds, turns, advance)


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


def standing_pose(skeleton: Skeleton) -> Pose:
    """Arms hanging, as the walk holds them."""
    return skeleton.turned(_stride(0.0, 0.0))


def _gait(times: Floats, seconds: float, random: Draw) -> tuple[list[Turns], Floats]:
    """Steps forward of drawn length and tempo, from a drawn phase."""
    strength, phase = random.uniform(0.6, 1.1), random.uniform(0.0, 2 * np.pi)
    speed = 1.0 / (CYCLE * random.uniform(0.85, 1.25))
    advance = np.outer(times * speed * 2 * STEP * strength, [0.0, -1.0, 0.0])
    return [_stride(phase + 2 * np.pi * speed * time, strength) for time in times], advance


def _turn(times: Floats, seconds: float, random: Draw) -> tuple[list[Turns], Floats]:
    """A turn on the spot to a drawn side, the feet stepping in between."""
    angle = random.uniform(60.0, 150.0) * random.choice([-1.0, 1.0])
    steps = random.uniform(0.2, 0.4)
    turns = []
    for time, done in zip(times, _smooth(times / seconds), strict=True):
        taken = _stride(2 * np.pi * time / CYCLE, steps * float(np.sin(np.pi * time / seconds)) ** 2)
        turns.append({**taken, "pelvis": _degrees(0.0, 0.0, angle * done)})
    return turns, np.zeros((len(times), 3))


def _arms(times: Floats, seconds: float, random: Draw) -> tuple[list[Turns], Floats]:
    """Both arms raised to the side, each to a height of its own, and lowered again."""
    up, forward = random.uniform(30.0, 75.0, 2), random.uniform(-10.0, 30.0)
    bend = random.uniform(0.0, 30.0)
    return [
        {
            **_stride(0.0, 0.0),
            **_arm("left", amount, up[0], forward, bend),
            **_arm("right", amount, up[1], forward, bend),
        }
        for amount in _there_and_back(times / seconds)
    ], np.zeros((len(times), 3))


def _squat(times: Floats, seconds: float, random: Draw) -> tuple[list[Turns], Floats]:
    """Down to a drawn depth and up again, the trunk leaning forward, the arms too."""
    depth, lean, reach = random.uniform(25.0, 50.0), random.uniform(8.0, 20.0), random.uniform(10.0, 40.0)
    return [_crouch(amount, depth, lean, reach) for amount in _there_and_back(times / seconds)], np.zeros(
        (len(times), 3)
    )


def _reach(times: Floats, seconds: float, random: Draw) -> tuple[list[Turns], Floats]:
    """One arm raised forward to a drawn height, the trunk turning and leaning after it."""
    side, sign = ("left", 1.0) if random.random() < 0.5 else ("right", -1.0)
    forward, up, bend = random.uniform(40.0, 75.0), random.uniform(10.0, 50.0), random.uniform(0.0, 20.0)
    twist, lean = random.uniform(5.0, 15.0), random.uniform(0.0, 12.0)
    turns = []
    for amount in _there_and_back(times / seconds):
        trunk = amount * _degrees(lean, 0.0, -sign * twist)
        turns.append({**_stride(0.0, 0.0), "spine": trunk, "chest": trunk, **_arm(side, amount, up, forward, bend)})
    return turns, np.zeros((len(times), 3))


def _jump(times: Floats, seconds: float, random: Draw) -> tuple[list[Turns], Floats]:
    """A crouch, a flight of a drawn height, a crouch at the landing."""
    height, depth, lean = random.uniform(0.06, 0.16), random.uniform(25.0, 40.0), random.uniform(5.0, 12.0)
    flight = 2 * np.sqrt(2 * height / GRAVITY)
    off = 0.5 * (seconds - flight)
    since = times - off
    lift = np.where((since > 0) & (since < flight), 0.5 * GRAVITY * since * (flight - since), 0.0)
    before, after = np.clip(times / off, 0.0, 1.0), np.clip((times - off - flight) / off, 0.0, 1.0)
    amounts = np.sin(np.pi * _smooth(before)) ** 2 + np.sin(np.pi * _smooth(after)) ** 2
    turns = [_crouch(float(amount), depth, lean, 25.0) for amount in amounts]
    return turns, np.outer(lift, [0.0, 0.0, 1.0])


KINDS: dict[str, Callable[[Floats, float, Draw], tuple[list[Turns], Floats]]] = {
    "gait": _gait,
    "turn": _turn,
    "arms": _arms,
    "squat": _squat,
    "reach": _reach,
    "jump": _jump,
}
"""Kinds of drawn clips: rotation vectors of the joints [rad] and advance of the root [m] at given times [s]."""


def _crouch(amount: float, depth: float, lean: float, reach: float) -> Turns:
    """Standing with hips, knees and ankles bent by a share of `depth` [degrees] at the hips."""
    turned = _stride(0.0, 0.0)
    bend = amount * depth
    for side in ("left", "right"):
        turned[f"{side}_hip"] = turned[f"{side}_hip"] + _degrees(-1.2 * bend, 0.0, 0.0)
        turned[f"{side}_knee"] = turned[f"{side}_knee"] + _degrees(2.0 * bend, 0.0, 0.0)
        turned[f"{side}_ankle"] = turned[f"{side}_ankle"] + _degrees(-0.8 * bend, 0.0, 0.0)
        turned |= _arm(side, amount, 10.0, reach, 10.0)
    turned["spine"] = turned["spine"] + amount * _degrees(lean, 0.0, 0.0)
    return turned


def _arm(side: str, amount: float, up: float, forward: float, bend: float) -> Turns:
    """An arm raised from hanging by a share of angles to the side and forward, the elbow bent [degrees]."""
    sign = 1.0 if side == "left" else -1.0
    hanging = _stride(0.0, 0.0)
    raised = from_rotation_vectors(amount * _degrees(0.0, -sign * up, 0.0))
    swung = from_rotation_vectors(amount * _degrees(-forward, 0.0, 0.0))
    turned = product(swung, product(raised, from_rotation_vectors(hanging[f"{side}_shoulder"])))
    elbow = hanging[f"{side}_elbow"] + amount * _degrees(-bend, 0.0, 0.0)
    return {f"{side}_shoulder": to_rotation_vectors(turned), f"{side}_elbow": elbow}


def _smooth(u: Floats) -> Floats:
    """0 to 1 with no speed and no acceleration at the ends."""
    return np.asarray(u**3 * (10 - 15 * u + 6 * u**2), np.float64)


def _there_and_back(u: Floats) -> Floats:
    """0 to 1 to 0."""
    return np.asarray(np.sin(np.pi * _smooth(u)) ** 2, np.float64)


def _degrees(x: float, y: float, z: float) -> Floats:
    return np.radians([x, y, z])


def _matrix(vector: Floats) -> Floats:
    return to_matrices(from_rotation_vectors(vector))
