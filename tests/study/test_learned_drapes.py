"""Models of drapes: learned from a farm, refused for another garment, and the start of a run."""

from dataclasses import replace

import numpy as np
import pytest
from small_scenes import small_scene

from clothsim import InputError
from clothsim.cli import main
from clothsim.scene.assembly.drape_model import family, predicted, read_model
from clothsim.scene.assembly.scene_world import world_of
from clothsim.study.farm.drape import drape
from clothsim.study.farm.plan import plan
from clothsim.study.farm.recipe import changed, make_recipe
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import work
from clothsim.study.learned_drapes import learn


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """Twelve drapes after a short time, on spheres of another radius each."""
    scene = small_scene(run={"duration": 0.24, "frames_per_second": 25})
    vary = {"body.radius": {"uniform": [0.29, 0.32]}, "cloth.density": {"uniform": [0.1, 0.3]}}
    made = plan(make_recipe(scene, {"count": 12, "until": "time"}, {}, vary), tmp_path_factory.mktemp("farm"))
    work(made, pause=0.01)
    verify(made, fraction=0)
    return made


@pytest.fixture(scope="module")
def learned(farm):
    return learn(farm, 0.25, 4)


def test_the_model_is_nearer_to_held_out_drapes_than_their_mean(learned):
    assert (learned.training, learned.held_out, learned.left_out) == (9, 3, 0)
    assert 0 < learned.error <= 0.5 * learned.mean_error
    assert learned.error < learned.nearest_error


def test_one_flipped_bit_of_a_drape_makes_no_model(farm):
    name = farm.jobs[3].id
    file = farm.folder(name) / "cloth.npy"
    whole = file.read_bytes()
    file.write_bytes(whole[:-2] + bytes([whole[-2] ^ 64]) + whole[-1:])
    with pytest.raises(InputError, match=name):
        learn(farm, 0.25, 4)
    file.write_bytes(whole)


def test_a_model_reads_as_it_was_written(learned, tmp_path):
    again = read_model(learned.model.write(tmp_path / "model.npz"))
    with pytest.raises(InputError, match="exists"):
        learned.model.write(tmp_path / "model.npz")
    assert learned.model.write(tmp_path / "model.npz", overwrite=True).is_file()
    asked = 0.5 * (learned.model.low + learned.model.high)
    assert again.family == learned.model.family
    assert np.array_equal(again.positions(asked), learned.model.positions(asked))
    (tmp_path / "other.npz").write_bytes(b"PK")
    with pytest.raises(InputError):
        read_model(tmp_path / "other.npz")


def test_inputs_are_clipped_to_the_box(learned):
    model = learned.model
    assert np.array_equal(model.positions(model.high + 1.0), model.positions(model.high))
    assert not np.array_equal(model.positions(model.low), model.positions(model.high))


def test_a_scene_starts_from_the_prediction(farm, learned, tmp_path):
    file = learned.model.write(tmp_path / "model.npz")
    job = farm.jobs[-1]
    scene = replace(farm.scene_of(job), seed={"from": "model", "file": str(file), "untangle": True})
    expected = predicted(learned.model, scene)
    world = world_of(replace(scene, seed={"from": "model", "file": str(file)}))
    assert np.allclose(world.cloths[0].positions + world.origin, expected, atol=1e-12)
    published = np.load(farm.directory / "drapes" / job.id / "cloth.npy")
    assert np.sqrt(np.mean((expected - published) ** 2)) < learned.mean_error
    assert drape(scene, tmp_path).summary["certificate"]["intersection_free"] is True


def test_another_garment_or_body_is_refused(farm, learned, tmp_path):
    file = learned.model.write(tmp_path / "model.npz")
    scene = replace(farm.scene, seed={"from": "model", "file": str(file)})
    varied = [*learned.model.inputs]
    same = changed(scene, {"body.radius": 0.3, "cloth.density": 0.2, "solver.dt": 0.03})
    assert family(same, varied) == family(farm.scene, varied)
    assert len(world_of(same).cloths[0].positions) == len(learned.model.mean) // 3
    with pytest.raises(InputError):  # without the density
        world_of(scene)
    for other in ({"cloth.cells": [3, 4]}, {"body.subdivisions": 3}, {"cloth.fabric": "denim"}):
        assert family(changed(same, other), varied) != learned.model.family
        with pytest.raises(InputError):
            world_of(changed(same, other))


def test_a_seed_model_needs_its_file():
    with pytest.raises(InputError):
        _ = small_scene(seed={"from": "model"}).seed_settings


def test_the_command_writes_a_model(farm, tmp_path, capsys):
    file = tmp_path / "model.npz"
    assert main(["learn", str(farm.directory), "-o", str(file), "--components", "3"]) == 0
    assert "mm" in capsys.readouterr().out
    assert read_model(file).basis.shape[1] == 3
    assert main(["learn", str(farm.directory), "-o", str(file), "--held-out", "0.9"]) == 2
