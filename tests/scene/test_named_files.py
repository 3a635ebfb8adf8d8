"""Files that a scene names."""

import json

import numpy as np
import pytest

from clothsim import InputError, Scene
from clothsim.scene.named_files import refuse_outside, relocated, with_arrays

SHEET = {"mesh": "rectangle", "cells": [2, 2]}


def test_files_of_numbers_are_read_where_tables_name_them(tmp_path):
    np.save(tmp_path / "stiff.npy", np.arange(4.0))
    read = with_arrays("effects.x", {"a": {"cloth": "stiff.npy", "b": 2}, "c": "text"}, tmp_path)
    assert np.array_equal(read["a"]["cloth"], np.arange(4.0))
    assert (read["a"]["b"], read["c"]) == (2, "text")


@pytest.mark.parametrize(
    ("content", "message"), [(None, "There is no file"), (b"abc", "not a NumPy file"), (b"", "not a Num")]
)
def test_a_file_that_is_missing_or_broken_is_named(tmp_path, content, message):
    if content is not None:
        (tmp_path / "bad.npy").write_bytes(content)
    with pytest.raises(InputError, match=f"effects.x.a: .*{message}.*bad.npy|effects.x.a: .*bad.npy .*{message}"):
        with_arrays("effects.x", {"a": "bad.npy"}, tmp_path)


def test_a_file_of_words_or_of_objects_is_refused(tmp_path):
    np.save(tmp_path / "words.npy", np.array(["a", "b"]))
    np.save(tmp_path / "things.npy", np.array([{}], object), allow_pickle=True)
    for name in ("words.npy", "things.npy"):
        with pytest.raises(InputError, match="array"):
            with_arrays("effects.x", {"a": name}, tmp_path)


def test_an_archive_takes_them_along(tmp_path):
    np.save(tmp_path / "rate.npy", np.ones(8))
    scene = Scene(cloth=SHEET, effects={"inertia": {}, "damping": {"rate": {"cloth": "rate.npy"}}}, directory=tmp_path)
    text, files = relocated(scene)
    name = "meshes/effect_damping_rate_cloth/rate.npy"
    assert files == {name: tmp_path / "rate.npy"}
    assert json.loads(text)["effects"]["damping"]["rate"] == {"cloth": name}
    refuse_outside(text)
    with pytest.raises(InputError, match="outside"):
        refuse_outside(text.replace("meshes/effect", "../effect"))


def test_the_mesh_of_a_rigid_body_is_one_of_them(tmp_path):
    """It was left out of archives, and one in an archive might lie anywhere."""
    (tmp_path / "block.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    block = {"name": "block", "mesh": "block.obj", "density": 500}
    scene = Scene(cloth=SHEET, rigid=block, effects={"inertia": {}}, directory=tmp_path)
    text, files = relocated(scene)
    assert list(files.values()) == [tmp_path / "block.obj"]
    with pytest.raises(InputError, match="outside"):
        refuse_outside(text.replace("meshes/rigid0", "../rigid0"))
