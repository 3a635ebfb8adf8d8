"""Animations of glTF files."""

from pathlib import Path
from typing import Any

import numpy as np

from clothsim.files.characters.clip import Clip, Interpolation, Track
from clothsim.files.characters.clip import Path as Part
from clothsim.files.characters.gltf_file import BROKEN, GltfFile, broken, read_gltf
from clothsim.files.characters.gltf_skeleton import node_order, node_pose
from clothsim.files.characters.skeleton import Skeleton

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
        return _clip(file, skeleton, name)
    except BROKEN as error:
        raise broken(path, error) from error


def _clip(file: GltfFile, skeleton: Skeleton, name: str | None) -> Clip:
    animations = file.table("animations")
    names = [str(each.get("name", f"animation{k}")) for k, each in enumerate(animations)]
    if not animations:
        raise file.fault("it has no animation.", "Export it with one, or take another clip.")
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
