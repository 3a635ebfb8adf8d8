"""A drape that friction holds elsewhere than its pictures show it, pulled there."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from views import looking, seen

from clothsim import load_scene, recover_views
from clothsim.base.errors import ClothsimError
from clothsim.gradients.loss_of_numbers import LossOfNumbers
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.placed_drape import STEP, frictionless_step, pulled, pulled_positions
from clothsim.gradients.recover_views import SearchEnd
from clothsim.gradients.run import traced
from clothsim.gradients.view_fit import ViewFit
from clothsim.gradients.views import View

SCENE = """
[cloth]
mesh = "rectangle"
size = [0.2, 0.2]
cells = [6, 6]
position = [0.0, 0.0, 0.003]
fabric = "cotton"
[[body]]
mesh = "rectangle"
size = [0.6, 0.6]
cells = [1, 1]
[effects.inertia]
[effects.membrane]
[effects.bending]
model = "hinge"
[effects.gravity]
[effects.damping]
rate = 4.0
[effects.body_contact]
[effects.friction]
coefficient = 0.5
[solver]
linear = "superlu"
dt = 0.02
integrator = "backward_euler"
[run]
duration = 0.1
frames_per_second = 10
"""
MOVED = np.array([0.01, -0.006, 0.0])
"""How far from the start the pictures show the cloth [m]."""


@pytest.fixture(scope="module")
def lying(tmp_path_factory):
    """The fit of a cloth that lies on a plate, of a picture from above where it lies elsewhere, and its first run."""
    file = tmp_path_factory.mktemp("plate") / "plate.toml"
    file.write_text(SCENE)
    scene = load_scene(file)
    trace = traced(scene)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    camera = looking((0.0, -0.1, 0.8), x.mean(axis=0), focal=500.0)
    mask = seen(camera, (x + MOVED)[triangles])[0] == 0
    view = View("above", camera, {"mask": MaskBorder(camera, mask)})
    paths = ("cloth.bending_stiffness",)
    problem = LossOfNumbers(scene, None, paths, np.log([1e-5]), trace.stiffness, None)
    fit = ViewFit(problem, (view,), triangles, problem.origin, np.zeros((1, 1)))
    return fit, fit.seen(problem.origin, np.zeros((0, 3)))


def offset(seen_run, fit):
    """Mean offset in the plane from where the picture shows the cloth [m]."""
    at_start = fit.seen(seen_run.at, np.zeros((0, 3))).positions
    return np.linalg.norm((seen_run.positions - at_start - MOVED).mean(axis=0)[:2])


def test_friction_is_off_while_the_cloth_is_pulled_and_holds_it_then(lying):
    fit, first = lying
    assert offset(first, fit) > 0.01
    found = pulled(fit, first)
    assert offset(found, fit) < 1e-3
    assert found.total < 0.05 * first.total
    again = fit.seen(first.at, found.positions)  # friction: it stays
    assert np.abs(again.positions - found.positions).max() < 1e-3


def test_a_pull_lowers_the_sum(lying):
    fit, first = lying
    moved = first.placed.displacement.reshape(-1, 3)
    assert fit.total(fit.residuals(first.positions + 0.5 * moved), first.at) < fit.total(first.parts, first.at)
    positions = pulled_positions(fit, first, frictionless_step(fit.problem.scene))
    assert fit.total(fit.residuals(positions), first.at) < fit.total(first.parts, first.at)


def test_what_is_not_pulled(lying):
    """A scene that friction does not hold, a run that failed, and a drape that no pull makes better."""
    fit, first = lying
    failed = replace(first, total=float("inf"), parts=())
    assert pulled(fit, failed) is failed
    scene = fit.problem.scene
    effects = {name: each for name, each in scene.effects.items() if name != "friction"}
    smooth = replace(fit, problem=replace(fit.problem, scene=replace(scene, effects=effects)))
    assert pulled(smooth, first) is first
    better = replace(first, parts=tuple(replace(each, values=0.0 * each.values) for each in first.parts))
    assert pulled(fit, better) is better


def test_a_pull_is_one_step_and_one_frame_without_friction(lying):
    short = frictionless_step(lying[0].problem.scene)
    assert "friction" not in short.effects
    assert len(traced(short).steps) == 1
    assert (short.run_settings.duration, short.run_settings.frames_per_second) == (STEP, 1 / STEP)
    assert short.solver_settings.dt == STEP


def test_a_search_begins_where_the_pictures_show_the_cloth(lying, monkeypatch):
    fit, first = lying
    pulls = []

    def pull(own, drape):
        pulls.append(drape.total)
        return pulled(own, drape)

    monkeypatch.setattr(sys.modules[recover_views.__module__], "pulled", pull)
    found = recover_views(fit.problem.scene, fit.views, ["bending_stiffness"], folds=1, twins=False)
    assert found.best.loss < 0.05 * first.total
    assert found.wide == ("cloth.bending_stiffness",)  # a cloth that lies flat
    assert len(pulls) == 2
    assert pulls[1] < 0.05 * pulls[0]


def ending(drape, total, runs, seconds):
    """The end of a search at a drape with some sum."""
    return SearchEnd(replace(drape, total=total), drape, np.zeros((3 * len(drape.positions), 1)), True, runs, seconds)


def test_runs_and_seconds_of_all_rounds_are_added(lying, monkeypatch):
    fit, first = lying
    module = sys.modules[recover_views.__module__]
    ends = iter([(100.0, 2, 0.5), (50.0, 7, 1.25), (49.9, 1, 0.25)])

    def descended(own, drape, tell, most, moves=None):
        return ending(drape, *next(ends))

    monkeypatch.setattr(module, "_descended", descended)
    end = module._searched(fit, first, lambda drape: None)
    assert (end.last.total, end.runs, end.adjoint) == (49.9, 10, 2.0)  # a round that is worth little is the last


def test_a_round_that_fails_leaves_the_end_of_the_one_before(lying, monkeypatch):
    fit, first = lying
    module, calls = sys.modules[recover_views.__module__], []

    def descended(own, drape, tell, most, moves=None):
        if calls:
            raise ClothsimError("The runs beside it fail.")
        calls.append(most)
        return ending(drape, 3.0, 2, 0.5)

    monkeypatch.setattr(module, "_descended", descended)
    end = module._searched(fit, first, lambda drape: None)
    assert calls == [module.FEW_ITERATIONS]
    assert (end.last.total, end.runs, end.adjoint) == (3.0, 2, 0.5)
