"""Determinants of known knots and links (Livingston 1993, Knot theory, appendix 1)."""

import numpy as np
import pytest

from tests.hard_cases.knots import determinant

T = np.linspace(0, 2 * np.pi, 120, endpoint=False)
CIRCLE = np.column_stack([np.cos(T), np.sin(T), 0 * T])
TREFOIL = np.column_stack([np.sin(T) + 2 * np.sin(2 * T), np.cos(T) - 2 * np.cos(2 * T), -np.sin(3 * T)])
FIGURE_EIGHT = np.column_stack(
    [(2 + np.cos(2 * T)) * np.cos(3 * T), (2 + np.cos(2 * T)) * np.sin(3 * T), np.sin(4 * T)]
)
LINKED = np.column_stack([1 + np.cos(T), 0 * T, np.sin(T)])


@pytest.mark.parametrize(
    ("curves", "expected"),
    [
        ([CIRCLE], 1),
        ([TREFOIL], 3),
        ([FIGURE_EIGHT], 5),
        ([CIRCLE, LINKED], 2),
        ([CIRCLE, CIRCLE + np.array([5.0, 0, 0])], 0),
    ],
    ids=["unknot", "trefoil", "figure eight", "Hopf link", "two apart"],
)
def test_determinant(curves, expected):
    assert determinant(curves) == expected
