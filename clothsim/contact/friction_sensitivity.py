"""Derivative of lagged friction by the start of a step: displacements, normals, weights and normal forces.

The force of a pair is L f0'(|u|)/|u| g_i u with u = (I - n n') sum_i g_i (x_i - start_i). It depends on the start of
the displacements, by minus its Hessian; and on the pair's own twelve coordinates at the start of the step, from which
the limit L = mu F, the normal n and the weights g are lagged. For those the pairs are taken apart, each with vertices
of its own, so that one coordinate of all pairs is varied at a time, by central differences of fourth order.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.contact import barrier_kernels
from clothsim.energies.protocols import PastSensitivity
from clothsim.energies.step import Step

if TYPE_CHECKING:
    from clothsim.contact.barrier import Barrier
    from clothsim.contact.friction import Friction

STEP = 3e-5
"""Displacement of a coordinate, as a fraction of the gap of its pair. Ten times more is wrong by 1e-6 where edges are
nearly parallel, ten times less rounds."""
WITHIN_RANGE = 0.1
"""Largest displacement as a fraction of what is left to the end of the barrier, where its third derivative jumps."""

MOST_REDUCTIONS = 4
"""Tenfold reductions of the displacement for a pair whose closest features change within it: the lagged weights and
normal have a kink there."""

STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
"""Offsets and weights of the first derivative, of fourth order."""


def friction_sensitivity(friction: "Friction", step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
    """Return d(adjoint . friction gradient(x)) by the start of the step, for contacts that creep.

    Parameters
    ----------
    friction : Friction
        Bound to `step`, with eps_v.
    step : Step
        Its start.
    x, adjoint : (N, 3) array
        Positions at the end of the step [m], and the adjoint of the forces [m].

    Returns
    -------
    PastSensitivity
        By `Step.positions` (what is lagged) and by the past positions (the start of displacements).
    """
    blocks = friction.hessian(x)
    products = blocks.times(adjoint[blocks.elements].reshape(len(blocks.elements), 12)).reshape(-1, 4, 3)
    by_start = -_scattered(blocks.elements, products, len(x))
    by_lag = np.zeros_like(x)
    displacements = x - friction.contacts.start
    for name, barrier in ((each.name, each) for each in friction.contacts.barriers):
        stiffness = float(step.memory.get(name, barrier.stiffness))
        by_lag += _by_lag(friction, barrier, stiffness, step.positions, displacements, adjoint)
    return PastSensitivity(positions=by_lag, past_positions=by_start)


def _by_lag(
    friction: "Friction", barrier: "Barrier", stiffness: float, at: Floats, displacements: Floats, adjoint: Floats
) -> Floats:
    """The derivative by the positions `at` the start from which the pairs of one barrier are lagged, (N, 3)."""
    pairs = barrier.distinct(at)
    if not len(pairs):
        return np.zeros_like(at)
    elements, p = pairs.elements, len(pairs)
    coefficients = friction.static[friction.labels[elements[:, 0]], friction.labels[elements[:, 3]]]
    corners = at[elements]
    corners = corners - corners.mean(axis=1, keepdims=True)
    own = np.arange(4 * p).reshape(p, 4)
    least_gap = friction.contacts.least_gap * barrier.d_hat
    lists = own, pairs.weights, pairs.thresholds, pairs.n_points, barrier.offset, barrier.d_hat, least_gap
    moved, turned = displacements[elements], adjoint[elements]

    def power(points: Floats) -> tuple[Floats, np.ndarray]:
        """Adjoint . friction force of each pair, (p,), its vertices at `points` (p, 4, 3) at first; its features."""
        weights, differences, slopes = barrier_kernels.normal_forces(points.reshape(-1, 3), *lists)
        limits = np.maximum(-stiffness * coefficients * slopes, 0.0)
        normals = differences / np.linalg.norm(differences, axis=1, keepdims=True)
        u, along = (np.einsum("pk,pkc->pc", weights, each) for each in (moved, turned))
        u = u - np.einsum("pc,pc->p", u, normals)[:, None] * normals
        values = limits * _per_length(np.linalg.norm(u, axis=1), friction.contacts.slip) * (u * along).sum(axis=1)
        return values, weights == 0

    differences = barrier_kernels.normal_forces(corners.reshape(-1, 3), *lists)[1]
    gaps = np.linalg.norm(differences, axis=1) - barrier.offset
    steps = np.minimum(STEP * gaps, WITHIN_RANGE * (barrier.d_hat - gaps))
    slopes, switched = _by_corners(power, corners, elements, steps)
    for _ in range(MOST_REDUCTIONS):
        if not switched.any():
            break
        steps = np.where(switched, 0.1 * steps, steps)
        again, still = _by_corners(power, corners, elements, steps)
        slopes, switched = np.where(switched[:, None, None], again, slopes), switched & still
    return _scattered(elements, slopes, len(at))


def _by_corners(
    power: Callable[[Floats], tuple[Floats, np.ndarray]], corners: Floats, elements: Ints, steps: Floats
) -> tuple[Floats, np.ndarray]:
    """Derivatives (p, 4, 3) by each corner; the pairs whose closest features change within the differences, (p,)."""
    slopes, features = np.zeros(corners.shape), power(corners)[1]
    switched = np.zeros(len(corners), bool)
    for slot in range(4):
        same = elements == elements[:, slot : slot + 1]  # a corner may be there twice: both are one vertex
        first = same.argmax(axis=1) == slot
        for k in range(3):
            offset = np.zeros_like(corners)
            offset[:, :, k] = same * steps[:, None]
            total = np.zeros(len(corners))
            for factor, weight in STENCIL:
                values, near = power(corners + factor * offset)
                total += weight * values
                switched |= (near != features).any(axis=1)
            slopes[:, slot, k] = np.where(first, total / steps, 0.0)
    return slopes, switched


def _per_length(length: Floats, e: float) -> Floats:
    """f0'(y)/y [1/m], as in `friction_kernels`."""
    slipping = 1.0 / np.maximum(length, e)
    return np.where(length >= e, slipping, (2.0 - length / e) / e)


def _scattered(elements: Ints, vectors: Floats, n: int) -> Floats:
    """Sum vectors (p, 4, 3) into the rows of their vertices, (n, 3)."""
    out = np.zeros((n, 3))
    np.add.at(out, elements.ravel(), vectors.reshape(-1, 3))
    return out
