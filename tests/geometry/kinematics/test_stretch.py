"""Polar decomposition of 3x2 deformation gradients against the SVD and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from meshes import deformed, random_rotation, small_world
from scipy.special import wrightomega

from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.deformation_gradient import area_ratios, deformation_gradients, reference_frames
from clothsim.geometry.kinematics.stretch import (
    deformed_thickness,
    polar_decomposition,
    principal_stretches,
    thickness_stretch,
)
from clothsim.mesh.body import rotation_matrix
from clothsim.mesh.cloth import triangle_planes

ULPS = 16
"""Round-offs of l1 by which an answer may differ; measured over 2e5 samples of each kind: l 5, R U - F 15."""

MEASURED_REFERENCE = np.array(
    [[0.759919, -0.015194, 6.38401], [0.767822, -0.0212492, 6.3669], [0.726977, -0.00749985, 6.38692]]
)
MEASURED_DEFORMED = np.array(
    [[0.771842, -0.0144887, 6.39045], [0.780121, -0.0186188, 6.37318], [0.737177, -0.00912791, 6.39292]]
)
ONE = np.array([[0, 1, 2]])


def transposed(A):
    return np.swapaxes(A, -1, -2)


def triangle_gradients(reference, positions, triangles=ONE):
    corners = triangle_planes(reference, triangles)
    inverses = np.linalg.inv(np.stack([corners[:, 1], corners[:, 2]], axis=2))
    return deformation_gradients(positions, triangles, inverses)


def area(corners):
    return 0.5 * np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))


def samples(kind, count=2000, seed=0):
    """Deformation gradients (count, 3, 2), regular and degenerate."""
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((count, 3, 2))
    powers = 10.0 ** rng.uniform(-12, 0, (count, 1))
    frames = np.linalg.qr(F)[0]
    return {
        "general": F,
        "rank 1": rng.standard_normal((count, 3, 1)) * rng.standard_normal((count, 1, 2)),
        "nearly rank 1": np.stack([F[..., 0], 1.3 * F[..., 0] + powers * F[..., 1]], axis=2),
        "equal stretches": frames * rng.uniform(0.1, 10, (count, 1, 1)),
        "nearly equal": frames + powers[..., None] * F,
        "one tiny column": F * np.stack([powers, np.ones_like(powers)], axis=2),
        "zero": np.zeros_like(F),
        "one column": F * [1, 0],
        "tiny": 1e-30 * F,
        "huge": 1e30 * F,
    }[kind]


KINDS = [
    "general",
    "rank 1",
    "nearly rank 1",
    "equal stretches",
    "nearly equal",
    "one tiny column",
    "zero",
    "one column",
    "tiny",
    "huge",
]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("kind", KINDS)
def test_decomposition_against_the_svd(kind, dtype):
    F = samples(kind).astype(dtype)
    stretch = polar_decomposition(F)
    fine = F.astype(np.float64)
    expected = np.linalg.svd(fine, compute_uv=False)
    size = expected[:, :1]
    bound = ULPS * np.finfo(dtype).eps

    for values in (stretch.principal_stretches, stretch.directions, stretch.R, stretch.R3, stretch.U):
        assert values.dtype == dtype
        assert np.isfinite(values).all()
    l1, l2 = stretch.principal_stretches.T
    assert (l1 >= l2).all()
    assert (l2 >= 0).all()
    assert (np.abs(stretch.principal_stretches - expected) <= bound * size).all()
    np.testing.assert_array_equal(principal_stretches(F), stretch.principal_stretches)

    R, R3, U, V = (a.astype(np.float64) for a in (stretch.R, stretch.R3, stretch.U, stretch.directions))
    assert (np.abs(R @ U - fine) <= bound * size[..., None]).all()
    assert (np.abs(U - transposed(U)) <= bound * size[..., None]).all()
    np.testing.assert_array_equal(R3[:, :, :2], R)
    np.testing.assert_allclose(transposed(R3) @ R3, np.broadcast_to(np.eye(3), R3.shape), rtol=0, atol=bound)
    np.testing.assert_allclose(np.linalg.det(R3), 1, rtol=bound)
    W = stretch.spatial_directions.astype(np.float64)
    assert (np.abs(fine @ V - W * stretch.principal_stretches[:, None, :]) <= bound * size[..., None]).all()


@settings(max_examples=100, deadline=None)
@given(arrays(np.float64, (2, 3, 2), elements=st.floats(-1e3, 1e3)))
def test_any_deformation_gradient(F):
    stretch = polar_decomposition(F)
    number = np.finfo(float)
    bound = 2 * ULPS * number.eps * np.abs(F).max(axis=(1, 2), keepdims=True) + number.tiny
    expected = np.linalg.svd(F, compute_uv=False)
    assert (np.abs(stretch.principal_stretches - expected) <= bound[:, :, 0]).all()
    assert (np.abs(stretch.R @ stretch.U - F) <= bound).all()
    np.testing.assert_allclose(
        transposed(stretch.R3) @ stretch.R3, np.broadcast_to(np.eye(3), (2, 3, 3)), rtol=0, atol=4e-15
    )


def test_float32_is_never_nan_for_rank_deficient_gradients():
    F = samples("rank 1", count=20000).astype(np.float32)
    with np.errstate(invalid="ignore"):
        naive = np.sqrt(np.linalg.eigvalsh(transposed(F) @ F))
    fraction = np.isnan(naive).any(axis=1).mean()
    assert 0.3 < fraction < 0.7
    assert np.isfinite(principal_stretches(F)).all()


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_small_stretch_of_a_thin_triangle_is_exact(dtype):
    """Squared in C, l2 = 1e-5 l1 is below the round-off of float32 (1e-10)."""
    thin = np.array([[[1, 0], [0, 1e-5], [0, 0]]]) @ rotation_matrix(np.array([0, 0, 0.6]))[:2, :2]
    l1, l2 = principal_stretches(thin.astype(dtype))[0]
    assert abs(l1 - 1) < ULPS * np.finfo(dtype).eps
    assert abs(l2 - 1e-5) < ULPS * np.finfo(dtype).eps


def test_the_measured_triangle():
    F = triangle_gradients(MEASURED_REFERENCE, MEASURED_DEFORMED)
    l1, l2 = principal_stretches(F)[0]
    ratio = area(MEASURED_DEFORMED) / area(MEASURED_REFERENCE)
    assert (round(l1, 4), round(l2, 4), round(l1 * l2, 4)) == (1.0507, 0.9896, 1.0398)
    np.testing.assert_allclose([l1 * l2, area_ratios(F)[0]], ratio, rtol=1e-12)


def test_measured_triangle_without_its_third_coordinate_differs():
    flat_reference, flat_deformed = MEASURED_REFERENCE * [1, 1, 0], MEASURED_DEFORMED * [1, 1, 0]
    l1, l2 = principal_stretches(triangle_gradients(flat_reference, flat_deformed))[0]
    assert (round(l1, 3), round(l2, 3)) == (1.054, 0.676)


@pytest.mark.parametrize("degrees", [0, 1e-5, 45, 179.9999, 180])
def test_rigid_motion(degrees):
    world = small_world(curved=True)
    R = rotation_matrix(np.radians(degrees) * np.array([1.0, 2.0, -2.0]) / 3)
    F = deformation_gradients(world.start() @ R.T + [3, 2, 1], world.triangles, world.rest_shape_inverses)
    stretch = polar_decomposition(F)
    np.testing.assert_allclose(stretch.principal_stretches, 1, rtol=1e-13)
    np.testing.assert_allclose(stretch.U, np.broadcast_to(np.eye(2), stretch.U.shape), rtol=0, atol=1e-13)
    turned = stretch.R3 @ reference_frames(world.start(), world.triangles).transpose(0, 2, 1)
    np.testing.assert_allclose(turned, np.broadcast_to(R, turned.shape), rtol=0, atol=1e-13)


def test_mirrored_sheet_is_a_rotation_by_180_degrees():
    world = small_world()
    F = deformation_gradients(world.start() * [-1, 1, 1], world.triangles, world.rest_shape_inverses)
    stretch = polar_decomposition(F)
    np.testing.assert_allclose(stretch.principal_stretches, 1, rtol=1e-13)
    turned = stretch.R3 @ reference_frames(world.start(), world.triangles).transpose(0, 2, 1)
    np.testing.assert_allclose(turned, np.broadcast_to(np.diag([-1, 1, -1]), turned.shape), rtol=0, atol=1e-13)


def test_uniform_scaling_by_two():
    world = small_world(curved=True)
    F = deformation_gradients(2 * world.start(), world.triangles, world.rest_shape_inverses)
    np.testing.assert_allclose(principal_stretches(F), 2, rtol=1e-13)


def test_known_stretches_directions_and_rotation():
    angle = 0.4
    V = rotation_matrix(np.array([0, 0, angle]))[:2, :2]
    R3 = random_rotation(3)
    U = V @ np.diag([1.7, 0.6]) @ V.T
    stretch = polar_decomposition((R3[:, :2] @ U)[None])
    np.testing.assert_allclose(stretch.principal_stretches[0], [1.7, 0.6], rtol=1e-14)
    np.testing.assert_allclose(stretch.directions[0], V, rtol=0, atol=1e-14)
    np.testing.assert_allclose(stretch.U[0], U, rtol=0, atol=1e-14)
    np.testing.assert_allclose(stretch.R3[0], R3, rtol=0, atol=1e-14)
    np.testing.assert_allclose(stretch.spatial_directions[0], R3[:, :2] @ V, rtol=0, atol=1e-14)


def test_rotation_in_space_leaves_u_unchanged():
    world = small_world(curved=True)
    x, Q = deformed(world), random_rotation(9)
    before = polar_decomposition(deformation_gradients(x, world.triangles, world.rest_shape_inverses))
    after = polar_decomposition(deformation_gradients(x @ Q.T, world.triangles, world.rest_shape_inverses))
    np.testing.assert_allclose(after.U, before.U, rtol=0, atol=1e-13)
    np.testing.assert_allclose(after.R3, Q @ before.R3, rtol=0, atol=1e-13)


def test_simple_shear():
    """J = 1, l1 = 1/l2 = (g + sqrt(g^2 + 4))/2; C = [[1, g], [g, 1 + g^2]], so v1 has the angle atan2(2 g, -g^2)/2."""
    g = 0.8
    F = np.array([[[1, g], [0, 1], [0, 0]]])
    stretch = polar_decomposition(F)
    l1 = (g + np.sqrt(g**2 + 4)) / 2
    np.testing.assert_allclose(stretch.principal_stretches[0], [l1, 1 / l1], rtol=1e-14)
    v1 = stretch.directions[0, :, 0]
    np.testing.assert_allclose(np.arctan2(v1[1], v1[0]), np.arctan2(2 * g, -(g**2)) / 2, rtol=1e-14)


def test_whole_numbers_and_empty_meshes():
    np.testing.assert_allclose(principal_stretches(np.array([[[3, 0], [0, 4], [0, 0]]])), [[4, 3]])
    assert polar_decomposition(np.zeros((0, 3, 2))).R3.shape == (0, 3, 3)


STRAIN = 1e-6


def closed_form(J, nu):
    """l3^2 = (a/2) w with w + ln w = 2/a - 2 ln J + ln(2/a), a = lam3/mu3: Wright's omega function, 0 < nu < .5."""
    a = 2 * nu / (1 - 2 * nu)
    return np.sqrt(a / 2 * wrightomega(2 / a - 2 * np.log(J) + np.log(2 / a)))


