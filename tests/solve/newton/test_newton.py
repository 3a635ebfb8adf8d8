"""Newton's method: minima, monotone decrease, diagonal shifts, and a named outcome of each end."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from effect_builders import bending, body_contact, gravity, inertia, membrane
from meshes import cloth, deformed, grid, small_world
from solving import NOTHING, equilibrium, held, newton_of, solve

from clothsim import Scene, simulate
from clothsim.mesh.body import make_body
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Energy, Prescribed
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.solve.linear.linear_system import System
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.newton import direction
from clothsim.solve.newton.convergence import MOST_UNBALANCED
from clothsim.solve.newton.direction import QuadraticModel
from clothsim.solve.newton.newton import FARTHEST, PROBE_PERIOD
from clothsim.solve.newton.outcome import Ending, outcome, position_text
from clothsim.solve.newton.potential import Potential
from clothsim.solve.timers import Timers


class Toy(Energy):
    """sum f(x_i) with given f, f', f'' over every coordinate; `limit`: its step limit."""

    def __init__(self, f, slope, curvature, limit=1.0):
        self.f, self.slope, self.curvature, self.limit = f, slope, curvature, limit
        self.seen = []

    def value(self, x):
        return float(self.f(x).sum())

    def gradient(self, x):
        self.seen.append(self.value(x))
        return self.slope(x)

    def hessian(self, x, project=True):
        blocks = self.curvature(x)[:, :, None] * np.eye(3)
        return ElementHessian(np.arange(len(x))[:, None], blocks)

    def step_limit(self, x, dx, most=1.0):
        return min(most, self.limit)


def quadratic(**changes):
    parts = {"f": lambda x: x**2 / 2, "slope": lambda x: x, "curvature": np.ones_like} | changes
    return Toy(**parts)


def double_well():
    """Minima at +-1, and not convex between: its Hessian is not projected."""
    return Toy(lambda x: (x**2 - 1) ** 2, lambda x: 4 * x * (x**2 - 1), lambda x: 12 * x**2 - 4)


def stiffening():
    """Full Newton steps overshoot: sqrt(1 + x^2)."""
    return Toy(lambda x: np.sqrt(1 + x**2), lambda x: x / np.sqrt(1 + x**2), lambda x: (1 + x**2) ** -1.5)


# --- minima ---------------------------------------------------------------------------------------------------------


def test_a_quadratic_takes_one_iteration_that_moves():
    world = small_world()
    energy = quadratic()
    result = solve(world, {"toy": energy}, deformed(world), tolerance=1e-9)
    assert result.outcome.converged
    assert np.abs(result.x).max() < 1e-15
    assert len(energy.seen) <= 3


def test_newton_never_climbs_where_full_steps_would():
    world = small_world()
    energy = stiffening()
    result = solve(world, {"toy": energy}, deformed(world) + 3.0, tolerance=1e-9)
    assert result.outcome.converged
    assert np.abs(result.x).max() < 1e-9
    assert (np.diff(energy.seen) <= 1e-12).all()
    assert len(energy.seen) > 3


def test_what_is_not_positive_definite_is_shifted_and_counted():
    world = small_world()
    x = 0.2 + 0.02 * deformed(world)
    x[0] = 1.5
    energy = double_well()
    assert (energy.curvature(x)[1:] < 0).all()
    newton = newton_of(world, {"toy": energy}, positions=x, tolerance=1e-10)
    result = newton.minimise(x, NOTHING)
    assert result.outcome.converged
    assert np.abs(np.abs(result.x) - 1).max() < 1e-9
    assert newton.potential.timers.linear_solves > result.iterations + 5
    assert (np.diff(energy.seen) <= 1e-12).all()


@pytest.mark.parametrize("linear", ["auto", "superlu"])
def test_a_strained_sheet_goes_back_to_rest(linear):
    world = small_world()
    energies = {"membrane": membrane(world), "bending": bending(world)}
    # nothing holds it: round-off of the forces, 1e-15 N, over the shift that stands for stiffness moves it by 1e-9 m/s
    x = equilibrium(world, energies, deformed(world, amplitude=0.05), tolerance=1e-8, linear=linear)
    assert sum(energy.value(x) for energy in energies.values()) < 1e-16


def test_residual_speed_and_iterations_are_reported():
    world = small_world()
    energies = {"membrane": membrane(world), "inertia": inertia(world)}
    start = deformed(world)
    newton = newton_of(world, energies, positions=start, dt=0.5, tolerance=1e-8)
    result = newton.minimise(start, NOTHING)
    force = newton.potential.gradient(result.x)
    assert result.outcome.converged
    assert result.speed < 1e-8
    assert result.iterations >= 3
    assert np.abs(force).max() < 1e-8
    assert result.residual < 1e-6


