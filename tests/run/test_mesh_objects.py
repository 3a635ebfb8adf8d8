"""Frames of a run as objects of trimesh and PyVista."""

import sys

import numpy as np
import pytest
from small_scenes import small_scene

from clothsim import InputError, examples, load_scene, simulate, to_pyvista, to_trimesh
from clothsim.base.errors import MissingPackageError


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return simulate(small_scene(run={"duration": 0.04}), tmp_path_factory.mktemp("run"))


def test_trimesh_has_the_surfaces_of_the_frame(run):
    made = to_trimesh(run, 0)
    assert set(made.geometry) == {"cloth", "ball"}
    assert np.array_equal(made.geometry["cloth"].vertices, run.positions(0))
    assert np.array_equal(made.geometry["cloth"].faces, run.triangles)


def test_pyvista_has_the_surfaces_and_stretches_of_the_frame(run):
    pytest.importorskip("pyvista")
    made = to_pyvista(run)
    assert made.keys() == ["cloth", "ball"]
    assert np.allclose(made["cloth"].points, run.positions(-1), atol=1e-6)
    assert np.array_equal(made["cloth"].regular_faces, run.triangles)
    assert np.array_equal(made["cloth"]["principal_stretches"], run.trajectory.stretches(-1).astype(float))
    assert "principal_stretches" not in made["ball"].cell_data


def test_a_frame_that_is_not_there_and_a_package_that_is_not(run, monkeypatch):
    with pytest.raises(InputError, match="99"):
        to_trimesh(run, 99)
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingPackageError, match="pip install pyvista"):
        to_pyvista(run)


@pytest.mark.parametrize("convert", [to_trimesh, to_pyvista])
@pytest.mark.parametrize("what", ["drape", None])
def test_what_is_no_run_is_refused_with_the_way_to_one(convert, what):
    with pytest.raises(InputError, match="open_run"):
        convert(what)


def test_each_example_is_loaded_by_its_name(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert "sphere" in examples()
    with pytest.raises(InputError, match="sphere"):
        examples()["spher"]
    assert load_scene("sphere").bodies
    assert all(text for text in examples().values())
