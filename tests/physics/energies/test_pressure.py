"""Pressure: exact on closed cloths and held borders, p A n / 3 on free ones; an inflated sphere and a disc (A6)."""

from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from meshes import UNIT, cloth, deformed, grid, random_rotation, small_world
from solving import integrator_of, run_of, step_at

from clothsim import InputError
from clothsim.mesh.generators.shapes import sphere
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.solve.stepping.time_loop import static_model
from tests.known_answers.a6_inflation import (
    inflated_disc,
    inflated_height_and_volume,
    inflated_radii,
    limit_stretch,
    sphere_pressure,
    volume,
)
from tests.support.effect_builders import gravity, inertia, membrane, pins, pressure


def ball(subdivisions=1, fabric=UNIT, inward=False):
    positions, triangles = sphere(radius=1.0, subdivisions=subdivisions)
    return make_world([cloth(positions, triangles[:, ::-1].copy() if inward else triangles, fabric)])


def bound(world, x, value=2.0, **step):
    return pressure(world, value=value).begin(step_at(x, **step))


def area_forces(x, triangles):
    """p A n / 3 on each corner for p = 1, summed one by one."""
    out = np.zeros_like(x)
    for triangle in triangles:
        a, b, c = x[triangle]
        out[triangle] += np.cross(b - a, c - a) / 6
    return out


# --- the load -------------------------------------------------------------------------------------------------------


def test_a_closed_cloth_has_the_energy_minus_p_v():
    world = ball()
    x = deformed(world)
    assert bound(world, x).value(x) == pytest.approx(-2.0 * volume(x, world.triangles), rel=1e-13)


@pytest.mark.parametrize("world", [ball(), small_world()], ids=["closed", "open"])
def test_the_force_at_the_start_of_a_step_is_p_a_n_over_3_on_each_corner(world):
    x = deformed(world)
    force = -bound(world, x).gradient(x)
    assert np.abs(force - 2.0 * area_forces(x, world.triangles)).max() < 1e-14


def test_within_a_step_only_free_borders_lag():
    world = small_world()
    x = deformed(world)
    energy = bound(world, x)
    y = x + 0.05 * np.random.default_rng(5).standard_normal(x.shape)
    wrong = np.abs(-energy.gradient(y) - 2.0 * area_forces(y, world.triangles)).max(axis=1)
    border = border_vertices(world.triangles)
    inside = np.setdiff1d(np.arange(world.n_cloth), border)
    assert len(inside)
    assert wrong[inside].max() < 1e-14
    assert wrong[border].max() > 1e-3
    again = bound(world, y)
    assert np.abs(-again.gradient(y) - 2.0 * area_forces(y, world.triangles)).max() < 1e-14


@pytest.mark.parametrize("world", [ball(), small_world()], ids=["closed", "open"])
def test_derivatives_away_from_the_start_of_the_step(world):
    x = deformed(world)
    energy = bound(world, x)
    y = x + 0.03 * np.random.default_rng(2).standard_normal(x.shape)
    assert gradient_error(energy, y) < 1e-8
    assert hessian_error(energy, y) < 1e-8


