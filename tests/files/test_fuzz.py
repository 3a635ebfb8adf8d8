"""Broken files of every kind: an InputError of one sentence or a sound result, never another end, never code run."""

import contextlib
import io
import json
import pickle
import re
import struct
import tracemalloc
import zipfile
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from clothsim.base.errors import LONGEST, InputError
from clothsim.base.record import read_record, read_summary
from clothsim.files.meshes.mesh_file import ENDINGS, read_mesh
from clothsim.files.runs.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from clothsim.files.runs.trajectory import TrajectoryWriter, read_trajectory
from clothsim.mesh.generators.shapes import sphere
from clothsim.mesh.world import SurfaceRows
from clothsim.solve.stepping.state import State

FEW = settings(
    max_examples=50,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
FORMS = {
    "ply": {},
    "ply, text": {"binary": False},
    "vtk": {},
    "vtk, text": {"binary": False},
    "vtu": {},
    "vtu, text": {"binary": False},
    "msh": {"file_format": "gmsh"},
    "msh, text": {"file_format": "gmsh", "binary": False},
    "msh 2": {"file_format": "gmsh22"},
    "msh 2, text": {"file_format": "gmsh22", "binary": False},
    "stl, text": {"binary": False},
    "stl": None,
    "obj": None,
    "off": None,
    "glb": None,
}
PROMISES = [10**12, 3 * 10**8, 2**31 - 1, 2**63 - 1]
CHECKPOINT = Checkpoint(State(0.1, 0.01, 2, 1, np.ones((4, 3)), np.zeros((4, 3))), '{"cloth": {}}', {"steps": 1})


def ending_of(form):
    return f".{form.split(',', maxsplit=1)[0].split()[0]}"


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    """A small ball in every format, by the name of the form; by meshio where there are keywords, else by trimesh."""
    folder, written = tmp_path_factory.mktemp("samples"), {}
    positions, triangles = sphere(0.5, 0)
    for form, keywords in FORMS.items():
        path = folder / f"ball{ending_of(form)}"
        if keywords is None:
            trimesh.Trimesh(positions, triangles, process=False).export(path)
        else:
            meshio.write(path, meshio.Mesh(positions, [("triangle", triangles)]), **keywords)
        written[form] = path.read_bytes()
    return written


def end(read, path):
    """Result of `read` on the file; None where it is refused with an InputError."""
    with contextlib.suppress(InputError):
        return read(path)
    with pytest.raises(InputError) as refusal:
        read(path)
    output = str(refusal.value)
    assert "\n" not in output
    assert output.isprintable()
    assert len(refusal.value.sentence) < LONGEST + 10
    return None


def sound(mesh):
    if mesh is not None:
        assert np.isfinite(mesh.positions).all()
        assert mesh.triangles.min() >= 0
        assert mesh.triangles.max() < len(mesh.positions)


ODD = st.sampled_from(
    [
        b"",
        b"-1",
        b"0",
        b"999999999999",
        b"99999999999999999999",
        b"nan",
        b"inf",
        b"1e400",
        b"1e200",
        b"x",
        b"\0",
        b"[[[",
    ]
)
ODD_BYTES = st.sampled_from(
    [
        b"\xff" * 4,
        b"\xff" * 8,
        struct.pack("<Q", 10**12),
        b"\0" * 8,
        struct.pack(">I", 2**31 - 1),
        b"\0\0\0\0\0\0\xf8\x7f",
    ]
)


@st.composite
def spoilt(draw, content):
    """`content` cut, with bytes changed, a number or eight bytes replaced, a piece doubled or left out."""
    how = draw(st.sampled_from(["cut", "bytes", "number", "eight", "piece"]))
    if how == "cut":
        return content[: draw(st.integers(0, len(content) - 1))]
    if how == "bytes":
        changed = bytearray(content)
        for place, byte in draw(st.lists(st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255)), max_size=4)):
            changed[place] = byte
        return bytes(changed)
    if how == "number":
        numbers = list(re.finditer(rb"(?<![\w.])-?\d[\d.e+-]*", content)) or [re.search(b"", content)]
        number = draw(st.sampled_from(numbers))
        return content[: number.start()] + draw(ODD) + content[number.end() :]
    place = draw(st.integers(0, len(content) - 8))
    if how == "eight":
        odd = draw(ODD_BYTES)
        return content[:place] + odd + content[place + len(odd) :]
    stop = draw(st.integers(place, len(content)))
    return (
        content[:stop] + content[place:stop] + content[stop:]
        if draw(st.booleans())
        else content[:place] + content[stop:]
    )


@pytest.mark.parametrize("form", FORMS)
@FEW
@given(data=st.data())
def test_a_spoilt_mesh_is_refused_or_sound(tmp_path, samples, capfd, form, data):
    path = tmp_path / f"spoilt{ending_of(form)}"
    path.write_bytes(data.draw(spoilt(samples[form])))
    sound(end(read_mesh, path))
    assert capfd.readouterr() == ("", "")  # the libraries print, one of them a traceback


