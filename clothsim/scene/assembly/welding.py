"""Sewing of panels before a cloth is made: the key `weld`."""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.checks import examine, refuse
from clothsim.mesh.topology import renumbered_groups
from clothsim.mesh.weld import flaps, mean_of_parts, weld
from clothsim.scene.assembly.placement import Shape


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
