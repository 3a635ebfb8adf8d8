"""Barrier with an offset against its formula, pair by pair; ipctk's barrier has the same shape."""

import ipctk
import numpy as np
import pytest
from contacts import sheet_on_ball

from clothsim.keys.typed_effects import BodyContact
from clothsim.physics.contact import barrier_kernels as kernels
from clothsim.physics.contact.body_contact import body_contact
from clothsim.physics.energies.base import Step

OFFSET, D_HAT, WEIGHT = 0.3, 0.2, 1.7


def formula(gap, offset=OFFSET, d_hat=D_HAT):
    """b [m], db/dd and d2b/dd2 [1/m] at a gap: b(s) = -(s - s_hat)^2 ln(s / s_hat) d_hat / s_hat^2, s = d^2 - o^2."""
    d = offset + gap
    s, s_hat = d**2 - offset**2, (offset + d_hat) ** 2 - offset**2
    scale, shape = d_hat / s_hat**2, ipctk.ClampedLogBarrier()
    first, second = (scale * f(s, s_hat) for f in (shape.first_derivative, shape.second_derivative))
    assert shape(s, s_hat) == pytest.approx(-((s - s_hat) ** 2) * np.log(s / s_hat) if gap < d_hat else 0.0)
    return scale * shape(s, s_hat), 2 * d * first, 2 * first + 4 * d**2 * second