@pytest.mark.parametrize("ending", ENDINGS)
@FEW
@given(content=st.one_of(st.binary(max_size=300), st.text(max_size=100).map(lambda t: t.encode("utf-16"))))
def test_garbage_is_refused(tmp_path, ending, content):
    path = tmp_path / f"garbage{ending}"
    path.write_bytes(content)
    assert end(read_mesh, path) is None


def promising(samples, count):
    """Files whose heads promise `count` elements, by a name that begins with the form."""
    n = str(count).encode()
    for form in ("ply", "ply, text"):
        for element in (b"vertex 12", b"face 20"):
            name = element.split()[0]
            yield form, samples[form].replace(b"element " + element, b"element %b %b" % (name, n))
    for form in ("vtk", "vtk, text"):
        for key in (b"POINTS", b"CELLS", b"CELL_TYPES"):
            yield form, re.sub(key + rb" \d+", key + b" " + n, samples[form])
    for form in ("vtu", "vtu, text"):
        for key in (b"NumberOfPoints", b"NumberOfCells"):
            yield form, re.sub(key + rb'="\d+"', b'%b="%b"' % (key, n), samples[form])
    for form in ("msh, text", "msh 2, text", "msh 2"):
        for key in (b"$Nodes\n", b"$Elements\n"):
            yield form, re.sub(re.escape(key) + rb"\d+ ?\d*", key + n + b" " + n, samples[form])
    for key in (b"$Nodes\n", b"$Elements\n"):
        place = samples["msh"].index(key) + len(key)
        yield "msh", samples["msh"][:place] + struct.pack("<2Q", count, count) + samples["msh"][place + 16 :]
    yield "stl", samples["stl"][:80] + struct.pack("<I", min(count, 2**32 - 1)) + samples["stl"][84:]
    yield "off", b"OFF\n%b %b 0\n0 0 0\n" % (n, n)
    yield "off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n%b 0 1 2\n" % n
    yield "obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 %b\n" % n
    yield "glb", re.sub(rb'"count":\d+', b'"count":' + n, samples["glb"])
    primitive = {"attributes": {"POSITION": 0}}
    tree = {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]}
    yield "glb", glb({**tree, "accessors": [{"componentType": 5126, "count": count, "type": "VEC3"}]})


def glb(document):
    text = json.dumps({"asset": {"version": "2.0"}, **document}).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4s4I", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text


@pytest.mark.parametrize("count", PROMISES)
def test_heads_that_promise_too_much_are_refused_before_memory_fills(tmp_path, samples, count):
    for k, (form, content) in enumerate(promising(samples, count)):
        path = tmp_path / f"{k}{ending_of(form)}"
        path.write_bytes(content)
        tracemalloc.start()
        assert end(read_mesh, path) is None, (form, content[:300])
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 50e6, (form, peak)