def residual(l3, J, nu):
    """Residual of (1 - 2 nu)(l3^2 - 1) + 2 nu ln(J l3) = 0, relative to its largest term where that is above 1."""
    terms = np.array([(1 - 2 * nu) * l3**2, np.full_like(J, -(1 - 2 * nu)), 2 * nu * np.log(J), 2 * nu * np.log(l3)])
    return np.abs(terms.sum(0)) / (1 + np.abs(terms).max(0))


@pytest.mark.parametrize("nu", [1e-9, 1e-3, 0.1, 0.3, 0.45, 0.499, 0.4999999])
def test_against_the_closed_form(nu):
    J = np.logspace(-12, 12, 401)
    np.testing.assert_allclose(thickness_stretch(J, 1, nu), closed_form(J, nu), rtol=2e-14)


@pytest.mark.parametrize(("l1", "l3"), [(1.1, 0.95904309), (1.5, 0.82492364)])
def test_published_digits(l1, l3):
    """docs/results/validation.md A1: lam = 1.5 mu solves the same equation for l2; 2 nu/(1 - 2 nu) = 1.5 is nu = .3."""
    assert round(float(thickness_stretch(l1, 1, 0.3)), 8) == l3


@settings(max_examples=100, deadline=None)
@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 0.5))
def test_thickness_satisfies_plane_stress_and_depends_on_the_area_only(log_l1, log_l2, nu):
    l1, l2 = np.exp([log_l1, log_l2])
    l3 = thickness_stretch(l1, l2, nu)
    assert residual(np.atleast_1d(l3), np.atleast_1d(l1 * l2), nu) < 1e-13
    np.testing.assert_allclose(l3, thickness_stretch(l1 * l2, 1, nu), rtol=1e-12)
    low, high = sorted([1.0, 1 / (l1 * l2)])
    assert low * (1 - 1e-13) <= l3 <= high * (1 + 1e-13)


