import numpy as np
import pytest

from clothsim.base.arrays import as_finite, as_points, as_positive, as_triangles, as_vector
from clothsim.base.errors import InputError


def test_points_come_back_as_contiguous_float64():
    points = as_points("p", np.asfortranarray(np.arange(6, dtype=np.int32).reshape(2, 3)))
    assert points.dtype == np.float64
    assert points.flags.c_contiguous
    assert points.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([1.0, 2.0, 3.0], r"p must have shape \(n, 3\), not \(3,\)"),
        ([[1.0, 2.0]], r"p must have shape \(n, 3\), not \(1, 2\)"),
        ([[0, 0, 0], [0, np.nan, 0]], r"p\[1, 1\] is nan"),
        ([[0, 0, -np.inf]], r"p\[0, 2\] is -inf"),
        ([["a", "b", "c"]], "p must be numbers"),
        ([[1, 2, 3], [4, 5]], r"p\[1\] has 2 entries, the first has 3"),
        ([[1, 2, 3], 4], r"p\[1\] is a number, the first has 3"),
    ],
)
def test_bad_points_are_named(points, message):
    with pytest.raises(InputError, match=message):
        as_points("p", points)


def test_points_of_another_dimension():
    assert as_points("uv", np.zeros((4, 2)), dimension=2).shape == (4, 2)


def test_triangles_come_back_as_contiguous_int64():
    triangles = as_triangles("t", np.asfortranarray(np.array([[0, 1, 2], [1.0, 2.0, 3.0]])), 4)
    assert triangles.dtype == np.int64
    assert triangles.flags.c_contiguous
    assert triangles.tolist() == [[0, 1, 2], [1, 2, 3]]


@pytest.mark.parametrize(
    ("triangles", "message"),
    [
        ([[0, 1, 2], [0, 1, 4]], r"t\[1\] = \[0, 1, 4\] names a vertex outside 0\.\.3"),
        ([[0, -1, 2]], r"t\[0\] = \[0, -1, 2\] names a vertex outside 0\.\.3"),
        ([[0, 1, 1.5]], "t must be whole numbers"),
        ([["a", "b", "c"]], "t must be whole numbers"),
        ([[0, 1, 2, 3]], r"t must have shape \(m, 3\), not \(1, 4\)"),
        ([0, 1, 2], r"t must have shape \(m, 3\), not \(3,\)"),
    ],
)
def test_bad_triangles_are_named(triangles, message):
    with pytest.raises(InputError, match=message):
        as_triangles("t", triangles, 4)


def test_vector():
    assert as_vector("v", (1, 2, 3)).tolist() == [1, 2, 3]
    assert as_vector("v", [1, 2], length=2).dtype == np.float64


@pytest.mark.parametrize(
    ("vector", "message"),
    [([1, 2], "v must be 3 numbers"), ([1, 2, np.inf], r"v\[2\] is inf"), ("up", "v must be numbers")],
)
def test_bad_vector_is_named(vector, message):
    with pytest.raises(InputError, match=message):
        as_vector("v", vector)


@pytest.mark.parametrize("shape", [(), (2,), (2, 3, 4)])
def test_finite_arrays_keep_their_shape(shape):
    assert as_finite("a", np.ones(shape, np.float32)).shape == shape


def test_the_first_number_that_is_not_finite_is_named():
    values = np.zeros((2, 2, 2))
    values[1, 0, 1] = np.nan
    values[1, 1, 1] = np.inf
    with pytest.raises(InputError, match=r"a\[1, 0, 1\] is nan"):
        as_finite("a", values)


@pytest.mark.parametrize("value", [1, 0.5, np.float32(2)])
def test_positive_numbers(value):
    assert as_positive("k", value) == float(value)


def test_zero_only_where_allowed():
    assert as_positive("k", 0, zero=True) == 0.0
    with pytest.raises(InputError, match="k must be above 0, not 0"):
        as_positive("k", 0)


@pytest.mark.parametrize("value", [-1, np.nan, np.inf, "much", "3", True, 10**400, None])
def test_bad_positive_numbers(value):
    with pytest.raises(InputError, match="k must be"):
        as_positive("k", value, zero=True)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("values", [np.ones((2, 3), complex), np.ma.masked_equal([[0.0, 1.0, 2.0]], 1.0)])
def test_what_a_conversion_would_drop_is_refused(values):
    for check in (lambda: as_points("a", values), lambda: as_triangles("a", values, 9)):
        with pytest.raises(InputError, match="a must be"):
            check()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("values", [np.ones((1, 3), bool), [[0.0, 1.0, np.nan]], [[0.0, 1.0, np.inf]]])
def test_triangles_are_whole_numbers(values):
    with pytest.raises(InputError, match="t must be whole numbers"):
        as_triangles("t", values, 9)
