"""Prescribed (Dirichlet) positions at a time: bodies on their motions, pins and ghosts on theirs."""

from collections.abc import Iterable

import numpy as np

from clothsim.mesh.world import World
from clothsim.physics.energies.constraint import Constraint, Prescribed


def prescribed(world: World, constraints: Iterable[Constraint], time: float) -> Prescribed:
    """Collect all prescribed rows of x at `time` [s]: bodies that move, then those of the constraints.

    Returns
    -------
    Prescribed
        vertices (k,) and positions (k, 3) [m].
    """
    parts = [
        Prescribed(np.arange(rows.start, rows.stop), body.at(time))
        for body, rows in zip(world.bodies, world.body_slices, strict=True)
        if not body.motion.still
    ]
    parts.extend(constraint.at(time) for constraint in constraints)
    none = Prescribed(np.zeros(0, np.int64), np.zeros((0, 3)))
    return Prescribed(
        np.concatenate([none.vertices, *(part.vertices for part in parts)]),
        np.concatenate([none.positions, *(part.positions for part in parts)]),
    )
