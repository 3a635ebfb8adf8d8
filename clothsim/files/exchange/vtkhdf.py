"""VTKHDF in another unit, axes or rate than the run's own trajectory, with stretches and without its other fields."""

from pathlib import Path

import numpy as np

from clothsim.base.file_writing import replacing
from clothsim.files.exchange.animation import Animation
from clothsim.files.runs.trajectory import TrajectoryWriter
from clothsim.files.runs.vtkhdf import FrameArray
from clothsim.mesh.world import SurfaceRows

STRETCH = FrameArray("stretch", "triangle")


def files(animation: Animation, target: Path) -> list[Path]:
    """One file."""
    return [target]


def write(animation: Animation, target: Path) -> None:
    """Write the file."""
    surfaces, start = [], 0
    for part, shape in zip(animation.parts, animation.at(0), strict=True):
        rows = slice(start, start + len(shape.points))
        surfaces.append(SurfaceRows(part.name, part.role, rows, part.triangles + start, part.moving))
        start = rows.stop
    with replacing(target) as beside, TrajectoryWriter(beside, surfaces, stretches=False, fields=[STRETCH]) as writer:
        for k, time in enumerate(animation.times):
            shapes = animation.at(k)
            stretch = np.concatenate(
                [s.stretch for s, part in zip(shapes, animation.parts, strict=True) if part.role == "cloth"]
            )
            writer.append(time, np.concatenate([shape.points for shape in shapes]), fields={STRETCH.name: stretch})