def over_a_face(gap):
    """A point over the interior of a triangle: distance along z alone."""
    x = np.array([[0.1, 0.2, OFFSET + gap], [-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [-1.0, 2.0, 0.0]])
    return x, np.array([[0, 1, 2, 3]]), np.array([WEIGHT]), np.zeros(1), 1


def crossed_edges(gap, sine=1.0, threshold=0.0):
    """Two edges of length 2 whose middles stand over one another, at an angle."""
    cosine = np.sqrt(1 - sine**2)
    x = np.array([[-1.0, 0.0, OFFSET + gap], [1.0, 0.0, OFFSET + gap], [-cosine, -sine, 0.0], [cosine, sine, 0.0]])
    return x, np.array([[0, 1, 2, 3]]), np.array([WEIGHT]), np.array([threshold]), 0


def evaluated(pair, d_hat=D_HAT):
    x, elements, weights, thresholds, n_points = pair
    records = np.empty((1, kernels.RECORD_SIZE))
    value = kernels.evaluate(records, x, elements, weights, thresholds, n_points, OFFSET, d_hat)
    return value, records


@pytest.mark.parametrize("pair", [over_a_face, crossed_edges])
@pytest.mark.parametrize("gap", [1e-3, 0.05, 0.1, 0.15, 0.199, 0.25])
def test_value_force_and_stiffness_of_a_pair_with_an_offset(pair, gap):
    x, elements, weights, thresholds, n_points = pair(gap)
    b, slope, curvature = formula(gap)
    value, records = evaluated(pair(gap))
    assert value == pytest.approx(WEIGHT * b, rel=1e-12)
    force = kernels.gradient(records, x, elements, thresholds)
    assert force[:, 2] == pytest.approx(WEIGHT * slope * records[0, :4], rel=1e-12)
    assert np.abs(force[:, :2]).max() <= 1e-12 * abs(WEIGHT * slope)
    blocks = np.empty((1, 12, 12))
    kernels.exact_blocks(blocks, records, x, elements, thresholds, n_points, 1.0)
    lifted = np.where(x[:, 2] > 0, 1.0, 0.0)  # the upper element as a whole: the gap alone changes
    assert lifted @ blocks[0, 2::3, 2::3] @ lifted == pytest.approx(WEIGHT * curvature, rel=1e-11)
    g, r, slopes = kernels.normal_forces(x, elements, weights, thresholds, n_points, OFFSET, D_HAT, 0.0)
    assert slopes == pytest.approx(WEIGHT * slope, rel=1e-12)
    assert r[0] == pytest.approx([0.0, 0.0, OFFSET + gap])
    assert g[0] == pytest.approx(records[0, :4])


@pytest.mark.parametrize("gap", [1e-3, 0.08, 0.19])
def test_the_factors_of_crossed_edges_are_the_positive_part_of_their_hessian(gap):
    """Perpendicular edges over their middles: the parts of the sum are perpendicular, and project one by one."""
    x, elements, _, thresholds, n_points = crossed_edges(gap)
    _, records = evaluated(crossed_edges(gap))
    blocks, factors, first, count = np.empty((1, 12, 12)), np.empty((3, 12)), np.empty(1, int), np.empty(1, int)
    kernels.exact_blocks(blocks, records, x, elements, thresholds, n_points, 2.0)
    n = kernels.rank_one_factors(factors, first, count, records, x, elements, n_points, 2.0)
    values, vectors = np.linalg.eigh(blocks[0])
    positive = (vectors * np.maximum(values, 0.0)) @ vectors.T
    assert factors[:n].T @ factors[:n] == pytest.approx(positive, abs=1e-9 * values[-1])


def test_a_gap_below_the_least_has_the_force_of_the_least():
    arguments = (*over_a_face(0.01), OFFSET, D_HAT)
    assert kernels.normal_forces(*arguments, 0.05)[2] == pytest.approx(WEIGHT * formula(0.05)[1], rel=1e-12)


@pytest.mark.parametrize("ratio", [0.05, 0.5, 0.97, 1.5])
def test_nearly_parallel_edges_with_an_offset_are_weakened_by_the_mollifier(ratio):
    """m(c) = (2 - c/e) c/e for c < e (IPC, eq. 24), c = 16 sin^2 of the angle of edges of length 2."""
    sine, gap = 0.3, 0.08
    threshold = 16 * sine**2 / ratio
    pair = crossed_edges(gap, sine, threshold)
    m = (2 - ratio) * ratio if ratio < 1 else 1.0
    b, slope, _ = formula(gap)
    assert evaluated(pair)[0] == pytest.approx(WEIGHT * m * b, rel=1e-12)
    assert kernels.normal_forces(*pair, OFFSET, D_HAT, 0.0)[2] == pytest.approx(WEIGHT * m * slope, rel=1e-12)


def test_the_barrier_ends_at_the_offset_and_at_d_hat():
    assert evaluated(over_a_face(0.0))[0] == np.inf
    assert evaluated(over_a_face(-1e-9))[0] == np.inf
    assert evaluated(over_a_face(D_HAT * (1 - 1e-6)))[0] > 0
    assert evaluated(over_a_face(D_HAT * (1 + 1e-6)))[0] == 0


def test_a_step_evaluates_its_start_once_whatever_its_stiffness(monkeypatch):
    world = sheet_on_ball(0.34)
    before, fresh = (body_contact(world, BodyContact(d_hat=0.05)) for _ in range(2))
    start, evaluate, calls = world.start(), kernels.evaluate, []
    monkeypatch.setattr(kernels, "evaluate", lambda *given: calls.append(1) or evaluate(*given))
    still = np.zeros_like(start)
    loads = np.tile([0.0, 0.0, 50.0], (len(start), 1))
    bound = before.begin(Step(0.0, 0.01, start, still, 1.0, loads))
    assert bound.stiffness > 2.0 * before.stiffness
    ends = [start + 1e-3 * k for k in range(1, 4)]
    values = [bound.value(x) for x in ends]
    assert bound.value(start) > 0.0
    assert len(calls) == 4  # the start is known beside the last two ends
    for x, value in zip([start, *ends], [bound.value(start), *values], strict=True):
        assert value == bound.stiffness * fresh.value(x)
        np.testing.assert_array_equal(bound.gradient(x), bound.stiffness * fresh.gradient(x) / fresh.stiffness)
    energy = (bound.stiffness - fresh.stiffness) * fresh.value(start)
    assert bound.stiffness_energy(start, fresh.stiffness) == pytest.approx(energy, rel=1e-14)
