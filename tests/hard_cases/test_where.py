"""Geometric checks of the hard cases, on triangles with known results."""

import numpy as np

from tests.hard_cases.where import ways_out


def test_an_edge_goes_out_of_a_cylinder_where_it_meets_its_circle():
    """One triangle: an edge out along x, one back in aslant, one that stays inside."""
    x = np.array([[0.0, 0.0, 0.1], [2.0, 0.0, 0.5], [0.0, 0.5, 0.1]])
    z = ways_out(x, np.array([[0, 1, 2]]), 1.0)
    fraction = (0.25 + np.sqrt(0.25**2 + 4.25 * 0.75)) / 4.25  # |(2 s, .5 - .5 s)| = 1
    np.testing.assert_allclose(z, [0.3, 0.1 + 0.4 * fraction, np.nan], atol=1e-15)


def test_an_edge_that_is_outside_or_upright_goes_nowhere():
    x = np.array([[3.0, 0.0, 0.1], [2.0, 0.0, 0.5], [2.0, 0.0, 0.7]])
    assert np.isnan(ways_out(x, np.array([[0, 1, 2]]), 1.0)).all()
