"""Scene whose cloth is cut from a pattern with other numbers: triangles, seams and start held."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.base.errors import InputError
from clothsim.gradients.pattern_numbers import PatternNumbers
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.patterns.pattern import Side
from clothsim.patterns.pattern_mesh import PatternMesh
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
    files = [k for k, keys in enumerate(scene.cloths) if _is_pattern(keys.mesh)]
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
        raise InputError("The cloth is not cut from this pattern: its rest triangles differ.")
    return ShapedScene(scene, PatternNumbers(mesh), number)


def _is_pattern(mesh: Any) -> bool:
    return isinstance(mesh, str) and Path(mesh).suffix.lower() == ".json"
