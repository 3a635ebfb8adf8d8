"""Paired membrane: derivatives, invariance, patch test, choice of pairs, and reduced locking."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from meshes import UNIT, cloth, deformed, grid, irregular_grid, random_rotation, small_world
from solving import equilibrium, held

from clothsim.base.errors import InputError
from clothsim.mesh.generators.shapes import sphere
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.paired_membrane import IN_PLANE, OWN, paired_membrane
from clothsim.physics.energies.triangle_pairs import pairs
from tests.known_answers.a1_membrane import FABRIC, STATES, psi, sliver_sheet
from tests.known_answers.a6_inflation import balloon, blown_up, mylar
from tests.known_answers.a8_wrinkles import sheared, strip, thickness_of
from tests.support.effect_builders import membrane

every_shape = pytest.mark.parametrize("curved", [False, True], ids=["flat", "curved"])


@every_shape
@pytest.mark.parametrize("own", [0.0, OWN, 1.0])
def test_derivatives(curved, own):
    world = small_world(curved=curved)
    energy, x = paired_membrane(world, own, max(own, IN_PLANE)), deformed(world)
    assert gradient_error(energy, x) < 1e-8
    assert hessian_error(energy, x) < 1e-8
    assert np.linalg.eigvalsh(energy.hessian(x).blocks).min() > -1e-12


@every_shape
def test_with_all_of_it_the_triangles_own_it_is_the_membrane(curved):
    world = small_world(curved=curved)
    x = deformed(world)
    energy, plain = paired_membrane(world, own=1.0, in_plane=1.0), membrane(world)
    assert energy.value(x) == pytest.approx(plain.value(x), rel=1e-13)
    assert energy.gradient(x) == pytest.approx(plain.gradient(x), abs=1e-13)
    assert np.abs(dense_hessian(energy, x) - dense_hessian(plain, x)).max() < 1e-12


@every_shape
def test_it_is_at_rest_in_its_rest_shape_however_turned(curved):
    world = small_world(curved=curved)
    energy = paired_membrane(world)
    for turn in (np.eye(3), random_rotation(1), np.diag([1.0, 1, -1])):
        x = world.start() @ turn.T + [1.0, 2.0, 3.0]
        assert energy.value(x) < 1e-28
        assert np.abs(energy.gradient(x)).max() < 1e-14


@pytest.mark.parametrize("F", STATES.values(), ids=STATES)
def test_patch(F):
    positions, triangles = sliver_sheet(0)
    world = make_world([cloth(positions, triangles, FABRIC)])
    affine, border = positions[:, :2] @ F.T, border_vertices(triangles)
    start = affine + 1e-3 * np.random.default_rng(0).standard_normal(affine.shape)
    start[border] = affine[border]
    energy = paired_membrane(world)
    x = equilibrium(world, {"membrane": energy}, start, held(affine, border))
    assert np.abs(start - affine).max() > 1e-3
    assert np.abs(x - affine).max() < 1e-10
    assert energy.value(x) == pytest.approx(world.rest_areas.sum() * psi(F), rel=1e-12)


def test_every_triangle_answers_once():
    world = small_world()
    _, both = pairs(world)
    assert len(both) >= 4
    assert len(np.unique(both)) == both.size
    assert paired_membrane(world).weights.sum() == pytest.approx(world.rest_areas.sum(), rel=1e-14)


def test_a_grid_is_paired_into_its_squares():
    positions, triangles = grid(4, 3)
    corners, both = pairs(make_world([cloth(positions, triangles)]))
    assert len(both) == 12
    length = np.linalg.norm(positions[corners[:, 0]] - positions[corners[:, 1]], axis=1)
    assert length == pytest.approx(np.hypot(1 / 4, 1 / 3))


def test_no_pair_has_two_fabrics_or_a_sharp_crease():
    positions, triangles = grid(1, 1)
    positions[3, 2] = 2.0  # folded along the diagonal, by more than a right angle
    assert len(pairs(make_world([cloth(positions, triangles)]))[0]) == 0
    sheets = [cloth(*grid(1, 1), replace(UNIT, youngs_modulus=e), name=str(e)) for e in (1.0, 2.0)]
    corners, _ = pairs(make_world(sheets))
    assert sorted(corners[:, 0] // 4) == [0, 1]


def test_a_square_has_no_motion_without_energy_but_the_rigid_ones():
    """Out of its plane a square costs nothing to first order; in the plane 8 - 3 motions cost."""
    world = make_world([cloth(*grid(1, 1))])

    def modes(own):
        flat = dense_hessian(paired_membrane(world, own, in_plane=own), world.start()).reshape(4, 3, 4, 3)[:, :2][
            ..., :2
        ]
        return (np.linalg.eigvalsh(flat.reshape(8, 8)) > 1e-10).sum()

    assert modes(OWN) == 5
    assert modes(0.0) == 3  # the hourglasses


def test_a_bend_of_the_square_costs_less_than_its_triangles_would():
    """Both of fourth order in the height."""
    positions, triangles = grid(1, 1)
    world = make_world([cloth(positions, triangles)])
    energy, plain = paired_membrane(world), membrane(world)
    across = np.array([[0, 0, 0], [0, 0, 1.0], [0, 0, 1.0], [0, 0, 0]])  # the corners beside the diagonal 0-3
    heights = [1e-2, 5e-3]
    values = [energy.value(positions + h * across) for h in heights]
    assert np.log2(values[0] / values[1]) == pytest.approx(4, abs=0.05)
    assert all(plain.value(positions + h * across) > value for h, value in zip(heights, values, strict=True))


def test_wrinkles_across_the_diagonals_need_not_be_longer():
    """Four cells a wrinkle, the diagonals across them: 1.9 times too long on triangles."""
    world = strip(thickness_of(0.2, 0.02), 10)
    long, short = (sheared(world, sheet, -0.02).half_wavelength for sheet in (membrane(world), paired_membrane(world)))
    assert long > 1.7 * 0.2
    assert short < 1.25 * 0.2


def test_the_mylar_balloon_fills():
    world = balloon(12)
    locked, free = (blown_up(world, sheet)[1] / mylar()[1] - 1 for sheet in (membrane(world), paired_membrane(world)))
    assert locked < -0.15
    assert abs(free) < 0.02


def test_it_is_an_option_of_the_effect():
    world = small_world()
    assert type(membrane(world, elements="pairs")) is type(paired_membrane(world))
    slack = make_world([cloth(*irregular_grid(), replace(UNIT, youngs_modulus=0.0))])
    assert isinstance(membrane(slack, elements="pairs"), Off)
    with pytest.raises(InputError, match="elements"):
        membrane(world, elements="quads")
    with pytest.raises(InputError, match=r"membrane\.elements .*orthotropic"):
        membrane(world, material="orthotropic", elements="pairs")


def test_an_inflated_sphere_is_at_rest_curved():
    world = make_world([cloth(*sphere(radius=1.0, subdivisions=1))])
    energy = paired_membrane(world)
    assert np.abs(energy.gradient(world.start())).max() < 1e-13
    assert energy.value(1.1 * world.start()) == pytest.approx(membrane(world).value(1.1 * world.start()), rel=1e-12)


def beam_error(sheet, cells, length=8):
    """Relative error of the energy of a sheet of width 1 that is bent in its plane by a small turn of its ends."""
    positions, triangles = grid(length * cells, cells)
    positions = positions * [length, 1.0, 0.0] - [length / 2, 0.5, 0.0]
    world = make_world([cloth(positions, triangles, replace(UNIT, youngs_modulus=1.0, poisson_ratio=0.3))])
    count, turn = len(positions), 1e-2
    stiffness = dense_hessian(sheet(world), world.start()).reshape(count, 3, count, 3)[:, :2][..., :2]
    stiffness = stiffness.reshape(2 * count, 2 * count)
    moved, known = np.zeros((count, 2)), np.zeros((count, 2), bool)
    ends = np.isclose(np.abs(positions[:, 0]), length / 2)
    moved[ends, 0], known[ends, 0] = -turn * positions[ends, 0] * positions[ends, 1], True
    known[0, 1] = True
    u, free = moved.ravel(), ~known.ravel()
    u[free] = np.linalg.solve(stiffness[np.ix_(free, free)], -stiffness[np.ix_(free, ~free)] @ u[~free])
    return 0.5 * u @ stiffness @ u / (0.5 * length * turn**2 / 12) - 1


def test_bending_in_the_plane_is_that_of_a_beam():
    """The hourglass mode is the whole of it at one cell across: a fifth of the stiffness without its own."""
    own_alone = partial(paired_membrane, in_plane=OWN)
    assert beam_error(own_alone, 1) < -0.5
    assert beam_error(membrane, 2) > 0.5
    assert abs(beam_error(paired_membrane, 2)) < 0.04
    assert abs(beam_error(paired_membrane, 4)) < 0.01


def test_the_hourglass_stiffness_is_only_in_the_plane_of_a_pair():
    positions, triangles = grid(1, 1)
    world = make_world([cloth(positions, triangles)])
    own_alone, split = paired_membrane(world, in_plane=OWN), paired_membrane(world)
    mode = np.array([1.0, -1.0, -1.0, 1.0])[:, None]
    up, along = (positions + 1e-3 * mode * direction for direction in ([0, 0, 1.0], [1.0, 0, 0]))
    assert split.value(up) == pytest.approx(own_alone.value(up), rel=1e-3)
    assert split.value(along) == pytest.approx(IN_PLANE / OWN * own_alone.value(along), rel=0.05)
