"""Name, faults and position of a mesh that a scene's table names."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.mesh_keys import FilePart, PlacedKeys
from clothsim.keys.schema import keys_of
from clothsim.mesh.checks import Role, examine, refuse
from clothsim.mesh.motion import rotation_matrix
from clothsim.mesh.pattern_lines import PatternLines

PART = ("scale", *keys_of(FilePart))
"""The keys that name a part of a file and its unit."""
LONGEST_NAME = 200
"""Bound on the letters of a name, which stands in every message, table and file about it."""


@dataclass(frozen=True)
class Shape:
    """A mesh of a scene before it is placed.

    Parameters
    ----------
    positions : (n, 3) ndarray [m]
        Rest positions.
    triangles : (m, 3) ndarray
        Vertex numbers.
    texture : (m, 3, 2) or (0, 3, 2) ndarray [m]
        Texture or material coordinates of each corner.
    notes : tuple of str
        Notes for the user.
    groups : dict
        Triangles of each panel or group that the file names.
    start : (n, 3) ndarray [m], optional
        Initial positions, where they are not the rest positions.
    flat : bool
        True where the material is at rest in `texture`.
    sewn : (k,) ndarray
        Of a sewn shape the vertex that each vertex before became, -1 where it is in no triangle; else (0,).
    lines : PatternLines
        Edges, labels and open seams of a sewing pattern.
    """

    positions: Floats
    triangles: Ints
    texture: Floats
    notes: tuple[str, ...]
    groups: Mapping[str, Ints] = field(default_factory=dict)
    start: Floats | None = None
    flat: bool = False
    sewn: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    lines: PatternLines = field(default_factory=PatternLines)


def name_of(keys: PlacedKeys, where: str) -> str:
    """The name that a section gives, or the section's own. InputError for an empty and for a long one."""
    name = where if keys.name is None else keys.name
    if not name:
        raise InputError(f"{where}.name is empty.", 'Write name = "sheet".')
    if len(name) > LONGEST_NAME:
        raise InputError(f"{where}.name has {len(name):,} letters, more than {LONGEST_NAME}.", 'Write name = "sheet".')
    return name


def existing_file(where: str, directory: Path, name: str) -> Path:
    """The path of a file that a key names, relative to a directory. InputError where it is not there."""
    path = directory / name
    try:
        there = path.exists()
    except (OSError, ValueError):  # longer than a name may be
        there = False
    if not there:
        folder = "" if Path(name).is_absolute() else f" The path starts at the folder of the scene, {directory}/."
        raise InputError(f"{where}: there is no file {name}.", f"Correct the path.{folder}")
    return path


def examined(label: str, shape: Shape, role: Role) -> tuple[str, ...]:
    """The notes of a shape and the warnings of the mesh check, each with its name. InputError for its errors."""
    report = examine(label, shape.positions, shape.triangles, role)
    refuse(report)
    warnings = (finding.sentence for finding in report.warnings)
    return tuple(f"{label}: {note}" for note in (*shape.notes, *warnings))


def placed(keys: PlacedKeys, positions: Floats) -> Floats:
    """Positions in the scene.

    Parameters
    ----------
    keys : PlacedKeys
        With up, rotation_degrees and position.
    positions : (..., 3) ndarray [m]
        Positions of the mesh.

    Returns
    -------
    (..., 3) ndarray [m]
        Turned from y up to z up where `up` says so, rotated about x, then y, then z, and displaced.
    """
    if keys.up == "y":
        x, y, z = np.moveaxis(positions, -1, 0)
        positions = np.stack([x, -z, y], axis=-1)
    angles = np.radians(np.array(keys.rotation_degrees, np.float64))
    turn = np.eye(3)
    for axis in range(3):
        turn = rotation_matrix(angles[axis] * np.eye(3)[axis]) @ turn
    return positions @ turn.T + np.array(keys.position, np.float64)
