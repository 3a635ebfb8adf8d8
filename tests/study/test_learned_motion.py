"""Garments in motion: sets without leaks, a farm of clips learned and checked, files and farms that are refused."""

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clothsim import InputError, Scene
from clothsim.cli import main
from clothsim.cli.learn_command import MODELS
from clothsim.engine import MovingGarment
from clothsim.scene.assembly.drape_model import read_model, refuse_unlike
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.paths import replace as with_key
from clothsim.study.farm.drape import Drape, store_world
from clothsim.study.farm.plan import plan
from clothsim.study.farm.reading import array_hash
from clothsim.study.farm.recipe import changed, make_recipe
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import work
from clothsim.study.learned_motion import SETS, clips_of, division, learn_motion
from transfer.motion_model import KINDS

FRAMES = {"until": "time", "frames": "all"}
VARY = {
    "body.motion.clip": {"grid": ["arms:1", "arms:2", "arms:3", "arms:4", "squat:1"]},
    "cloth.waist": {"grid": [1.0]},
    "cloth.chest": "=cloth.waist",
}


def scene(**sections):
    usual = {
        "cloth": {"name": "shirt", "mesh": "shirt", "edge": 0.04, "ease": 0.03},
        "body": {"name": "mannequin", "model": "mannequin", "motion": {"clip": "walk", "lead_in": 0.1}},
        "effects": {"membrane": {}},
        "run": {"duration": 0.36},
    }
    return Scene(**{**usual, **sections})


