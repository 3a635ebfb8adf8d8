"""Expected cost of a run: steps, memory, processor time and disk space, before anything is built."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from clothsim.base.errors import InputError
from clothsim.keys.generator_keys import GENERATOR_KEYS, GarmentKeys
from clothsim.keys.key_table import KeyTable
from clothsim.scene.scene import Scene

BYTES_AT_START, BYTES_A_VERTEX, BYTES_A_BODY_VERTEX = 2.3e8, 1.3e4, 2e3
"""Memory, by runs of a sheet with contact: 260, 384 and 750 MB at 1,681, 10,201 and 40,401 vertices (2026-11-22)."""
SECONDS_A_STEP, SECONDS_A_VERTEX = 2e-3, 9e-5
"""Processor time of a step with three to four Newton iterations, by the same runs: .9 s and 3.5 s."""
FRAME_BYTES_A_VERTEX = 40.0
"""Positions, and stretches of two triangles, uncompressed."""

GARMENT_AREA = 1.5
"""Vertices of a generated garment times its edge length squared [m2], at most."""

NOTABLE_SECONDS, NOTABLE_BYTES, NOTABLE_DISK = 3600.0, 4e9, 1e10
MOST_SECONDS, MOST_STEPS, MOST_DISK = 14 * 86400.0, 1e7, 1e12
"""Bounds that --force lifts."""
_MEMORY = 6.4e10
"""Bound where the memory of the machine is not known."""


@dataclass(frozen=True)
class Cost:
    """Expected cost of a run; right within a factor of a few.

    Parameters
    ----------
    vertices, body_vertices : int
        Of generated meshes alone; those of files are known when they are read.
    steps, frames : float
        Numbers of time steps, without halved ones, and of frames.
    """

    vertices: int
    body_vertices: int
    steps: float
    frames: float

    @property
    def memory(self) -> float:
        """Largest memory [bytes]."""
        return BYTES_AT_START + BYTES_A_VERTEX * self.vertices + BYTES_A_BODY_VERTEX * self.body_vertices

    @property
    def seconds(self) -> float:
        """Processor time [s]."""
        return self.steps * (SECONDS_A_STEP + SECONDS_A_VERTEX * self.vertices)

    @property
    def disk(self) -> float:
        """Size of the trajectory [bytes]."""
        return self.frames * FRAME_BYTES_A_VERTEX * self.vertices

    @property
    def notable(self) -> bool:
        """True where the user should know it before the run."""
        large = self.memory > NOTABLE_BYTES or self.disk > NOTABLE_DISK
        return large or self.seconds > NOTABLE_SECONDS

    @property
    def too_much(self) -> bool:
        """True beyond the bounds, of which that on memory is the machine's."""
        large = self.memory > _machine_memory() or self.disk > MOST_DISK
        return large or self.seconds > MOST_SECONDS or self.steps > MOST_STEPS

    def __str__(self) -> str:
        hours = self.seconds / 3600
        time = f"{hours:.2g} hours" if hours < 72 else f"{_count(hours / 24)} days"
        meshes = f"{self.vertices:,} generated vertices of cloth"
        meshes += f", {self.body_vertices:,} of bodies" if self.body_vertices else ""
        return (
            f"{meshes}, {_count(self.steps)} steps and {_count(self.frames)} frames: about "
            f"{self.memory / 1e9:,.2g} GB of memory, {time} of processor time, {self.disk / 1e9:,.2g} GB of trajectory"
        )


def _count(number: float) -> str:
    return f"{number:,.0f}" if number < 1e12 else f"{number:.2g}"


def expected_cost(scene: Scene) -> Cost:
    """Expected cost of a scene, from its keys alone.

    Examples
    --------
    >>> import clothsim
    >>> sheet = {"mesh": "rectangle", "cells": [2000, 2000]}
    >>> cost = expected_cost(clothsim.Scene(cloth=sheet, effects=[clothsim.Inertia()]))
    >>> cost.vertices, cost.steps, round(cost.memory / 1e9)
    (4004001, 200.0, 52)
    """
    run, solver = scene.run_settings, scene.solver_settings
    dt = min(solver.longest_step, 1 / run.frames_per_second)
    cloths, bodies = (sum(_vertices(keys) for keys in tables) for tables in (scene.cloths, scene.bodies))
    return Cost(cloths, bodies, run.duration / dt, run.duration * run.frames_per_second)


CHEAPER = "Use fewer cells, a larger solver.dt, or fewer frames; --force runs it all the same."


def refuse_costly(scene: Scene) -> None:
    """InputError where the expected cost is beyond the bounds."""
    cost = expected_cost(scene)
    if cost.too_much:
        raise InputError(f"The run would take {cost}.", CHEAPER)


def _vertices(keys: KeyTable) -> int:
    """Number of vertices of a generated mesh; 0 of a file, and of those that no key makes large."""
    mesh = getattr(keys, "mesh", None)
    if not isinstance(mesh, str) or mesh not in GENERATOR_KEYS:
        return 0
    if isinstance(keys, GarmentKeys):
        return round(GARMENT_AREA / keys.edge**2)
    count = _COUNTS.get(mesh)
    if count is None:
        return 0
    given = getattr(keys, "subdivisions" if mesh == "sphere" else "cells")
    cells = [int(n) for n in given] if isinstance(given, Sequence) else [int(given)]
    return count(*cells) + (cells[0] * cells[1] if getattr(keys, "diagonals", "") == "crisscross" else 0)


_COUNTS: Mapping[str, Callable[..., int]] = {
    "rectangle": lambda a, b: (a + 1) * (b + 1),
    "tube": lambda around, along: around * (along + 1),
    "slab": lambda a, b, c: 2 * (a * b + b * c + c * a + 1),
    "disk": lambda rings: 3 * rings * (rings + 1) + 1,
    "pillow": lambda rings: 6 * rings * rings + 2,
    "sphere": lambda subdivisions: 10 * 4**subdivisions + 2,
}
"""Numbers of vertices of generated meshes by the values of their key `cells` (of a sphere: subdivisions)."""


def _machine_memory() -> float:
    """Memory of the machine [bytes]."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not on Windows
        return _MEMORY
