"""MakeHuman clothes: places on the base mesh in closed form, and each line that can be broken."""

import re

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.files.meshes.mhclo import read_clothes
from clothsim.garments.inputs import read_garment

BASE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 8.0]])
HEAD = """# clothes
basemesh hm08
name shirt
obj_file shirt.obj
x_scale 0 1 1.0
y_scale 0 2 1.0
z_scale 0 3 16.0
z_depth 50
"""
ROWS = """verts 0
1
0 1 2 0.5 0.25 0.25 0.1 0.1 0.1
3 2 1 0.2 0.3 0.5 0 0 -1
"""


def clothes(tmp_path, text):
    file = tmp_path / "shirt.mhclo"
    file.write_text(text)
    return read_clothes(file)


def test_places_are_barycentric_and_offsets_scale_with_the_base(tmp_path):
    found = clothes(tmp_path, HEAD + ROWS)
    assert found.obj_file == tmp_path / "shirt.obj"
    on = found.on(BASE)  # the base is 2, 4 and 1/2 times what it was when the garment was made
    np.testing.assert_allclose(on[0], BASE[1])
    np.testing.assert_allclose(on[1], 0.25 * (BASE[1] + BASE[2]) + [0.2, 0.4, 0.05])
    np.testing.assert_allclose(on[2], 0.2 * BASE[3] + 0.3 * BASE[2] + 0.5 * BASE[1] + [0.0, 0.0, -0.5])


def test_twice_the_base_is_twice_the_garment(tmp_path):
    found = clothes(tmp_path, HEAD + ROWS)
    np.testing.assert_allclose(found.on(2 * BASE), 2 * found.on(BASE))


def test_without_a_scale_offsets_are_in_the_units_of_the_base(tmp_path):
    text = "\n".join(line for line in (HEAD + ROWS).splitlines() if "_scale" not in line)
    np.testing.assert_allclose(clothes(tmp_path, text).on(BASE)[1], 0.25 * (BASE[1] + BASE[2]) + 0.1)


def test_what_follows_the_vertices_is_no_vertex(tmp_path):
    text = f"{HEAD}{ROWS}# the body below is hidden\ndelete_verts\n0 - 3 5\n"
    assert len(clothes(tmp_path, text).on(BASE)) == 3
    assert len(clothes(tmp_path, text.replace("1\n0 1", "1 # a comment\n\n0 1")).on(BASE)) == 3


@pytest.mark.parametrize(
    "line",
    [
        "x_scale 0 1",
        "x_scale 0 1 zero",
        "x_scale 0 1 0.0",
        "x_scale 0 1 nan",
        "x_scale -1 1 1.0",
        "y_scale 0 99999999999 1.0",
        "obj_file",
    ],
)
def test_a_broken_head_line_is_named(tmp_path, line):
    with pytest.raises(InputError, match=rf"shirt\.mhclo.*\b9\b.*'{re.escape(line)}'"):
        clothes(tmp_path, f"{HEAD}{line}\n{ROWS}")


@pytest.mark.parametrize(
    "line",
    [
        "0 1",
        "0 1 2 0.5 0.25 0.25 0.1 0.1",
        "0 1 2 0.5 0.25 half 0.1 0.1 0.1",
        "0 1 2 0.5 0.25 nan 0.1 0.1 0.1",
        "0 1 2 0.5 0.25 inf 0.1 0.1 0.1",
        "0 -1 2 0.5 0.25 0.25 0.1 0.1 0.1",
        "-1",
        "0.5 1 2 0.5 0.25 0.25 0.1 0.1 0.1",
        "99999999999",
    ],
)
def test_a_broken_vertex_line_is_named(tmp_path, line):
    with pytest.raises(InputError, match=rf"shirt\.mhclo.*\b13\b.*'{re.escape(line)}'"):
        clothes(tmp_path, f"{HEAD}{ROWS}{line}\n")


@pytest.mark.parametrize("text", ["", HEAD, ROWS, "not a clothes file", "verts 0\n"])
def test_a_file_without_mesh_or_vertices_is_refused(tmp_path, text):
    with pytest.raises(InputError, match=r"obj_file.*verts"):
        clothes(tmp_path, text)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.mhclo"):
        read_clothes(tmp_path / "none.mhclo")


def test_a_base_with_too_few_vertices_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\b4\b.*\b3\b"):
        clothes(tmp_path, HEAD + ROWS).on(BASE[:3])


def test_a_path_in_the_name_of_the_mesh_leads_nowhere_else(tmp_path):
    assert clothes(tmp_path, (HEAD + ROWS).replace("shirt.obj", "../../etc/shirt.obj")).obj_file.parent == tmp_path


def test_the_garment_takes_the_places_of_its_clothes(tmp_path):
    clothes(tmp_path, HEAD + ROWS)
    (tmp_path / "shirt.obj").write_text("v 9 9 9\nv 8 9 9\nv 9 8 9\nf 1 2 3\n")
    (tmp_path / "base.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in BASE) + "f 1 2 3\nf 1 2 4\n")
    garment = read_garment(tmp_path / "shirt.mhclo", tmp_path / "base.obj", 0.1)
    np.testing.assert_allclose(garment.positions, 0.1 * read_clothes(tmp_path / "shirt.mhclo").on(BASE))
    (tmp_path / "shirt.obj").write_text("v 9 9 9\nv 8 9 9\nv 9 8 9\nv 7 7 7\nf 1 2 3\nf 2 3 4\n")
    with pytest.raises(InputError, match=r"\b3\b.*shirt\.obj.*\b4\b"):
        read_garment(tmp_path / "shirt.mhclo", tmp_path / "base.obj", 0.1)
