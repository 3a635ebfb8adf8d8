"""Gmsh files of every version, as written by meshio and by Gmsh itself."""

import re
import struct

import meshio
import numpy as np
import pytest
from meshes import irregular_grid

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.files.meshes.readers.gmsh import CORNERS

TEXT = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Comments
$Nodes of no meaning
$EndComments
$Nodes
2 4 3 900
2 1 1 3
900
3
7
0 0 0 .1 .2
1 0 0 .3 .4
1 1 0 .5 .6
0 5 0 1
8
0 1 0
$EndNodes
$Elements
3 4 1 4
1 1 1 1
1 900 3
2 1 3 1
2 900 3 7 8
2 1 2 2
3 7 3 900
4 7 8 3
$EndElements
"""


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("version", ["gmsh22", "gmsh"])
def test_every_version_that_meshio_writes(tmp_path, version, binary):
    positions, triangles = irregular_grid()
    quads = np.array([[0, 3, 4, 1], [1, 4, 5, 2]])
    cells = [("line", triangles[:3, :2]), ("triangle", triangles), ("quad", quads), ("triangle6", [[0, 1, 2, 3, 4, 5]])]
    path = tmp_path / "sheet.msh"
    entities = [np.full(len(block), k + 1) for k, (_, block) in enumerate(cells)]
    whole = meshio.Mesh(
        positions,
        cells,
        point_data={"gmsh:dim_tags": np.tile([2, 1], (len(positions), 1))},
        cell_data={"gmsh:geometrical": entities, "gmsh:physical": entities},
    )
    meshio.write(path, whole, file_format=version, binary=binary)
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.positions, positions)
    np.testing.assert_array_equal(mesh.triangles[: len(triangles)], triangles)
    assert len(mesh.triangles) == len(triangles) + 4
    assert [re.findall(r"\d+", message) for message in mesh.messages][:2] == [["3", "1"], ["1", "9"]]
    assert CORNERS[9] == 6


def test_tags_with_gaps_parametric_nodes_and_other_sections(tmp_path):
    path = tmp_path / "sheet.msh"
    path.write_text(TEXT)
    mesh = read_mesh(path)
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert mesh.triangles[2:].tolist() == [[2, 1, 0], [2, 3, 1]]
    path.write_bytes(TEXT.replace("\n", "\r\n").encode())
    assert read_mesh(path).triangles.tolist() == mesh.triangles.tolist()


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_version_4_0(tmp_path, order):
    """Its blocks have the rows of version 2, and its counts eight bytes. order: of the bytes; "": text."""
    points = [(5, 0.0, 0.0, 0.0), (6, 1.0, 0.0, 0.0), (9, 0.0, 1.0, 0.0)]
    if order:
        nodes = struct.pack(f"{order}2Q3iQ", 1, 3, 1, 2, 0, 3) + b"".join(
            struct.pack(f"{order}i3d", *point) for point in points
        )
        elements = struct.pack(f"{order}2Q3iQ4i", 1, 1, 1, 2, 2, 1, 1, 9, 5, 6)
        head = b"4.0 1 8\n" + struct.pack(f"{order}i", 1)
    else:
        nodes = b"1 3\n1 2 0 3\n" + "\n".join(" ".join(map(str, point)) for point in points).encode()
        elements, head = b"1 1\n1 2 2 1\n1 9 5 6", b"4.0 0 8"
    path = tmp_path / "triangle.msh"
    sections = ((b"MeshFormat", head), (b"Nodes", nodes), (b"Elements", elements))
    path.write_bytes(b"".join(b"$%b\n%b\n$End%b\n" % (name, text, name) for name, text in sections))
    mesh = read_mesh(path)
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.triangles.tolist() == [[2, 0, 1]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("\n8\n", "\n3\n", r"\b3\b"),
        ("4 7 8 3", "4 7 8 9", r"\b9\b"),
        ("2 4 3 900", "999999999999 4 3 900", r"\b3\b.*\b0\b"),
        ("2 1 1 3", "2 1 1 999999999999", "999999999999"),
        ("2 1 2 2", "2 1 200 2", "KeyError: 200"),
        ("2 1 2 2", "2 1 2 -2", "count of -2"),
        ("3 4 1 4", "-3 4 1 4", "count of -3"),
        ("$EndElements", "", r"\$Elements"),
        ("4.1 0 8", "5.0 0 8", r"5\.0"),
        ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "", r"\$MeshFormat"),
        (".1 .2", ".1", r"\b8\b"),
    ],
)
def test_what_is_wrong_is_reported(tmp_path, old, new, message):
    assert old in TEXT
    path = tmp_path / "sheet.msh"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as refusal:
        read_mesh(path)
    assert str(path) in str(refusal.value)
