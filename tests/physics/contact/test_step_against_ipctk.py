"""Step limits in random and hard configurations: never past the impact that ipctk's CCD finds."""

import ipctk
import numpy as np
import pytest
from contact_configurations import GAP, adversarial, at_random, close, rotated
from ipctk_barrier import by_ipctk

POSES = {**at_random(), **adversarial(), **close()}


QUICK = [name for name in POSES if "needles" not in name or name.endswith("body")]
"""Without needles beside needles: for those tight inclusion splits boxes for seconds and for gigabytes."""


def motions(pose):
    """Displacements (N, 3) [m]: as long as the gap, far longer, layer through layer, an in-plane slide, a twist."""
    x = pose.x
    second = np.arange(len(x))[:, None] >= len(x) // 2
    above = second == (x[-1, 2] > x[0, 2])
    random = np.random.default_rng(0).standard_normal(x.shape)
    yield pose.contact().minimum_gap(x) * random
    yield 0.1 * random
    yield np.where(above, [0.0, 0.0, -3.0 * GAP], 0.0)
    yield second * np.array([0.3, 0.1, 0.0])
    yield second * (rotated(1.0)(x) - x)


@pytest.mark.parametrize("name", QUICK)
def test_step_limit_is_at_most_that_of_tight_inclusion(name):
    """Its tolerance is a hundredth of the gap and its own rescaling 1: the time of impact itself."""
    pose = POSES[name]
    mine, oracle = pose.contact(), by_ipctk(pose.contact()).candidates
    tolerance = 1e-2 * mine.minimum_gap(pose.x)
    tight = ipctk.TightInclusionCCD(tolerance=tolerance, max_iterations=100_000, conservative_rescaling=1.0)
    shortened = 0
    for dx in motions(pose):
        paths = oracle.rows_of(pose.x), oracle.rows_of(pose.x + dx)
        found = ipctk.Candidates()
        found.build(oracle.mesh, *paths, 0.0, ipctk.LBVH())
        impact = found.compute_collision_free_stepsize(oracle.mesh, *paths, 0.0, tight)
        assert 0.0 < mine.step_limit(pose.x, dx) <= impact
        shortened += impact < 1.0
    assert shortened


@pytest.mark.parametrize("name", POSES)
def test_step_keeps_a_tenth_of_the_gap(name):
    """By ipctk's distances; and nothing intersects."""
    pose = POSES[name]
    mine, oracle = pose.contact(), by_ipctk(pose.contact()).candidates
    for dx in motions(pose):
        there = pose.x + mine.step_limit(pose.x, dx) * dx
        assert oracle.minimum_gap(there) >= 0.1 * oracle.minimum_gap(pose.x) * (1 - 1e-6)
        assert not ipctk.has_intersections(oracle.mesh, oracle.rows_of(there))
