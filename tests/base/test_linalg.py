import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from meshes import random_rotation

from clothsim.base.errors import InputError
from clothsim.base.linalg import dot, eigen_2x2, kabsch
from clothsim.mesh.body import rotation_matrix

EPS = np.finfo(float).eps


def flat(points):
    """The points in a plane that is not a coordinate plane."""
    return (points * [1, 1, 0]) @ random_rotation(7).T


# --- 2x2 eigenpairs ---


@settings(max_examples=100, deadline=None)
@given(arrays(np.float64, (4, 3), elements=st.floats(-1e6, 1e6)))
def test_eigenpairs_against_numpy(entries):
    matrices = entries[:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    values, vectors = eigen_2x2(matrices)
    size = np.abs(matrices).max() + 1e-300
    np.testing.assert_allclose(values, np.linalg.eigvalsh(matrices)[:, ::-1], rtol=0, atol=8 * EPS * size)
    np.testing.assert_allclose(
        vectors * values[:, None] @ np.swapaxes(vectors, 1, 2), matrices, rtol=0, atol=8 * EPS * size
    )
    np.testing.assert_allclose(np.linalg.det(vectors), 1, rtol=0, atol=4 * EPS)
    assert (values[:, 0] >= values[:, 1]).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        ([[2, 0], [0, 2]], (2, 2)),
        ([[0, 0], [0, 0]], (0, 0)),
        ([[1, 1], [1, 1]], (2, 0)),
        ([[1, 0], [0, 3]], (3, 1)),
        ([[0, -1], [-1, 0]], (1, -1)),
        ([[1e30, 0], [0, 1e30]], (1e30, 1e30)),
    ],
)
def test_eigenvalues_in_closed_form(matrix, expected, dtype):
    values, vectors = eigen_2x2(np.array(matrix, dtype))
    assert values.dtype == vectors.dtype == dtype
    np.testing.assert_allclose(values, np.array(expected, dtype), rtol=4 * np.finfo(dtype).eps, atol=1e-15)


def test_semidefinite_clamps_at_zero():
    F = np.random.default_rng(0).standard_normal((1000, 3, 1)) * np.array([0.3, 0.7])
    C = np.swapaxes(F, 1, 2) @ F
    assert (eigen_2x2(C)[0][:, 1] < 0).any()
    assert (eigen_2x2(C, semidefinite=True)[0] >= 0).all()


# --- Kabsch ---


@pytest.mark.parametrize("degrees", [0, 1e-6, 30, 90, 179.999999, 180])
@pytest.mark.parametrize("shape", [np.asarray, flat], ids=["solid", "flat"])
def test_rigid_motions_are_found(shape, degrees):
    points = shape(np.random.default_rng(0).standard_normal((5, 7, 3)))
    axis = np.array([2.0, -1.0, 2.0]) / 3
    R = rotation_matrix(np.radians(degrees) * axis)
    found, determined = kabsch(points, points @ R.T + [3.0, -4.0, 5.0])
    assert determined.all()
    np.testing.assert_allclose(found, np.broadcast_to(R, (5, 3, 3)), rtol=0, atol=1e-14)


def test_without_centring_it_would_be_wrong():
    rng = np.random.default_rng(1)
    P = np.array([0.7, 0, 6.4]) + rng.standard_normal((6, 3))
    R = random_rotation(1)
    Q = P @ R.T + [0.5, -0.3, 1.0]
    A, _, Bt = np.linalg.svd(P.T @ Q)
    uncentred = Bt.T @ np.diag([1, 1, np.sign(np.linalg.det(A @ Bt))]) @ A.T
    assert np.abs(uncentred - R).max() > 1e-2
    np.testing.assert_allclose(kabsch(P, Q)[0], R, rtol=0, atol=1e-14)


def test_a_mirrored_flat_sheet_is_a_rotation_and_a_mirrored_solid_is_not():
    points = np.random.default_rng(2).standard_normal((8, 3))
    sheet = points * [1, 1, 0]
    R, determined = kabsch(sheet, sheet * [-1, 1, 1])
    assert determined
    np.testing.assert_allclose(R, np.diag([-1, 1, -1]), rtol=0, atol=1e-14)
    R, _ = kabsch(points, points * [-1, 1, 1])
    np.testing.assert_allclose(np.linalg.det(R), 1)


def test_it_is_the_minimum():
    rng = np.random.default_rng(3)
    P, Q = rng.standard_normal((2, 9, 3))
    Pc, Qc = P - P.mean(0), Q - Q.mean(0)
    best = kabsch(P, Q)[0]

    def misfit(R):
        return ((Pc @ R.T - Qc) ** 2).sum()

    others = [misfit(rotation_matrix(1e-3 * rng.standard_normal(3)) @ best) for _ in range(50)]
    others += [misfit(random_rotation(k)) for k in range(50)]
    assert misfit(best) < min(others)


LINE = np.linspace(-1, 2, 5)[:, None] * np.array([0.3, 0.5, -0.7])
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])


@pytest.mark.parametrize("far", [0.0, 1.0, 1e6])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_collinear_points_are_reported(far, dtype):
    bent = LINE + np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1], [0, 0, 0]])
    line, bent = (LINE + far).astype(dtype), (bent + far).astype(dtype)
    for reference, deformed in ((line, line), (line, bent), (bent, line)):
        R, determined = kabsch(reference, deformed)
        assert not determined
        np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-14)
    assert kabsch(bent, bent)[1] == (far < 1e6 or dtype == np.float64)


def test_a_collinear_ring_still_follows_its_line():
    R = random_rotation(4)
    found, determined = kabsch(LINE, LINE @ R.T)
    assert not determined
    np.testing.assert_allclose((LINE - LINE.mean(0)) @ found.T, (LINE - LINE.mean(0)) @ R.T, rtol=0, atol=1e-14)


def test_a_mirrored_regular_tetrahedron_has_no_single_best_rotation():
    regular = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]])
    assert kabsch(regular, regular)[1]
    assert not kabsch(regular, -regular)[1]


def test_coincident_points_get_the_identity():
    R, determined = kabsch(np.zeros((2, 1, 3)), np.ones((2, 1, 3)))
    assert not determined.any()
    np.testing.assert_array_equal(R, np.broadcast_to(np.eye(3), (2, 3, 3)))


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_verdict_does_not_depend_on_the_unit_of_length(scale):
    points = np.random.default_rng(5).standard_normal((6, 3)) * [1, 1e-3, 0]
    for shape, expected in ((points, True), (LINE, False)):
        assert kabsch(scale * shape, scale * shape)[1] == expected


def test_bad_points_are_refused_by_name():
    with pytest.raises(InputError, match=r"deformed\[1, 2\] is nan"):
        kabsch(CORNERS, np.where(np.arange(12).reshape(4, 3) == 5, np.nan, CORNERS))
    with pytest.raises(InputError, match=r"must both have shape"):
        kabsch(CORNERS, CORNERS[:3])
    with pytest.raises(InputError, match=r"k >= 1"):
        kabsch(np.zeros((0, 3)), np.zeros((0, 3)))


def test_dot_is_the_sum_of_products_of_any_shape():
    a, b = np.random.default_rng(3).standard_normal((2, 40, 3))
    assert dot(a, b) == pytest.approx((a * b).sum(), rel=1e-14)
