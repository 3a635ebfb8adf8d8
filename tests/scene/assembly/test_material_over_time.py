"""Material that changes in a run: stiffnesses, curl and shrinkage over time."""

import numpy as np
import pytest

import clothsim
from clothsim import InputError
from clothsim.gradients.losses import Height
from clothsim.physics.energies.protocols import ChangingMaterial
from clothsim.scene.assembly.scene_world import build

STRIP = {"mesh": "rectangle", "size": [0.2, 0.05], "cells": [8, 2], "youngs_modulus": 1e6, "poisson_ratio": 0.0,
         "thickness": 3e-4, "density": 0.1}  # fmt: skip
CLAMPS = {"group": [{"select": "left"}, {"select": "right"}]}
HANGING = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "pins": {"select": "left"}}


def scene(effects, duration=0.4, dt=0.1, **cloth):
    run = {"duration": duration, "frames_per_second": 1 / dt, "forces": True}
    return clothsim.Scene(cloth=STRIP | cloth, effects=effects, run=run, solver={"dt": dt})


def test_a_strip_that_shrinks_between_clamps_has_the_tension_of_its_strain(tmp_path):
    """Stretch l = 1/(1 - s) at width b and nu = 0: force b E2/2 (l - 1/l), energy E2/4 (l^2 - 1 - 2 ln l) an area."""
    s = 0.05
    shrinking = scene({"membrane": {}, "pins": CLAMPS}, shrinkage_warp=[[0.0, 0.0], [0.3, s]])
    run = clothsim.simulate(shrinking, tmp_path)
    stretch, b, modulus = 1 / (1 - s), 0.05, 300.0
    assert run.forces().pins["pins.group[1]"][-1, 0] == pytest.approx(b * modulus / 2 * (stretch - 1 / stretch))
    stored = modulus / 4 * (stretch**2 - 1 - 2 * np.log(stretch)) * b * 0.2 * (1 - s)
    changes = run.summary["certificate"]["material_changes"]
    assert changes["added"] == pytest.approx(stored)
    assert changes["removed"] == 0
    assert sum(entry["material_energy"] for entry in run.record()) == pytest.approx(stored)


def test_a_hanging_strip_whose_stiffness_halves_sags_twice_as_far(tmp_path):
    """The end of a strip of length L and density rho sinks by rho g L^2 / (2 E2)."""
    effects = {"membrane": {}, "gravity": {"acceleration": [9.81, 0, 0]}, "pins": {"select": "left"}}
    sag = {}
    for name, modulus in {"stiff": 2e5, "soft": 1e5, "softer": [[0.1, 2e5], [0.3, 1e5]]}.items():
        run = clothsim.simulate(scene(effects, youngs_modulus=modulus), tmp_path / name)
        sag[name] = run.positions(-1)[:, 0].max() - 0.1
    assert sag["softer"] == pytest.approx(sag["soft"], rel=1e-5)
    assert sag["softer"] == pytest.approx(0.1 * 9.81 * 0.2**2 / 2 / 30, rel=5e-3)
    assert sag["softer"] / sag["stiff"] == pytest.approx(2, rel=3e-3)
    assert run.summary["certificate"]["material_changes"]["removed"] > 0


def test_a_cylinder_that_shrinks_bends_as_the_smaller_sheet():
    """E = D k^2/2 an area, of the area at rest that is left; the free ends have none, whatever the shrinkage."""

    def bent(**shrinkage):
        made = build(scene({"bending": {}}, cells=[16, 4], bending_stiffness=1e-5, **shrinkage))
        left = [1 - shrinkage.get(key, 0.0) for key in ("shrinkage_warp", "shrinkage_weft")]
        u, v = (made.world.start()[:, :2] * left).T
        return made.energies["bending"].value(np.column_stack([np.sin(8 * u) / 8, v, (1 - np.cos(8 * u)) / 8]))

    whole = bent()
    assert whole == pytest.approx(1e-5 / 2 * 8**2 * 0.01 * 15 / 16, rel=1e-9)
    assert bent(shrinkage_warp=0.1) == pytest.approx(0.9 * whole, rel=1e-9)
    assert bent(shrinkage_weft=0.2) == pytest.approx(0.8 * whole, rel=1e-9)


def test_a_function_of_time_and_the_stress_of_its_material(tmp_path):
    """E2/2 (l - 1/l) of the stretch against the rest shape of the step; the function may vanish after the run."""
    shrinking = scene(
        {"membrane": {}, "pins": CLAMPS}, shrinkage_warp=lambda t: 0.05 * t, youngs_modulus=lambda t: 1e6 * (1 - t)
    )
    keys = dict(shrinking.run) | {"fields": ["stress"]}
    run = clothsim.simulate(
        clothsim.Scene(shrinking.cloths[0], effects=shrinking.effects, run=keys, solver={"dt": 0.1}), tmp_path
    )
    stretch, modulus = 1 / (1 - 0.02), 300 * 0.6
    assert run.field("stress")[:, 0, 0] == pytest.approx(modulus / 2 * (stretch - 1 / stretch), rel=1e-4)
    frames = scene({"membrane": {}, "pins": CLAMPS}, shrinkage_warp=[[0, 0], [1, 0.05]])
    afterwards = clothsim.simulate(frames, tmp_path / "again").field("stress", 2)
    stretch = 1 / (1 - 0.01)
    assert afterwards[:, 0, 0] == pytest.approx(150 * (stretch - 1 / stretch), rel=1e-4)


