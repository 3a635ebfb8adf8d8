"""Shapes: meshes of a scene before they are placed, wound alike, sewn, one-sided and checked."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.mesh_keys import FilePart, PlacedKeys
from clothsim.keys.schema import keys_of
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.checks import Role, examine, refuse
from clothsim.mesh.cloth import PatternLines
from clothsim.mesh.topology import duplicates, renumbered_groups
from clothsim.mesh.weld import flaps, mean_of_parts, weld
from clothsim.mesh.winding import facing_away, wound

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


def checked_notes(label: str, shape: Shape, role: Role) -> tuple[str, ...]:
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


def wound_alike(shape: Shape, body: Floats | None = None) -> Shape:
    """A shape whose triangles are wound alike in each component: as most of them, or away from a body (k, 3) [m].

    The material plane of a turned triangle is mirrored with it, which keeps warp and weft.
    """
    triangles, turned = wound(shape.triangles, len(shape.positions))
    if not turned.any():
        return shape
    how = "as most of their piece"
    if body is not None:
        triangles = facing_away(shape.positions, triangles, body, turned)
        how = "away from the body"
    swapped = (triangles != shape.triangles).any(axis=1)
    texture = shape.texture
    if len(texture):
        texture = np.where(swapped[:, None, None], texture[:, [0, 2, 1]] * [1.0, -1.0], texture)
    count, first = np.count_nonzero(swapped), np.flatnonzero(turned)[0]
    note = (
        f"{count} of {len(triangles)} triangles (the first {first}) are rewound {how}: their winding was inconsistent"
    )
    return replace(shape, triangles=triangles, texture=texture, notes=(*shape.notes, note))


def sewn(label: str, shape: Shape, start: Floats | None, gap: float, at_start: bool) -> tuple[Shape, Floats | None]:
    """A shape whose borders closer than a gap are joined; triangles folded onto one another are left out.

    Parameters
    ----------
    label : str
        Name of the cloth.
    shape : Shape
        Its mesh.
    start : (n, 3) ndarray [m], optional
        Initial positions, which are joined with the shape.
    gap : float
        Largest distance of borders that are joined [m].
    at_start : bool
        True: distances are those of the start, which becomes the positions of the sewn shape; else of the shape.

    Returns
    -------
    shape : Shape
    start : (k, 3) ndarray [m] or None

    Raises
    ------
    InputError
        For a mesh with faults other than those that sewing makes.
    """
    report = examine(label, shape.positions, shape.triangles)
    refuse(replace(report, findings=tuple(fault for fault in report.findings if fault.kind != "soup")))
    measured = start if at_start and start is not None else shape.positions
    positions, triangles, number = weld(measured, shape.triangles, gap)
    notes = [*shape.notes, f"{len(number) - len(positions)} border vertices were welded"]
    folded = flaps(triangles)
    if len(folded):
        notes.append(f"{len(folded)} triangles sewn to one another on all sides were left out, the first {folded[0]}")
    remaining = np.delete(np.arange(len(triangles)), folded)
    used, faces = np.unique(triangles[remaining], return_inverse=True)
    texture = shape.texture[remaining] if len(shape.texture) else shape.texture
    joined = None if start is None else mean_of_parts(start, number)[used]
    groups = renumbered_groups(shape.groups, remaining)
    became = np.full(len(positions), -1)
    became[used] = np.arange(len(used))
    faces = faces.reshape(-1, 3).astype(np.int64)
    lines = shape.lines.renumbered(became[number])
    made = Shape(positions[used], faces, texture, tuple(notes), groups, sewn=became[number], lines=lines)
    return made, joined


TWO_SIDED = 0.8
"""Least fraction of triangles that are given twice, with opposite windings, in a two-sided mesh."""


def worn_shape(
    name: str, positions: Floats, triangles: Ints, notes: tuple[str, ...], weld: float = 0.0, body: Floats | None = None
) -> Shape:
    """Shape of a garment, with notes of what was changed.

    weld: borders closer than that are sewn [m]; body (k, 3) [m]: what wears it, from which triangles of inconsistent
    winding are turned away. InputError for a mesh that no body may have.
    """
    shape = one_sided(Shape(positions, triangles, np.zeros((0, 3, 2)), notes))
    shape = wound_alike(shape, body)
    if weld:
        shape, _ = sewn(name, shape, None, weld, at_start=False)
        shape = wound_alike(shape, body)
    refuse(examine(name, shape.positions, shape.triangles, "body"))
    return shape


def refuse_unwearable(name: str, positions: Floats, triangles: Ints, *, sewn: bool) -> tuple[str, ...]:
    """InputError for a mesh that no cloth may have; the sentences on what may be a fault."""
    report = examine(name, positions, triangles, "sewn cloth" if sewn else "cloth")
    refuse(report)
    return tuple(finding.sentence for finding in report.warnings)


def one_sided(shape: Shape) -> Shape:
    """A shape without the second side of a mesh most of whose triangles are given twice, with opposite windings."""
    if ((shape.triangles < 0) | (shape.triangles >= len(shape.positions))).any():
        return shape  # the mesh check names them
    flipped = duplicates(shape.triangles)[1]
    if 2 * len(flipped) < TWO_SIDED * len(shape.triangles):
        return shape
    note = f"a two-sided mesh: {len(flipped)} triangles given again with opposite winding are left out"
    return replace(shape, triangles=np.delete(shape.triangles, flipped, axis=0), notes=(*shape.notes, note))
