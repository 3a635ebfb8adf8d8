"""Factors in domains: the solution of the whole matrix, and its bits at each number of threads."""

import numpy as np
import pytest
from sheet_patterns import pattern_of_sheets

from clothsim.base.parallel import threads
from clothsim.solve.linear import pardiso as dissected_factor
from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear.pardiso import DissectedFactor, make_factor, useful_threads
from clothsim.solve.linear.pardiso_factor import load_library

try:
    load_library()
except (ImportError, OSError):
    pytest.skip("PARDISO is not installed", allow_module_level=True)

SHEETS = {"one": ((14, 9),), "four": ((6, 6),) * 4, "unequal": ((14, 9), (3, 3))}


@pytest.fixture(autouse=True)
def _any_size(monkeypatch):
    monkeypatch.setattr(dissected_factor, "MIN_VERTICES", 1)
    monkeypatch.setattr(dissected_factor, "MIN_TOGETHER", 1)
    monkeypatch.setattr("clothsim.solve.linear.pardiso.LARGEST_SEPARATOR", 0.3)


def matrix(sheets):
    """A pattern, data of a positive definite matrix in it, and the dense matrix."""
    pattern = pattern_of_sheets(*SHEETS[sheets])
    rng = np.random.default_rng(0)
    data = rng.standard_normal(9 * len(pattern.columns))
    upper = np.triu(pattern.upper(data).toarray())
    dense = upper + np.triu(upper, 1).T
    amount = 1.0 + np.abs(dense).sum(axis=1)
    return pattern, pattern.shift(data, amount), dense + np.diag(amount)


@pytest.mark.parametrize(("kind", "error"), [(np.float64, 1e-13), (np.float32, 1e-5)])
@pytest.mark.parametrize("sheets", SHEETS)
def test_it_solves(sheets, kind, error):
    pattern, data, dense = matrix(sheets)
    factor = make_factor(pattern, 1, kind, dissected=True)
    assert isinstance(factor, DissectedFactor)
    b = np.random.default_rng(1).standard_normal(len(dense))
    for size in (1.0, 1e-300, 1e300):
        factor.factorise(data)
        exact = np.linalg.solve(dense, b)
        assert np.abs(factor.back_solve(size * b) / size - exact).max() < error * np.abs(exact).max()


@pytest.mark.parametrize("sheets", SHEETS)
def test_the_bits_do_not_depend_on_the_number_of_threads(sheets):
    pattern, data, dense = matrix(sheets)
    b = np.random.default_rng(2).standard_normal(len(dense))
    bits = set()
    for count in (1, 2, 3, 2):
        with threads(count):
            factor = make_factor(pattern, count, np.float32, dissected=True)
            for _ in range(5):
                factor.factorise(data)
                bits.add(factor.back_solve(b).tobytes())
    assert len(bits) == 1


@pytest.mark.parametrize("where", ["domain", "separator"])
@pytest.mark.parametrize("value", [-1.0, np.nan, 1e300])
def test_a_matrix_that_is_not_positive_definite_is_refused_and_the_next_one_solved(where, value):
    pattern, data, dense = matrix("one")
    factor = make_factor(pattern, 2, np.float32, dissected=True)
    parts = dissected_factor.dissection(pattern)
    row = int((parts.domains[1] if where == "domain" else parts.separator)[0])
    wrong = data.copy()
    wrong[9 * pattern.starts[row]] = value
    with threads(2), pytest.raises(NotPositiveDefiniteError):
        factor.factorise(wrong)
    factor.factorise(data)
    b = np.ones(len(dense))
    assert np.abs(dense @ factor.back_solve(b) - b).max() < 1e-4


def test_a_small_matrix_and_one_thread_have_one_factor(monkeypatch):
    pattern, _, _ = matrix("one")
    assert not isinstance(make_factor(pattern, 1, np.float64), DissectedFactor)
    monkeypatch.setattr(dissected_factor, "MIN_VERTICES", pattern.n_vertices + 1)
    assert not isinstance(make_factor(pattern, 2, np.float64, dissected=True), DissectedFactor)


def test_a_small_matrix_has_one_thread_where_a_step_has_helpers(monkeypatch):
    monkeypatch.setattr(dissected_factor, "MIN_VERTICES", 100)
    assert [useful_threads(n, 4, dissected=True) for n in (99, 100)] == [1, 4]
    assert [useful_threads(n, 4, dissected=False) for n in (99, 100)] == [4, 4]