def made_up(scene, folder, farm, *_):
    """A drape without a simulation: the garment as it is placed, skinned, and wider with the arms' height."""
    garment = MovingGarment.of_scene(scene)
    times = np.arange(10) * 0.04
    rest = garment.unposed(garment.start, 0.0, garment.reference)
    wider = 1.0 + 0.02 * garment.inputs(times)[:, 3 * garment.made.character.skeleton.names.index("left_wrist") + 2]
    frames = [garment.posed(rest * [k, k, 1.0], t, garment.reference) for k, t in zip(wider, times, strict=True)]
    summary = {"status": "completed", "reason": "", "cause": "", "usable": True, "certificate": {}, "processor": ""}
    positions = np.array(frames, np.float32)
    return Drape({**summary, "hash": array_hash(positions), "meshes": store_world(farm, garment.world)}, positions)


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    made = plan(make_recipe(scene(), FRAMES, {}, VARY), tmp_path_factory.mktemp("clips"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clothsim.study.farm.work.drape", made_up)
        work(made, pause=0.01)
    verify(made, fraction=0)
    return made


@pytest.fixture(scope="module")
def clips(farm):
    return clips_of(farm)


@pytest.fixture(scope="module")
def learned(farm, clips):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clothsim.study.learned_motion.SPACING", 0.05)
        return learn_motion(farm, "squat", 0, 4, clips=clips)


@pytest.mark.parametrize("seed", range(8))
def test_no_id_is_in_two_sets(seed):
    random = np.random.default_rng(seed)
    kinds = ["gait", "turn", "jump", "reach"]
    motions = [f"{random.choice(kinds)}:{random.integers(12)}" for _ in range(60)]
    labels = [(f"body{random.integers(6)}", motion, motion.partition(":")[0]) for motion in motions]
    made = division(labels, seed=seed)
    own = {name: [labels[k] for k in made.rows(name)] for name in ("training", *SETS)}
    assert sorted(k for name in ("training", *SETS, "left out") for k in made.rows(name)) == list(range(60))
    seen = {label[1] for label in own["training"]}
    for name in SETS:
        assert seen.isdisjoint(label[1] for label in own[name])
    assert {label[1] for label in own["validation"]}.isdisjoint(
        label[1] for name in ("new motion", "new body") for label in own[name]
    )
    for known in ("training", "validation"):
        assert all(label[2] != made.kind and label[0] not in made.bodies for label in own[known])
    assert {label[2] for label in own["new motion"]} == {made.kind}
    assert {label[0] for label in own["new body"]} <= set(made.bodies)


def test_too_few_clips_and_unknown_kinds_are_refused():
    with pytest.raises(InputError, match="hold out fewer"):
        division([("a", "jump:1", "jump"), ("b", "gait:1", "gait")])
    with pytest.raises(InputError, match=r"kind .dance.*They have jump"):
        division([("a", "jump:1", "jump")] * 9, "dance")


def test_all_kinds_are_learned_and_ridge_knows_the_pose(learned):
    assert set(learned.models) <= set(KINDS)
    assert learned.best in learned.models
    errors = {name: each["validation"] for name, each in learned.errors.items()}
    assert 0 < errors["ridge"] < errors["skinned"]
    assert all(0 <= share <= 1 for each in learned.inside.values() for share in each.values() if not np.isnan(share))


def test_clips_have_positions_velocities_and_inputs(farm, clips):
    clip = clips[0]
    assert clip.positions.shape == clip.velocities.shape == (10, len(clip.positions[0]), 3)
    assert (clip.kind, clip.motion, len(clip.inputs)) == ("arms", "arms:1", 10)
    shape = clip.canonical[-1].reshape(-1, 3)
    again = clip.garment.posed(shape, float(clip.times[-1]), MovingGarment.of_scene(farm.scene).reference)
    assert np.abs(again - clip.positions[-1]).max() < 1e-5


def test_a_scene_starts_from_a_model_that_is_refused_for_another(farm, learned, tmp_path):
    file = learned.write(tmp_path / "model.npz")
    with pytest.raises(InputError, match="exists"):
        learned.write(tmp_path / "model.npz")
    mine = changed(farm.scene_of(farm.jobs[0]), {"body.motion.clip": "turn:7"})
    garment = MovingGarment.of_scene(mine)
    made = garment.model_in(file)
    started = world_of(replace(mine, seed={"from": "model", "file": str(file)}))
    start = started.cloths[0].positions + started.origin
    assert np.allclose(start, garment.predicted(made, 0.0), atol=1e-12)
    assert np.allclose(garment.canonical(made, [0.0, 0.04])[0], garment.canonical(made, [0.0])[0])
    for key, value, what in (("cloth.ease", 0.028, "another garment"), ("cloth.chest", 1.01, "cloth.chest is 1.01")):
        with pytest.raises(InputError, match=what):
            MovingGarment.of_scene(with_key(mine, key, value)).model_in(file)
    (tmp_path / "torn.npz").write_bytes(file.read_bytes()[:-200])
    with pytest.raises(InputError, match="not a model"):
        read_model(tmp_path / "torn.npz")


def test_farms_without_clips_are_refused(farm, tmp_path):
    still = plan(make_recipe(scene(), {"until": "time"}, {}, VARY), tmp_path / "still")
    with pytest.raises(InputError, match="last frame"):
        learn_motion(still)
    body = {"name": "mannequin", "mesh": "mannequin"}
    recipe = make_recipe(scene(body=body), FRAMES, {}, {"cloth.ease": {"grid": [0.02]}})
    with pytest.raises(InputError, match="no body model that moves"):
        learn_motion(plan(recipe, tmp_path / "unmoved"))
    for of_motion in (("--kind", "ridge"), ("--model", "recurrent")):
        assert main(["learn", str(farm.directory), *of_motion, "-o", str(tmp_path / "m.npz")]) == 2


@pytest.mark.parametrize("wrong", [("--held-kind", "swim"), ("--held-out", "0.5"), ("--components", "0")])
def test_what_a_model_of_motion_has_not_is_refused_before_clips_are_made(wrong, tmp_path, monkeypatch):
    monkeypatch.setattr("clothsim.cli.learn_command.make_drapes", lambda *_: pytest.fail("clips are made"))
    assert main(["learn", "shirt_in_motion", "--motion", *wrong, "-o", str(tmp_path / "m.npz")]) == 2


def test_clips_that_leave_too_few_to_learn_from_are_not_made(tmp_path, monkeypatch):
    monkeypatch.setattr("clothsim.cli.learn_command.make_drapes", lambda *_: pytest.fail("clips are made"))
    recipe = tmp_path / "few.toml"
    text = (Path(__file__).parents[2] / "scenes/shirt_in_motion.recipe").read_text(encoding="utf-8")
    recipe.write_text(text.replace("count = 50", "count = 6"), encoding="utf-8")
    assert main(["learn", str(recipe), "--motion", "-o", str(tmp_path / "m.npz")]) == 2


def test_the_command_offers_the_kinds_of_models():
    assert set(MODELS) == set(KINDS)


def test_the_command_learns_a_farm(farm, clips, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("clothsim.study.learned_motion.clips_of", lambda _: clips)
    monkeypatch.setattr("clothsim.study.learned_motion.SPACING", 0.05)
    words = ["learn", str(farm.directory), "--motion", "--held-kind", "squat", "--held-bodies", "0", "--json"]
    assert main([*words, "--kind", "ridge", "--components", "4", "-o", str(tmp_path / "model.npz")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["kind"], answer["clips"]["training"], answer["clips"]["new motion"]) == ("ridge", 3, 1)
    assert read_model(tmp_path / "model.npz").kind == "ridge"


@pytest.mark.parametrize(
    ("body", "cloth", "fits"),
    [({}, {}, True), ({"shape": {"chest": 1.05}}, {}, True), ({}, {"height": 1.62}, False)],
)
def test_measures_that_a_mannequin_leaves_out_are_the_usual_ones(body, cloth, fits):
    garment = {"mesh": "shirt", "height": 1.7} | cloth
    given = Scene(cloth=garment, body={"model": "mannequin"} | body)
    with nullcontext() if fits else pytest.raises(InputError, match=r"cloth\.height = 1\.7"):
        refuse_unlike(given, ["cloth.height"], ["body.shape.height"])
