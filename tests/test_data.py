"""Data sets of drapes: what is read is what was packed."""

import pickle

import h5py
import numpy as np
import pytest
from small_scenes import small_scene

from clothsim import InputError
from clothsim.data import Drapes
from clothsim.study.farm.pack import pack
from clothsim.study.farm.plan import plan
from clothsim.study.farm.reading import positions_of
from clothsim.study.farm.recipe import make_recipe
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import work


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """A farm of four drapes of two topologies, one of which is refused, and its data set."""
    scene = small_scene(run={"duration": 0.04, "frames_per_second": 25})
    vary = {
        "cloth.position": {"grid": [[0, 0, 0.33], [0, 0, 0.1]]},
        "cloth.cells": {"grid": [[4, 4], [3, 4]]},
        "body.name": ["ball", "orb"],
        "cloth.density": {"uniform": [0.1, 0.3]},
    }
    recipe = make_recipe(scene, {"until": "time", "licence": "CC0-1.0", "count": 4}, {}, vary)
    made = plan(recipe, tmp_path_factory.mktemp("farm") / "farm")
    work(made)
    verify(made, fraction=0)
    pack(made, made.directory.parent / "data.h5")
    return made


def test_drapes_are_those_that_were_packed(farm):
    data = Drapes(farm.directory.parent / "data.h5")
    jobs = [farm.jobs[0], farm.jobs[2]]
    assert len(data) == 2
    assert data.inputs == ("cloth.density",)
    assert data.licence == "CC0-1.0"
    assert "## Left out" in data.card
    for number, job in enumerate(jobs):
        drape = data[number]
        assert drape["id"] == job.id
        assert drape["parameters"] == data.rows[number]["parameters"] == job.values
        assert drape["inputs"] == np.float32(job.values["cloth.density"])
        assert np.array_equal(drape["positions"], positions_of(farm.directory, job.id))
        (garment,) = data.garments(number).values()
        assert garment["triangles"].max() == len(drape["positions"]) - 1
        assert list(data.bodies(number)) == [job.values["body.name"]]
    assert [drape["id"] for drape in data] == [data[-2]["id"], data[np.int64(1)]["id"]]
    with pytest.raises(IndexError):
        data[2]
    again = pickle.loads(pickle.dumps(data))
    assert np.array_equal(again[1]["positions"], data[1]["positions"])


def test_another_file_is_refused(tmp_path):
    (tmp_path / "data.h5").write_bytes(b"no")
    for name in ("data.h5", "none.h5"):
        with pytest.raises(InputError):
            Drapes(tmp_path / name)


@pytest.mark.parametrize("row", ["{}", "[]", "3"])
def test_a_manifest_of_something_else_is_refused(tmp_path, row):
    with h5py.File(tmp_path / "data.h5", "w") as file:
        file["manifest"], file["card"], file["garments/0/ids"] = [row], "", ["0"]
        file.attrs["licence"] = ""
    with pytest.raises(InputError):
        Drapes(tmp_path / "data.h5")
