"""Motion files: BVH, AMASS (.npz, axis-angle poses of a body model of the SMPL family), animations of glTF.

A BVH file is a hierarchy of offsets, with channels in each joint's own order.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_reading import MOST, Budget, read_arrays, read_regular_file
from clothsim.files.characters.character import SMPL_JOINTS, parents_of_smpl
from clothsim.files.characters.clip import Clip, Interpolation, Track, uniform_clip
from clothsim.files.characters.clip import Path as Part
from clothsim.files.characters.gltf_file import BROKEN, GltfFile, broken, node_order, node_pose, read_gltf
from clothsim.files.characters.skeleton import Skeleton, from_rotation_vectors, product, skeleton_at, to_matrices

MOST_BYTES = 1 << 30
MOST_JOINTS = 2000
ABOVE, END_SITE = -1, -2
"""In place of a joint: outside of the hierarchy, and the end of the last bone."""
CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


@dataclass
class _Hierarchy:
    """Joints as they are read."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[list[str]] = field(default_factory=list)

    def add(self, name: str, parent: int) -> int:
        """Add a joint and return its row."""
        if parent == END_SITE:
            raise ValueError("a joint below an end site")
        self.names.append(name or f"joint{len(self.names)}")
        self.parents.append(parent)
        self.offsets.append([0.0, 0.0, 0.0])
        self.channels.append([])
        return len(self.names) - 1


def read_bvh(path: Path) -> Clip:
    """Read a BVH file.

    Parameters
    ----------
    path : Path
        Angles in degrees, about the axes of each joint's CHANNELS in their order; any unit of length.

    Returns
    -------
    Clip
        Its skeleton stands in the offsets of the file, in the unit of the file.

    Raises
    ------
    InputError
        The file is missing, is not a BVH file, or ends before its last frame: the sentence has the line or the frame.
    """
    head, motion, frames = read_regular_file(path, MOST_BYTES).decode("utf-8", "replace").partition("MOTION")
    if not motion or not head.lstrip("\ufeff \t\r\n").startswith("HIERARCHY"):
        raise InputError(f"{path.name} is not a BVH file: HIERARCHY or MOTION is missing.", "Export it as BVH.")
    joints, braces = _Hierarchy(), [ABOVE]
    for number, line in enumerate(head.splitlines(), start=1):
        words = line.replace("{", " ").split()  # some exporters open the brace behind the name
        if not words or words[0] == "HIERARCHY":
            continue
        try:
            _read_line(joints, braces, words)
        except (ValueError, IndexError) as error:
            reason = str(error) or f"{line.strip()[:60]!r} is not understood"
            raise InputError(f"{path.name}, line {number}: {reason}.", "Export it again.") from error
    if not joints.names or len(braces) != 1:
        raise InputError(f"{path.name}: its HIERARCHY has no joint, or a brace is not closed.", "Export it again.")
    if joints.parents.count(ABOVE) != 1:
        raise InputError(f"{path.name} has {joints.parents.count(ABOVE)} ROOT joints.", "Export one character.")
    count, seconds, values = _bvh_frames(path, frames, sum(map(len, joints.channels)))
    Budget(path.name).spend("numbers", count, len(joints.names), 4)
    parents: Ints = np.array(joints.parents, np.int64)
    offsets = np.array(joints.offsets)
    positions = offsets.copy()
    for j, parent in enumerate(joints.parents):
        if parent >= 0:
            positions[j] += positions[parent]
    names = tuple(name if joints.names.index(name) == k else f"{name}_{k}" for k, name in enumerate(joints.names))
    skeleton = skeleton_at(names, parents, positions)
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (count, len(parents), 1))
    root = np.tile(offsets[0], (count, 1))
    column = 0
    for j, channels in enumerate(joints.channels):
        for name in channels:
            axis = "XYZ".index(name[0])
            if name.endswith("rotation"):
                turn = np.radians(values[:, column, None]) * np.eye(3)[axis]
                rotations[:, j] = product(rotations[:, j], from_rotation_vectors(turn))
            elif j == 0:
                root[:, axis] = values[:, column]
            column += 1
    return uniform_clip(path.name, skeleton, 1 / seconds, rotations, root)