def test_a_tighter_tolerance_comes_closer():
    world = small_world()
    energies = {"membrane": membrane(world)}
    start = deformed(world)
    target = held(start, border_vertices(world.triangles))
    exact = equilibrium(world, energies, start, target, tolerance=1e-12)
    for tolerance in (1e-3, 1e-6):
        x = solve(world, energies, start, target, tolerance=tolerance).x
        assert np.abs(x - exact).max() < 10 * tolerance


# --- prescribed vertices --------------------------------------------------------------------------------------------


def test_prescribed_vertices_arrive_to_the_bit_and_the_rest_follows():
    world = small_world()
    x = world.start()
    border = border_vertices(world.triangles)
    target = Prescribed(border, 1.3 * x[border] + np.array([0.1, 0.2, 0.3]))
    result = equilibrium(world, {"membrane": membrane(world)}, x, target)
    assert np.array_equal(result[border], target.positions)
    assert np.abs(result - 1.3 * x - [0.1, 0.2, 0.3]).max() < 1e-10


def test_rows_beyond_the_cloth_are_prescribed_too():
    positions, triangles = grid(2, 2)
    floor = make_body("floor", np.array([[0.0, 0, -1], [1, 0, -1], [0, 1, -1]]), np.array([[0, 1, 2]]))
    world = make_world([cloth(positions, triangles)], [floor])
    x = world.start()
    rows = np.arange(world.n_cloth, world.n_vertices)
    target = Prescribed(rows, x[rows] + 0.25)
    result = equilibrium(world, {"inertia": inertia(world)}, x, target)
    assert np.array_equal(result[rows], target.positions)
    assert np.array_equal(result[: world.n_cloth], x[: world.n_cloth])


def test_the_free_vertices_know_on_their_way_where_the_others_go():
    """H_ff dx_f = -(g + H way)_f."""
    world = small_world()
    x, displacement = deformed(world), np.zeros_like(world.start())
    energies = {"inertia": inertia(world), "membrane": membrane(world), "bending": bending(world)}
    fixed = np.arange(world.n_cloth) < 3
    displacement[:3] = 0.1
    solver = newton_of(world, energies)
    found = QuadraticModel(solver.potential, solver.system, fixed).direction(x, displacement)
    matrix = sum(hessian.to_sparse(len(x)) for hessian in solver.potential.hessians(x))
    left = (solver.potential.gradient(x).ravel() + matrix @ found.dx.ravel()).reshape(-1, 3)
    assert np.array_equal(found.dx[:3], displacement[:3])
    assert np.abs(left[3:]).max() < 1e-12 * np.abs(left[:3]).max()


def test_what_holds_a_vertex_is_no_residual():
    world = small_world()
    x = deformed(world)
    solver = newton_of(world, {"membrane": membrane(world)})
    fixed = np.arange(world.n_cloth) < 3
    gradient = solver.potential.gradient(x)
    assert QuadraticModel(solver.potential, solver.system, fixed).residual(gradient) == np.abs(gradient[3:]).max()
    assert QuadraticModel(solver.potential, solver.system, ~fixed).residual(gradient) == np.abs(gradient[:3]).max()


def test_a_fold_across_the_sheet_is_displaced_in_parts_when_it_would_invert():
    """Pins that cross over the sheet's own middle in one step: the value may rise, but it stays finite."""
    positions, triangles = grid(4, 1)
    world = make_world([cloth(positions, triangles)])
    x = world.start()
    left, right = np.flatnonzero(positions[:, 0] == 0), np.flatnonzero(positions[:, 0] == 1)
    pinned = np.concatenate([left, right])
    goals = x[pinned].copy()
    goals[: len(left), 0] += 0.9
    energies = {"membrane": membrane(world), "inertia": inertia(world)}
    result = solve(world, energies, x, Prescribed(pinned, goals), dt=0.1, tolerance=1e-4)
    assert result.outcome.converged, result.outcome.sentence
    assert np.array_equal(result.x[pinned], goals)


def test_free_vertices_of_a_slack_sheet_are_not_thrown_far_out(tmp_path):
    """Little resists out of the plane without inertia: cotton went 20 m out, and came back in 94 iterations."""
    pins = [{"select": "left", "motion": {"velocity": [0.5, 0, 0]}}, {"select": "right"}]
    scene = Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.4], "cells": [8, 8]},
        effects={"membrane": {}, "bending": {"model": "hinge"}, "gravity": {}, "pins": {"group": pins}},
        solver={"dt": 0.1, "threads": 1, "tolerance": 1e-3},
        run={"duration": 0.1, "frames_per_second": 10},
    )
    run = simulate(scene, tmp_path, dump_iterates=1)
    with np.load(tmp_path / "iterates_1.npz") as log:
        positions = log["positions"]
    assert run.status == "completed"
    assert np.abs(positions - positions[0]).max() < 1.0