def test_the_projected_hessian_is_the_positive_part_of_blocks_that_sum_to_the_exact_one():
    """K_ij = [o_j - o_i]x / 12: from differences of p A n / 3, made symmetric."""
    world = ball()
    x = deformed(world)
    energy = bound(world, x)
    blocks = np.zeros((len(world.triangles), 9, 9))
    for t, triangle in enumerate(world.triangles):
        for column in range(9):
            ahead, behind = x[triangle].copy(), x[triangle].copy()
            ahead[column // 3, column % 3] += 0.5
            behind[column // 3, column % 3] -= 0.5
            force = [np.cross(c[1] - c[0], c[2] - c[0]) / 6 for c in (ahead, behind)]
            blocks[t, :, column] = -2.0 * np.tile(force[0] - force[1], 3)
    blocks = 0.5 * (blocks + blocks.transpose(0, 2, 1))
    summed = ElementHessian(world.triangles, blocks).to_sparse(len(x)).toarray()
    exact = dense_hessian(energy, x)
    assert np.abs(summed - exact).max() < 1e-13 * np.abs(exact).max()
    projected = energy.hessian(x).blocks
    assert np.abs(projected).max() > 0.01
    values, vectors = np.linalg.eigh(blocks)
    nearest = (vectors * np.maximum(values, 0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    assert np.abs(projected - nearest).max() < 1e-14


def test_a_triangle_without_area_and_a_huge_pressure_leave_the_projected_hessian_finite():
    world = ball()
    x = world.start()
    flat = x.copy()
    flat[world.triangles[0, 2]] = flat[world.triangles[0, 0]]
    assert np.isfinite(bound(world, flat).hessian(flat).blocks).all()
    assert not bound(world, flat).hessian(flat).blocks[0].any()
    huge = bound(world, x, value=1e300).hessian(x).blocks / 1e300
    assert huge == pytest.approx(bound(world, x, value=1.0).hessian(x).blocks, rel=1e-12, abs=1e-15)


def test_a_closed_cloth_feels_no_net_force_or_torque_and_turns_along():
    world = ball()
    x = deformed(world)
    force, turn = bound(world, x).gradient(x), random_rotation(4)
    assert np.abs(force.sum(axis=0)).max() < 1e-14
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-14
    moved = x @ turn.T + [3.0, -2.0, 1.0]
    assert np.abs(bound(world, moved).gradient(moved) - force @ turn.T).max() < 1e-13


def test_it_pushes_outward_whichever_way_the_triangles_face():
    for world in (ball(), ball(inward=True)):
        x = world.start()
        assert (np.einsum("vi,vi->v", -bound(world, x).gradient(x), x) > 0).all()


def test_it_pushes_a_flat_sheet_up():
    positions, triangles = grid(3, 3)
    world = make_world([cloth(positions, triangles)])
    force = -bound(world, world.start()).gradient(world.start())
    assert np.abs(force[:, :2]).max() < 1e-15
    assert force[:, 2].sum() == pytest.approx(2.0, rel=1e-14)


def test_a_scheduled_pressure_is_that_of_the_end_of_the_step_and_its_own_ramp():
    world = ball()
    x = world.start()
    whole = bound(world, x, value=1.0).value(x)
    assert bound(world, x, value=[[0, 0.0], [2.0, 4.0]], dt=0.5).value(x) == pytest.approx(whole)
    assert bound(world, x, value=[[0, 0.0], [2.0, 4.0]], dt=0.5, load=0.25).value(x) == pytest.approx(whole)
    assert bound(world, x, value=lambda time: 2 * time, dt=0.5).value(x) == pytest.approx(whole)
    assert bound(world, x, value=1.0, dt=0.5, load=0.25).value(x) == pytest.approx(whole / 4)
    later = pressure(world, value=[[0, 0.0], [2.0, 4.0]]).begin(replace(step_at(x, dt=0.5), time=1.0))
    assert later.value(x) == pytest.approx(3 * whole)


def test_each_cloth_may_have_its_own():
    positions, triangles = sphere(radius=1.0, subdivisions=0)
    world = make_world([cloth(positions + 3 * k, triangles, name=name) for k, name in enumerate("ab")])
    x = world.start()
    force = bound(world, x, value={"a": 0, "b": [[0, 1.0], [1, 3.0]]}, dt=1.0).gradient(x)
    n = len(positions)
    assert not force[:n].any()
    assert np.abs(force[n:] + 3.0 * area_forces(positions, triangles)).max() < 1e-14


@pytest.mark.parametrize("value", [0.0, [[0, 0.0], [1, 0.0]], {"other": 0}])
def test_it_is_off_where_it_is_zero_at_all_times(value):
    assert isinstance(pressure(ball(), value=value), Off)


@pytest.mark.parametrize("value", ["much", [1.0, 2.0], {"nobody": 1.0}, [[1, 0], [0, 1]]])
def test_a_bad_value_is_refused(value):
    with pytest.raises(InputError, match=r"effects\.pressure\.value"):
        pressure(ball(), value=value)


@pytest.mark.parametrize("formula", ["backward_euler", "bdf2"])
def test_a_free_sheet_floats_on_the_pressure_that_supports_its_weight(formula):
    positions, triangles = grid(2, 2)
    world = make_world([cloth(positions, triangles)])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "gravity": gravity(world)}
    energies["pressure"] = pressure(world, value=9.81 * UNIT.density)
    integrator = integrator_of(world, energies, 0.05, tolerance=1e-9)
    reports = run_of(integrator, 0.5)
    assert np.abs(reports[-1].state.positions - world.start()).max() < 1e-9
    assert not any(report.switches for report in reports)


@pytest.mark.parametrize("held", [False, True])
def test_it_has_a_potential_where_its_border_is_held(held):
    """Stability is looked for there alone."""
    open_cloth, closed = small_world(), ball()
    border = np.unique(border_vertices(open_cloth.triangles))
    assert np.array_equal(bound(open_cloth, open_cloth.start()).rows_without_potential, border)
    assert not len(bound(open_cloth, open_cloth.start(), value=0.0001, load=0.0).rows_without_potential)
    assert not len(bound(closed, closed.start()).rows_without_potential)
    energies = {"membrane": membrane(open_cloth), "pressure": pressure(open_cloth, value=0.01)}
    constraints = {"pins": pins(open_cloth, select=border.tolist())[1]} if held else {}
    integrator = integrator_of(open_cloth, {"inertia": inertia(open_cloth)} | energies, 0.01, constraints)
    report = run_of(integrator, 0.01)[-1]
    assert static_model(integrator, report).is_conservative == held


# --- A6 -------------------------------------------------------------------------------------------------------------


def test_the_closed_forms_are_those_of_the_yardstick():
    assert sphere_pressure(1.1) == pytest.approx(0.74519991, abs=5e-9)
    assert sphere_pressure(1.25) == pytest.approx(1.26149699, abs=5e-9)
    assert limit_stretch() == pytest.approx(1.51121540, abs=1e-7)
    assert inflated_disc() == pytest.approx((0.53152270, 0.95787436), abs=2e-8)


@pytest.mark.parametrize("stretch", [1.1, 1.25])
def test_an_inflated_sphere_converges_to_the_closed_form(stretch):
    """Radius over rest radius; one vertex is held, where no force is left to hold."""
    errors = []
    for subdivisions in (1, 2, 3):
        radii = inflated_radii(stretch, subdivisions)
        errors.append(stretch - radii.mean())
        assert np.ptp(radii) < 0.02
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert abs(errors[-1]) < 2.6e-3
    assert (np.abs(orders - 2) < 0.25).all(), orders


def test_an_inflated_disc_converges_to_its_height_and_volume():
    errors = [np.abs(inflated_height_and_volume(cells) - [0.53152270, 0.95787436]) for cells in (4, 8, 16)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (errors[-1] < [3e-4, 4e-3]).all(), errors
    assert (orders > 1.6).all(), orders