def _read_line(joints: _Hierarchy, braces: list[int], words: list[str]) -> None:
    """Read one line; `braces`: the joint of each open one. ValueError with the fault."""
    here = braces[-1]
    if words[0] in ("ROOT", "JOINT"):
        if len(joints.names) >= MOST_JOINTS:
            raise ValueError(f"more than {MOST_JOINTS:,} joints")
        braces.append(joints.add(" ".join(words[1:]), here))
    elif words[0] == "End":
        braces.append(END_SITE)
    elif words[0] == "}" and len(braces) > 1:
        braces.pop()
    elif words[0] == "OFFSET" and here != ABOVE:
        offset = [float(word) for word in words[1:]]
        if len(offset) != 3 or not np.isfinite(offset).all():
            raise ValueError("three finite numbers are needed")
        if here != END_SITE:
            joints.offsets[here] = offset
    elif words[0] == "CHANNELS" and here >= 0:
        if words[1] != str(len(words) - 2) or any(word not in CHANNELS for word in words[2:]):
            raise ValueError(f"CHANNELS are {' '.join(words[1:])[:60]!r}")
        joints.channels[here] = words[2:]
    else:
        raise ValueError(f"{' '.join(words)[:60]!r} is not understood")


def _bvh_frames(path: Path, text: str, width: int) -> tuple[int, float, Floats]:
    """Number of frames, time between them [s] and their values (frames, width)."""
    words = text.split()
    try:
        if words[0] != "Frames:" or words[2:4] != ["Frame", "Time:"]:
            raise ValueError("Frames: and Frame Time: are missing")
        count, seconds = int(words[1]), float(words[4])
        values = np.array(words[5:], np.float64)
    except (ValueError, IndexError) as error:
        raise InputError(f"{path.name}: its MOTION is broken ({error}).", "Export it again.") from error
    if count < 1 or not 0 < seconds < np.inf:
        raise InputError(f"{path.name} has {count} frames of {seconds} s.", "Export it again.")
    if not width:
        raise InputError(f"{path.name} has no CHANNELS: nothing moves.", "Export it with its motion.")
    if len(values) != count * width:
        whole = len(values) // width
        raise InputError(
            f"{path.name} declares {count:,} frames of {width} channels, and has {whole:,}.", "Copy it again."
        )
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(f"{path.name}: frame {bad[0] // width} has a value that is not finite.", "Export it again.")
    return count, seconds, values.reshape(count, width)


RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
_T_POSE = {
    "pelvis": (0, 0, 0), "spine1": (0, 0.11, 0), "spine2": (0, 0.24, 0), "spine3": (0, 0.3, 0),
    "neck": (0, 0.5, 0), "head": (0, 0.6, 0), "hip": (0.08, -0.08, 0), "knee": (0.08, -0.46, 0),
    "ankle": (0.08, -0.86, 0), "foot": (0.08, -0.92, 0.12), "collar": (0.06, 0.4, 0), "shoulder": (0.18, 0.44, 0),
    "elbow": (0.44, 0.44, 0), "wrist": (0.69, 0.44, 0),
}  # fmt: skip
"""An upright T of an adult [m], y up, left at +x: directions of the bones are all that retargeting takes of it."""


def t_pose() -> Skeleton:
    """Skeleton of the 22 joints that bodies of the SMPL family share, in a T."""
    positions = []
    for name in SMPL_JOINTS:
        side = -1.0 if name.startswith("right_") else 1.0
        x, y, z = _T_POSE[name.removeprefix("left_").removeprefix("right_")]
        positions.append((side * x, y, z))
    return skeleton_at(SMPL_JOINTS, parents_of_smpl(), np.array(positions, np.float64))


def read_amass(path: Path, skeleton: Skeleton | None = None) -> Clip:
    """Read an AMASS motion, turned to y up where it is z up.

    Parameters
    ----------
    path : Path
        poses (F, 3 j) [rad], trans (F, 3) [m] and mocap_framerate [1/s]; other keys are not read. Joints are those of
        SMPL (72 numbers), SMPL-H (156) or SMPL-X (165).
    skeleton : Skeleton, optional
        Of the body model that moves; None: a T of the 22 joints that all have. Of a model with another number of joints
        than the motion, the first 22 are moved.

    Raises
    ------
    InputError
        The file is missing, broken or pickled, or lacks a key.
    """
    arrays = read_arrays(path, ["poses", "trans", *RATES], MOST["bytes"])
    for name in ("poses", "trans"):
        if name not in arrays:
            raise InputError(f"{path.name} has no {name!r}.", "An AMASS motion has poses, trans and mocap_framerate.")
    rate = next((arrays[name] for name in RATES if name in arrays), np.array(np.nan))
    if rate.size != 1 or not 0 < float(rate.ravel()[0]) < 1e5:
        raise InputError(f"{path.name} has no frame rate.", "Save mocap_framerate with it.")
    poses, trans = _amass_frames(path, arrays["poses"], arrays["trans"])
    body = t_pose() if skeleton is None else skeleton
    known, moved = poses.shape[1], len(body.names)
    Budget(path.name).spend("numbers", len(poses), moved, 4)
    count = moved if known == moved else min(len(SMPL_JOINTS), known, moved)
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (len(poses), moved, 1))
    rotations[:, :count] = from_rotation_vectors(poses[:, :count])
    root = body.rest.translations[0] + trans
    # a body model has y up, AMASS's roots turn it to z up
    ups = to_matrices(rotations[:, 0])[:, :, 1].mean(axis=0)
    quarter = np.array([-np.pi / 2, 0.0, 0.0]) if ups[2] > abs(ups[1]) else np.zeros(3)
    turn = from_rotation_vectors(quarter)
    rotations[:, 0] = product(np.broadcast_to(turn, (len(poses), 4)), rotations[:, 0])
    return uniform_clip(path.name, body, float(rate.ravel()[0]), rotations, root @ to_matrices(turn).T)


