"""Sewing the panels of a cloth before it is made: the key `weld`."""

from dataclasses import replace

import numpy as np

from clothsim.arrays import Floats
from clothsim.build.placement import Shape
from clothsim.mesh.checks import examine, refuse
from clothsim.mesh.topology import renumbered_groups
from clothsim.mesh.weld import flaps, mean_of_parts, weld


def sewn(label: str, shape: Shape, start: Floats | None, gap: float, at_start: bool) -> tuple[Shape, Floats | None]:
    """`shape` with the borders closer than `gap` [m] joined, and its `start (n, 3)` with them; flaps are left out.

    Whether borders are close is judged in the shape; at_start: in the start, which then is the sewn shape's positions
    too. Only what sewing makes is excused afterwards: a mesh with faults of its own is refused here (InputError).
    """
    report = examine(label, shape.positions, shape.triangles)
    refuse(replace(report, findings=tuple(fault for fault in report.findings if fault.kind != "soup")))
    touching = start if at_start and start is not None else shape.positions
    positions, triangles, number = weld(touching, shape.triangles, gap)
    notes = [*shape.notes, f"{len(number) - len(positions)} border vertices were welded"]
    folded = flaps(triangles)
    if len(folded):
        notes.append(f"{len(folded)} triangles sewn to one another on all sides were left out, the first {folded[0]}")
    kept = np.delete(np.arange(len(triangles)), folded)
    used, faces = np.unique(triangles[kept], return_inverse=True)
    texture = shape.texture[kept] if len(shape.texture) else shape.texture
    together = None if start is None else mean_of_parts(start, number)[used]
    groups = renumbered_groups(shape.groups, kept)
    return Shape(positions[used], faces.reshape(-1, 3).astype(np.int64), texture, tuple(notes), groups), together
