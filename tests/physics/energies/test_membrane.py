"""The Neo-Hookean membrane: closed forms of homogeneous states, invariance, and the edges of its domain.

psi = mu/2 (I1 - 2 - 2 ln J) + lam/2 (ln J)^2; principal stresses P1 = mu (l1 - 1/l1) + lam ln(l1 l2)/l1.
"""

from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian, hessian_error
from effect_builders import membrane
from meshes import UNIT, cloth, deformed, grid, irregular_grid, random_rotation, small_world
from scipy.optimize import brentq

from clothsim.base.errors import InputError
from clothsim.keys.fabric import Fabric
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off

MU, LAM = 1.0, 1.5
NU = LAM / (LAM + 2 * MU)
FABRIC = Fabric(
    density=1.0,
    thickness=1.0,
    youngs_modulus=4 * MU * (LAM + MU) / (LAM + 2 * MU),
    poisson_ratio=NU,
    bending_stiffness=0.0,
)


def sheet(seed=0):
    """An irregular unit square and its membrane with mu = 1, lam = 1.5."""
    world = make_world([cloth(*irregular_grid(seed), FABRIC)])
    return world, membrane(world)


def psi(F):
    C = F.T @ F
    log_J = 0.5 * np.log(np.linalg.det(C))
    return MU / 2 * (np.trace(C) - 2 - 2 * log_J) + LAM / 2 * log_J**2


def stress(F):
    """P = mu (F - F C^-1) + lam ln J F C^-1."""
    inverse = F @ np.linalg.inv(F.T @ F)
    return MU * (F - inverse) + LAM * 0.5 * np.log(np.linalg.det(F.T @ F)) * inverse


def principal_stress(l1, l2):
    return MU * (l1 - 1 / l1) + LAM * np.log(l1 * l2) / l1


def uniaxial_width(l1):
    """l2 of a strip stretched by l1 with free sides: P2 = 0."""
    return brentq(lambda l2: principal_stress(l2, l1), 0.2, 1.5, xtol=1e-15)


def measured(F):
    """psi and P of the energy under x = F X: the energy over the area, and the derivative of that along dF."""
    world, energy = sheet()
    material = world.start()[:, :2]
    x = material @ F.T
    area = world.rest_areas.sum()
    gradient = energy.gradient(x)
    return energy.value(x) / area, gradient.T @ material / area


CUTS = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])


def test_the_moduli_are_those_of_the_fabric():
    _, energy = sheet()
    assert np.allclose(energy.mu, MU, rtol=1e-14)
    assert np.allclose(energy.lam, LAM, rtol=1e-14)


@pytest.mark.parametrize(
    ("l1", "digits"), [(1.1, (0.95904309, 0.26385123, 0.01353688)), (1.5, (0.82492364, 1.04633399, 0.28627581))]
)
def test_uniaxial_tension(l1, digits):
    l2 = uniaxial_width(l1)
    F = CUTS * [l1, l2]
    reference = l2, principal_stress(l1, l2), psi(F)
    assert reference == pytest.approx(digits, abs=6e-9)
    value, P = measured(F)
    assert value == pytest.approx(reference[2], rel=1e-13)
    assert np.abs(P - CUTS * [reference[1], 0]).max() < 1e-14


def test_equibiaxial_tension():
    F = 1.5 * CUTS
    assert (principal_stress(1.5, 1.5), psi(F)) == pytest.approx((1.64426355, 0.93227565), abs=6e-9)
    value, P = measured(F)
    assert value == pytest.approx(psi(F), rel=1e-13)
    assert np.abs(P - principal_stress(1.5, 1.5) * CUTS).max() < 1e-13


@pytest.mark.parametrize("shear", [1e-3, 0.2, -1.0, 5.0])
def test_simple_shear(shear):
    """J = 1: psi = mu g^2/2, and of the stress only P12 = P21 = mu g."""
    F = CUTS + shear * np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    value, P = measured(F)
    assert value == pytest.approx(MU * shear**2 / 2, rel=1e-12, abs=1e-15)
    assert np.abs(P - MU * shear * np.array([[0, 1], [1, 0], [0, 0]])).max() < 1e-13 * max(1, abs(shear))


@pytest.mark.parametrize("seed", range(4))
def test_any_homogeneous_state(seed):
    F = np.random.default_rng(seed).standard_normal((3, 2))
    value, P = measured(F)
    assert value == pytest.approx(psi(F), rel=1e-12)
    assert np.abs(P - stress(F)).max() < 1e-12 * np.abs(stress(F)).max()


def test_small_strain_has_the_fabric_s_youngs_modulus_and_poisson_ratio():
    strain = 1e-6
    l2 = uniaxial_width(1 + strain)
    _, P = measured(CUTS * [1 + strain, l2])
    assert P[0, 0] / strain == pytest.approx(FABRIC.youngs_modulus, rel=1e-5)
    assert (1 - l2) / strain == pytest.approx(NU, rel=1e-5)


@pytest.mark.parametrize("strain", [1e-3, 1e-5, 1e-7])
def test_the_value_near_rest_is_no_difference_of_large_numbers(strain):
    """psi = mu e:e + lam/2 (tr e)^2 to first order in e: relative accuracy even where psi is below eps mu."""
    e = strain * np.array([[1.0, 0.3], [0.3, -0.5]])
    F = np.vstack([np.eye(2) + e, [0, 0]])
    linear = MU * (e**2).sum() + LAM / 2 * np.trace(e) ** 2
    assert measured(F)[0] == pytest.approx(linear, rel=3 * strain + 1e-7)


