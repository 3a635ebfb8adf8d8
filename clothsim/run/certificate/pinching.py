"""Cloth that bodies press from opposite sides."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.solve.stepping.closest_contact import HasContactPairs

OPPOSED = 0.5
"""Net force over the sum of the magnitudes below which the contact forces of a vertex oppose each other.

On a plane it is 1, in a rectangular groove or over a rectangular edge .71, between two planes 0.
"""


@dataclass(frozen=True)
class Pinches:
    """Pinched vertices in the frames so far.

    Parameters
    ----------
    frames : int
        Number of frames with some.
    most_vertices : int
        Most in a frame.
    first_time : float or None
        Time of the first such frame [s].
    first_vertex : str
        One of its vertices, by name.
    """

    frames: int = 0
    most_vertices: int = 0
    first_time: float | None = None
    first_vertex: str = ""

    def after(self, world: World, energies: Iterable[Energy], x: Floats, time: float) -> Self:
        """Return the record after one more frame at x (N, 3) [m]."""
        rows = pinched_vertices(world, energies, x)
        if not len(rows):
            return self
        record = replace(self, frames=self.frames + 1, most_vertices=max(self.most_vertices, len(rows)))
        if self.first_time is not None:
            return record
        label = int(world.labels[rows[0]])
        name = f"vertex {int(rows[0]) - world.cloth_slices[label].start} of {world.names[label]}"
        return replace(record, first_time=time, first_vertex=name)


def pinched_vertices(world: World, energies: Iterable[Energy], x: Floats) -> Ints:
    """Rows of the cloth vertices whose contact forces from bodies oppose each other at x (N, 3) [m]."""
    net, total = np.zeros((world.n_cloth, 3)), np.zeros(world.n_cloth)
    for energy in energies:
        if not isinstance(energy, HasContactPairs) or not world.bodies:
            continue
        rows, weights, lines, forces = energy.normal_forces(x, energy.stiffness)
        with_body = (rows[:, [0, 3]] >= world.n_cloth).any(axis=1)
        acting = with_body & (forces > 0)
        rows, weights, lines, forces = rows[acting], weights[acting], lines[acting], forces[acting]
        directions = forces[:, None] * lines / np.linalg.norm(lines, axis=1)[:, None]
        of_cloth = rows < world.n_cloth
        np.add.at(net, rows[of_cloth], (weights[:, :, None] * directions[:, None])[of_cloth])
        np.add.at(total, rows[of_cloth], (np.abs(weights) * forces[:, None])[of_cloth])
    pressed = total > 0
    opposed = np.linalg.norm(net, axis=1) < OPPOSED * total
    return np.flatnonzero(pressed & opposed)
