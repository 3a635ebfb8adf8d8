"""Mesh files: every format there and back, parts, quads, broken files, the real data.

Sequences of mesh files: order, parts, and differing topology.
"""

import importlib.util

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from meshes import irregular_grid
from real_data import DATA, needs_data

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import ENDINGS, animation_files, read_frames, read_mesh
from clothsim.files.meshes.polygons import MeshFile, MeshPart
from clothsim.mesh.checks import examine
from clothsim.mesh.generators.shapes import slab, sphere

QUAD = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0.0]])
OBJ = """
# two panels and a loose vertex
mtllib nowhere.mtl
o dress
v 0 0 0
v 1 0 0 0.5 0.5 0.5
v 1 1 0
v 0 1 0
vt 0 0
vt 2 0
vt 2 2
vt 0 2
g front left
f 1/1/1 2/2/1 3/3/1
g front
f 1/1 3/3 \\
  4/4
v 5 0 0
v 6 0 0
v 6 1 0
v 9 9 9
g back
s off
f -4/1 -3/2 -2/3
sew 1 2
"""


def write(path, text):
    path.write_text(text)
    return path


def meshio_file(path, positions, cells, **keywords):
    import meshio

    meshio.write(path, meshio.Mesh(positions, cells), **keywords)


def trimesh_file(path, positions, triangles):
    import trimesh

    trimesh.Trimesh(positions, triangles, process=False).export(path)


def test_obj_groups_texture_and_messages(tmp_path):
    mesh = read_mesh(write(tmp_path / "dress.obj", OBJ))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert mesh.texture.tolist() == [[[0, 0], [2, 0], [2, 2]], [[0, 0], [2, 2], [0, 2]], [[0, 0], [2, 0], [2, 2]]]
    assert mesh.positions.shape == (8, 3)
    assert mesh.messages == ("1 lines 'sew' ignored", "1 vertices are in no triangle")


@pytest.mark.parametrize(
    ("part", "kept", "n_triangles"),
    [
        ({"group": "front"}, [0, 1, 2, 3], 2),
        ({"group": "left"}, [0, 1, 2], 1),
        ({"group": "back"}, [4, 5, 6], 1),
        ({"group": "dress"}, [0, 1, 2, 3, 4, 5, 6], 3),
        ({"component": 0}, [0, 1, 2, 3], 2),
        ({"component": 1}, [4, 5, 6], 1),
        ({"vertices": (0, 4)}, [0, 1, 2, 3], 2),
        ({"vertices": [4, 8]}, [4, 5, 6], 1),
    ],
)
def test_parts_keep_order_and_drop_what_they_do_not_use(tmp_path, part, kept, n_triangles):
    path = write(tmp_path / "dress.obj", OBJ)
    mesh, whole = read_mesh(path, **part), read_mesh(path)
    np.testing.assert_array_equal(mesh.positions, whole.positions[kept])
    assert mesh.triangles.shape == (n_triangles, 3)
    assert mesh.texture.shape == (n_triangles, 3, 2)
    assert np.unique(mesh.triangles).tolist() == list(range(len(kept)))
    assert f"{len(kept)} of 8 vertices, {n_triangles} of 3 triangles" in mesh.messages[-1]


@pytest.mark.parametrize(
    ("part", "names"),
    [
        ({"group": "fron"}, "'fron'.*'front'"),
        ({"component": 2}, r"component .*\b1\b.*\b2\b"),
        ({"component": -1}, "component"),
        ({"component": "0"}, "component"),
        ({"vertices": (0, 3)}, r"triangle 1\b.*\[0, 2, 3\]"),
        ({"vertices": (7, 8)}, "triangle"),
        ({"vertices": (4, 3)}, r"vertices\[1\]"),
        ({"vertices": (0, 99)}, r"vertices\[1\]"),
        ({"vertices": 4}, "vertices"),
        ({"group": "front", "component": 0}, r"group.*component"),
        ({"scale": 0.0}, "scale"),
    ],
)
def test_a_part_that_is_not_there_is_named(tmp_path, part, names):
    with pytest.raises(InputError, match=names):
        read_mesh(write(tmp_path / "dress.obj", OBJ), **part)


