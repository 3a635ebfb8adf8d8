"""Files that are larger inside than outside, pipes, devices and headers that lie."""

import base64
import lzma
import os
import signal
import struct
import tracemalloc
import zlib

import meshio
import numpy as np
import pytest

from clothsim import InputError, check, load_scene
from clothsim.base.file_reading import read_numbers, read_regular_file
from clothsim.files.meshes import mesh_file
from clothsim.files.meshes.mesh_file import animation_files, read_frames, read_mesh
from clothsim.files.meshes.polygons import MeshPart
from clothsim.files.runs.checkpoint import read_checkpoint
from clothsim.run.export import unpack_bundle

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
MB = 1 << 20


def peak(function):
    """Largest memory of a call that is refused [bytes], and its message."""
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            function()
        return tracemalloc.get_traced_memory()[1], str(caught.value)
    finally:
        tracemalloc.stop()


def test_thousands_of_groups_in_a_line_are_refused(tmp_path):
    """8,000 groups of 30,000 faces took 2 GB."""
    file = tmp_path / "groups.obj"
    file.write_text(TRIANGLE + "g " + " ".join(f"g{k}" for k in range(8000)) + "\n" + "f 1 2 3\n" * 300)
    memory, message = peak(lambda: read_mesh(file))
    assert "line 4" in message
    assert memory < 40 * MB
    file.write_text(TRIANGLE + "g " + " ".join(f"g{k}" for k in range(64)) + "\nf 1 2 3\n")
    assert read_mesh(file, group="g63").triangles.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("kind", ["zlib", "lzma"])
def test_a_compressed_file_that_unpacks_to_far_more_is_refused(tmp_path, kind, monkeypatch):
    small = tmp_path / "small.vtu"
    mesh = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))])
    meshio.vtu.write(str(small), mesh, compression=kind)
    assert read_mesh(small).triangles.tolist() == [[0, 1, 2]]
    pack = {"zlib": zlib.compress, "lzma": lzma.compress}[kind]
    monkeypatch.setattr(mesh_file, "LEAST_UNPACKED", 4 * MB)
    bomb = pack(bytes(64 * MB))
    header = np.array([1, 8, 8, len(bomb)], np.uint32).tobytes()  # 8 bytes, it says
    text = small.read_text()
    first = text.index(">", text.index("<DataArray")) + 1
    last = text.index("</DataArray>", first)
    content = base64.b64encode(header).decode() + base64.b64encode(bomb).decode()
    large = tmp_path / "large.vtu"
    large.write_text(text[:first] + content + text[last:])
    assert large.stat().st_size < MB
    memory, message = peak(lambda: read_mesh(large))
    assert "large.vtu unpacks" in message
    assert memory < 24 * MB
    assert meshio.vtu._vtu.zlib is zlib


def test_a_folder_of_any_size_is_listed_to_the_bound_only(tmp_path, monkeypatch):
    def endless(*_, **__):
        for k in range(9):
            yield f"{k}.obj"
        raise AssertionError("listed beyond the bound")

    monkeypatch.setattr(mesh_file, "MOST_FRAMES", 6)
    monkeypatch.setattr(mesh_file, "iglob", endless)
    with pytest.raises(InputError, match="more than 6 files"):
        animation_files(tmp_path, "*.obj")


def test_a_pattern_of_everything_is_bounded(tmp_path, monkeypatch):
    for k in range(7):
        (tmp_path / f"{k}.obj").write_text(TRIANGLE + "f 1 2 3\n")
    monkeypatch.setattr(mesh_file, "MOST_FRAMES", 6)
    with pytest.raises(InputError, match="more than 6 files"):
        animation_files(tmp_path, "*.obj")
    monkeypatch.setattr(mesh_file, "MOST_FRAMES", 7)
    files = animation_files(tmp_path, "*.obj")
    assert len(files) == 7
    monkeypatch.setattr(mesh_file, "MOST_BYTES", 100)
    with pytest.raises(InputError, match="7 frames"):
        read_frames(files, MeshPart())


