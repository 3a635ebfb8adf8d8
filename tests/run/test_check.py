"""Checks of meshes and scenes from Python."""

import numpy as np
import pytest
import trimesh
from small_scenes import BALL, EFFECTS, SHEET, small_scene

import clothsim
from clothsim import InputError

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SOUND, TWICE = [[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, 3], [0, 1, 2]]


def kinds(what, **keys):
    return [(finding.severity, finding.kind) for finding in clothsim.check(what, **keys)]


@pytest.mark.parametrize(
    "make", [lambda v, t: (v, t), clothsim.Cloth, lambda v, t: trimesh.Trimesh(v, t, process=False)]
)
def test_a_mesh_in_any_form(make):
    assert kinds(make(SQUARE, SOUND)) == []
    assert kinds(make(SQUARE, TWICE)) == [("error", "duplicate")]
    assert kinds(make(SQUARE, TWICE), role="body") == [("warning", "duplicate")]
    [finding] = clothsim.check(make(SQUARE, TWICE))
    assert finding.indices.tolist() == [2]
    assert finding.remedy


def test_a_body_is_no_cloth():
    assert kinds(clothsim.Body(SQUARE, TWICE)) == [("warning", "duplicate")]
    assert kinds(clothsim.Body(SQUARE, TWICE), role="cloth") == [("error", "duplicate")]


def test_raw_arrays_may_have_any_fault():
    found = kinds((SQUARE * [1, 1, np.nan], [[0, 1, 7]]))
    assert ("error", "not finite") in found
    assert ("error", "index out of range") in found


def test_files(tmp_path):
    (tmp_path / "square.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 1 2 3\n")
    assert ("error", "duplicate") in kinds(tmp_path / "square.obj")
    (tmp_path / "scene.toml").write_text('[cloth]\nmesh = "square.obj"\n[effects.inertia]\n')
    assert {kind for _, kind in kinds(str(tmp_path / "scene.toml"))} == {"scene"}
    with pytest.raises(InputError):
        clothsim.check(tmp_path / "nothing.obj")
    with pytest.raises(InputError):
        clothsim.check(3.0)


def test_scenes():
    assert kinds(small_scene()) == []
    through = SHEET | {"position": [0.0, 0.0, 0.2]}
    assert kinds(small_scene(cloth=through)) == [("error", "scene")]
    without = {name: keys for name, keys in EFFECTS.items() if name != "body_contact"}
    assert kinds(small_scene(cloth=through, effects=without)) == [("warning", "intersection")]
    assert kinds(small_scene(body=BALL | {"position": [0, 0, -9]}, effects=without)) == []