def test_components_are_numbered_by_decreasing_size(tmp_path):
    small, large = sphere(1.0, 0), sphere(1.0, 1)
    path = tmp_path / "two.off"
    trimesh_file(path, np.vstack([small[0], large[0] + 5]), np.vstack([small[1], large[1] + len(small[0])]))
    assert len(read_mesh(path, component=0).positions) == 42
    assert len(read_mesh(path, component=1).positions) == 12


def test_scale_is_applied_and_reported(tmp_path):
    path = write(tmp_path / "dress.obj", OBJ)
    mesh = read_mesh(path, scale=0.01, group="back")
    np.testing.assert_allclose(mesh.positions, [[0.05, 0, 0], [0.06, 0, 0], [0.06, 0.01, 0]])
    assert mesh.messages[-1] == "scaled by 0.01"


WRITERS = {
    "ply": lambda path, p, t: meshio_file(path, p, [("triangle", t)]),
    "ply, text": lambda path, p, t: meshio_file(path, p, [("triangle", t)], binary=False),
    "ply, trimesh": trimesh_file,
    "vtk": lambda path, p, t: meshio_file(path, p, [("triangle", t)]),
    "vtk, text": lambda path, p, t: meshio_file(path, p, [("triangle", t)], binary=False),
    "vtu": lambda path, p, t: meshio_file(path, p, [("line", t[:, :2]), ("triangle", t)]),
    "msh": lambda path, p, t: meshio_file(path, p, [("triangle", t)], file_format="gmsh"),
    "msh, version 2": lambda path, p, t: meshio_file(path, p, [("triangle", t)], file_format="gmsh22"),
    "obj": trimesh_file,
    "obj, meshio": lambda path, p, t: meshio_file(path, p, [("triangle", t)]),
    "off": trimesh_file,
    "stl": trimesh_file,
    "stl, text": lambda path, p, t: meshio_file(path, p, [("triangle", t)], binary=False),
    "glb": trimesh_file,
}


@pytest.mark.parametrize("writer", WRITERS)
def test_every_format_there_and_back(tmp_path, writer):
    ending = writer.split(",")[0]
    positions, triangles = sphere(0.5, 1)
    positions = positions.astype(np.float32).astype(float)
    path = tmp_path / f"ball.{ending}"
    WRITERS[writer](path, positions, triangles)
    mesh = read_mesh(path)
    assert mesh.positions.shape == positions.shape
    np.testing.assert_allclose(mesh.positions[mesh.triangles], positions[triangles], rtol=1e-6, atol=1e-8)
    assert mesh.triangles.dtype == np.int64
    assert mesh.positions.dtype == np.float64
    assert mesh.positions.dtype.isnative
    assert examine("ball", mesh.positions, mesh.triangles).findings == ()
    merged = any("merged" in message for message in mesh.messages)
    assert merged == (ending == "stl")
    assert any("line" in message for message in mesh.messages) == (writer == "vtu")


def test_every_ending_is_tried():
    assert {f".{writer.split(',')[0]}" for writer in WRITERS} == set(ENDINGS)


@pytest.mark.parametrize("grid", [False, True])
@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="pyvista is not installed")
def test_vtk_as_vtk_writes_it(tmp_path, binary, grid):
    import pyvista

    positions, triangles = irregular_grid()
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    surface = pyvista.PolyData(positions, faces).compute_normals(split_vertices=False)
    surface.field_data["TimeValue"] = [0.5]
    (surface.cast_to_unstructured_grid() if grid else surface).save(tmp_path / "sheet.vtk", binary=binary)
    mesh = read_mesh(tmp_path / "sheet.vtk")
    np.testing.assert_allclose(mesh.positions, positions, rtol=1e-6, atol=1e-7)
    np.testing.assert_array_equal(mesh.triangles, triangles)