def _amass_frames(path: Path, poses: NDArray, trans: NDArray) -> tuple[Floats, Floats]:
    if poses.ndim != 2 or poses.shape[1] % 3 or poses.shape[1] < 3 * len(SMPL_JOINTS) or not len(poses):
        raise InputError(f"poses of {path.name} has shape {poses.shape}.", "It has 72, 156 or 165 numbers a frame.")
    if trans.shape != (len(poses), 3):
        raise InputError(f"trans of {path.name} has shape {trans.shape}, not ({len(poses)}, 3).")
    Budget(path.name).spend("numbers", *poses.shape)
    for name, values in (("poses", poses), ("trans", trans)):
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            raise InputError(f"{name} of {path.name}: frame {bad[0, 0]} is not finite.", "Repair it.")
    return poses.astype(np.float64).reshape(len(poses), -1, 3), trans.astype(np.float64)


PARTS: dict[str, Part] = {"translation": "translations", "rotation": "rotations", "scale": "scales"}
INTERPOLATIONS: dict[str, Interpolation] = {"LINEAR": "linear", "STEP": "step", "CUBICSPLINE": "cubic"}


def read_animation(path: Path, skeleton: Skeleton, name: str | None = None) -> Clip:
    """Read an animation of a character's file.

    Parameters
    ----------
    path : Path
        The file.
    skeleton : Skeleton
        The character's, as `read_character` made it of the same file.
    name : str, optional
        Name of the animation; None: the first.

    Returns
    -------
    Clip
        Weights of morph targets that it animates are left out.

    Raises
    ------
    InputError
        There is no such animation, or it is broken.
    """
    file = read_gltf(path)
    try:
        animations = file.table("animations")
        names = [str(each.get("name", f"animation{k}")) for k, each in enumerate(animations)]
        if not animations:
            raise file.fault("it has no animation.", "Export it with one, or use another clip.")
        if name is not None and name not in names:
            raise file.fault(f"it has no animation {name!r}.", f"Known: {', '.join(names)}.")
        number = 0 if name is None else names.index(name)
        order, _ = node_order(file)
        row = {node: k for k, node in enumerate(order)}
        tracks = []
        for channel in animations[number].get("channels", []):
            target = channel["target"]
            if "node" in target and target.get("path") in PARTS:
                file.entry("nodes", target["node"])
                sampler = animations[number]["samplers"][channel["sampler"]]
                tracks.append(_track(file, sampler, PARTS[target["path"]], row[target["node"]], names[number]))
        if not tracks:
            raise file.fault(f"animation {names[number]!r} moves no joint.", "Export it with its key frames.")
        return Clip(names[number], skeleton, node_pose(file, order), tuple(tracks))
    except BROKEN as error:
        raise broken(path, error) from error


def _track(file: GltfFile, sampler: dict[str, Any], path: Part, joint: int, name: str) -> Track:
    times = np.asarray(file.array(sampler["input"], 1)[:, 0], np.float64)
    kind = INTERPOLATIONS.get(str(sampler.get("interpolation", "LINEAR")))
    width = 4 if path == "rotations" else 3
    values = np.asarray(file.array(sampler["output"], width), np.float64)
    each = 3 if kind == "cubic" else 1
    if kind is None or not len(times) or (np.diff(times) <= 0).any() or len(values) != each * len(times):
        raise file.fault(f"animation {name!r} has {len(times)} times that do not increase, or {len(values)} values.")
    if path == "rotations":
        values = np.roll(values, 1, axis=1)
    tangents = np.zeros((2, 0, 0, 0))
    if kind == "cubic":
        parts = values.reshape(len(times), 3, 1, width)
        tangents, values = np.stack([parts[:, 0], parts[:, 2]]), parts[:, 1, 0]
    if path == "rotations":
        lengths = np.linalg.norm(values, axis=1, keepdims=True)
        if not lengths.min() > 0:
            raise file.fault(f"animation {name!r} has a rotation of length 0.")
        values = np.asarray(values / lengths, np.float64)
    return Track(path, np.array([joint]), times, values[:, None, :], kind, tangents)
