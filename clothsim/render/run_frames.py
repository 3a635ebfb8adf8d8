"""Frames of a run as surfaces to draw."""

from collections.abc import Callable, Sequence
from typing import overload

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.files.runs.trajectory import Trajectory
from clothsim.mesh.world import World, world_surfaces
from clothsim.render.surface_look import Surface


def frame_surfaces(trajectory: Trajectory, frame: int) -> list[Surface]:
    """The cloths, then the bodies of a frame; cloths without stretches where the run wrote none."""
    positions = trajectory.positions(frame)
    cloths = [surface for surface in trajectory.surfaces if surface.role == "cloth"]
    ends = np.cumsum([len(cloth.triangles) for cloth in cloths])
    stretches = np.split(_stretches(trajectory, frame), ends[:-1])
    first = trajectory.positions(0)
    made = [
        Surface(cloth.name, positions[cloth.rows], cloth.own_triangles, "cloth", part, material=first[cloth.rows])
        for cloth, part in zip(cloths, stretches, strict=True)
    ]
    none = np.zeros((0, 2))
    return made + [
        Surface(name, points, triangles, "body", none) for name, points, triangles in trajectory.bodies(frame)
    ]


def state_surfaces(world: World, x: Floats, stretches: Floats) -> list[Surface]:
    """The cloths, then the bodies of a state: x (N, 3) [m] and the principal stretches (m, 2) of all cloths."""
    parts = world_surfaces(world)
    of_cloths = np.split(stretches, np.cumsum([len(part.triangles) for part in parts if part.role == "cloth"]))
    none = np.zeros((0, 2))
    return [
        Surface(part.name, x[part.rows], part.own_triangles, part.role, of_cloths[k] if part.role == "cloth" else none)
        for k, part in enumerate(parts)
    ]


class Frames(Sequence[list[Surface]]):
    """All frames of a run, each read when it is asked for; surfaces_of: the surfaces of a frame."""

    def __init__(
        self, trajectory: Trajectory, surfaces_of: Callable[[Trajectory, int], list[Surface]] = frame_surfaces
    ) -> None:
        self._trajectory, self._surfaces_of = trajectory, surfaces_of

    def __len__(self) -> int:
        return len(self._trajectory.times)

    @overload
    def __getitem__(self, frame: int) -> list[Surface]: ...

    @overload
    def __getitem__(self, frame: slice) -> list[list[Surface]]: ...

    def __getitem__(self, frame: int | slice) -> list[Surface] | list[list[Surface]]:
        if isinstance(frame, slice):
            return [self._surfaces_of(self._trajectory, k) for k in range(*frame.indices(len(self)))]
        if not -len(self) <= frame < len(self):
            raise IndexError(frame)
        return self._surfaces_of(self._trajectory, frame)


def _stretches(trajectory: Trajectory, frame: int) -> Floats:
    try:
        return np.asarray(trajectory.stretches(frame), np.float64)
    except InputError:  # a trajectory written without them
        return np.zeros((0, 2))
