"""Sequences of mesh files: order, parts, and differing topology."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.files.meshes.mesh_part import Part
from clothsim.files.meshes.mesh_sequence import frame_files, read_frames

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
    found = [file.name for file in frame_files(tmp_path, "shell*.obj")]
    assert found == ["shell1.obj", "shell02.obj", "shell2.obj", "shell10.obj", "shell.obj"]


def test_a_pattern_may_be_a_path_of_its_own(tmp_path):
    file = two_quads(tmp_path, "a1.obj")
    assert frame_files(tmp_path / "elsewhere", str(tmp_path / "a*.obj")) == [file]


def test_no_file_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"'kick\*.obj'"):
        frame_files(tmp_path, "kick*.obj")


@pytest.mark.parametrize("part", [Part(), Part(group="high"), Part(component=1), Part(2.0, vertices=(4, 8))])
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
        read_frames(files, Part())
