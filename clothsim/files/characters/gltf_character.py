"""Characters of glTF files: skinned meshes with their joints, and morph targets."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.files.characters.character import Character
from clothsim.files.characters.gltf_file import BROKEN, GltfFile, bound_skeleton, broken, node_order, read_gltf
from clothsim.mesh.topology import flat_triangles

TRIANGLES = 4
"""The mode of a primitive of triangles."""
MOST_WEIGHTS = 200_000_000
"""Largest number of skinning weights, vertices times joints."""


def read_character(path: Path, shape: Mapping[str, float] | None = None, group: str | None = None) -> Character:
    """Read the skinned meshes of a .glb or .gltf file, y up.

    Parameters
    ----------
    path : Path
        The file.
    shape : mapping of str to float, optional
        Weights of morph targets by their names; those left out are 0.
    group : str, optional
        Node or mesh to take alone; None: all that are skinned.

    Returns
    -------
    Character
        Vertices that the file splits for texture coordinates are joined; triangles without area are left out.

    Raises
    ------
    InputError
        The file is missing or broken, has no skinned mesh, or no morph target or node of a name.
    """
    file = read_gltf(path)
    try:
        nodes = [node for node in file.table("nodes") if "mesh" in node and "skin" in node]
        named = [node for node in nodes if group is None or group in _names(file, node)]
        if not named:
            if group is not None and nodes:
                known = ", ".join(sorted({name for node in nodes for name in _names(file, node)}))
                raise file.fault(f"it has no skinned mesh {group!r}.", f"Known: {known}.")
            raise file.fault("it has no mesh with a skin.", "Export the mesh with its armature, or give it as mesh.")
        for node in named:
            file.entry("skins", node["skin"])
        skins = sorted({int(node["skin"]) for node in named})
        joints, inverse_bind, columns = _columns(file, skins)
        parts = _Parts(file, dict(shape or {}), len(joints))
        for node in named:
            parts.add(node, columns[node["skin"]])
        positions, triangles, weights = parts.joined()
        skeleton = bound_skeleton(file, joints, inverse_bind)
        none = np.zeros((len(positions), 3, 0))
        return Character(positions, triangles, weights, skeleton, joints, inverse_bind, none)
    except BROKEN as error:
        raise broken(path, error) from error


class _Parts:
    """Primitives of skinned meshes, collected one after the other."""

    def __init__(self, file: GltfFile, shape: dict[str, float], joints: int) -> None:
        self.file, self.shape, self.count = file, shape, joints
        self.known: set[str] = set()
        self.positions: list[Floats] = []
        self.triangles: list[Ints] = []
        self.weights: list[Floats] = []
        self.start = 0

    def add(self, node: dict[str, Any], column: Ints) -> None:
        """Add the primitives of a node, whose joint numbers are rows of `column`."""
        mesh = self.file.entry("meshes", node["mesh"])
        names = mesh.get("extras", {}).get("targetNames", []) if isinstance(mesh.get("extras"), dict) else []
        for primitive in mesh.get("primitives", []):
            if primitive.get("mode", TRIANGLES) != TRIANGLES:
                continue
            attributes = primitive.get("attributes", {})
            if "JOINTS_0" not in attributes or "POSITION" not in attributes:
                raise self.file.fault(f"mesh {mesh.get('name', node['mesh'])!r} has a part without joints.")
            points = np.asarray(self.file.array(attributes["POSITION"], 3), np.float64)
            if len(points) * self.count > MOST_WEIGHTS:
                raise self.file.fault(f"{len(points):,} vertices on {self.count:,} joints are too many.")
            for k, target in enumerate(primitive.get("targets", [])):
                name = str(names[k]) if k < len(names) else f"target{k}"
                self.known.add(name)
                if self.shape.get(name) and "POSITION" in target:
                    points = points + self.shape[name] * self._like(target["POSITION"], 3, points)
            self.positions.append(points)
            self.weights.append(self._weights(attributes, column, points))
            if "indices" not in primitive:
                flat = np.arange(len(points))
            else:
                flat = np.asarray(self.file.array(primitive["indices"], 1)[:, 0], np.int64)
            if len(flat) % 3 or (len(flat) and (flat.max() >= len(points) or flat.min() < 0)):
                raise self.file.fault(f"a triangle names a vertex beyond the {len(points):,} of its mesh.")
            self.triangles.append(flat.reshape(-1, 3) + self.start)
            self.start += len(points)

    def joined(self) -> tuple[Floats, Ints, Floats]:
        """Positions, triangles and weights of all, with vertices joined that are alike."""
        unknown = [name for name in self.shape if name not in self.known]
        if unknown:
            known = f"Known: {', '.join(sorted(self.known))}." if self.known else "It has none."
            raise self.file.fault(f"it has no morph target {unknown[0]!r}.", known)
        if not self.positions or not sum(map(len, self.triangles)):
            raise self.file.fault("its skinned meshes have no triangles.")
        positions, triangles = np.concatenate(self.positions), np.concatenate(self.triangles)
        weights = np.concatenate(self.weights)
        alike = np.concatenate([positions, weights], axis=1)
        _, first, number = np.unique(alike, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(np.argsort(first))
        first = np.sort(first)
        triangles = order[number.reshape(-1)][triangles]
        positions, weights = positions[first], weights[first]
        flat = flat_triangles(positions, triangles)
        return positions, np.delete(triangles, flat, axis=0), weights

    def _like(self, accessor: Any, width: int, points: Floats) -> Floats:
        values = np.asarray(self.file.array(accessor, width))
        if len(values) != len(points):
            raise self.file.fault(f"accessors[{accessor}] has {len(values)} elements for {len(points)} vertices.")
        return values

    def _weights(self, attributes: dict[str, Any], column: Ints, points: Floats) -> Floats:
        """Weights (n, k) of all sets of four joints."""
        self.file.budget.spend("weights", len(points), self.count)
        weights = np.zeros((len(points), self.count))
        rows = np.arange(len(points))[:, None]
        for k in range(8):
            if f"JOINTS_{k}" not in attributes:
                break
            joints = np.asarray(self._like(attributes[f"JOINTS_{k}"], 4, points), np.int64)
            if len(joints) and (joints.max() >= len(column) or joints.min() < 0):
                raise self.file.fault(f"a vertex names joint {joints.max()} of a skin of {len(column)}.")
            if f"WEIGHTS_{k}" not in attributes:
                raise self.file.fault(f"a mesh has JOINTS_{k} without WEIGHTS_{k}.")
            values = self._like(attributes[f"WEIGHTS_{k}"], 4, points)
            np.add.at(weights, (np.broadcast_to(rows, joints.shape), column[joints]), values)
        sums = weights.sum(axis=1)
        bad = np.flatnonzero((sums <= 0) | (weights < 0).any(axis=1))
        if len(bad):
            raise self.file.fault(f"vertex {bad[0]} has no weight at any joint, or one below 0.")
        return np.asarray(weights / sums[:, None], np.float64)


def _columns(file: GltfFile, skins: list[int]) -> tuple[Ints, Floats, dict[int, Ints]]:
    """Joints (k,) in node order and inverse bind matrices (k, 4, 4) of all skins, and the columns of each skin."""
    order, _ = node_order(file)
    row = {node: k for k, node in enumerate(order)}
    joints: list[int] = []
    matrices: list[Floats] = []
    columns = {}
    for number in skins:
        skin = file.table("skins")[number]
        own = skin.get("joints", [])
        for node in own:
            file.entry("nodes", node)
        columns[number] = np.arange(len(joints), len(joints) + len(own))
        joints.extend(row[node] for node in own)
        if "inverseBindMatrices" in skin:
            given = np.asarray(file.array(skin["inverseBindMatrices"], 16), np.float64)
            if len(given) < len(own):
                raise file.fault(f"skins[{number}] has {len(own)} joints and {len(given)} inverse bind matrices.")
            matrices.extend(given[: len(own)].reshape(-1, 4, 4).transpose(0, 2, 1))
        else:
            matrices.extend(np.tile(np.eye(4), (len(own), 1, 1)))
    if not joints:
        raise file.fault("its skin has no joints.")
    return np.array(joints, np.int64), np.array(matrices), columns


def _names(file: GltfFile, node: dict[str, Any]) -> set[str]:
    return {str(each["name"]) for each in (node, file.entry("meshes", node["mesh"])) if "name" in each}
