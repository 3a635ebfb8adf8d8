"""Symbolic analyses of a system: one for a pattern, another after many added blocks."""

import numpy as np
import pytest
from small_scenes import EFFECTS, SHEET, small_scene

from clothsim.mesh.generators.shapes import rectangle
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.linear import linear_system as module
from clothsim.solve.linear.direct_solver import EXACT
from clothsim.solve.linear.linear_system import NEW_BLOCKS, Patch, System
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.newton.direction import PRECONDITIONER_ERROR, QuadraticModel
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import advance
from clothsim.solve.timers import Timers

COUNT, TRIANGLES = 441, rectangle(cells=(20, 20))[1]


def squares(elements):
    """Positive definite blocks."""
    size = 3 * elements.shape[1]
    return ElementHessian(elements, np.tile(2.0 * np.eye(size) + 1.0, (len(elements), 1, 1)))


def far(count):
    """Pairs of vertices that the mesh does not couple."""
    return squares(np.column_stack([np.arange(count), np.arange(count) + 200]))


def grown(count):
    """A system that was analysed for the mesh, and the data of a matrix with so many more blocks."""
    system = System(make_pattern(COUNT, TRIANGLES, []), "superlu")
    assert system.analyses == 0
    data = system.assemble([squares(TRIANGLES)])
    system.solver.solve(data, np.ones(3 * COUNT))
    assert system.analyses == 1
    return system, system.assemble([squares(TRIANGLES), far(count)])


def test_a_few_new_blocks_are_lacked_by_the_preconditioner_and_by_it_alone():
    system, data = grown(5)
    solver, own = system.preconditioner(data)
    assert system.analyses == 1
    assert len(own) == len(data) - 9 * 5
    b = np.random.default_rng(0).standard_normal(3 * COUNT)
    rough = solver.solve(own, b)
    exact = system.solver.solve(data, b)
    assert system.analyses == 2
    assert np.abs(system.pattern.times(data)(exact) - b).max() < 1e-10
    assert np.abs(rough - exact).max() > 1e-6
    assert 0.5 < (rough @ b) / (exact @ b) < 2.0
    assert system.preconditioner(data) == (system.solver, data)


def test_where_many_blocks_have_come_the_pattern_is_analysed_afresh():
    system, data = grown(int(NEW_BLOCKS * (COUNT + 3 * 20 * 20)) + 2)
    _, own = system.preconditioner(data)
    assert own is data
    assert system.analyses == 2


@pytest.mark.parametrize("count", [0, 5])
def test_a_step_begins_with_its_own_pattern(count):
    system, _ = grown(5)
    system.begin([far(count).elements])
    assert system.analyses == 1
    assert system.solver is system.solver
    assert system.analyses == (2 if count else 1)  # nothing is analysed twice in a row
    assert len(system.pattern.columns) == len(system.base.columns) + count


def test_what_is_the_same_in_the_next_step_is_not_analysed_again():
    system, _ = grown(5)
    for _ in range(2):
        system.begin([far(5).elements])
        system.solver.factorise(system.assemble([squares(TRIANGLES), far(5)]))
        system.assemble([squares(TRIANGLES), far(7)])  # and what comes later goes with the step
    assert system.analyses == 2


def test_a_step_whose_pattern_is_another_starts_without_the_solver_of_the_last():
    """Solver choice for the first matrix of a step: independent of the step before."""
    system, _ = grown(5)
    system.begin([far(5).elements])
    data = system.assemble([squares(TRIANGLES), far(5)])
    assert system.preconditioner(data)[1] is data
    assert system.analyses == 2


def test_a_step_trusts_single_precision_afresh(monkeypatch):
    system, _ = grown(5)
    restarts = []
    monkeypatch.setattr(system.solver, "restart", lambda: restarts.append(system.analyses))
    system.solver.restart()  # of the grown pattern
    system.begin([far(5).elements])
    assert len(restarts) == 2


def test_a_region_has_what_has_come_in_the_step():
    system, _ = grown(5)
    patch = Patch(np.array([0, 1, 200, 201]), COUNT)
    part = system.subsystem(patch)
    before = len(part.pattern.columns)
    part.assemble([squares(TRIANGLES), far(5)])
    assert before == len(part.pattern.columns) == 4 + 2 + 2


def test_the_name_of_the_solver_costs_no_analysis():
    system, _ = grown(5)
    assert system.name == "superlu"
    assert system.analyses == 1


@pytest.mark.parametrize("accuracy", [EXACT, PRECONDITIONER_ERROR])
def test_only_a_preconditioner_lacks_blocks(accuracy):
    """The projected directions are Newton's own: no product with the whole matrix comes after them."""
    system, data = grown(5)
    model = QuadraticModel(Potential({}, Timers()), system, np.zeros(COUNT, bool))
    solved = model._solve(data, b := np.random.default_rng(0).standard_normal(3 * COUNT), accuracy)
    assert solved is not None
    off = np.abs(system.pattern.times(data)(solved[0]) - b).max()
    assert off < 1e-10 if accuracy == EXACT else off > 1e-6


def two_sheets(steps=10):
    """Positions after some steps of a sheet that falls flat on another, and how often the matrix was analysed."""
    upper = {**SHEET, "name": "upper", "cells": [6, 6], "size": [0.6, 0.6], "position": [0.0, 0.0, 0.05]}
    lower = {**SHEET, "name": "lower", "cells": [8, 8], "position": [0.0, 0.0, 0.0]}
    floor = {"name": "floor", "mesh": "rectangle", "cells": [2, 2], "size": [3.0, 3.0], "position": [0.0, 0.0, -0.05]}
    effects = {**EFFECTS, "self_contact": {}}
    solver = {"dt": 0.02, "linear": "superlu", "tolerance": 1e-4, "integrator": "backward_euler"}
    session = prepare(scene := small_scene([upper, lower], floor, effects, solver), build(scene))
    state = first_state(session.built.world, 0.02)
    for _ in range(steps):
        report = advance(session.integrator, state, state.time + 0.02)
        assert report.converged
        state = report.state
    return state.positions, session.integrator.system.analyses


def test_contact_that_is_expected_is_analysed_before_it_is_there():
    assert two_sheets()[1] <= 3


def test_what_was_not_expected_changes_the_way_and_not_the_end(monkeypatch):
    expected, _ = two_sheets()
    monkeypatch.setattr(Barrier, "couplings", lambda self, x, dx: np.zeros((0, 4), np.int64))
    monkeypatch.setattr(module, "NEW_BLOCKS", 0.0)
    surprised, often = two_sheets()
    monkeypatch.setattr(module, "NEW_BLOCKS", 10.0)
    lacking, seldom = two_sheets()
    assert seldom < often
    assert np.abs(surprised - expected).max() < 1e-6
    assert 0.0 < np.abs(lacking - expected).max() < 1e-6


def test_a_covered_pattern_keeps_few_spare_blocks():
    system = System(make_pattern(COUNT, TRIANGLES, []), "superlu")
    mesh = len(system.pattern.columns)
    system.cover([far(5).elements])
    wider = system.pattern
    assert len(wider.columns) == mesh + 5
    system.cover([far(3).elements])
    assert system.pattern is wider  # nothing is missing
    system.cover([far(200).elements])
    system.cover([far(1).elements + 17])
    assert len(system.pattern.columns) == mesh + 200  # the pair was there
    system.cover([np.array([[0, 300]])])
    assert len(system.pattern.columns) == mesh + 1
    first = system.widened([far(4).elements])
    assert system.widened([far(4).elements]) is first
    assert len(system.widened([far(9).elements]).base.columns) == mesh + 9
