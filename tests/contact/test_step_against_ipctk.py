"""The step that contact allows, at random and at hard poses: never past the impact that ipctk's CCD finds."""

import ipctk
import numpy as np
import pytest
from contact_poses import GAP, adversarial, at_random, close, turned

POSES = {**at_random(), **adversarial(), **close()}


QUICK = [name for name in POSES if "needles" not in name or name.endswith("body")]
"""Without needles beside needles: flat as they lie, tight inclusion splits boxes for seconds and for gigabytes."""


def motions(pose):
    """Displacements (N, 3) [m]: as long as the gap, far longer, layer through layer, in the plane a slide, a twist."""
    x = pose.x
    second = np.arange(len(x))[:, None] >= len(x) // 2
    above = second == (x[-1, 2] > x[0, 2])
    shaken = np.random.default_rng(0).standard_normal(x.shape)
    yield pose.contact().minimum_gap(x) * shaken
    yield 0.1 * shaken
    yield np.where(above, [0.0, 0.0, -3.0 * GAP], 0.0)
    yield second * np.array([0.3, 0.1, 0.0])
    yield second * (turned(1.0)(x) - x)


@pytest.mark.parametrize("name", QUICK)
def test_no_step_is_longer_than_that_of_tight_inclusion(name):
    """Its tolerance is a hundredth of the gap and its own rescaling 1: the time of impact, and not a share of it."""
    pose = POSES[name]
    mine, oracle = pose.contact(), pose.contact(backend="ipctk").candidates
    tolerance = 1e-2 * mine.minimum_gap(pose.x)
    tight = ipctk.TightInclusionCCD(tolerance=tolerance, max_iterations=100_000, conservative_rescaling=1.0)
    shortened = 0
    for dx in motions(pose):
        ways = oracle.rows_of(pose.x), oracle.rows_of(pose.x + dx)
        found = ipctk.Candidates()
        found.build(oracle.mesh, *ways, 0.0, ipctk.LBVH())
        impact = found.compute_collision_free_stepsize(oracle.mesh, *ways, 0.0, tight)
        assert 0.0 < mine.step_limit(pose.x, dx) <= impact
        shortened += impact < 1.0
    assert shortened


@pytest.mark.parametrize("name", POSES)
def test_the_step_keeps_a_gap(name):
    """By ipctk's distances: a tenth of the gap at the start is left, and nothing is crossed."""
    pose = POSES[name]
    mine, oracle = pose.contact(), pose.contact(backend="ipctk").candidates
    for dx in motions(pose):
        there = pose.x + mine.step_limit(pose.x, dx) * dx
        assert oracle.minimum_gap(there) >= 0.1 * oracle.minimum_gap(pose.x) * (1 - 1e-6)
        assert not ipctk.has_intersections(oracle.mesh, oracle.rows_of(there))