@pytest.mark.parametrize("ending", ["vtk", "vtu", "msh", "ply"])
def test_quads_and_planar_points_through_meshio(tmp_path, ending):
    path = tmp_path / f"quad.{ending}"
    keywords = {"file_format": "gmsh"} if ending == "msh" else {}
    meshio_file(path, QUAD, [("quad", np.array([[0, 1, 2, 3]]))], **keywords)
    mesh = read_mesh(path)
    assert len(mesh.triangles) == 2
    assert "1 quads cut into triangles" in mesh.messages
    assert not mesh.positions[:, 2].any()


def test_glb_nodes_are_placed_and_named(tmp_path):
    import trimesh

    scene = trimesh.Scene()
    box = trimesh.Trimesh(*slab((1, 1, 1)), process=False)
    scene.add_geometry(box, node_name="left")
    scene.add_geometry(box.copy(), node_name="right", transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.export(tmp_path / "two.glb")
    assert len(read_mesh(tmp_path / "two.glb").positions) == 16
    right = read_mesh(tmp_path / "two.glb", group="right")
    assert len(right.triangles) == 12
    np.testing.assert_allclose(right.positions.mean(axis=0), [5, 0, 0], atol=1e-6)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
BROKEN_OBJ = {
    "empty": ("", "is empty"),
    "blank": (" \n\n", "is empty"),
    "no faces": (TRIANGLE, "contains no faces"),
    "no vertices": ("f 1 2 3\n", "line 1: index 1 is out of range"),
    "page": ("<html>\n<body>v</body>\n", "contains no faces"),
    "short vertex": ("v 0 0\n", "line 1: 'v 0 0' cannot be read .3 numbers expected"),
    "word": ("v 0 0 zero\n", "line 1: 'v 0 0 zero' cannot be read"),
    "nan": ("v 0 0 0\nv 0 nan 0\nf 1 2 1\n", "line 2: .* is not finite"),
    "overflow": ("v 0 0 1e999\nf 1 1 1\n", "line 1: .* is not finite"),
    "two corners": (TRIANGLE + "f 1 2\n", "line 4: .*three corners"),
    "index 0": (TRIANGLE + "f 0 1 2\n", "line 4: .*index 0 is out of range"),
    "beyond": (TRIANGLE + "\nf 1 2 4\n", "line 5: index 4 is out of range, the file has 3 vertices"),
    "too far back": (TRIANGLE + "f -4 1 2\n", "line 4: .*index -4 is out of range"),
    "huge": (TRIANGLE + f"f 1 2 {10**30}\n", "line 4: .*out of range"),
    "digits": (TRIANGLE + f"f 1 2 {'9' * 5000}\n", "line 4"),
    "fraction": (TRIANGLE + "f 1 2 3.5\n", "line 4"),
    "texture beyond": (TRIANGLE + "vt 0 0\nf 1/1 2/2 3/1\n", "line 5: index 2 is out of range, .* 1 texture"),
    "texture nan": (TRIANGLE + "vt 0 inf\nf 1/1 2/1 3/1\n", "line 4: .*not finite"),
    "slashes": (TRIANGLE + "f / / /\n", "line 4"),
}


@pytest.mark.parametrize("name", BROKEN_OBJ)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_a_broken_obj_is_refused_by_line(tmp_path, name, newline):
    text, says = BROKEN_OBJ[name]
    path = tmp_path / "broken.obj"
    path.write_bytes(text.replace("\n", newline).encode())
    with pytest.raises(InputError, match=says) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_texture_on_some_corners_only_is_left_out_and_reported(tmp_path):
    mesh = read_mesh(write(tmp_path / "some.obj", TRIANGLE + "vt 0 0\nf 1/1 2 3//7\nf 3 2 1\n"))
    assert mesh.texture.shape == (0, 3, 2)
    assert mesh.messages == ("texture coordinates ignored: 5 corners have none",)


def test_faults_of_the_mesh_are_left_to_the_doctor(tmp_path):
    """A repeated corner and a loose vertex are in the file: they stay, so that the doctor can name them."""
    mesh = read_mesh(write(tmp_path / "faults.obj", TRIANGLE + "v 9 9 9\nf 1 2 3\nf 1 2 2\n"))
    found = {
        finding.kind: finding.indices.tolist() for finding in examine("f", mesh.positions, mesh.triangles).findings
    }
    assert found == {"repeated corner": [1], "isolated vertex": [3]}


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("content", [b"", b"\0\x01\x02junk\xff" * 50, b"hello world\n" * 9, b"\x80\x04\x95pickle."])
def test_junk_of_every_ending_is_refused_in_one_sentence(tmp_path, ending, content, capsys):
    path = tmp_path / f"junk{ending}"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("writer", [name for name in WRITERS if name != "obj, meshio"])
@pytest.mark.parametrize("part", [0.1, 0.4, 0.7, 0.95])
def test_a_file_that_ends_early_is_refused_or_whole(tmp_path, writer, part):
    path = tmp_path / f"ball.{writer.split(',')[0]}"
    WRITERS[writer](path, *sphere(0.5, 1))
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content))])
    try:
        mesh = read_mesh(path)
    except InputError:
        return
    assert len(mesh.triangles) <= 80
    assert mesh.triangles.max() < len(mesh.positions)


