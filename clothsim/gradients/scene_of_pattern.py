"""Scenes with other meshes: cut from a pattern with other numbers, or with four triangles for one."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_array

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.gradients.pattern_numbers import PatternNumbers
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.mesh.refinement import refined
from clothsim.patterns.pattern import Side
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene import paths as keys_by_path
from clothsim.scene.assembly.meshes import cloth_shape
from clothsim.scene.assembly.pattern_file import mesh_of_file
from clothsim.scene.scene import Scene

OF_FILE = ("size", "scale", "rotation_order")
"""Keys of a table that tell how a pattern file is meshed."""
ALIKE = 1e-9
"""Difference of material coordinates that one mesh may have [m]."""


@dataclass(frozen=True)
class ShapedScene:
    """A scene with a cloth from a pattern.

    Parameters
    ----------
    scene : Scene
        The scene, its cloth given by arrays.
    numbers : PatternNumbers
        Of the meshed pattern.
    cloth : int
        Number of the cloth.
    """

    scene: Scene
    numbers: PatternNumbers
    cloth: int

    @property
    def name(self) -> str:
        """The name of the cloth."""
        return self.scene.cloths[self.cloth].name or "cloth"

    def edge_rows(self, panel: str, edge: int) -> Ints:
        """Return the vertices of the sewn cloth on an edge of a panel, (k,). InputError where there is no such edge."""
        mesh, side = self.numbers.mesh, Side(panel, edge)
        if side not in mesh.edges:
            known = ", ".join(f"{each.panel}.{each.edge}" for each in mesh.edges)
            raise InputError(f"The pattern has no {side}.", f"Edges: {known}.")
        number = np.zeros(len(mesh.positions), np.int64)
        arrays: Any = self.scene.cloths[self.cloth].mesh
        number[mesh.triangles] = arrays.triangles
        return np.unique(number[mesh.edges[side]])

    def with_numbers(self, values: Mapping[str, float], scene: Scene | None = None) -> Scene:
        """Return a scene with the cloth cut to other numbers of the pattern."""
        scene = self.scene if scene is None else scene
        tables: list[Any] = list(scene.cloths)
        arrays: MeshArrays = tables[self.cloth].mesh
        rest = self.numbers.material_coordinates(values) / tables[self.cloth].scale
        tables[self.cloth] = {**tables[self.cloth], "mesh": replace(arrays, rest=rest)}
        changed: dict[str, Any] = {"cloth": tables}
        return replace(scene, **changed)


def shaped_scene(scene: Scene, mesh: PatternMesh | None = None) -> ShapedScene:
    """Return a scene whose cloth follows the numbers of its pattern.

    Parameters
    ----------
    scene : Scene
        With one cloth from a pattern file, or one of arrays.
    mesh : PatternMesh, optional
        The pattern of a cloth of arrays, which has its triangles and material coordinates; as `clothsim dress` leaves.

    Raises
    ------
    InputError
        Where no cloth is of a pattern, or the mesh is another one.
    """
    files = [
        k
        for k, keys in enumerate(scene.cloths)
        if isinstance(keys.mesh, str) and Path(keys.mesh).suffix.lower() == ".json"
    ]
    arrays = [k for k, keys in enumerate(scene.cloths) if isinstance(keys.mesh, MeshArrays)]
    if mesh is not None:
        if len(arrays) != 1:
            raise InputError(
                f"The scene has {len(arrays)} cloths of arrays, and exactly one must come from the pattern."
            )
        return _replace_arrays(scene, arrays[0], mesh)
    if len(files) != 1:
        raise InputError(
            f"The scene has {len(files)} cloths from a pattern file, and one is needed.",
            'Give [cloth] mesh = "x_specification.json", or the pattern of a dressed garment with --pattern.',
        )
    number = files[0]
    keys, where = scene.cloths[number], "cloth" if len(scene.cloths) == 1 else f"cloth[{number}]"
    shape = cloth_shape(keys, where, scene.directory)
    given = MeshArrays.checked(where, shape.positions, shape.triangles, shape.texture)
    tables: list[Any] = list(scene.cloths)
    tables[number] = {key: value for key, value in keys.items() if key not in OF_FILE} | {"mesh": given}
    changed: dict[str, Any] = {"cloth": tables}
    return _replace_arrays(replace(scene, **changed), number, mesh_of_file(scene.directory / keys.mesh, keys))


def _replace_arrays(scene: Scene, number: int, mesh: PatternMesh) -> ShapedScene:
    arrays: Any = scene.cloths[number].mesh
    scale = scene.cloths[number].scale
    wanted = mesh.material_coordinates.shape
    if not arrays.is_flat or arrays.rest is None or arrays.rest.shape != wanted:
        have = "no material coordinates" if arrays.rest is None else f"material coordinates {arrays.rest.shape}"
        raise InputError(
            f"The cloth has {have}, the mesh of the pattern {wanted}.", "Give the size it was meshed with."
        )
    if np.abs(scale * arrays.rest - mesh.material_coordinates).max() > ALIKE:
        raise InputError(
            "The cloth is not cut from this pattern: its rest triangles differ.",
            "Give the file that was dressed, and the size that it was meshed with.",
        )
    return ShapedScene(scene, PatternNumbers(mesh), number)


# Cloths with four triangles for one, of the same material and at the same place.

HELD = ("inertia", "membrane", "bending", "gravity", "damping", "pins", "body_contact", "self_contact", "friction")
"""Effects that name no vertices, or pins: a cloth with others is not meshed more finely."""


def halved(scene: Scene) -> tuple[Scene, csr_array, Ints]:
    """Return a scene whose cloths of arrays have four triangles for one, its vertices as combinations, and triangles.

    InputError for another mesh, arrays of its keys, and effects that name vertices other than pins.
    """
    others = [name for name in scene.effects if name not in HELD]
    if others:
        raise InputError(f"effects.{others[0]} may select vertices by number, and a finer mesh has other numbers.")
    tables, parts, fine, count = list[Any](), list[csr_array](), list[Ints](), 0
    for keys in scene.cloths:
        mesh = keys.mesh
        if not isinstance(mesh, MeshArrays) or any(isinstance(value, np.ndarray) for value in keys.values()):
            raise InputError("The cloth is not a mesh of arrays, or has keys that are arrays.")
        weights, triangles = refined(mesh.triangles, len(mesh.vertices))
        rest = mesh.vertices if mesh.rest is None else mesh.rest
        groups = {name: (4 * rows[:, None] + np.arange(4)).ravel() for name, rows in mesh.groups.items()}
        finer = MeshArrays.checked(
            "cloth",
            weights @ mesh.vertices,
            triangles,
            quartered(rest) if mesh.is_flat else weights @ rest,
            groups=groups,
        )
        tables.append({**keys, "mesh": finer})
        parts.append(weights)
        fine.append(triangles + count)
        count += weights.shape[0]
    changed: dict[str, Any] = {"cloth": tables}
    made = replace(scene, **changed)
    pins = scene.effects.get("pins")
    if pins is not None and not isinstance(pins.select, str):
        held = np.asarray(pins.select, np.int64)
        if len(scene.cloths) > 1 or pins.group:
            raise InputError("Pins are of several cloths, or of groups.")
        own: Any = scene.cloths[0].mesh
        # vertices of the finer mesh are held also between two that are
        _, divided = refined(own.triangles, len(own.vertices))
        ends = own.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        middles = divided.reshape(-1, 4, 3)[:, 3].ravel()  # ab, bc, ca
        held = np.union1d(held, middles[np.isin(ends, held).all(axis=1)])
        made = keys_by_path.replace(made, "effects.pins.select", held.tolist())
    return made, csr_array(block_diag(parts)), np.concatenate(fine)


def quartered(corners: Floats) -> Floats:
    """Return what is linear over each of m triangles, (m, 3, d) at their corners, at those of four for each.

    Triangles are in the order of `refined`.

    Examples
    --------
    >>> quartered(np.array([[[0.0], [2.0], [4.0]]]))[:, :, 0].tolist()
    [[0.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 3.0, 4.0], [1.0, 3.0, 2.0]]
    """
    a, b, c = (corners[:, k] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3, corners.shape[2])
