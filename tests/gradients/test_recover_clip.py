"""What explains edited frames: a stiffness from two keys, and a number that they do not determine."""

from dataclasses import replace

import numpy as np
import pytest

import clothsim
from clothsim import InputError
from clothsim.base.errors import ClothsimError
from clothsim.gradients import recover_clip
from clothsim.gradients.clips import clip_fit
from clothsim.mesh.generators.shapes import rectangle
from clothsim.scene.assembly import scene_world


def strip(youngs_modulus=1e4):
    points, triangles = rectangle(size=(0.1, 0.3), cells=(1, 3))
    start = points[:, [0, 2, 1]]
    cloth = clothsim.Cloth(start, triangles, rest=points, youngs_modulus=youngs_modulus, bending_stiffness=1e-5)
    pins = {"select": np.flatnonzero(points[:, 1] > 0.149).tolist()}
    effects = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "damping": {"rate": 2.0}, "pins": pins}
    run = {"duration": 0.16, "frames_per_second": 25}
    return clothsim.Scene(cloth, effects=effects, solver={"dt": 0.02, "tolerance": 1e-5, "threads": 1}, run=run)


@pytest.fixture(scope="module")
def keys():
    truth = clothsim.simulate(strip(4e4))
    return {frame: truth.positions(frame) for frame in (2, 4)}


@pytest.fixture(scope="module")
def found(keys):
    return clothsim.recover_clip(strip(), keys, ["stretch", "bending"])


def test_the_stiffness_is_found_and_the_bending_is_not(found):
    assert found.values["stretch"] == pytest.approx(4.0, rel=0.05)
    assert found.errors["stretch"] < 0.1
    assert found.values["bending"] == pytest.approx(1.0, rel=0.1)  # in its plane the strip does not bend
    assert found.errors["bending"] == np.inf
    assert [list(each) for each in found.undetermined] == [["bending"]]
    assert found.misfits[1] < 0.1 * found.misfits[0]
    assert found.rest is None
    assert found.from_minimum < 5
    assert found.runs < 35


def test_the_scene_that_is_returned_has_the_numbers(found):
    assert found.scene.cloths[0].youngs_modulus == pytest.approx(1e4 * found.values["stretch"])


def test_a_scene_without_a_gradient_is_searched_by_its_runs(keys):
    ball = {"mesh": "sphere", "radius": 0.02, "subdivisions": 1, "position": [1.0, 0.0, 0.0]}
    effects = strip().effects | {"body_contact": {}, "friction": {"eps_v": 1e-2, "iterations": 2}}
    repeating = replace(strip(), body=ball, effects=effects)
    recovered = clothsim.recover_clip(repeating, {4: keys[4]}, ["stretch"], rest=False)
    assert recovered.values["stretch"] == pytest.approx(4.0, rel=0.05)
    assert np.isnan(recovered.from_minimum)
    assert "friction" in recovered.no_gradient


def test_a_rest_shape_takes_what_numbers_leave(keys):
    away = {frame: x + 0.004 * np.sin(40 * x[:, [2]]) for frame, x in keys.items()}
    recovered = clothsim.recover_clip(strip(4e4), away, ["bending"])
    assert recovered.misfits[2] < recovered.misfits[1]
    assert recovered.rest.after == recovered.misfits[2]
    rest = recovered.scene.cloths[0].mesh.rest
    moved = rest - recovered.scene_of_numbers.cloths[0].mesh.rest
    assert recovered.rest.most == pytest.approx(np.linalg.norm(moved - moved.mean(axis=0), axis=1).max())


@pytest.mark.parametrize(("change", "word"), [({0: 1.0}, "edited frame"), ({}, "edited frame")])
def test_frames_that_are_none_are_refused(change, word):
    with pytest.raises(InputError, match=word):
        clothsim.recover_clip(strip(), change)
    with pytest.raises(InputError, match="vertices"):
        clothsim.recover_clip(strip(), {2: np.zeros((3, 3))}, ["stretch"])


