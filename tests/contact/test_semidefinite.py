"""Clamped blocks against LAPACK's eigenvalues, and the pairs that are clamped."""

import numpy as np
import pytest
from contact_poses import adversarial, at_random

from clothsim.contact.barrier_kernels import crossing, hessian
from clothsim.contact.semidefinite import clamp

WITHOUT_TRANSLATION = np.eye(12) - np.kron(np.full((4, 4), 0.25), np.eye(3))
KINDS = {
    "general": lambda rng: rng.normal(size=(12, 12)),
    "a square": lambda rng: np.outer(*[rng.normal(size=12)] * 2),
    "a negative square": lambda rng: -np.outer(*[rng.normal(size=12)] * 2),
    "diagonal": lambda rng: np.diag(rng.integers(-1, 2, 12)).astype(float),
    "eigenvalues three times": lambda rng: np.kron(rng.integers(-1, 2, (4, 4)), np.eye(3)),
    "of many scales": lambda rng: rng.normal(size=(12, 12)) * 10.0 ** rng.uniform(-8, 0, 12),
    "zero": lambda rng: np.zeros((12, 12)),
}


def clamped_by_lapack(block):
    values, vectors = np.linalg.eigh(block)
    return vectors * np.maximum(values, 0) @ vectors.T


@pytest.mark.parametrize("kind", KINDS)
def test_a_clamped_block_is_that_of_lapack(kind):
    rng = np.random.default_rng(3)
    blocks = np.stack([KINDS[kind](rng) for _ in range(50)])
    blocks = WITHOUT_TRANSLATION @ (blocks + blocks.transpose(0, 2, 1)) @ WITHOUT_TRANSLATION
    size = max(np.abs(blocks).max(), 1e-9)
    expected = np.stack([clamped_by_lapack(block) for block in blocks])
    clamp(blocks, np.arange(50))
    assert blocks == pytest.approx(expected, abs=2e-14 * size)


def test_only_the_named_blocks_are_clamped_and_what_is_not_a_number_stays_so():
    blocks = np.stack([-WITHOUT_TRANSLATION, -WITHOUT_TRANSLATION, np.full((12, 12), np.nan)])
    clamp(blocks, np.array([1, 2]))
    assert np.array_equal(blocks[0], -WITHOUT_TRANSLATION)
    assert np.abs(blocks[1]).max() < 1e-15
    assert np.isnan(blocks[2]).any()


@pytest.mark.parametrize("poses", [adversarial, at_random])
def test_the_projected_blocks_of_mollified_pairs_are_their_exact_ones_clamped(poses):
    clamped = 0
    for name, pose in poses().items():
        contact = pose.contact()
        projected, exact = contact.hessian(pose.x), contact.hessian(pose.x, project=False)
        assert projected.elements is exact.elements  # so that their places in the matrix are looked up once
        thresholds = contact.candidates.near(pose.x).thresholds
        for k in range(len(thresholds)):
            if crossing(pose.x, exact.elements[k]) < thresholds[k]:
                difference = np.abs(projected.blocks[k] - clamped_by_lapack(exact.blocks[k])).max()
                assert difference <= 1e-13 * np.abs(exact.blocks[k]).max(), name
                clamped += np.linalg.eigvalsh(exact.blocks[k])[0] < -1e-3 * np.abs(exact.blocks[k]).max()
    assert clamped > 10


def test_a_pair_beyond_the_reach_of_the_barrier_has_a_block_of_zeros():
    x = np.array([[0.2, 0.3, 0.5], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    for project in (True, False):
        blocks = np.full((2, 12, 12), np.nan)
        pairs = np.tile(np.arange(4), (2, 1)), np.ones(2), np.zeros(2), 2
        assert not hessian(blocks, x, *pairs, 0.0, 0.4, project).any()
        assert np.array_equal(blocks, np.zeros((2, 12, 12)))
