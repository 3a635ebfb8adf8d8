"""Cloth of a sewing pattern: panels meshed and placed as in the file, sewn where they touch."""

from pathlib import Path
from typing import Any

import numpy as np

from clothsim.mesh.cloth import PatternLines
from clothsim.mesh.weld import mean_of_parts
from clothsim.patterns.pattern_mesh import TOUCHING, PatternMesh, largest_gap, mesh_pattern, scaled_mesh, sewn_vertices
from clothsim.patterns.specification import read_specification
from clothsim.scene.assembly.shapes import Shape


def shape_of_pattern(path: Path, keys: Any) -> Shape:
    """The mesh of a sewing pattern in a [cloth] table.

    Parameters
    ----------
    path : Path
        The `specification.json`.
    keys : ClothTable
        Of a sewing pattern: with size, rotation_order and scale.

    Returns
    -------
    Shape
        At rest flat, warp along y of each panel; `groups`: the triangles of each panel. A seam whose gap is below
        `TOUCHING` throughout is welded; a note names those that stay open.

    Raises
    ------
    InputError
        Naming the panel, edge or stitch, as `read_specification` and `mesh_pattern`.
    """
    mesh = mesh_of_file(path, keys)
    closed = [seam for seam in mesh.seams if largest_gap(mesh.positions, seam) < TOUCHING]
    still_open = [seam.name for seam in mesh.seams if not any(seam is other for other in closed)]
    number = sewn_vertices(mesh, closed)
    notes = list(mesh.pattern.notes)
    if still_open:
        named = ", ".join(still_open[:3]) + (", ..." if len(still_open) > 3 else "")
        notes.append(f"{len(still_open)} of {len(mesh.seams)} seams stay open as placed ({named})")
    groups = {name: np.arange(rows.start, rows.stop) for name, rows in mesh.faces.items()}
    return Shape(
        mean_of_parts(mesh.positions, number),
        number[mesh.triangles],
        mesh.material_coordinates,
        tuple(notes),
        groups,
        flat=True,
        lines=lines_of(mesh).renumbered(number),
    )


def lines_of(mesh: PatternMesh) -> PatternLines:
    """Edges, labels and seams of a meshed pattern whose seams are all open."""
    edges = {(side.panel, side.edge): rows for side, rows in mesh.edges.items()}
    labels = {label: tuple((side.panel, side.edge) for side in sides) for label, sides in mesh.labelled().items()}
    return PatternLines(edges, labels, {seam.name: seam.pairs for seam in mesh.seams})


def mesh_of_file(path: Path, keys: Any) -> PatternMesh:
    """The meshed pattern of a [cloth], in metres of the scene; parameters and errors as `shape_of_pattern`."""
    mesh = mesh_pattern(read_specification(path, keys.rotation_order), keys.size / keys.scale)
    return mesh if keys.scale == 1.0 else scaled_mesh(mesh, keys.scale)