# --- endings --------------------------------------------------------------------------------------------------------


def over_a_floor(height=0.5):
    positions, triangles = grid(2, 2)
    floor = make_body("floor", np.array([[-9.0, -9, 0], [9, -9, 0], [0, 18, 0]]), np.array([[0, 1, 2]]))
    sheet = replace(cloth(positions, triangles), positions=positions + np.array([0.0, 0.0, height]))
    return make_world([sheet], [floor])


def iteration_limit():
    world = small_world()
    return solve(world, {"membrane": membrane(world)}, deformed(world), tolerance=1e-12, max_iterations=2)


def blocked():
    """Pins driven through a floor."""
    world = over_a_floor()
    energies = {
        "membrane": membrane(world),
        "inertia": inertia(world),
        "body_contact": body_contact(world, d_hat=0.05, stiffness=100.0),
    }
    x = world.start()
    corner = np.array([0, 2])
    return solve(world, energies, x, Prescribed(corner, x[corner] - np.array([0.0, 0.0, 1.0])), dt=0.1)


def no_room():
    world = small_world()
    return solve(world, {"toy": quadratic(limit=0.0)}, deformed(world))


def blocked_at_once():
    world = small_world()
    x = world.start()
    return solve(world, {"toy": quadratic(limit=1e-13)}, x, Prescribed(np.array([3]), x[[3]] + 1.0))


def sunk():
    """A solve whose contact is found too soft after PROBE_PERIOD iterations."""
    world = small_world()
    newton = newton_of(world, {"membrane": membrane(world)}, tolerance=1e-300)
    return replace(newton, sinks=lambda x: True).minimise(deformed(world), NOTHING)


def line_search():
    """An energy that falls where its gradient says that it rises."""
    world = small_world()
    return solve(world, {"toy": quadratic(f=lambda x: -(x**2))}, deformed(world))


def not_finite():
    """A triangle that starts as a point."""
    world = small_world()
    x = world.start()
    x[world.triangles[4]] = x[world.triangles[4, 0]]
    return solve(world, {"membrane": membrane(world)}, x)


def singular():
    """Weight, and nothing that resists."""
    world = small_world()
    return solve(world, {"gravity": gravity(world)}, world.start())


def unbalanced():
    """A stiffness so far from the force that its steps are below the tolerance for ever."""
    world = small_world()
    energy = quadratic(curvature=lambda x: np.full_like(x, 1e6))
    return replace(newton_of(world, {"toy": energy}), least_force=0.0).minimise(deformed(world), NOTHING)


ENDS = [
    (iteration_limit, Ending.ITERATION_LIMIT, None, {"tolerance", "limit", "speed"}),
    (blocked, Ending.BLOCKED, {0, 2}, set()),
    (no_room, Ending.NO_ROOM, None, {"fraction"}),
    (blocked_at_once, Ending.BLOCKED, {3}, set()),
    (sunk, Ending.SUNK, None, set()),
    (line_search, Ending.LINE_SEARCH, None, {"speed"}),
    (not_finite, Ending.NOT_FINITE, None, set()),
    (singular, Ending.SINGULAR, {None}, set()),
    (unbalanced, Ending.UNBALANCED, None, {"force", "percent"}),
]


@pytest.mark.parametrize(
    ("scene", "ending", "rows", "numbers"), ENDS, ids=lambda value: getattr(value, "__name__", None)
)
def test_every_end_has_its_name_and_place(scene, ending, rows, numbers):
    result = scene()
    end = result.outcome
    assert result.outcome.ending is ending, result.outcome.sentence
    assert not result.outcome.converged
    assert end.row in (range(len(result.x)) if rows is None else rows)
    assert (end.position is None) == (end.row is None)
    assert set(end.numbers) == numbers
    assert np.isfinite(result.x).all()


def test_a_solve_that_ends_at_its_limit_took_as_many_iterations():
    assert iteration_limit().iterations == 2
    assert sunk().iterations == PROBE_PERIOD
    assert unbalanced().iterations == MOST_UNBALANCED


def test_iterations_of_prescribed_displacements_are_not_probed():
    world = small_world()
    newton = newton_of(world, {"membrane": membrane(world)}, tolerance=1e-300)
    x, corner = deformed(world), np.array([0])
    target = Prescribed(corner, x[corner] + np.array([0.0, 0.0, 0.5]))
    result = replace(newton, sinks=lambda x: True).minimise(x, target)
    assert result.outcome.ending is Ending.SUNK
    assert result.iterations > PROBE_PERIOD


