"""Candidates of moving vertices: those of the whole, within the radius of the list and beyond it."""

import numpy as np
import pytest
from contacts import body_surface, self_surface, sheet_on_ball, two_sheets

from clothsim.physics.contact.candidate_subsets import RADIUS_IN_SKINS, CandidateSubset
from clothsim.physics.contact.candidates import Candidates

D_HAT = 0.05


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("size", [0.2, 1.0, 5.0])
def test_subset_equals_the_whole_restricted_to_moving_vertices(kind, size):
    """size: of the steps, in radii of the list."""
    surface, x = body_surface(sheet_on_ball(0.33)) if kind == "body" else self_surface(two_sheets(gap=0.045))
    whole, fresh = (Candidates(surface, D_HAT, 0.005) for _ in range(2))
    cloth = surface.first.points
    moving = np.zeros(len(x), bool)
    moving[cloth[[9, 10, 12, 24]]] = True
    subset = CandidateSubset.restrict(whole, moving, x)
    radius, rng, found, clipped = RADIUS_IN_SKINS * 0.005, np.random.default_rng(3), 0, 0
    for _ in range(12):
        dx = np.zeros_like(x)
        dx[moving] = size * radius * rng.standard_normal((int(moving.sum()), 3)) / 2
        limit = subset.step_limit(x, dx)
        assert limit == pytest.approx(fresh.step_limit(x, dx), rel=1e-12)
        y = x + limit * dx
        active = fresh.active(y)
        wanted = active.elements[moving[active.elements].any(axis=1)]
        np.testing.assert_array_equal(subset.active(y).elements, wanted)
        found, clipped = found + len(wanted), clipped + (limit < 1)
    assert found > 20
    assert clipped or size < 5


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("gap", [0.06, 0.12])
def test_pairs_beyond_the_radius_are_found_on_the_path(kind, gap):
    """Descent to what was further than d_hat: from .06 m within the list's radius of .02, from .12 beyond it."""
    surface, x = body_surface(sheet_on_ball(0.3 + gap)) if kind == "body" else self_surface(two_sheets(gap))
    high = surface.first.points[x[surface.first.points, 2] > 0.5 * gap]
    middle = high[np.abs(x[high, :2]).max(axis=1) < 0.1]
    moving = np.isin(np.arange(len(x)), middle)
    whole, fresh = (Candidates(surface, D_HAT, 0.005) for _ in range(2))
    subset = CandidateSubset.restrict(whole, moving, x)
    assert len(middle)
    assert not len(subset.active(x))
    for down in (0.019, gap + 0.05):
        dx = -down * moving[:, None] * np.array([0.0, 0.0, 1.0])
        limit = subset.step_limit(x, dx)
        assert limit == pytest.approx(fresh.step_limit(x, dx), rel=1e-12)
        y = x + limit * dx
        found, wanted = subset.active(y).elements, fresh.active(y).elements
        np.testing.assert_array_equal(found, wanted[moving[wanted].any(axis=1)])
        assert len(found) or (gap, down) == (0.12, 0.019)
    assert limit < 1
