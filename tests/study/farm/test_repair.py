"""Repair: torn and killed drapes are made again, whole ones stay."""

import shutil

import pytest
from small_scenes import small_scene

from clothsim.cli import main
from clothsim.study.farm.plan import open_farm, plan
from clothsim.study.farm.publication import note_attempt
from clothsim.study.farm.reading import read_drape
from clothsim.study.farm.recipe import make_recipe
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import repair, work


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A farm of three drapes: one was killed too often, one is refused, one is usable."""
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    vary = {"cloth.position": {"grid": [[0, 0, 0.33], [0, 0, 0.34], [0, 0, 0.2]]}}
    farm = plan(make_recipe(scene, {"until": "time"}, {}, vary), tmp_path_factory.mktemp("farm"))
    for _ in range(3):
        note_attempt(farm.directory, farm.jobs[0].id, "started")
    assert work(farm).usable == 1
    return farm


@pytest.fixture
def farm(sound, tmp_path):
    """A copy of it."""
    return open_farm(shutil.copytree(sound.directory, tmp_path / "farm"))


def cause(farm, number):
    return read_drape(farm.directory, farm.jobs[number].id)[0]["cause"]


def test_killed_drapes_are_made_again_and_others_stay(farm):
    assert [cause(farm, k) for k in range(3)] == ["killed", "", "refused"]
    assert main(["farm", "repair", str(farm.directory)]) == 0
    assert set(farm.unpublished()) == {farm.jobs[0].id}
    assert work(farm).usable == 1
    assert set(repair(farm, ("refused",)).taken_back) == {farm.jobs[2].id}
    assert work(farm).usable == 0
    assert cause(farm, 2) == "refused"


def test_a_torn_mesh_is_made_again_without_its_drapes(farm):
    (mesh,) = read_drape(farm.directory, farm.jobs[1].id)[0]["meshes"]["body"].values()
    file = farm.directory / "meshes" / f"{mesh}.npz"
    file.write_bytes(file.read_bytes()[:-30])
    assert set(verify(farm, fraction=0).torn) == {farm.jobs[1].id}
    done = repair(farm, ())
    assert (done.taken_back, done.meshes) == ({}, (mesh,))
    assert verify(farm, fraction=0).good


def test_torn_drapes_are_made_again(farm):
    verify(farm, fraction=0)
    file = farm.folder(farm.jobs[1].id) / "cloth.npy"
    whole = file.read_bytes()
    file.write_bytes(whole[:-4])
    assert set(repair(farm, ()).taken_back) == {farm.jobs[1].id}
    assert work(farm).usable == 1
    assert file.read_bytes() == whole
    assert verify(farm, fraction=0).good
