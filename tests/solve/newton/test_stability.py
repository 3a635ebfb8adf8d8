"""Static model and stability against dense eigenvalues: pressed strips, free sheets, both sides of a table."""

import numpy as np
import pytest
from effect_builders import bending, gravity, inertia, membrane, springs
from meshes import cloth, deformed, grid, irregular_grid, random_rotation, small_world
from scipy.linalg import eigh
from solving import pattern_of, step_at

from clothsim.base.linalg import dot
from clothsim.keys.fabric import Fabric
from clothsim.mesh.world import make_world
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.potential import Potential
from clothsim.solve.newton.stability import HORIZON, StaticModel, descent_from_saddle, lowest_mode
from clothsim.solve.timers import EffectCounters, Timers

STRIP = Fabric(density=0.15, thickness=1e-3, youngs_modulus=2e5, poisson_ratio=0.0, bending_stiffness=1e-3)
LENGTH, CELLS = 0.5, 12


def model_at(world, energies, x, fixed=(), linear="superlu"):
    """The static model of a world at x with some vertices fixed."""
    timers = Timers(effects={name: EffectCounters() for name in energies})
    held = np.zeros(world.n_cloth, bool)
    held[list(fixed)] = True
    system = System(pattern_of(world, energies, x), linear)
    bound = Potential(energies, timers).begin(step_at(x, dt=0.01))
    return StaticModel(bound, system, world.masses, held, step_at(x, dt=0.01))


def dense(model, project=False):
    """K + M / T^2 of the free rows and the masses, from the energies' own element Hessians."""
    x, n = model.rest.positions, len(model.masses)
    energies = model.bound.energies.values()
    K = sum(e.hessian(x, project).to_sparse(len(x)).toarray() for e in energies if not e.incremental)[: 3 * n, : 3 * n]
    free = np.repeat(~model.fixed, 3)
    M = np.repeat(model.masses, 3)[free]
    return K[np.ix_(free, free)] + np.diag(M) / HORIZON**2, M


def pressed(stretch, seed=None, linear="superlu", bends="hinge"):
    """A flat strip between hinges, pressed along x to `stretch`; turned by `seed`."""
    points, triangles = grid(CELLS, 2, LENGTH, 0.1)
    world = make_world([cloth(points, triangles, STRIP)])
    ends = np.flatnonzero((points[:, 0] == 0) | (points[:, 0] == LENGTH))
    x = world.start() * [stretch, 1, 1]
    x = x if seed is None else x @ random_rotation(seed).T
    energies = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world, model=bends)}
    return model_at(world, energies, x, ends, linear)


def euler_strain():
    """Strain of Euler's load of a strip on hinges, (pi / L)^2 D / E2."""
    return (np.pi / LENGTH) ** 2 * STRIP.bending_stiffness / (STRIP.youngs_modulus * STRIP.thickness)


@pytest.mark.parametrize("linear", ["superlu", "auto"])
@pytest.mark.parametrize("bends", ["hinge", "midedge"])
@pytest.mark.parametrize("load", [0.2, 0.7, 1.5, 3.0, 1000.0])
def test_stability_is_that_of_the_dense_matrix(load, bends, linear):
    """Mid-edge bending couples more vertices than the Newton matrix has room for."""
    model = pressed(1 - load * euler_strain(), linear=linear, bends=bends)
    lowest = float(eigh(dense(model)[0], eigvals_only=True, subset_by_index=(0, 0))[0])
    assert model.is_stable == (lowest > 0)
    assert (lowest_mode(model, 0) is None) == (lowest > 0)


def test_a_strip_is_unstable_from_about_its_euler_load_on():
    """Hinges are softer than the plate by up to a quarter (docs/results/validation.md, A3)."""
    assert pressed(1 - 0.7 * euler_strain()).is_stable
    assert not pressed(1 - 1.1 * euler_strain()).is_stable
    assert pressed(1 + euler_strain()).is_stable


@pytest.mark.parametrize("load", [2.0, 100.0])
@pytest.mark.parametrize("seed", [None, 3])
def test_the_lowest_mode_is_that_of_the_dense_pencil(load, seed):
    """v' K v / v' P v is the least; half a sine, whatever the load, where the fastest mode has many waves."""
    model = pressed(1 - load * euler_strain(), seed)
    A, M = dense(model)
    values, vectors = eigh(A, dense(model, project=True)[0])
    found = lowest_mode(model, 0)
    free = ~model.fixed
    v = found.shape[: len(model.masses)][free].ravel()
    assert not found.shape[: len(model.masses)][model.fixed].any()
    cosine = abs(v @ vectors[:, 0]) / np.linalg.norm(v) / np.linalg.norm(vectors[:, 0])
    assert cosine > 1 - 1e-5
    assert values[0] < 0 < values[1] or load > 2
    K = A - np.diag(M) / HORIZON**2
    assert found.curvature == pytest.approx(v @ K @ v, rel=1e-9)
    assert found.growth_rate == pytest.approx(np.sqrt(-(v @ K @ v) / (v @ (M * v))), rel=1e-9)
    assert np.linalg.norm(found.shape, axis=1).max() == pytest.approx(1.0)
    points = grid(CELLS, 2, LENGTH, 0.1)[0]
    sine = np.sin(np.pi * points[:, 0] / LENGTH)
    heights = np.linalg.norm(found.shape[: len(points)], axis=1)
    assert heights == pytest.approx(sine / sine.max(), abs=0.05)


