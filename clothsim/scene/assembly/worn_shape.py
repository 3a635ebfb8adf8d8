"""Shape of a garment as its file has it, made one-sided, wound alike and sewn before it is checked as a cloth."""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.checks import examine, refuse
from clothsim.mesh.topology import duplicates
from clothsim.scene.assembly.placement import Shape
from clothsim.scene.assembly.welding import sewn
from clothsim.scene.assembly.winding import wound_alike

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