@pytest.mark.parametrize(
    ("keys", "options", "word"),
    [
        ({2: np.full((3, 3), np.nan)}, {}, "frame 2"),
        ({"2": np.zeros((3, 3))}, {}, "edited frame"),
        ({2: np.zeros((3, 3))}, {"free": "stretch"}, "stretch"),
    ],
)
def test_keys_and_names_of_the_wrong_type_are_refused(keys, options, word):
    with pytest.raises(InputError, match=word):
        clothsim.recover_clip(strip(), keys, **options)


@pytest.mark.parametrize("until", ["time", "rest"])
def test_a_frame_beyond_the_run_is_named(keys, until):
    """Of a run that may rest before its time, too: frame 40 of a run of 4, or of one that rests before."""
    settings = {"duration": 0.16, "frames_per_second": 25}
    if until == "rest":
        settings = {"duration": 1.6, "frames_per_second": 25, "until": "rest", "rest_speed": 0.5}
    with pytest.raises(InputError, match="no frame 40 "):
        clothsim.recover_clip(replace(strip(), run=settings), {40: keys[2]}, ["stretch"])


def test_the_floor_is_found_when_all_else_is_checked(keys):
    def floor():
        raise AssertionError

    with pytest.raises(InputError, match="colour"):
        clothsim.recover_clip(strip(), keys, ["colour"], floor=floor)
    with pytest.raises(AssertionError):
        clothsim.recover_clip(strip(), keys, ["stretch"], floor=floor)


def test_a_key_that_is_hardly_known_hardly_counts(keys, found):
    """A late frame where twins are 20 mm apart, with an edit of 8 mm that is no part of the truth."""
    off = {2: keys[2], 4: keys[4] + 0.008 * np.sin(40 * keys[4][:, [2]])}
    alike, own = (
        clothsim.recover_clip(strip(), off, ["stretch"], floor=floor, rest=False) for floor in (1e-5, (1e-5, 0.02))
    )
    assert own.values["stretch"] == pytest.approx(4.0, rel=0.1)
    assert abs(np.log(own.values["stretch"] / 4)) < 0.5 * abs(np.log(alike.values["stretch"] / 4))
    assert own.noise == (1e-4, 0.02)


def test_what_moves_the_keys_as_little_as_twins_is_not_determined(keys):
    recovered = clothsim.recover_clip(strip(4e4), keys, ["stretch"], floor=0.05, rest=False)
    assert recovered.errors["stretch"] == np.inf
    assert recovered.values["stretch"] == pytest.approx(1.0)
    assert recovered.undetermined == ({"stretch": 1.0},)


def test_runs_end_at_the_last_key(keys, monkeypatch):
    seen = []
    monkeypatch.setattr(clip_fit, "build", lambda scene, **more: seen.append(scene) or scene_world.build(scene))
    recovered = clothsim.recover_clip(strip(4e4), {2: keys[2]}, ["stretch"], rest=False)
    assert {scene.run_settings.duration for scene in seen} == {0.08}
    assert recovered.scene.run_settings.duration == 0.16
    assert recovered.misfits[0] < 1e-12  # the frame of a run to its end


@pytest.mark.parametrize("floor", [(1e-3,), (1e-3, -1.0), -1.0, float("nan"), "auto"])
def test_a_floor_that_is_none_is_refused(keys, floor):
    with pytest.raises(InputError, match="floor") as refused:
        clothsim.recover_clip(strip(), keys, ["stretch"], floor=floor)
    assert "np." not in refused.value.sentence


