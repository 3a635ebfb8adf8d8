"""Independent reference of a scene, and the RMS distance of a run from it over the same material points.

The reference is one run that shares nothing with an extrapolation: BDF2, dt / 16, cells x 4, d_hat / 8, tight
tolerance, `midedge` bending. Two coarser ones show how far it may be from the exact solution itself (`truth`).
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

from clothsim import Run, Scene, simulate
from clothsim.base.arrays import Floats
from clothsim.scene import paths
from clothsim.scene.assembly.refinement import with_cells
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.effects import CONTACTS
from clothsim.study.evaluation import Material, at_points_of, point_areas, world_material
from clothsim.study.parameters import with_explicit_lengths
from clothsim.study.reference_solution import Norm


@dataclass(frozen=True)
class Refinement:
    """Factors by which a reference is finer than the scene; tolerance [m/s]."""

    dt: int = 16
    cells: int = 4
    d_hat: int = 8
    tolerance: float = 1e-4

    @property
    def coarser(self) -> "Refinement":
        """A level coarser in everything but the tolerance."""
        return replace(self, dt=self.dt // 2, cells=self.cells // 2, d_hat=self.d_hat // 2)


@dataclass(frozen=True)
class Solution:
    """The last frame of a run: material, positions (n, 3) [m], CPU seconds, summary.json."""

    material: Material
    positions: Floats
    seconds: float
    summary: dict[str, Any]


def reference_scene(scene: Scene, finer: Refinement = Refinement()) -> Scene:
    """The scene of the reference; lengths that the mesh gives (d_hat, eps_v) are those of the scene's own mesh."""
    solver = {key: value for key, value in scene.solver.items() if key != "error"}
    scene = with_explicit_lengths(replace(scene, solver=solver), build(scene).energies)
    scene = paths.replace(scene, "solver.dt", scene.solver_settings.dt / finer.dt)
    scene = paths.replace(scene, "solver.tolerance", finer.tolerance)
    scene = paths.replace(scene, "solver.integrator", "bdf2")
    if "bending" in scene.effects:
        scene = paths.replace(scene, "effects.bending.model", "midedge")
    for name in CONTACTS:
        if name in scene.effects:
            scene = paths.replace(scene, f"effects.{name}.d_hat", scene.effects[name]["d_hat"] / finer.d_hat)
    return with_cells(scene, Fraction(finer.cells))


def solution(scene: Scene) -> Solution:
    """Run a scene. ValueError where it does not come to its end: it is no data point."""
    started = process_time()
    with TemporaryDirectory() as folder:
        sessions: list[Any] = []
        run = simulate(scene, Path(folder) / "run", announce=sessions.append)
        seconds = process_time() - started
        return solution_of(run, sessions[-1].built.world, seconds)


def solution_of(run: Run, world: Any, seconds: float) -> Solution:
    """The last frame of a run of a world."""
    if run.status != "completed":
        raise ValueError(run.reason)
    material = world_material(world)
    return Solution(material, run.positions(-1), seconds, run.summary)


def distance(one: Solution, other: Solution) -> float:
    """RMS distance over the vertices of `one`, weighted by their areas [m]."""
    areas = point_areas(one.material)
    there = at_points_of(one.material, other.material, other.positions)
    return Norm(areas / areas.sum())(one.positions - there)


@dataclass(frozen=True)
class Truth:
    """The finest of three references and its doubt: its own RMS distance from the exact solution [m], or inf."""

    solution: Solution
    doubt: float


STEEPEST = 4.0
"""Ratio of two successive distances at most, of order 2: a larger one is a coincidence on the coarsest run."""
LEAST = 1.25
"""Ratio below which three solutions show no convergence."""


def doubt_of(coarse: float, fine: float) -> float:
    """Distance of the finest of three solutions from their limit [m] by the distances of neighbours.

    With e_k = c q^-k the distances are coarse = c (q - 1) / q and fine = coarse / q, and what is left is
    fine / (q - 1).

    Examples
    --------
    >>> doubt_of(4e-3, 1e-3)  # order 2
    0.000333...
    >>> doubt_of(1e-3, 1e-3)  # no convergence
    inf
    """
    ratio = min(coarse / fine, STEEPEST) if fine > 0 else STEEPEST
    return fine / (ratio - 1) if ratio >= LEAST else float("inf")


def truth(scene: Scene, finest: Refinement = Refinement()) -> Truth:
    """The reference of a scene with its doubt, by three runs each a level finer than the one before."""
    levels = (finest.coarser.coarser, finest.coarser, finest)
    first, second, last = (solution(reference_scene(scene, each)) for each in levels)
    return Truth(last, doubt_of(distance(first, second), distance(second, last)))
