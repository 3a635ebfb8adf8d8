"""Difference formulas of a step, the positions that it prescribes, and the start of its solve.

Backward Euler, and BDF2 with variable steps (docs/theory.md#time-integration).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.rigid_body import CORNERS, RigidBody
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Past, Prescribed
from clothsim.solve.linear.dependent_rows import DependentRows
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import Previous, State

BACKWARD_EULER, BDF2 = "backward_euler", "bdf2"

LARGEST_RATIO = 2.4
"""Largest ratio of a step to the one before for BDF2, which is unstable from 1 + sqrt(2) on (Grigorieff 1983); backward
Euler steps there.
"""


@dataclass(frozen=True)
class Formula:
    """Difference formula v = (x - past.positions) / past.dt.

    Parameters
    ----------
    past : Past
        Weighted past positions (N, 3) [m], velocities [m/s] and length [s].
    order : int
        1 or 2.
    ratio : float
        h_n / h_(n-1); nan for a one-step formula.
    """

    past: Past
    order: int
    ratio: float = float("nan")

    def velocities(self, x: Floats) -> Floats:
        """Return v at the end of the step that ends at x (N, 3) [m/s]."""
        return (x - self.past.positions) / self.past.dt


def formula_of(integrator: str, state: State, h: float) -> Formula:
    """Return the formula of a step of length h [s] from `state`.

    BDF2 starts with a step of backward Euler: at the start, without a previous state, and after a step so short that
    the ratio would be LARGEST_RATIO or more.
    """
    before = state.previous
    if integrator == BDF2 and before is not None and h / before.dt < LARGEST_RATIO:
        ratio = h / before.dt
        return Formula(bdf2_past(state, before, h, ratio), 2, ratio)
    return Formula(Past(state.positions, state.velocities, h), 1)


def bdf2_past(state: State, before: Previous, h: float, r: float) -> Past:
    """Return x^ = ((1+r)^2 x_n - r^2 x_(n-1)) / (1+2r), v^ alike, and b h with b = (1+r) / (1+2r)."""
    new, old = (1 + r) ** 2 / (1 + 2 * r), r**2 / (1 + 2 * r)
    return Past(
        new * state.positions - old * before.positions,
        new * state.velocities - old * before.velocities,
        (1 + r) / (1 + 2 * r) * h,
    )


# Prescribed (Dirichlet) positions at a time: bodies on their motions, pins and ghosts on theirs.


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


# Start of Newton's method in a step of rigid bodies: each moved as it turns and flies, where that is free of contact.
#
# From the positions at the start of the step a body would have to turn through states in which its stiff energy is
# large; with a block that turns by 9 degrees a step that takes 13 iterations, from its predicted state 3.


LEAST_TURN = 1e-3
"""Rotation in a step below which Newton's method starts from the positions as they are [rad]."""


def predicted_start(world: World, dependent: DependentRows, bound: Potential, state: State, h: float) -> Floats:
    """Return the positions (N, 3) [m] from which a step of length h [s] is solved; those of `state` without a turn.

    Parameters
    ----------
    world : World
        Meshes.
    dependent : DependentRows
        Vertices of the rigid bodies.
    bound : Potential
        Potential bound to the step: the way to the prediction must be free of contact, and its energy finite.
    state : State
        Start of the step.
    h : float
        Length of the step [s].
    """
    displacement, turns = np.zeros_like(state.positions), False
    for body, rows in zip(world.rigid, world.coordinate_slices, strict=True):
        now, rates = state.positions[rows], state.velocities[rows]
        spin = angular_velocity(body, now, rates)
        if np.linalg.norm(spin) * h > LEAST_TURN:
            turns = True
            turn = rotation_matrix(h * spin).T
            if len(now) < len(CORNERS):
                ahead = now @ turn
            else:  # a free body, whose centre flies
                centre, velocity = now.mean(axis=0), rates.mean(axis=0)
                ahead = (now - centre) @ turn + centre + h * velocity
            displacement[rows] = ahead - now
    if not turns:
        return state.positions
    displacement = dependent.follow(displacement)
    if bound.step_limit(state.positions, displacement) < 1.0:
        return state.positions
    ahead = state.positions + displacement
    return ahead if np.isfinite(bound.value(ahead)) else state.positions


def angular_velocity(body: RigidBody, coordinates: Floats, rates: Floats) -> Floats:
    """Return the angular velocity (3,) [rad/s] of a body with the coordinates (k, 3) [m] and their rates [m/s]."""
    rate = rates.T @ body.gradients @ np.linalg.inv(body.deformation(coordinates))
    return 0.5 * np.array([rate[2, 1] - rate[1, 2], rate[0, 2] - rate[2, 0], rate[1, 0] - rate[0, 1]])