def test_indices_beyond_the_vertices_are_refused_in_any_format(tmp_path):
    path = tmp_path / "beyond.vtu"
    meshio_file(path, QUAD, [("triangle", np.array([[0, 1, 2], [0, 2, 7]]))])
    with pytest.raises(InputError, match=r"\b1\b.*\b7\b"):
        read_mesh(path)


def test_vertices_that_are_not_finite_are_refused_in_any_format(tmp_path):
    path, points = tmp_path / "nan.vtu", QUAD.copy()
    points[1, 2] = np.nan
    meshio_file(path, points, [("triangle", np.array([[0, 1, 2]]))])
    with pytest.raises(InputError, match=r"\b1\b"):
        read_mesh(path)


@pytest.mark.parametrize("name", ["nowhere.obj", "", "folder.obj", "mesh.xyz", "mesh", "a\0b.obj"])
def test_a_path_that_is_no_mesh_is_refused(tmp_path, name):
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(InputError):
        read_mesh(tmp_path / name)


WORDS = st.sampled_from(["v", "vt", "f", "g", "o", "\\", "#", "/", "1", "-1", "2/2", "3//", "1e400", "nan", "0", "x"])
LINES = st.lists(st.lists(WORDS, max_size=6).map(" ".join), max_size=12)


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(st.one_of(LINES.map("\n".join), st.text(max_size=80), LINES.map(lambda lines: TRIANGLE + "\n".join(lines))))
def test_any_text_is_a_mesh_or_an_input_error(tmp_path, text):
    path = tmp_path / "fuzz.obj"
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        mesh = read_mesh(path)
    except InputError:
        return
    assert isinstance(mesh, MeshFile)
    assert np.isfinite(mesh.positions).all()
    assert mesh.triangles.min() >= 0
    assert mesh.triangles.max() < len(mesh.positions)


@needs_data
@pytest.mark.parametrize(
    ("name", "part", "n_vertices", "n_triangles"),
    [
        ("bodies/mean_all.obj", {}, 23752, 47500),
        ("bodies/f_smpl_average_A40.obj", {}, 6890, 13776),
        ("bodies/makehuman_hm08_base.obj", {"group": "body", "scale": 0.1}, 13380, 26756),
        ("dress_on_body/dress_knife_stage.obj", {}, 15656, 29456),
        ("dress_on_body/dress_knife_drape.obj", {"vertices": (15656, 28467)}, 12811, 25472),
        ("garments/diffcloth_skirt2011.obj", {}, 1074, 2011),
        ("garments/female_casualsuit01.obj", {"scale": 0.1}, 2197, 4236),
    ],
)
def test_real_files(name, part, n_vertices, n_triangles):
    mesh = read_mesh(DATA / name, **part)
    assert mesh.positions.shape == (n_vertices, 3)
    assert mesh.triangles.shape == (n_triangles, 3)
    role = "body" if name.startswith("bodies") else "cloth"
    report = examine(name, mesh.positions, mesh.triangles, role)
    assert report.errors == ()