def test_seeds_take_opposite_sides_of_one_mode():
    model = pressed(1 - 100 * euler_strain())
    first, second = lowest_mode(model, 4), lowest_mode(model, 5)
    assert np.array_equal(first.shape, -second.shape)
    assert np.abs(first.shape[:, 2]).max() > 0.9


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size", [1e-3, 1.0, 300.0])
def test_rigid_modes_of_a_free_sheet_are_not_unstable(seed, size):
    """Their curvature is 0 but for round-off, wherever the sheet is and however large."""
    points, triangles = irregular_grid(seed, 6, 5)
    world = make_world([cloth(size * points, triangles, STRIP)])
    x = world.start() @ random_rotation(seed).T + size * np.array([30.0, -70.0, 50.0])
    energies = {"membrane": membrane(world), "bending": bending(world)}
    model = model_at(world, energies, x)
    assert lowest_mode(model, seed) is None
    assert np.abs(model.displacement()).max() < 1e-6 * size


def test_every_force_counts_but_that_of_inertia():
    world = small_world()
    energies = {"inertia": inertia(world), "gravity": gravity(world), "membrane": membrane(world)}
    x = deformed(world)
    model = model_at(world, energies, x)
    wanted = energies["gravity"].gradient(x) + energies["membrane"].gradient(x)
    assert np.array_equal(model.gradient(), wanted)


# --- the way down ---------------------------------------------------------------------------------------------------


def test_a_descent_lowers_the_energy_by_the_curvature():
    model = pressed(1 - 100 * euler_strain())
    mode = lowest_mode(model, 0)
    amplitude = 1e-4
    dx = descent_from_saddle(model, mode, amplitude)
    assert np.array_equal(dx, amplitude * mode.shape)
    x = model.rest.positions
    fallen = model.potential.value(x + dx) - model.potential.value(x)
    assert fallen == pytest.approx(0.5 * mode.curvature * amplitude**2, rel=1e-2)


def test_a_slope_along_the_mode_decides_the_side():
    """With a load across the strip, both seeds give the side to which it pushes."""
    points, triangles = grid(CELLS, 2, LENGTH, 0.1)
    world = make_world([cloth(points, triangles, STRIP)])
    ends = np.flatnonzero((points[:, 0] == 0) | (points[:, 0] == LENGTH))
    for push in (-1.0, 1.0):
        loads = {"gravity": gravity(world, acceleration=(0, 0, push)), "membrane": membrane(world)}
        loads["bending"] = bending(world)
        model = model_at(world, loads, world.start() * [1 - 100 * euler_strain(), 1, 1], ends)
        for seed in (0, 1):
            dx = descent_from_saddle(model, lowest_mode(model, seed), 1e-5)
            assert dot(dx[:, 2], np.full(len(dx), push)) > 0


def test_a_longer_way_ends_where_the_energy_would_rise():
    model = pressed(0.8)
    mode = lowest_mode(model, 0)
    short, long = descent_from_saddle(model, mode, 1e-4), descent_from_saddle(model, mode, 1e-4, longest=1e6)
    x = model.rest.positions
    assert np.abs(long).max() > 100 * np.abs(short).max()
    assert model.potential.value(x + long) < model.potential.value(x + short) < model.potential.value(x)
    assert model.potential.value(x + 2 * long) >= model.potential.value(x + long)


def test_a_saddle_whose_sides_are_both_closed_has_no_descent():
    """Springs that resist every finite displacement, though their exact Hessian is made to look soft, stay."""
    model = pressed(1 - 100 * euler_strain())
    mode = lowest_mode(model, 0)
    world = make_world([cloth(*grid(CELLS, 2, LENGTH, 0.1), STRIP)])
    tie = springs(world, spring=[{"select": list(range(world.n_cloth)), "stiffness": 1e9}])
    stiff = model_at(world, {"springs": tie}, world.start(), np.flatnonzero(model.fixed))
    assert descent_from_saddle(stiff, mode, 1e-3) is None
