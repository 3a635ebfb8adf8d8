"""Derivative of lagged friction by the start of a step: displacements, normals, weights and normal forces.

With D = sum g_i (x_i - start_i) and w = sum g_i a_i of a pair, a the adjoint, the power of its force is

    P = L f(|u|) u.w,    u = (I - n n') D,    f(y) = f0'(y)/y,    n = r/|r|

It depends on the start of the displacements, by minus the Hessian; and on the pair's own twelve coordinates y_i at the
start of the step, from which the limit L = mu F, the normal n and the weights g are lagged. By r and g, with
q = f w + f' (u.w) u/|u| and L by its chain,

    P_g_i = L ((I - n n') q . (x_i - start_i) + f u . a_i)
    P_r   = L_r f u.w - L ((q.n) u + (D.n)(I - n n') q)/|r|

and, as r = sum g_i y_i is the shortest over the feature's tangents t_a with dg = c_a dp_a (`distance`),

    P_y_i = g_i P_r - sum_a (t_a . P_r + c_a . P_g) (g_i t_a + c_ai r)    (+ L's mollifier of nearly parallel edges).
"""

from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.jit import kernel, natural, part
from clothsim.base.vectors import dot, four_points
from clothsim.physics.contact.barrier_kernels import barrier as barrier_function
from clothsim.physics.contact.barrier_kernels import cross_squared, cross_squared_gradient, edges, mollifier
from clothsim.physics.contact.distance import closest_points, tangent_directions
from clothsim.physics.energies.protocols import PastSensitivity
from clothsim.physics.energies.step import Step

if TYPE_CHECKING:
    from clothsim.physics.contact.barrier import Barrier
    from clothsim.physics.contact.friction import FrictionEnergy


