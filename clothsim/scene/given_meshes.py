"""Meshes in memory that a scene is given: arrays, objects of other libraries, and the text of a run."""

from collections.abc import Mapping
from typing import Any

from clothsim.base.errors import InputError
from clothsim.keys.mesh_arrays import TEXT, MeshArrays
from clothsim.scene.mesh_objects import is_mesh, surface_of


def checked_mesh(where: str, vertices: Any, triangles: Any = None, **others: Any) -> MeshArrays:
    """The mesh of arrays, or of a mesh object where `triangles` is None; others: as of `MeshArrays.checked`.

    Raises
    ------
    InputError
        For another shape, a number that is not finite or an index out of range: it names array and index.
    """
    if triangles is None:
        name = where if is_mesh(vertices) else f"{where}.vertices"
        vertices, triangles = surface_of(name, vertices)
    return MeshArrays.checked(where, vertices, triangles, **others)


def mesh_arrays(where: str, value: Any) -> MeshArrays:
    """The mesh in memory that a key `mesh` holds: arrays, a mesh object, or the text of one.

    Raises
    ------
    InputError
        Where it is none of them.
    """
    if isinstance(value, MeshArrays):
        return value
    if isinstance(value, Mapping):
        if set(value) == {TEXT}:
            return MeshArrays.from_text(where, value[TEXT])
        raise InputError(
            f"{where} must be a mesh, not a table with {', '.join(map(repr, value)) or 'no key'}.",
            "Name a generator or a file; or give a mesh object, or clothsim.Cloth(vertices, triangles).",
        )
    if isinstance(value, tuple | list):
        if len(value) != 2:
            raise InputError(
                f"{where} has {len(value)} entries.", "Give a pair (vertices, triangles), or clothsim.Cloth(...)."
            )
        return checked_mesh(where, *value)
    return checked_mesh(where, value)
