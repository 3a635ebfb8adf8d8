"""Nonlinear elimination: the same minimiser with fewer iterations over the whole cloth."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending, inertia, membrane
from meshes import cloth, grid
from solving import newton_of

from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Prescribed
from clothsim.solve.linear import linear_system
from clothsim.solve.linear.linear_system import NONE, unconverged
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.newton import newton
from clothsim.solve.newton.outcome import Ending, outcome, unobserved

NOTHING = Prescribed(NONE, np.zeros((0, 3)))


@pytest.fixture(autouse=True)
def small_cloths_have_regions(monkeypatch):
    monkeypatch.setattr(linear_system, "MIN_VERTICES", 0)


def test_a_small_cloth_has_none(monkeypatch):
    _, triangles = grid(8, 8)
    pattern, free, moved = make_pattern(81, triangles, []), np.zeros(81, bool), np.arange(81) == 0.0
    assert len(unconverged(moved, 0.5, pattern, free))
    monkeypatch.setattr(linear_system, "MIN_VERTICES", 82)
    assert not len(unconverged(moved, 0.5, pattern, free))


def test_what_moved_takes_rings_of_neighbours_along():
    _, triangles = grid(20, 20)
    pattern = make_pattern(441, triangles, [])
    moved = np.zeros(441)
    moved[220] = 1.0  # the middle of 21 x 21
    rows = unconverged(moved, 0.5, pattern, np.zeros(441, bool))
    down, across = rows // 21 - 10, rows % 21 - 10
    assert len(rows) > 30
    assert max(np.abs(down).max(), np.abs(across).max()) == linear_system.RINGS
    fixed = np.zeros(441, bool)
    fixed[221] = True
    assert 221 in rows
    assert 221 not in unconverged(moved, 0.5, pattern, fixed)


def test_there_is_no_region_where_nothing_or_too_much_moves():
    _, triangles = grid(8, 8)
    pattern, free = make_pattern(81, triangles, []), np.zeros(81, bool)
    assert not len(unconverged(np.zeros(81), 0.5, pattern, free))
    assert not len(unconverged(np.ones(81), 0.5, pattern, free))
    assert not len(unconverged(np.arange(81) % 9 == 4.0, 0.5, pattern, free))  # a row, and three on both sides of it
    assert len(unconverged(np.arange(81) == 0.0, 0.5, pattern, free))


def dented(monkeypatch, most, observe=unobserved, **settings):
    """A step of a sheet at rest with one dent in it; most: fraction of the vertices that a region may have."""
    monkeypatch.setattr(linear_system, "MAX_FRACTION", most)
    positions, triangles = grid(24, 24)
    world = make_world([cloth(positions, triangles)], [])
    x = world.start()
    near = np.linalg.norm(x - x[312], axis=1)
    x = x + 0.15 * np.exp(-((near / 0.08) ** 2))[:, None] * np.array([0.3, -0.2, 1.0])
    energies = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world, model="hinge")}
    solver = newton_of(world, energies, dt=0.02, tolerance=1e-2, **settings)
    return replace(solver, observe=observe).minimise(x, NOTHING)


def test_the_end_is_the_same_with_regions_and_without(monkeypatch):
    with_them, without = dented(monkeypatch, 0.5), dented(monkeypatch, 0.0)
    assert with_them.outcome.converged
    assert without.outcome.converged
    assert with_them.elimination_iterations > 0
    assert with_them.iterations < without.iterations
    assert without.elimination_iterations == 0
    assert np.abs(with_them.x - without.x).max() < with_them.remaining + without.remaining < 1e-2 * 0.02


def test_a_region_is_left_after_its_iterations(monkeypatch):
    monkeypatch.setattr(newton, "MAX_PATCH_ITERATIONS", 1)
    assert dented(monkeypatch, 0.5).outcome.converged


def test_who_observes_sees_regions_too(monkeypatch):
    fractions = []
    result = dented(monkeypatch, 0.5, lambda iterate: fractions.append(iterate.fraction))
    regions = int(np.isnan(fractions).sum())
    assert regions > 0
    assert len(fractions) == 1 + result.iterations + regions


def test_the_last_iteration_is_followed_by_no_region(monkeypatch):
    asked = []
    monkeypatch.setattr(newton.Newton, "_eliminated", lambda self, x, dx, model: asked.append(x))
    assert not dented(monkeypatch, 0.5, max_iterations=5).outcome.converged
    assert len(asked) == 4


def test_what_is_left_after_a_region_is_the_whole_step(monkeypatch):
    """The step before the region says nothing of the rate at which Newton converges after it."""

    def eliminated(self, x, dx, model):
        return newton.NewtonResult(x, outcome(Ending.CONVERGED), 0, 0.0, 0.0)

    rated = dented(monkeypatch, 0.0)
    monkeypatch.setattr(newton.Newton, "_eliminated", eliminated)
    result = dented(monkeypatch, 0.5)
    assert result.outcome.converged
    assert result.remaining == result.speed * 0.02
    assert rated.remaining < rated.speed * 0.02