@needs_data
def test_the_texture_of_the_stage_dress_is_its_pattern():
    """Its `vt` is the rest pattern in metres: every panel is wound one way."""
    mesh = read_mesh(DATA / "dress_on_body/dress_knife_stage.obj")
    edge1, edge2 = mesh.texture[:, 1] - mesh.texture[:, 0], mesh.texture[:, 2] - mesh.texture[:, 0]
    pattern = 0.5 * (edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0])
    assert (pattern > 0).all() or (pattern < 0).all()
    assert len(read_mesh(DATA / "dress_on_body/dress_knife_stage.obj", group="panel3").triangles) == 452


QUADS = "f 1 2 3 4\nf 5 6 7 8\n"


def two_quads(folder, name, long=1.0, faces=QUADS, extra=""):
    """A quad whose shorter diagonal depends on `long`, and another one, in a group of its own, `long` above it."""
    square = [(0, 0), (1, 0), (1 + long, 1 + long), (0, 1)]
    points = [(x, y, z) for z in (0.0, long) for x, y in square]
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    first, second = faces.splitlines()
    (folder / name).write_text("\n".join([*lines, "g low", first, "g high", second, extra]))
    return folder / name


def test_files_are_in_natural_order(tmp_path):
    names = ["shell10.obj", "shell2.obj", "shell1.obj", "shell02.obj", "shell.obj"]
    for name in names:
        two_quads(tmp_path, name)
    (tmp_path / "other1.obj").write_text("")
    found = [file.name for file in animation_files(tmp_path, "shell*.obj")]
    assert found == ["shell1.obj", "shell02.obj", "shell2.obj", "shell10.obj", "shell.obj"]


def test_a_pattern_may_be_a_path_of_its_own(tmp_path):
    file = two_quads(tmp_path, "a1.obj")
    assert animation_files(tmp_path / "elsewhere", str(tmp_path / "a*.obj")) == [file]


def test_no_file_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"'kick\*.obj'"):
        animation_files(tmp_path, "kick*.obj")


@pytest.mark.parametrize(
    "part", [MeshPart(), MeshPart(group="high"), MeshPart(component=1), MeshPart(2.0, vertices=(4, 8))]
)
def test_every_frame_is_the_same_part_cut_as_the_first(tmp_path, part):
    lengths = (1.0, -0.6, 0.3)
    files = [two_quads(tmp_path, f"{k}.obj", long) for k, long in enumerate(lengths)]
    mesh, frames = read_frames(files, part)
    keys = {"scale": part.scale, "group": part.group, "component": part.component, "vertices": part.vertices}
    first = read_mesh(files[0], **keys)
    assert np.array_equal(mesh.triangles, first.triangles)
    assert not np.array_equal(mesh.triangles, read_mesh(files[1], **keys).triangles)  # the other diagonal is shorter
    assert frames.shape == (3, len(first.positions), 3)
    for frame, file in zip(frames, files, strict=True):
        assert np.array_equal(frame, read_mesh(file, **keys).positions)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"extra": "v 0 0 9"}, "2.obj has 9 vertices, 1.obj has 8"),
        ({"extra": "f 1 2 6"}, "2.obj has 3 faces, 1.obj has 2"),
        ({"faces": "f 1 2 3\nf 5 6 7 8 4"}, "2.obj: face 0 has another number of corners"),
        ({"faces": "f 1 2 3 4\nf 5 6 8 7"}, r"2.obj: face 1 is \[4, 5, 7, 6\], in 1.obj \[4, 5, 6, 7\]"),
    ],
)
def test_another_topology_is_named(tmp_path, changes, message):
    files = [two_quads(tmp_path, "1.obj"), two_quads(tmp_path, "2.obj", **changes)]
    with pytest.raises(InputError, match=message):
        read_frames(files, MeshPart())