READERS = {
    "mesh.obj": read_mesh,
    "mesh.vtu": read_mesh,
    "scene.toml": load_scene,
    "values.npy": read_numbers,
    "checkpoint.npz": read_checkpoint,
    "run.zip": lambda path: unpack_bundle(path, path.parent / "out"),
}


@pytest.fixture
def not_waiting():
    """What opens a pipe without a writer fails within a minute; it would wait for ever."""

    def waited(*_):
        raise AssertionError("it waits for a writer")

    before = signal.signal(signal.SIGALRM, waited)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="makes a pipe")
@pytest.mark.usefixtures("not_waiting")
@pytest.mark.parametrize("name", READERS)
def test_a_pipe_a_device_and_a_directory_are_refused_before_they_are_opened(tmp_path, name):
    """Opened, a pipe would wait for a writer that never comes."""
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=name):
        READERS[name](tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(InputError, match=name):
        READERS[name](tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=name):
        READERS[name](tmp_path / name)


def test_a_file_of_a_terabyte_is_not_read(tmp_path):
    file = tmp_path / "sparse.obj"
    with file.open("wb") as handle:
        handle.truncate(1 << 40)
    with pytest.raises(InputError, match="GB"):
        read_mesh(file)
    assert read_regular_file(__file__).startswith(b'"""Files')


def header(text, version=(1, 0)):
    """A .npy file of that header and 24 bytes."""
    raw = text.encode().ljust(118) + b"\n"
    return b"\x93NUMPY" + bytes(version) + struct.pack("<H", len(raw)) + raw + bytes(24)


GOOD = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }"


@pytest.mark.parametrize(
    "content",
    [
        header(GOOD.replace("(3,)", "(1000000000000,)")),
        header(GOOD.replace("(3,)", "(99999999999999999999999,)")),
        header(GOOD.replace("(3,)", "(-3,)")),
        header(GOOD.replace("(3,)", "(2,)")),
        header(GOOD.replace("(3,)", "((3,),)")),
        header("{'descr': '<f8', 'fortran_order': False, 'shape': (3,"),
        header("'''"),
        header("(" * 110),
        header(GOOD, version=(9, 9)),
        header(GOOD.replace("<f8", "|O")),
        header(GOOD.replace("<f8", "<U6")),
        header(GOOD.replace("<f8", "<U2")),
        header(GOOD.replace("<f8", "|S8")),
        header(GOOD.replace("<f8", "<c8")),
        header(GOOD.replace("<f8", "<M8[s]")),
        b"\x93NUMPY",
        b"",
        b"PK\x03\x04 no archive",
        b"root:x:0:0:root:/root:/bin/sh\n",
    ],
)
def test_a_header_that_lies_is_bad_input(tmp_path, content):
    file = tmp_path / "values.npy"
    file.write_bytes(content)
    memory, message = peak(lambda: read_numbers(file))
    assert "values.npy" in message
    assert memory < MB


def test_numbers_are_read_as_numpy_reads_them(tmp_path):
    for numbers in (np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6).reshape(2, 3)), np.float32(3.0)):
        np.save(tmp_path / "values.npy", numbers)
        again = read_numbers(tmp_path / "values.npy")
        assert np.array_equal(again, numbers)
        assert again.dtype == numbers.dtype


@pytest.mark.parametrize("name", ["secret.obj", "secret.off", "secret.ply", "secret.vtk", "secret.msh", "secret.stl"])
def test_of_a_file_that_is_no_mesh_nothing_is_repeated(tmp_path, name):
    file = tmp_path / name
    file.write_text("hunter2:x:0:0\nswordfish tr0ub4dor\n" * 30)
    with pytest.raises(InputError) as caught:
        check(file)
    assert not any(word in str(caught.value) for word in ("hunter2", "swordfish", "tr0ub4dor"))
