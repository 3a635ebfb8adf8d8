"""BVH motion files: a hierarchy of offsets, and channels in each joint's own order."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file
from clothsim.files.characters.clip import Clip, uniform_clip
from clothsim.files.characters.quaternions import from_rotation_vectors, product
from clothsim.files.characters.skeleton import skeleton_at

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
        The file is missing, is no BVH file, or ends before its last frame: the sentence has the line or the frame.
    """
    head, motion, frames = read_regular_file(path, MOST_BYTES).decode("utf-8", "replace").partition("MOTION")
    if not motion or not head.lstrip("\ufeff \t\r\n").startswith("HIERARCHY"):
        raise InputError(f"{path.name} is no BVH file: HIERARCHY or MOTION is missing.", "Export it as BVH.")
    joints = _hierarchy(path, head)
    count, seconds, values = _frames(path, frames, sum(map(len, joints.channels)))
    return _clip(path, joints, count, seconds, values)


def _hierarchy(path: Path, text: str) -> _Hierarchy:
    joints, braces = _Hierarchy(), [ABOVE]
    for number, line in enumerate(text.splitlines(), start=1):
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
    return joints


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
        offset = _three_numbers(words[1:])
        if here != END_SITE:
            joints.offsets[here] = offset
    elif words[0] == "CHANNELS" and here >= 0:
        if words[1] != str(len(words) - 2) or any(word not in CHANNELS for word in words[2:]):
            raise ValueError(f"CHANNELS are {' '.join(words[1:])[:60]!r}")
        joints.channels[here] = words[2:]
    else:
        raise ValueError(f"{' '.join(words)[:60]!r} is not understood")


def _frames(path: Path, text: str, width: int) -> tuple[int, float, Floats]:
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
    if len(values) != count * width:
        whole = len(values) // max(width, 1)
        raise InputError(f"{path.name} says {count:,} frames of {width} channels, and has {whole:,}.", "Copy it again.")
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(f"{path.name}: frame {bad[0] // width} has a value that is not finite.", "Export it again.")
    return count, seconds, values.reshape(count, width)


def _clip(path: Path, joints: _Hierarchy, count: int, seconds: float, values: Floats) -> Clip:
    parents: Ints = np.array(joints.parents, np.int64)
    offsets = np.array(joints.offsets)
    positions = offsets.copy()
    for j, parent in enumerate(joints.parents):
        if parent >= 0:
            positions[j] += positions[parent]
    skeleton = skeleton_at(_unique(joints.names), parents, positions)
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


def _three_numbers(words: list[str]) -> list[float]:
    values = [float(word) for word in words]
    if len(values) != 3 or not np.isfinite(values).all():
        raise ValueError("three finite numbers are needed")
    return values


def _unique(names: list[str]) -> tuple[str, ...]:
    return tuple(name if names.index(name) == k else f"{name}_{k}" for k, name in enumerate(names))