@pytest.mark.parametrize("nu", [-0.9, -0.3, 0.0, 0.2, 0.3, 0.49, 0.5])
@pytest.mark.parametrize("strains", [(1, 1), (2, -0.5), (-1, -1), (3, 0)])
def test_small_strains(nu, strains):
    e1, e2 = STRAIN * np.array(strains)
    l3 = thickness_stretch(1 + e1, 1 + e2, nu)
    np.testing.assert_allclose(l3 - 1, -nu / (1 - nu) * (e1 + e2), rtol=0, atol=20 * STRAIN**2)


def test_plane_stress_lam_underestimates_thinning_by_30_percent():
    """lam/mu = 2 nu/(1 - nu) in place of 2 nu/(1 - 2 nu) is equivalent to the correct equation at nu' = nu/(1 + nu)."""
    nu = 0.3
    wrong_nu = nu / (1 + nu)
    assert np.isclose(2 * wrong_nu / (1 - 2 * wrong_nu), 2 * nu / (1 - nu))
    right, wrong = (1 - thickness_stretch(1 + STRAIN, 1, n) for n in (nu, wrong_nu))
    np.testing.assert_allclose(wrong / right, 0.70, atol=1e-5)
    np.testing.assert_allclose(right, 3 / 7 * STRAIN, rtol=1e-5)