MOTIONS = {
    "none": np.eye(3),
    "random": random_rotation(3),
    "half turn in the plane": np.diag([-1.0, -1.0, 1.0]),
    "mirrored: turned over by 180 degrees": np.diag([-1.0, 1.0, -1.0]),
    "quarter turn": np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
}


@pytest.mark.parametrize("turn", MOTIONS.values(), ids=MOTIONS)
def test_rigid_motion_costs_nothing(turn):
    world, energy = sheet()
    x = world.start() @ turn.T + [0.5, -1.0, 2.0]
    assert abs(energy.value(x)) < 1e-28 + 1e-15 * MU * world.rest_areas.sum()
    assert np.abs(energy.gradient(x)).max() < 1e-12 * MU
    assert energy.value(world.start() * 1.1) > 1e-3


def test_net_force_and_torque_are_zero():
    world = small_world()
    x = deformed(world)
    force = membrane(world).gradient(x)
    largest = np.abs(force).max()
    assert largest > 0.1
    assert np.abs(force.sum(axis=0)).max() < 1e-13 * largest
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-13 * largest


def triangle_at(F):
    world = make_world([cloth(np.eye(3)[[2, 0, 1]] * [1, 1, 0], np.array([[0, 1, 2]]), FABRIC)])
    return membrane(world), world.start()[:, :2] @ np.asarray(F, float).T


@pytest.mark.parametrize("J", [1e-3, 1e-8, 1e-12, 1e-100])
@pytest.mark.parametrize("project", [True, False])
def test_a_nearly_flat_triangle_is_finite(J, project):
    energy, x = triangle_at(CUTS * [1.0, J])
    assert np.isfinite(energy.value(x))
    exact = 0.5 * (MU / 2 * (J**2 - 1 - 2 * np.log(J)) + LAM / 2 * np.log(J) ** 2)
    assert energy.value(x) == pytest.approx(exact, rel=1e-12)
    assert np.isfinite(energy.gradient(x)).all()
    assert np.isfinite(energy.hessian(x, project).blocks).all()


@pytest.mark.parametrize("F", [CUTS * [1.0, 0.0], CUTS * 0.0, np.outer([1.0, 2, 3], [1.0, 1])])
def test_a_triangle_without_area_is_not_admissible(F):
    energy, x = triangle_at(F)
    assert energy.value(x) == np.inf


def test_energy_rises_without_bound_as_the_area_vanishes():
    values = [
        triangle_at(CUTS * [1.0, J])[0].value(triangle_at(CUTS * [1.0, J])[1]) for J in 10.0 ** -np.arange(1, 150)
    ]
    assert (np.diff(values) > 0).all()
    assert values[-1] > 1e4


@pytest.mark.parametrize("project", [True, False])
@pytest.mark.parametrize("l2", [1 - 1e-16, 1.0, 1 + 2.3e-16, 1 + 1e-12, 1 - 1e-9])
def test_equal_stretches_take_the_limit(l2, project):
    """psi_11 - psi_12 at s1 = s2, not 0/0; about rest both projected and exact are the linear-elastic Hessian."""
    rest_energy, rest = triangle_at(CUTS)
    energy, x = triangle_at(CUTS * [1.0, l2])
    blocks = energy.hessian(x, project).blocks
    assert np.isfinite(blocks).all()
    assert np.abs(blocks - rest_energy.hessian(rest, False).blocks).max() < 1e-8


@pytest.mark.parametrize("stretch", [0.7, 1.0, 1.3])
def test_hessian_at_exactly_equal_stretches_is_the_derivative(stretch):
    energy, x = triangle_at(random_rotation(1)[:, :2] * stretch)
    assert hessian_error(energy, x) < 1e-7


def test_compressed_triangles_have_an_indefinite_hessian_and_its_projection_keeps_what_was_positive():
    energy, x = triangle_at(CUTS * [0.8, 0.9])
    exact, projected = dense_hessian(energy, x), dense_hessian(energy, x, project=True)
    assert np.linalg.eigvalsh(exact)[0] < -0.1
    assert np.linalg.eigvalsh(projected)[0] > -1e-14
    stretched, y = triangle_at(CUTS * [1.2, 1.3])
    assert np.abs(dense_hessian(stretched, y) - dense_hessian(stretched, y, project=True)).max() < 1e-14


def test_only_triangles_with_a_stiffness_take_part():
    stiff = cloth(*irregular_grid(0), FABRIC, name="stiff")
    limp = cloth(*irregular_grid(1), replace(UNIT, youngs_modulus=0.0), name="limp")
    world = make_world([limp, stiff])
    x = deformed(world)
    assert len(membrane(world).triangles) == len(stiff.triangles)
    assert not membrane(world).gradient(x)[world.cloth_slices[0]].any()
    assert membrane(make_world([limp])) == Off("Young's modulus is 0")


def test_an_unknown_material_is_refused_by_name():
    with pytest.raises(InputError, match=r"'silk'.*neo_hookean"):
        membrane(small_world(), material="silk")


def test_a_negative_poisson_ratio_is_kept_by_the_sheet_that_can():
    """lam < 0: the isotropic energy falls without bound as J -> 0."""
    positions, triangles = grid(2, 2)
    world = make_world([cloth(positions, triangles, replace(UNIT, poisson_ratio=-0.3))])
    energy = membrane(world)
    assert energy.value(world.start() * [1e-6, 1.0, 1.0]) > energy.value(world.start() * [0.5, 1.0, 1.0])
    values = np.linalg.eigvalsh(energy.hessian(world.start(), project=False).blocks)
    assert values.min() > -1e-9 * values.max()
    with pytest.raises(InputError):
        membrane(world, material="neo_hookean")