def test_key_frames_of_one_value_are_a_number():
    constant = build(scene(HANGING, youngs_modulus=[[0.0, 5e5], [1.0, 5e5]]))
    plain = build(scene(HANGING, youngs_modulus=5e5))
    rng = np.random.default_rng(0)
    x = plain.world.start() + 1e-3 * rng.standard_normal(plain.world.start().shape)
    for name, energy in plain.energies.items():
        assert type(constant.energies[name]) is type(energy) is not ChangingMaterial
        if name in ("membrane", "bending"):
            assert constant.energies[name].value(x) == energy.value(x)


def test_a_resumed_run_has_the_same_bits(tmp_path):
    changing = scene(HANGING, 0.12, 0.01, bending_stiffness=[[0, 1e-4], [0.1, 1e-6]], shrinkage_weft=[[0, 0], [1, 0.5]])
    whole = clothsim.simulate(changing, tmp_path / "whole")

    def stop(progress):
        if progress.time > 0.05:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        clothsim.simulate(changing, tmp_path / "part", progress=stop)
    resumed = clothsim.resume(tmp_path / "part")
    assert np.array_equal(resumed.positions(-1), whole.positions(-1))
    assert resumed.summary["certificate"] == whole.summary["certificate"]
    assert whole.summary["certificate"]["material_changes"]["added"] > 0


def test_the_gradient_by_a_key_frame_is_that_of_differences():
    def run(value):
        changing = scene(HANGING, 0.05, 0.01, shrinkage_warp=[[0, 0.0], [0.05, value]])
        return clothsim.simulate(changing, differentiable=True)

    low, high = (run(value).trace.cloth_positions(-1)[:, 2].mean() for value in (0.0999, 0.1001))
    gradient = run(0.1).gradient(Height())["cloth.shrinkage_warp"]
    assert gradient.shape == (2, 2)
    assert gradient[1, 1] == pytest.approx((high - low) / 2e-4, rel=1e-4)


@pytest.mark.parametrize(
    ("cloth", "effects", "named"),
    [
        ({"youngs_modulus": [[0, 1e6], [1, 0]]}, HANGING, "cloth.youngs_modulus"),
        ({"shrinkage_warp": [[0, 0], [1, 1.0]]}, HANGING, "cloth.shrinkage_warp"),
        ({"bending_warp": [[0, 1e-5], [0, 2e-5]]}, HANGING, r"cloth.bending_warp\[1\]"),
        ({"youngs_modulus": [[0, 1e6], [1, 1e5]], "bending_hysteresis": 1e-4}, HANGING, "bending_hysteresis"),
        (
            {"bending_stiffness": [[0, 1e-5], [1, 1e-6]]},
            HANGING | {"plastic_bending": {"yield_curvature": 100}},
            "plastic_bending",
        ),
    ],
)
def test_what_cannot_change_is_refused(cloth, effects, named):
    with pytest.raises(InputError, match=named):
        build(scene(effects, **cloth))


def test_a_run_until_rest_waits_for_the_change(tmp_path):
    """The strip is at rest between its clamps long before it shrinks."""
    effects = {"inertia": {}, "membrane": {}, "damping": {"rate": 20.0}, "pins": CLAMPS}
    given = scene(effects, 3.0, dt=0.05, cells=[4, 1], shrinkage_warp=[[1.5, 0.0], [1.6, 0.05]])
    keys = dict(given.run) | {"until": "rest", "rest_speed": 0.01}
    run = clothsim.simulate(clothsim.Scene(given.cloths[0], effects=effects, run=keys, solver={"dt": 0.05}), tmp_path)
    assert 1.6 <= run.times[-1] < 3.0
    assert run.summary["certificate"]["material_changes"]["added"] > 0


def test_a_function_that_is_no_stiffness_at_the_start_and_pairs_that_shrink_are_refused():
    with pytest.raises(InputError, match="youngs_modulus is 0 at 0 s"):
        build(scene({"membrane": {}}, youngs_modulus=lambda t: 1e6 * t))
    with pytest.raises(InputError, match="pairs"):
        build(scene({"membrane": {"elements": "pairs"}}, shrinkage_warp=0.05))


def test_a_fabric_set_by_hand_goes_with_key_frames():
    """Half as stiff from the second step on, and shrinking as before."""
    shrinking = scene({"membrane": {}, "pins": CLAMPS}, youngs_modulus=[[0, 1e6], [1, 9e5]], shrinkage_warp=0.05)
    made = clothsim.Simulation(shrinking)
    made.step()
    whole = made.field("stress")[:, 0, 0]
    made.set_fabric(youngs_modulus=[[0, 5e5], [1, 4.5e5]], bending_stiffness=1e-5)
    made.step()
    assert made.field("stress")[:, 0, 0] == pytest.approx(whole * 4.9 / 9.9)


def test_a_free_strip_shrinks_beyond_its_strain_limit():
    """The limit is of the stretch against the shape at rest of the time, which the strip follows."""
    effects = {"inertia": {}, "membrane": {}, "strain_limit": {"limit": 1.05}, "pins": {"select": "left"}}
    run = clothsim.simulate(scene(effects, dt=0.02, cells=[4, 1], shrinkage_warp=[[0.0, 0.0], [0.4, 0.2]]))
    assert run.status == "completed", run.reason
    with pytest.raises(InputError, match="starts stretched"):
        build(scene(effects, shrinkage_warp=[[0.0, 0.2], [0.4, 0.3]]))
