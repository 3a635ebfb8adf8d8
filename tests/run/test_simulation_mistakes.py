"""Stepping by hand: failed steps, and mistakes that are refused and change nothing."""

import numpy as np
import pytest
from small_scenes import BALL, EFFECTS, end, small_scene

from clothsim import InputError, simulate
from clothsim.run.simulation import Simulation, SimulationError

SKY = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "air": {"wind": [1.0, 0.0, 0.0]}}
HELD = SKY | {"pins": {"select": [0, 4]}}


def flying(effects=SKY):
    return small_scene(body=(), effects=effects)


def test_a_failed_step_raises_and_leaves_the_last_good_state():
    simulation = Simulation(
        small_scene(body=BALL | {"position": [0, 0, -0.02]}, effects=EFFECTS | {"pins": {"select": [12]}})
    )
    before = simulation.step()
    simulation.move_pins(before.positions["cloth"][[12]] - [0.0, 0.0, 0.2])
    with pytest.raises(SimulationError) as caught:
        simulation.step()
    assert caught.value.failure is simulation.failure
    assert simulation.failure.cause == "blocked"
    assert simulation.state is before
    simulation.move_pins(before.positions["cloth"][[12]])
    assert simulation.step().step == before.step + 1
    assert simulation.failure is None


@pytest.mark.parametrize(
    "mistake",
    [
        lambda s: s.change("winds", wind=[0, 0, 0]),
        lambda s: s.change("pressure", pressure=1.0),
        lambda s: s.change("air", winds=[0, 0, 0]),
        lambda s: s.change("air", drag=-1.0),
        lambda s: s.change("pins", select=[1]),
        lambda s: setattr(s, "wind", "north"),
        lambda s: s.set_fabric("silk of another kind"),
        lambda s: s.set_fabric("denim", cloth="clothe"),
        lambda s: s.set_fabric("denim", densty=1.0),
        lambda s: s.move_pins(np.zeros((3, 3))),
        lambda s: s.move_pins(np.full((2, 3), np.nan)),
        lambda s: s.move_pins(np.zeros((2, 3)), "pin"),
        lambda s: s.drive_pins(velocity=(1.0, 0.0)),
        lambda s: s.add_pins("pins", [7]),
        lambda s: s.add_pins("hand", [4]),
        lambda s: s.add_pins("hand", [99]),
        lambda s: s.add_pins("hand", []),
        lambda s: s.add_pins("hand", [[7], [8, 9]]),
        lambda s: s.add_pins(3, [7]),
        lambda s: s.release_pins("hand"),
        lambda s: s.move_body("ball", np.zeros((3, 3))),
        lambda s: s.drive_body("ball"),
    ],
)
def test_a_mistake_is_refused_and_changes_nothing(mistake):
    simulation, as_it_was = Simulation(flying(HELD)), Simulation(flying(HELD))
    with pytest.raises(InputError):
        mistake(simulation)
    assert np.array_equal(end(simulation, 2), end(as_it_was, 2))


@pytest.mark.parametrize(
    ("mistake", "wrong", "there"),
    [
        (lambda s: s.move_pins(np.zeros((2, 3)), "hands"), "'hands'", ["'pins'", "'hand'"]),
        (lambda s: s.drive_pins("feet"), "'feet'", ["'pins'", "'hand'"]),
        (lambda s: s.release_pins("feet"), "'feet'", ["'pins'", "'hand'"]),
        (lambda s: s.set_fabric("denim", cloth="clothe"), "'clothe'", ["'cloth'"]),
        (lambda s: s.add_pins("feet", [1], cloth="sheet"), "'sheet'", ["'cloth'"]),
        (lambda s: s.drive_body("box"), "'box'", ["'ball'"]),
        (lambda s: s.change("winds", wind=[0, 0, 0]), "'winds'", ["'gravity'", "'air'"]),
    ],
)
def test_an_unknown_name_is_answered_with_those_there(mistake, wrong, there):
    simulation = Simulation(small_scene(effects=HELD))
    simulation.add_pins("hand", [12])
    with pytest.raises(InputError) as caught:
        mistake(simulation)
    assert wrong in caught.value.sentence
    assert all(name in caught.value.remedy for name in there)


@pytest.mark.parametrize(("effect", "keys"), [("strain_limit", {"limit": 1.00001}), ("body_contact", {"offset": 0.02})])
def test_a_barrier_that_the_cloth_does_not_satisfy_is_refused(effect, keys):
    effects = EFFECTS | {"pins": {"select": [0, 4]}, "strain_limit": {"limit": 1.5}}
    simulation = Simulation(small_scene(body=BALL | {"position": [0, 0, -0.03]}, effects=effects))
    end(simulation, 8)
    unchanged = simulation.branch()
    with pytest.raises(InputError, match=effect):
        simulation.change(effect, **keys)
    assert simulation.scene is unchanged.scene
    assert np.array_equal(end(simulation, 1), end(unchanged, 1))


@pytest.mark.parametrize("scene", [None, "scenes/sphere.toml", {}])
@pytest.mark.parametrize("start", [Simulation, simulate])
def test_what_is_no_scene_is_refused(start, scene):
    with pytest.raises(InputError, match=type(scene).__name__):
        start(scene)


def test_a_python_function_is_not_saved(tmp_path):
    simulation = Simulation(flying())
    simulation.wind = lambda points, time: np.array([time, 0.0, 0.0])
    simulation.step()
    with pytest.raises(InputError):
        simulation.save(tmp_path / "state.npz")
    assert not (tmp_path / "state.npz").exists()
