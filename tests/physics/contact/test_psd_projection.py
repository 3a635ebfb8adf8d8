"""PSD projection against LAPACK's eigenvalues, alone and in the barrier's Hessian."""

import numpy as np
import pytest
from contact_configurations import adversarial, at_random

from clothsim.base.vectors import four_points
from clothsim.physics.contact.barrier import exact, projected
from clothsim.physics.contact.barrier_kernels import RECORD_SIZE, cross_squared, evaluate
from clothsim.physics.contact.psd_projection import BATCH, absolute, positive_factors, relative
from clothsim.physics.energies.hessians import LowRankHessian

COUNT = BATCH + 18
"""Blocks of a kind: one full batch, and a part of another."""
KINDS = {
    "general": lambda rng: rng.normal(size=(9, 9)),
    "a square": lambda rng: np.outer(*[rng.normal(size=9)] * 2),
    "a negative square": lambda rng: -np.outer(*[rng.normal(size=9)] * 2),
    "diagonal": lambda rng: np.diag(rng.integers(-1, 2, 9)).astype(float),
    "eigenvalues three times": lambda rng: np.kron(rng.integers(-1, 2, (3, 3)), np.eye(3)),
    "of many scales": lambda rng: rng.normal(size=(9, 9)) * 10.0 ** rng.uniform(-8, 0, 9),
    "zero": lambda rng: np.zeros((9, 9)),
}
TO_RELATIVE = np.kron(np.array([relative(vertex) for vertex in np.eye(4)]).T, np.eye(3))


def clamped_by_lapack(block):
    values, vectors = np.linalg.eigh(block)
    return vectors * np.maximum(values, 0) @ vectors.T


def positive(blocks):
    """The positive parts as blocks (m, 12, 12), written from row 3 on in reverse order."""
    indices = np.arange(len(blocks))[::-1].copy()
    factors, (first, count) = np.full((9 * len(blocks) + 3, 12), np.nan), np.zeros((2, len(blocks)), np.int64)
    end = positive_factors(blocks, indices, factors, 3, first, count)
    assert end == 3 + count.sum()
    return LowRankHessian(np.zeros((len(blocks), 4), np.int64), first, count, factors).blocks[::-1]


def test_coordinates_are_orthonormal_and_translation_free():
    assert pytest.approx(np.eye(9), abs=1e-15) == TO_RELATIVE @ TO_RELATIVE.T
    assert np.abs(TO_RELATIVE @ np.tile(np.eye(3), (4, 1))).max() < 1e-15
    assert absolute(relative((1.0, -2.0, 3.0, -2.0))) == pytest.approx((1.0, -2.0, 3.0, -2.0))


@pytest.mark.parametrize("kind", KINDS)
def test_positive_part_against_lapack(kind):
    rng = np.random.default_rng(3)
    blocks = np.stack([KINDS[kind](rng) for _ in range(COUNT)])
    blocks = blocks + blocks.transpose(0, 2, 1)
    size = max(np.abs(blocks).max(), 1e-9)
    expected = np.stack([TO_RELATIVE.T @ clamped_by_lapack(block) @ TO_RELATIVE for block in blocks])
    assert positive(blocks) == pytest.approx(expected, abs=2e-14 * size)


def test_non_finite_blocks_propagate_and_do_not_affect_others():
    blocks = np.tile(np.eye(9), (3, 1, 1))
    blocks[1] = np.nan
    found = positive(blocks)
    assert np.isnan(found[1]).any()
    assert found[[0, 2]] == pytest.approx(np.tile(TO_RELATIVE.T @ TO_RELATIVE, (2, 1, 1)), abs=1e-15)


@pytest.mark.parametrize("records", [adversarial, at_random])
def test_projected_blocks_of_mollified_pairs_against_lapack(records):
    clamped = 0
    for name, pose in records().items():
        contact = pose.contact()
        projected_hessian, exact_hessian = contact.hessian(pose.x), contact.hessian(pose.x, project=False)
        assert projected_hessian.elements is exact_hessian.elements  # so that their block offsets are looked up once
        blocks = projected_hessian.blocks
        thresholds = contact.distinct(pose.x).thresholds
        for k in range(len(thresholds)):
            if cross_squared(four_points(pose.x, exact_hessian.elements, k)) < thresholds[k]:
                difference = np.abs(blocks[k] - clamped_by_lapack(exact_hessian.blocks[k])).max()
                assert difference <= 1e-13 * np.abs(exact_hessian.blocks[k]).max(), name
                clamped += (
                    np.linalg.eigvalsh(exact_hessian.blocks[k])[0] < -1e-3 * np.abs(exact_hessian.blocks[k]).max()
                )
    assert clamped > 10


def test_block_of_a_pair_beyond_d_hat_is_zero():
    x = np.array([[0.2, 0.3, 0.5], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    elements, records = np.tile(np.arange(4), (2, 1)), np.full((2, RECORD_SIZE), np.nan)
    assert evaluate(records, x, elements, np.ones(2), np.zeros(2), 2, 0.0, 0.4) == 0.0
    for derived in (projected, exact):
        assert np.array_equal(derived(records, x, elements, np.zeros(2), 2, 1.0).blocks, np.zeros((2, 12, 12)))
