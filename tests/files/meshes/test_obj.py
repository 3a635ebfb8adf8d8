"""OBJ read by columns: the same polygons as line by line, or none."""

from pathlib import Path

import numpy as np
import pytest
from real_data import DATA, needs_data

from clothsim.files.meshes import obj
from clothsim.files.meshes.obj import polygons_by_columns

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0.5\n"
ALIKE = {
    "plain": TRIANGLE + "f 1 2 3\nf 3 2 1\n",
    "quads": TRIANGLE + "v 1 1 0\nf 1 2 4 3\nf 1 2 3\n",
    "texture": TRIANGLE + "f 1/1 2/2 3/1\n",
    "normals": TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3//1\n",
    "both": TRIANGLE + "vn 0 0 1\nf 1/1/1 2/2/1 3/2/1\n",
    "groups": "o all\n" + TRIANGLE + "g a b\nf 1 2 3\ng\nf 2 3 1\ng b\nf 3 1 2\nf 3 2 1\no other\nf 1 3 2\n",
    "exponents": "v 1e-3 -2.5E2 +7\nv .1 1. 0\nv 0.1 0.30000000000000004 4.9e-324\n# end\n\nf 1 2 3\n",
}
NOT_ALIKE = {
    "negative": TRIANGLE + "f -3 -2 -1\n",
    "mixed": TRIANGLE + "f 1/1 2 3/1/1\n",
    "colours": "v 0 0 0 1 1 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "comment": TRIANGLE + "f 1 2 3 # last\n",
    "unknown": TRIANGLE + "sew 1 2\nf 1 2 3\n",
    "continued": TRIANGLE + "f 1 2 \\\n3\n",
    "nan": "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "beyond": TRIANGLE + "f 1 2 4\n",
    "zero": TRIANGLE + "f 0 1 2\n",
    "huge": TRIANGLE + f"f 1 2 {10**30}\n",
    "underscore": "v 1_0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "two corners": TRIANGLE + "f 1 2\n",
    "texture beyond": TRIANGLE + "f 1/1 2/2 3/3\n",
    "fraction": TRIANGLE + "f 1 2 3.5\n",
    "no faces": TRIANGLE,
    "many groups": TRIANGLE + "g " + " ".join("abcdefghi") + "\nf 1 2 3\n",
}


def by_lines(text, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(obj, "polygons_by_columns", lambda _: None)
        return obj.read_obj(Path("some.obj"), text)


def same(a, b):
    arrays = all(
        np.array_equal(getattr(a, name), getattr(b, name)) and getattr(a, name).dtype == getattr(b, name).dtype
        for name in ("positions", "corners", "starts", "texture")
    )
    groups = a.groups.keys() == b.groups.keys() and all(np.array_equal(a.groups[k], b.groups[k]) for k in a.groups)
    return arrays and groups and a.messages == b.messages


@pytest.mark.parametrize("name", ALIKE)
def test_what_is_alike_is_read_to_the_same_bits(name, monkeypatch):
    monkeypatch.setattr(obj, "FEWEST", 1)
    found = polygons_by_columns(ALIKE[name])
    assert found is not None
    assert same(found, by_lines(ALIKE[name], monkeypatch))


@pytest.mark.parametrize("name", NOT_ALIKE)
def test_what_is_not_is_left_to_the_other_reader(name, monkeypatch):
    monkeypatch.setattr(obj, "FEWEST", 1)
    assert polygons_by_columns(NOT_ALIKE[name]) is None


def test_random_numbers_keep_their_bits(monkeypatch):
    points = np.random.default_rng(1).normal(size=(800, 3)) * 10.0 ** np.arange(-4, 4).repeat(100)[:, None]
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    text = "\n".join([*rows, *(f"f {i} {i + 1} {i + 2}" for i in range(1, 700))])
    found = polygons_by_columns(text)
    assert np.array_equal(found.positions, points)
    assert same(found, by_lines(text, monkeypatch))


@needs_data
@pytest.mark.parametrize("name", ["bodies/makehuman_hm08_base.obj", "garments/female_casualsuit01.obj"])
def test_real_files_are_read_to_the_same_bits(name, monkeypatch):
    text = (DATA / name).read_text()
    found = polygons_by_columns(text)
    assert found is not None
    assert same(found, by_lines(text, monkeypatch))