def test_the_branch_of_the_edit_is_found_from_beside_it(keys, monkeypatch):
    """Cloth that buckles another way where its stiffness is 0.3 % or more off: small differences lead to the edit."""
    fit = clip_fit.ClipFit.of(recover_clip.clip_numbers(strip(), ["stretch"]), keys, np.full(2, 1e-6))
    along, across = (0.01 * np.random.default_rng(seed).standard_normal(fit.keys.shape) for seed in (0, 1))
    across -= along * (across * along).sum() / (along**2).sum()

    def positions(scene, frames):
        off = np.log(scene.cloths[0].youngs_modulus / 4e4)
        return (fit.keys + off * along + (abs(off) > 0.003) * across).reshape(-1, 3)

    monkeypatch.setattr(clip_fit, "positions_at", positions)
    beside = fit.run(np.array([np.log(3.95)]))
    taken = []
    found, moves = recover_clip._nearby(fit, beside, np.zeros((along.size, 1)), taken.append)
    assert np.exp(found.at[0]) == pytest.approx(4.0, rel=1e-3)
    np.testing.assert_allclose(moves[:, 0], along.ravel(), atol=1e-6)
    assert len(taken) < 10
    known, _ = recover_clip._nearby(fit, found, moves, taken.append)
    assert known is found


def test_a_direction_is_chosen_by_a_long_step(keys, monkeypatch):
    """At the start differences of damping and width lower the sum by chance; the edit is of the stretch."""
    fit = clip_fit.ClipFit.of(recover_clip.clip_numbers(strip(), ["stretch", "damping", "width"]), keys, np.zeros(2))
    along = 0.01 * np.random.default_rng(0).standard_normal(fit.keys.shape)
    small = 1.01 * fit.numbers.of_kind("step")

    def run(self, at):
        near = abs(at[0]) < 0.15
        chance = np.where((np.abs(at) < small) & near, at / small, 0.0)
        off = np.log(4.0) - (0.0 if near else at[0]) - 0.3 * chance[1:].sum()
        return self.at(clip_fit.ClipRun(at, 0.0, (fit.keys + off * along).reshape(-1, 3)))

    monkeypatch.setattr(clip_fit.ClipFit, "run", run)
    best, _ = recover_clip._explained(fit, fit.run(np.zeros(3)), lambda seen: None)
    assert np.exp(best.at[0]) == pytest.approx(4.0, rel=0.01)


def test_a_last_search_that_fails_loses_nothing(keys, monkeypatch):
    """Runs beside the numbers that fail leave the fit as it was."""
    fit = clip_fit.ClipFit.of(recover_clip.clip_numbers(strip(), ["stretch"]), keys, np.zeros(2))
    best = fit.run(np.array([np.log(3.9)]))
    moves = np.zeros((best.positions.size, 1))

    def failing(scene, frames):
        raise ClothsimError("It fails.")

    monkeypatch.setattr(clip_fit, "positions_at", failing)
    found, own_moves = recover_clip._nearby(fit, best, moves, lambda seen: None)
    assert found is best
    assert own_moves is moves


def test_a_wider_rest_shape_is_found_before_the_numbers():
    """The stretch stays as it was: edges across are longer in both keys."""
    scene = strip(1e5)
    arrays = scene.cloths[0].mesh
    wider = replace(arrays, rest=arrays.rest * [1.05, 1.0, 1.0])
    truth = clothsim.simulate(replace(scene, cloth=[{**scene.cloths[0], "mesh": wider}]))
    found = clothsim.recover_clip(scene, {frame: truth.positions(frame) for frame in (2, 4)}, ["stretch"])
    assert found.values == {"stretch": 1.0}
    assert found.rest is not None
    assert found.misfits[2] < 0.2 * found.misfits[0]
    assert "not searched" in found.no_gradient


@pytest.mark.parametrize(("floor", "counts"), [(2e-5, True), (1e-3, False)])
def test_a_small_difference_counts_where_the_keys_are_known_finely(keys, monkeypatch, floor, counts):
    fit = clip_fit.ClipFit.of(recover_clip.clip_numbers(strip(), ["stretch"]), keys, np.full(2, floor))
    seen = clip_fit.ClipRun(np.zeros(1), 0.0, fit.keys.reshape(-1, 3))
    monkeypatch.setattr(clip_fit, "positions_at", lambda scene, frames: seen.positions + 1e-5)
    beside = fit.beside(np.full(1, 0.01), seen)
    assert np.allclose(beside.positions, seen.positions, rtol=0, atol=1e-9) != counts