def test_no_end_was_forgotten():
    assert {ending for _, ending, *_ in ENDS} | {Ending.CONVERGED} == set(Ending)


def test_blocked_pins_stop_above_the_floor():
    result = blocked()
    assert 0 < result.x[:9, 2].min() < 0.05


@pytest.mark.parametrize("ending", Ending)
def test_every_sentence_can_be_filled(ending):
    numbers = {"tolerance": 1.0, "limit": 2, "speed": 3.0, "fraction": 0.5, "force": 6.0, "percent": 70.0}
    filled = outcome(ending, np.arange(15.0).reshape(5, 3), 4, **numbers)
    assert "{" not in filled.sentence
    assert filled.sentence.endswith(".")
    assert ("vertex 4" in filled.sentence) == ("(12, 13, 14) m" in filled.sentence) == ("{who}" in ending.value)
    assert filled.describe("knee of trousers") == filled.sentence.replace("vertex 4", "knee of trousers")
    assert filled.converged == (ending is Ending.CONVERGED)


def test_a_place_is_reported_without_its_round_off():
    assert position_text(np.array([0.25, -3e-17, 1e-3])) == "(0.25, 0, 0.001) m"
    assert position_text(np.array([2e-12, 0.0, -1e-12])) == "(2e-12, 0, -1e-12) m"


def test_an_old_factor_serves_on_the_way_but_never_ends_a_solve(monkeypatch):
    ages, found = [], QuadraticModel.direction

    def recorded(self, *arguments):
        answer = found(self, *arguments)
        ages.append(answer.cached.age)
        return answer

    monkeypatch.setattr(direction, "MIN_VERTICES", 0)
    monkeypatch.setattr(QuadraticModel, "direction", recorded)
    world = small_world()
    energies = {"membrane": membrane(world), "bending": bending(world), "inertia": inertia(world)}
    for amplitude in (0.05, 0.1, 0.15, 0.2):
        ages.clear()
        result = solve(world, energies, deformed(world, amplitude=amplitude), NOTHING, tolerance=1e-4, dt=0.5)
        assert result.outcome.converged
        assert ages[-1] == 0
        assert max(ages) > 0
        assert all(later in (0, earlier + 1) for earlier, later in pairwise(ages))


# --- singular to working precision ----------------------------------------------------------------------------------


@pytest.mark.parametrize("linear", ["auto", "superlu"])
def test_a_stiffness_of_round_off_is_no_stiffness(linear):
    """Two springs that 4 ulps hold in place: every processor factorises them, and their middles would go 1e9 m far.

    Newton on a strip without bending stalled where such a matrix passed for positive definite, by the rounding of BLAS.
    """
    k, held_by = 2.0**20, 1.0 + 2.0**-50
    block = k * np.kron([[held_by, -1.0], [-1.0, held_by]], np.eye(3))
    hessian = ElementHessian(np.array([[0, 1], [2, 3]]), np.array([block, block]))
    pattern = make_pattern(4, np.zeros((0, 3), np.int64), [hessian])
    model = QuadraticModel(Potential({}, Timers()), System(pattern, linear), np.zeros(4, bool))
    data = pattern.assemble([hessian])[0]
    moved, _ = model._solve(data, np.ones(12), direction.EXACT)
    assert 0 < np.abs(moved).max() < 1e5
    pull = np.repeat([1.0, -1.0, 1.0, -1.0], 3)
    stretched, _ = model._solve(data, pull, direction.EXACT)  # nothing but the springs: it needs no shift
    assert stretched * 2 * k == pytest.approx(pull, rel=1e-12)
    assert model.potential.timers.linear_solves == 3


def test_a_vertex_thrown_far_by_prescribed_ones_follows_to_a_bound_where_its_energy_is_lower(monkeypatch):
    world = small_world()
    newton = newton_of(world, {"membrane": membrane(world)})
    x, displacement = world.start(), np.zeros_like(world.start())
    displacement[0] = [0.0, 0.02, 0.0]
    thrown = displacement.copy()
    thrown[5] = [300.0, 0.0, 400.0]
    dx, fraction = newton._following(x, thrown, displacement)
    bound = FARTHEST * 0.02
    assert fraction == 1.0
    assert dx[0] == pytest.approx(displacement[0])
    assert dx[5] == pytest.approx([0.75 * bound, 0.0, bound])
    thrown[5] = [0.0, 0.0, 0.9 * bound]
    assert newton._following(x, thrown, displacement)[0] is thrown
    thrown[5] = [300.0, 0.0, 400.0]
    monkeypatch.setattr(type(newton), "_limit", lambda *_: 0.99)  # what contact clips is left alone
    clipped, fraction = newton._following(x, thrown, displacement)
    assert clipped is thrown
    assert fraction == 0.99
