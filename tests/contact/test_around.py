"""The pairs around what moves: those of the whole, within the reach of the list and beyond it."""

import numpy as np
import pytest
from contacts import body_surface, self_surface, sheet_on_ball, two_sheets

from clothsim.contact.around import REACH, CandidatesAround
from clothsim.contact.candidates import Candidates

D_HAT = 0.05


@pytest.mark.parametrize("kind", ["body", "self"])
@pytest.mark.parametrize("size", [0.2, 1.0, 5.0])
def test_what_moves_meets_what_it_meets_in_the_whole(kind, size):
    """size: of the steps, in radii of the list."""
    surface, x = body_surface(sheet_on_ball(0.33)) if kind == "body" else self_surface(two_sheets(gap=0.045))
    whole, fresh = (Candidates(surface, D_HAT, 0.005) for _ in range(2))
    cloth = surface.first.points
    moving = np.zeros(len(x), bool)
    moving[cloth[[9, 10, 12, 24]]] = True
    part = CandidatesAround.of(whole, moving, x)
    radius, rng, found, clipped = REACH * 0.005, np.random.default_rng(3), 0, 0
    for _ in range(12):
        dx = np.zeros_like(x)
        dx[moving] = size * radius * rng.standard_normal((int(moving.sum()), 3)) / 2
        limit = part.step_limit(x, dx)
        assert limit == pytest.approx(fresh.step_limit(x, dx), rel=1e-12)
        y = x + limit * dx
        near = fresh.near(y)
        wanted = near.elements[moving[near.elements].any(axis=1)]
        np.testing.assert_array_equal(part.near(y).elements, wanted)
        found, clipped = found + len(wanted), clipped + (limit < 1)
    assert found > 20
    assert clipped or size < 5
