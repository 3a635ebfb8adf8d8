"""Time error of a step as Newton's method sees it, for the balance of both errors."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.solve.newton.convergence import ErrorBalance, MotionStop
from clothsim.solve.stepping.integrators import Formula
from clothsim.solve.stepping.local_error import VELOCITY_ERROR_FACTOR, step_error, vertex_errors
from clothsim.solve.stepping.state import State


def error_balance(
    fraction: float, integrator: str, formula: Formula, before: State, count: int, h: float, held: Ints
) -> ErrorBalance:
    """Return the balance of Newton's error against the local error of a step of length h [s].

    The error is that of the positions at the end of this step, by `step_error` without the factor for what velocities
    add later: Newton's error enters the velocities too.

    Parameters
    ----------
    fraction : float
        Fraction of the time error that Newton may leave.
    integrator : str
        "backward_euler" or "bdf2".
    formula : Formula
        Formula of the step.
    before : State
        Start of the step.
    count : int
        Number of cloth vertices.
    held : (k,) int64
        Prescribed rows, which have no error.
    """

    def time_error(x: Floats) -> tuple[float, float]:
        error = step_error(integrator, formula, before, formula.velocities(x)[:count], h, held)
        return error.rms / VELOCITY_ERROR_FACTOR, error.largest / VELOCITY_ERROR_FACTOR

    return ErrorBalance(fraction, count, time_error)


def motion_stop(
    fraction: float,
    least: float,
    integrator: str,
    formula: Formula,
    world: World,
    before: State,
    h: float,
    held: Ints,
) -> MotionStop:
    """Return the stop by the motion of a step of length h [s].

    Parameters
    ----------
    fraction : float
        Fraction of the time error that the last Newton step may have.
    least : float
        Root mean square of a step that ends a solve whatever the time error [m].
    integrator, formula, before, held
        As of `error_balance`.
    world : World
        Meshes.
    """
    bodies = (*world.cloth_slices, *world.coordinate_slices)

    def time_errors(x: Floats) -> Floats:
        after = formula.velocities(x)[: world.n_unknowns]
        lengths = vertex_errors(integrator, formula, before, after, h, held) / VELOCITY_ERROR_FACTOR
        return np.array([np.sqrt((lengths[rows] ** 2).mean()) for rows in bodies])

    return MotionStop(fraction, bodies, time_errors, world.cell, least)