def test_nodes_of_a_glb_that_name_one_another_end(tmp_path):
    """A ring, and a tree in which forty nodes name their child twice: 2^40 places if each was followed."""
    mesh = {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "accessors": [{"count": 1}]}
    ring = [{"mesh": 0, "children": [1]}, {"mesh": 0, "children": [0]}]
    twice = [*({"mesh": 0, "children": [k + 1, k + 1]} for k in range(40)), {"mesh": 0}]
    for nodes in (ring, twice):
        path = tmp_path / "nodes.glb"
        path.write_bytes(glb({"scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes, **mesh}))
        assert end(read_mesh, path) is None


def test_a_vtu_of_entities_in_entities_is_refused(tmp_path):
    entities = b"".join(b'<!ENTITY %c "%b">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(9))
    path = tmp_path / "laughs.vtu"
    path.write_bytes(b'<!DOCTYPE a [<!ENTITY a "ha">' + entities + b']><VTKFile type="UnstructuredGrid">&j;</VTKFile>')
    assert end(read_mesh, path) is None


class Evil:
    """Makes a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_no_code_in_a_file_is_run(tmp_path):
    """Pickles under every name that a reader takes, and in arrays of objects."""
    ran = tmp_path / "ran"
    content = pickle.dumps(Evil(ran))
    readers = {f"mesh{ending}": read_mesh for ending in ENDINGS} | {"run.vtkhdf": read_trajectory}
    readers |= {"checkpoint.npz": read_checkpoint, "summary.json": read_summary}
    for name, read in readers.items():
        (tmp_path / name).write_bytes(content)
        assert end(read, tmp_path / name) is None
    for key in ("format", "positions", "times"):
        np.savez(tmp_path / "checkpoint.npz", **{**arrays(tmp_path), key: np.array([Evil(ran)], object)})
        assert end(read_checkpoint, tmp_path / "checkpoint.npz") is None
    assert not ran.exists()
    pickle.loads(content)
    assert ran.exists()


def arrays(folder):
    write_checkpoint(folder / "whole.npz", CHECKPOINT)
    with np.load(folder / "whole.npz") as loaded:
        return dict(loaded)


@FEW
@given(data=st.data())
def test_a_spoilt_checkpoint_is_refused_or_the_same(tmp_path, data):
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, CHECKPOINT)
    path.write_bytes(data.draw(spoilt(path.read_bytes())))
    read = end(read_checkpoint, path)
    if read is not None:
        assert np.array_equal(read.state.positions, CHECKPOINT.state.positions)
        assert read.scene_text == CHECKPOINT.scene_text


STRANGE = [
    np.zeros(0),
    np.array(1),
    np.array(["x", "y", "z"]),
    np.full(3, np.nan),
    np.full((4, 3), 1j),
    np.zeros(3, "M8[s]"),
]


@pytest.mark.parametrize("key", ["format", "times", "counts", "positions", "velocities", "scene_text", "counters"])
@pytest.mark.parametrize("value", STRANGE, ids=str)
def test_arrays_of_other_kinds_are_refused(tmp_path, key, value):
    np.savez(tmp_path / "checkpoint.npz", **{**arrays(tmp_path), key: value})
    assert end(read_checkpoint, tmp_path / "checkpoint.npz") is None


@pytest.mark.parametrize("text", ["[" * 100_000, "3", "null", "[]", '{"a": ', "9" * 5000])
def test_counters_that_are_no_table_are_refused(tmp_path, text):
    np.savez(tmp_path / "checkpoint.npz", **{**arrays(tmp_path), "counters": np.frombuffer(text.encode(), np.uint8)})
    assert end(read_checkpoint, tmp_path / "checkpoint.npz") is None


@pytest.mark.parametrize(
    "times", [[np.nan, 0.1, 0], [0, 0, 0], [0, np.nan, 0], [0, -1, 0], [-1, 0.1, 0], [0, np.inf, 0]]
)
def test_times_that_no_run_has_are_refused(tmp_path, times):
    np.savez(tmp_path / "checkpoint.npz", **{**arrays(tmp_path), "times": np.array(times, float)})
    assert end(read_checkpoint, tmp_path / "checkpoint.npz") is None


@pytest.mark.parametrize(
    "shape", ["(1000000000000, 3)", "(2**70,)", "(-1, 3)", "(" * 3000, "__import__('os').getpid()"]
)
def test_an_array_that_promises_too_much_is_refused(tmp_path, shape):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for key, value in arrays(tmp_path).items():
            member = io.BytesIO()
            np.save(member, value)
            lie = b"\x93NUMPY\2\0" + struct.pack("<I", len(head)) + head + b"\0" * 96
            archive.writestr(f"{key}.npy", lie if key == "positions" else member.getvalue())
    (tmp_path / "checkpoint.npz").write_bytes(packed.getvalue())
    assert end(read_checkpoint, tmp_path / "checkpoint.npz") is None


def test_an_archive_that_unpacks_to_more_than_it_holds_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "checkpoint.npz", **{**arrays(tmp_path), "positions": np.zeros((100_000, 3))})
    assert end(read_checkpoint, tmp_path / "checkpoint.npz") is None


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)


@FEW
@given(content=st.one_of(JSON.map(lambda v: json.dumps(v).encode()), st.binary(max_size=60), st.just(b"[" * 100_000)))
def test_any_record_and_summary(tmp_path, content):
    path = tmp_path / "record.jsonl"
    path.write_bytes(content + b"\n")
    assert isinstance(end(read_summary, path), dict | None)
    assert isinstance(end(read_record, path), list | None)


@FEW
@given(fraction=st.floats(0, 1))
def test_a_trajectory_cut_short_is_refused_or_read(tmp_path, fraction):
    """Cut only: on some changed bytes the HDF5 library itself never returns."""
    path = tmp_path / "trajectory.vtkhdf"
    path.unlink(missing_ok=True)
    surface = SurfaceRows("cloth", "cloth", slice(0, 3), np.array([[0, 1, 2]]), True)
    with TrajectoryWriter(path, [surface], stretches=False) as writer:
        writer.append(0.0, np.eye(3))
    content = path.read_bytes()
    path.write_bytes(content[: int(fraction * len(content))])

    def first_frame(file):
        trajectory = read_trajectory(file)
        return trajectory.positions(0), trajectory.triangles

    end(first_frame, path)


@pytest.mark.parametrize(
    ("block", "change", "message"),
    [
        ("Polygons/Connectivity", [0, 1, 3], "vertices that are not there"),
        ("Polygons/Connectivity", [0, 1, -1], "vertices that are not there"),
        ("NumberOfPoints", [5], "no frame 0"),
    ],
)
def test_a_trajectory_that_contradicts_itself_is_refused(tmp_path, block, change, message):
    path = tmp_path / "trajectory.vtkhdf"
    surface = SurfaceRows("cloth", "cloth", slice(0, 3), np.array([[0, 1, 2]]), True)
    with TrajectoryWriter(path, [surface], stretches=False) as writer:
        writer.append(0.0, np.eye(3))
    with h5py.File(path, "r+") as file:
        file[f"VTKHDF/surface0/{block}"][...] = change
    with pytest.raises(InputError, match=message):
        read_trajectory(path).positions(0)
