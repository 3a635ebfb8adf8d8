"""Runs of a scene at a resolution: pilot runs, of which only the last positions are kept, and their distances."""

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np

from clothsim import Run, Scene
from clothsim.base.arrays import Floats
from clothsim.engine import Session, last_positions
from clothsim.study.error_control.resolution import Resolution
from clothsim.study.resample import Material, at_points_of, point_areas, world_material


@dataclass(frozen=True)
class Trial:
    """A run.

    Parameters
    ----------
    resolution : Resolution
        Its resolution.
    material : Material
        Its mesh at rest.
    positions : (n, 3) float64
        Cloth vertices at the last frame [m].
    seconds : float
        Processor seconds.
    reason : str
        Why it came to no end; empty where it did.
    """

    resolution: Resolution
    material: Material
    positions: Floats
    seconds: float
    reason: str = ""


Runs = Callable[[Scene, list[Session]], Run]
"""Runs a scene with fixed settings into the output directory; the list receives the session that it announces."""
Distance = Callable[[Trial, Trial], float]
ANOTHER_SHAPE = 0.1
"""Distance of two runs over the size of the cloth from which no order of convergence holds between them."""


def pilot(scene: Scene, resolution: Resolution) -> Trial:
    """Run a scene at a resolution without writing anything."""
    started = process_time()
    world, positions, reason = last_positions(scene)
    return Trial(resolution, world_material(world), positions, process_time() - started, reason)


def another_shape(finer: Trial, moved: float) -> bool:
    """True where a coarser run ends so far away [m] that it is another solution rather than a less accurate one."""
    return moved > ANOTHER_SHAPE * float(np.linalg.norm(np.ptp(finer.positions, axis=0)))


def distance_at(points: Material) -> Distance:
    """RMS distance of two runs [m] over these material points, weighted by their areas."""
    areas = point_areas(points)
    weights = areas / areas.sum()

    def distance(one: Trial, other: Trial) -> float:
        here, there = (at_points_of(points, each.material, each.positions) for each in (one, other))
        return float(np.sqrt(weights @ ((here - there) ** 2).sum(axis=1)))

    return distance