def friction_sensitivity(friction: "FrictionEnergy", step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
    """Return d(adjoint . friction gradient(x)) by the start of the step, for contacts that creep.

    Parameters
    ----------
    friction : FrictionEnergy
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
    by_start = np.zeros_like(x)
    np.subtract.at(by_start, blocks.elements.ravel(), products.reshape(-1, 3))
    by_lag = np.zeros_like(x)
    displacements = x - friction.contacts.start
    for name, barrier in ((each.name, each) for each in friction.contacts.barriers):
        stiffness = float(step.memory.get(name, barrier.stiffness))
        by_lag += _by_lag(friction, barrier, stiffness, step.positions, displacements, adjoint)
    return PastSensitivity(positions=by_lag, past_positions=by_start)


def _by_lag(
    friction: "FrictionEnergy", barrier: "Barrier", stiffness: float, at: Floats, displacements: Floats, adjoint: Floats
) -> Floats:
    """The derivative by the positions `at` the start from which the pairs of one barrier are lagged, (N, 3)."""
    pairs, least_gap = barrier.distinct(at), friction.contacts.least_gap * barrier.d_hat
    rows = pairs.elements
    factors = stiffness * friction.static[friction.labels[rows[:, 0]], friction.labels[rows[:, 3]]]
    lists = rows, pairs.weights, pairs.thresholds, pairs.n_points, factors
    lengths = barrier.offset, barrier.d_hat, least_gap, friction.contacts.slip
    return np.asarray(by_lag(at, displacements, adjoint, *lists, *lengths))


@kernel
def by_lag(at, moves, adjoint, elements, weights, thresholds, n_points, factors, offset, d_hat, least_gap, slip):
    """Derivative of the power of all pairs by the positions `at` which they are lagged, (N, 3).

    moves: x - start; factors (p,): mu kappa; slip: displacement from which a contact slides; lengths in [m].
    """
    out = np.zeros_like(at)
    for e in range(len(elements)):
        points = four_points(at, elements, e)
        g, r = closest_points(points, e >= n_points)
        limit, by_distance, by_cross = _limit(points, r, weights[e], thresholds[e], offset, d_hat, least_gap)
        limit, by_distance, by_cross = factors[e] * limit, factors[e] * by_distance, factors[e] * by_cross
        if not limit > 0.0:
            continue
        d, a = four_points(moves, elements, e), four_points(adjoint, elements, e)
        by_r, by_g, per_limit = _by_closest_points(g, r, d, a, limit, by_distance, slip)
        (has_first, t, c), (has_second, u, b) = tangent_directions(points, e >= n_points, g)
        first = dot(t, by_r) + _dot_four(c, by_g) if has_first else 0.0
        second = dot(u, by_r) + _dot_four(b, by_g) if has_second else 0.0
        for i in range(4):
            row = natural(elements[e, i])
            along = first * c[i] + second * b[i]
            for k in range(3):
                out[row, k] += g[i] * (by_r[k] - first * t[k] - second * u[k]) - along * r[k]
        if by_cross != 0.0:
            du, dv = cross_squared_gradient(*edges(points))
            slope = per_limit * by_cross
            for k in range(3):
                out[natural(elements[e, 0]), k] -= slope * du[k]
                out[natural(elements[e, 1]), k] += slope * du[k]
                out[natural(elements[e, 2]), k] -= slope * dv[k]
                out[natural(elements[e, 3]), k] += slope * dv[k]
    return out


@part
def _limit(points, r, weight, threshold, offset, d_hat, least_gap):
    """-w m db/dd of `barrier_kernels.normal_forces`, its derivatives by |r| and by the squared cross product."""
    length = np.sqrt(dot(r, r))
    distance = max(length, offset + least_gap)
    s, s_hat = distance * distance - offset * offset, d_hat * (2.0 * offset + d_hat)
    if s >= s_hat:
        return 0.0, 0.0, 0.0
    m, dm = 1.0, 0.0
    if threshold > 0.0:
        ratio = cross_squared(points) / threshold
        if ratio < 1.0:
            m, dm, _ = mollifier(ratio, threshold)
    _, first, second = barrier_function(s, s_hat, d_hat)
    slope = -2.0 * weight * first * distance
    by_distance = -2.0 * weight * m * (first + 2.0 * second * distance * distance) if length == distance else 0.0
    return m * slope, by_distance, dm * slope


@part
def _by_closest_points(g, r, d, a, limit, by_distance, slip):
    """Derivatives of P by r (3) and by g (4), and P/L."""
    length = np.sqrt(dot(r, r))
    n = r[0] / length, r[1] / length, r[2] / length
    moved, w = _combined(g, d), _combined(g, a)
    normal = dot(moved, n)
    u = moved[0] - normal * n[0], moved[1] - normal * n[1], moved[2] - normal * n[2]
    y, power = np.sqrt(dot(u, u)), dot(u, w)
    if y >= slip:
        f, slope = 1.0 / y, -power / (y * y * y)
    else:
        f, slope = (2.0 - y / slip) / slip, (-power / (slip * slip * y) if y > 0.0 else 0.0)
    q = f * w[0] + slope * u[0], f * w[1] + slope * u[1], f * w[2] + slope * u[2]
    out = dot(q, n)
    q = q[0] - out * n[0], q[1] - out * n[1], q[2] - out * n[2]
    by_length, turn = by_distance * f * power, limit / length
    by_r = (
        by_length * n[0] - turn * (out * u[0] + normal * q[0]),
        by_length * n[1] - turn * (out * u[1] + normal * q[1]),
        by_length * n[2] - turn * (out * u[2] + normal * q[2]),
    )
    by_g = (
        limit * (dot(q, d[0]) + f * dot(u, a[0])),
        limit * (dot(q, d[1]) + f * dot(u, a[1])),
        limit * (dot(q, d[2]) + f * dot(u, a[2])),
        limit * (dot(q, d[3]) + f * dot(u, a[3])),
    )
    return by_r, by_g, f * power


@part
def _combined(g, x):
    """Sum of g_i x_i."""
    p, a, b, c = x
    return (
        g[0] * p[0] + g[1] * a[0] + g[2] * b[0] + g[3] * c[0],
        g[0] * p[1] + g[1] * a[1] + g[2] * b[1] + g[3] * c[1],
        g[0] * p[2] + g[1] * a[2] + g[2] * b[2] + g[3] * c[2],
    )


@part
def _dot_four(c, g):
    return c[0] * g[0] + c[1] * g[1] + c[2] * g[2] + c[3] * g[3]