def test_limit_of_incompressibility():
    l1, l2 = np.array([0.6, 1.0, 1.3, 2.0]), np.array([0.9, 1.0, 0.8, 1.5])
    expected = thickness_stretch(l1, l2, 0.1, model="incompressible")
    np.testing.assert_array_equal(expected, np.exp(-np.log(l1) - np.log(l2)))
    np.testing.assert_allclose(expected, 1 / (l1 * l2), rtol=4e-15)
    gaps = [np.abs(thickness_stretch(l1, l2, 0.5 - gap) - expected).max() for gap in (1e-3, 1e-4, 1e-5)]
    np.testing.assert_allclose(np.divide(gaps[:-1], gaps[1:]), 10, rtol=0.02)
    np.testing.assert_allclose(thickness_stretch(l1, l2, 0.5), expected, rtol=4e-15)


def test_zero_poisson_ratio_keeps_the_thickness():
    np.testing.assert_array_equal(thickness_stretch([0, 0.5, 2], [1, 1, 3], 0.0), 1)


def test_poisson_ratio_per_triangle():
    nu = np.array([0.0, 0.2, 0.5])
    together = thickness_stretch([1.2, 1.2, 1.2], 1.1, nu)
    np.testing.assert_array_equal(together, [thickness_stretch(1.2, 1.1, n) for n in nu])
    assert (np.diff(together) < 0).all()


def test_deformed_thickness_is_rest_thickness_times_stretch():
    stretches, nu = np.array([[1.2, 1.0], [1.1, 0.9], [1.0, 1.0]]), np.array([0.1, 0.3, 0.5])
    rest = np.array([1e-3, 2e-3, 3e-3])
    found = deformed_thickness(stretches, rest, nu)
    np.testing.assert_array_equal(found, rest * thickness_stretch(*stretches.T, nu))
    assert found[2] == rest[2]


@pytest.mark.parametrize("nu", [0.01, 0.3, 0.5])
def test_extreme_stretches(nu):
    assert thickness_stretch(0.0, 1.0, nu) == np.inf
    assert thickness_stretch(1e-150, 1e-150, nu) > 1
    assert 0 <= thickness_stretch(1e150, 1e150, nu) < 1


@pytest.mark.parametrize("nu", [-1e-6, -0.2, -0.5, -0.95])
def test_auxetic_sheets_thicken_under_tension(nu):
    J = np.array([0.95, 1.0, 1.1, 2.0, 1e3])
    l3 = thickness_stretch(J, 1, nu)
    assert (residual(l3, J, nu) < 1e-14).all()
    assert (np.sign(l3 - 1) == np.sign(J - 1)).all()


def test_compressed_auxetic_sheet_without_equilibrium_is_refused():
    """nu = -.5: mu3 (l3^2 - 1) - mu3/2 ln(J l3) has its minimum at l3 = 1/2, above 0 for ln J < ln 2 - 3/2."""
    limit = np.exp(np.log(2) - 1.5)
    np.testing.assert_allclose(thickness_stretch(limit * (1 + 1e-12), 1, -0.5), 0.5, atol=1e-5)
    with pytest.raises(InputError, match=r"entry \[1\]"):
        thickness_stretch([1.0, limit * (1 - 1e-12)], 1, -0.5)
    with pytest.raises(InputError, match="poisson_ratio"):
        thickness_stretch(0.0, 1.0, -0.5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1, -0.1], 1, 0.3), r"l1\[1\] .*0.* -0.1"),
        ((1, -1, 0.3), r"^l2 .*-1"),
        ((1, np.nan, 0.3), r"^l2 .*nan"),
        ((1, 1, 0.6), r"^poisson_ratio .*\(-1, 0.5\].* 0.6"),
        ((1, 1, [0.2, -1]), r"^poisson_ratio\[1\]"),
        ((1, 1, 0.3, "rubber"), r"'rubber'.*neo_hookean, incompressible"),
    ],
)
def test_bad_input_is_named(arguments, words):
    with pytest.raises(InputError, match=words):
        thickness_stretch(*arguments)
