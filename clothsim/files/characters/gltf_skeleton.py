"""Skeleton of a glTF file: its nodes, with the pose in which the skins were bound."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.gltf_file import GltfFile
from clothsim.files.characters.quaternions import from_matrices, to_matrices
from clothsim.files.characters.skeleton import Pose, Skeleton, orthonormal

SHEAR = 1e-3
"""Largest relative deviation of a matrix from rotation and scale; a bound pose with more is that of the nodes."""


def node_order(file: GltfFile) -> tuple[list[int], Ints]:
    """Nodes listed after their parents, and the parent of each in that list, -1 for a root.

    Raises
    ------
    InputError
        A node has two parents, or is its own ancestor.
    """
    nodes = file.table("nodes")
    parents = np.full(len(nodes), -1)
    for k, node in enumerate(nodes):
        for child in node.get("children", []):
            file.entry("nodes", child)
            if parents[child] >= 0:
                raise file.fault(f"nodes[{child}] has two parents.")
            parents[child] = k
    order = [int(k) for k in np.flatnonzero(parents < 0)]
    for k in order:
        order.extend(nodes[k].get("children", []))
    if len(order) < len(nodes):
        raise file.fault("a node is its own ancestor.")
    place = np.empty(len(nodes), np.int64)
    place[order] = np.arange(len(nodes))
    return order, np.array([place[parents[k]] if parents[k] >= 0 else -1 for k in order], np.int64)


def node_names(file: GltfFile, order: list[int]) -> tuple[str, ...]:
    """Names of the nodes in `order`, each once: a nameless or repeated one gets its number."""
    names: list[str] = []
    for k in order:
        name = file.table("nodes")[k].get("name")
        named = isinstance(name, str) and name.isprintable() and name and name not in names
        names.append(name if named and isinstance(name, str) else f"node{k}")
    return tuple(names)


def node_pose(file: GltfFile, order: list[int]) -> Pose:
    """Transforms of the nodes as the file has them."""
    rows = [_transform(file, k) for k in order]
    return Pose(*(np.array([row[part] for row in rows]) for part in range(3)))


def bound_skeleton(file: GltfFile, joints: Ints, inverse_bind: Floats) -> Skeleton:
    """Skeleton of all nodes, at rest in the pose in which `joints` (in node order) were bound.

    Parameters
    ----------
    file : GltfFile
    joints : (k,) ndarray
        Row of each joint of the skins.
    inverse_bind : (k, 4, 4) ndarray

    Notes
    -----
    Exporters write nodes in the pose of the moment; the bound pose is in the inverse bind matrices B_k. Where the first
    root of the joints keeps its transform G_0, joint k rests at G_0 B_0 B_k^-1. A pose that is no rotation, scale and
    translation stays that of the nodes.
    """
    order, parents = node_order(file)
    names, pose = node_names(file, order), node_pose(file, order)
    skeleton = Skeleton(names, parents, pose)
    now = skeleton.transforms(pose)
    wanted, root = now.copy(), int(np.argmin(joints))
    space = now[joints[root]] @ inverse_bind[root]
    for row, matrix in zip(joints, inverse_bind, strict=True):
        if abs(np.linalg.det(matrix)) > 0:
            wanted[row] = space @ np.linalg.inv(matrix)
    bound = np.zeros(len(order), bool)
    bound[joints] = True
    rest = [part.copy() for part in (pose.translations, pose.rotations, pose.scales)]
    for row in range(len(order)):
        parent = wanted[parents[row]] if parents[row] >= 0 else np.eye(4)
        if not bound[row]:
            wanted[row] = parent @ _matrix(*(part[row] for part in rest))
            continue
        found = _parts(np.linalg.solve(parent, wanted[row]))
        if found is None:
            return skeleton
        for part, value in zip(rest, found, strict=True):
            part[row] = value
    return Skeleton(names, parents, Pose(*rest))


def _transform(file: GltfFile, k: int) -> tuple[Floats, Floats, Floats]:
    """Translation, rotation (w, x, y, z) and scale of a node."""
    node, where = file.table("nodes")[k], f"nodes[{k}]"
    if "matrix" in node:
        found = _parts(file.numbers(node, "matrix", [0.0] * 16, where).reshape(4, 4).T)
        if found is None:
            raise file.fault(f"{where}.matrix is no rotation, scale and translation.", "Apply its shear.")
        return found
    rotation = file.numbers(node, "rotation", [0.0, 0.0, 0.0, 1.0], where)
    length = float(np.linalg.norm(rotation))
    if length == 0:
        raise file.fault(f"{where}.rotation is no rotation.")
    translation = file.numbers(node, "translation", [0.0] * 3, where)
    return translation, np.roll(rotation, 1) / length, file.numbers(node, "scale", [1.0] * 3, where)


def _parts(matrix: Floats) -> tuple[Floats, Floats, Floats] | None:
    """Translation, rotation and scale of a transform; None for one with shear or reflection."""
    linear = matrix[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    if scale.min() <= 0 or np.linalg.det(linear) <= 0:
        return None
    rotation = orthonormal(linear / scale)
    if np.abs(rotation * scale - linear).max() > SHEAR * scale.max():
        return None
    return matrix[:3, 3], from_matrices(rotation), scale


def _matrix(translation: Floats, rotation: Floats, scale: Floats) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = to_matrices(rotation) * scale, translation
    return matrix
