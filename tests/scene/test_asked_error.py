"""[solver] error in place of dt: accepted keys, and the resulting settings."""

import pytest
from small_scenes import BALL, EFFECTS, small_scene, without

from clothsim import InputError
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.paths import override

ASKED = {"error": 1e-3, "linear": "superlu", "threads": 1}


def prepared(**changes):
    scene = small_scene(**{"solver": ASKED, **changes})
    return prepare(scene, build(scene))


def test_dt_and_error_exclude_each_other():
    with pytest.raises(InputError, match=r"solver.*dt.*error"):
        small_scene(solver={"dt": 0.01, "error": 1e-3})


@pytest.mark.parametrize("error", [0, -1e-3, float("nan"), "1 mm", True])
def test_an_error_is_a_length(error):
    with pytest.raises(InputError, match=r"solver\.error"):
        small_scene(solver={"error": error})


def test_the_longest_step_is_a_frame():
    integrator = prepared().integrator
    assert integrator.dt == integrator.control.longest == 0.04
    assert (integrator.control.error, integrator.control.duration) == (1e-3, 0.16)
    assert prepared(solver={"dt": 0.01, "linear": "superlu"}).integrator.control is None


def test_a_body_that_turns_bounds_the_step():
    spin = BALL | {"motion": {"rotate_degrees_per_second": [0, 0, 4500]}}
    assert prepared(body=spin).integrator.dt == pytest.approx(0.01, rel=1e-2)


def test_newton_goes_as_far_as_the_error_needs():
    fine = prepared(solver=ASKED | {"error": 1e-5})
    assert fine.integrator.settings.tolerance == pytest.approx(0.1 * 1e-5 / 0.16)
    assert any("tolerance" in note for note in fine.notes)
    assert prepared(solver=ASKED | {"error": 1e-1}).integrator.settings.tolerance == 1e-3
    given = prepared(solver=ASKED | {"error": 1e-5, "tolerance": 1e-2})
    assert given.integrator.settings.tolerance == 1e-2


def test_without_inertia_it_is_refused():
    with pytest.raises(InputError, match=r"solver\.error.*effects\.inertia"):
        prepared(effects=without("inertia", "body_contact", "damping") | {"pins": {"select": "left"}}, body=())


def test_with_seams_it_is_refused():
    seam = {"from": {"side": "left"}, "to": {"side": "right"}}
    with pytest.raises(InputError, match=r"solver\.error.*effects\.seams"):
        prepared(effects=without("body_contact") | {"seams": {"seam": [seam]}}, body=())


def test_on_the_command_line_it_takes_the_place_of_dt():
    scene = small_scene(solver={"dt": 0.01, "threads": 1}, effects=EFFECTS)
    assert override(scene, "solver.error=1e-3").solver == {"error": 1e-3, "threads": 1}
    assert override(override(scene, "solver.error=1e-3"), "solver.dt=0.02").solver == {"dt": 0.02, "threads": 1}
