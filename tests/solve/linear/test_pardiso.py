"""Domains of a matrix graph: all rows once, no block between domains, and a small separator."""

import numpy as np
import pytest
from sheet_patterns import pattern_of_sheets

from clothsim.solve.linear.pardiso import LARGEST_SEPARATOR, dissection
from clothsim.solve.linear.sparsity import make_pattern


def checked(pattern):
    """The dissection, once it holds all rows and no block couples its domains."""
    found = dissection(pattern)
    assert found is not None
    rows = np.concatenate([*found.domains, found.separator])
    np.testing.assert_array_equal(np.sort(rows), np.arange(pattern.n_vertices))
    side = np.full(pattern.n_vertices, -1)
    for number, domain in enumerate(found.domains):
        side[domain] = number
    i = np.repeat(np.arange(pattern.n_vertices), np.diff(pattern.starts))
    sides = np.stack([side[i], side[pattern.columns]])
    assert not ((sides.min(axis=0) == 0) & (sides.max(axis=0) == 1)).any()
    return found


@pytest.mark.parametrize(("cells", "widest"), [((40, 40), 45), ((120, 12), 14)])
def test_a_sheet_is_cut_in_halves_along_a_short_line(cells, widest):
    found = checked(pattern_of_sheets(cells))
    sizes = [len(domain) for domain in found.domains]
    assert min(sizes) > 0.75 * max(sizes)
    assert 0 < len(found.separator) <= widest


def test_parts_without_a_common_block_are_shared_out():
    found = checked(pattern_of_sheets((9, 9), (9, 9), (9, 9), (9, 9)))
    assert [len(domain) for domain in found.domains] == [200, 200]
    assert len(found.separator) == 0


def test_the_largest_of_unequal_parts_is_cut():
    found = checked(pattern_of_sheets((30, 30), (5, 5)))
    sizes = [len(domain) for domain in found.domains]
    assert 0 < len(found.separator) <= 40
    assert max(sizes) < 0.65 * sum(sizes)


def test_a_matrix_without_a_small_separator_stays_whole():
    n = 60
    everything = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2)
    triangles = np.column_stack([everything, everything[:, :1]])
    assert 0 < LARGEST_SEPARATOR < 0.5
    assert dissection(make_pattern(n, triangles, [])) is None


def test_the_same_pattern_has_the_same_domains():
    one, other = (checked(pattern_of_sheets((25, 14), (7, 7))) for _ in range(2))
    for a, b in zip((*one.domains, one.separator), (*other.domains, other.separator), strict=True):
        np.testing.assert_array_equal(a, b)
