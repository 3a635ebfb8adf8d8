"""Export of runs, each format opened by a reader of another project."""

import importlib.util
import json
import struct

import numpy as np
import pytest
from command_line import refused
from exported_runs import Y_UP, all_points, exported_run, glb_frames

import clothsim
from clothsim import InputError, open_run
from clothsim.cli import main
from clothsim.files.exchange.formats import FORMATS
from clothsim.files.meshes.mesh_file import read_mesh

EQUAL = 1e-6
"""Largest difference of positions [m]."""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return exported_run(tmp_path_factory.mktemp("scene"))


def equal(points, expected):
    np.testing.assert_allclose(points, expected, rtol=0, atol=EQUAL)


def read_glb(path):
    """The JSON and the buffer of a .glb file."""
    content = path.read_bytes()
    size = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + size]), content[28 + size :]


def test_glb_plays_the_frames_in_metres_with_y_up(run, tmp_path):
    done = run.export(tmp_path / "a.glb")
    assert (done.frames, done.rate, done.up, done.unit, done.interpolated, done.notes) == (4, 25.0, "y", 1.0, 0, ())
    for frame, meshes in enumerate(glb_frames(tmp_path / "a.glb", run.times)):
        panel, _, still, kick = meshes  # panels share all vertices; VTK 9.7 moves the first primitive of a mesh only
        equal(panel[:15], run.positions(frame) @ Y_UP.T)
        for points, (_, body, _) in zip((still, kick), run.bodies(frame), strict=True):
            equal(points, body @ Y_UP.T)


def test_glb_has_panels_texture_and_one_copy_of_what_does_not_move(run, tmp_path):
    import trimesh

    run.export(tmp_path / "a.glb")
    scene = trimesh.load_scene(tmp_path / "a.glb", process=False)
    assert scene.units == "meters"
    names = [each.visual.material.name for each in scene.geometry.values()]
    assert names == ["left", "right", "still", "kick"]
    corners = [each.visual.uv[each.faces] for each in list(scene.geometry.values())[:2]]
    equal(np.concatenate(corners), read_mesh(run.directory.parent / "panels.obj").texture)
    document, _ = read_glb(tmp_path / "a.glb")
    cloth, still, kick = document["meshes"]
    assert [len(mesh["primitives"][0].get("targets", ())) for mesh in (cloth, still, kick)] == [3, 0, 3]
    left, right = cloth["primitives"]
    assert (left["attributes"], left["targets"]) == (right["attributes"], right["targets"])
    assert [entry["target"]["node"] for entry in document["animations"][0]["channels"]] == [0, 2]
    assert all(material["doubleSided"] for material in document["materials"][:2])


def test_obj_files_have_objects_groups_texture_and_the_last_bit(run, tmp_path):
    import trimesh

    done = run.export(tmp_path / "a.obj")
    assert [file.name for file in done.files] == [f"a_{k:04d}.obj" for k in range(4)]
    for frame, file in enumerate(done.files):
        scene = trimesh.load(file, process=False, maintain_order=True, split_object=True, force="scene")
        vertices = np.concatenate([each.vertices[np.unique(each.faces)] for each in scene.geometry.values()])
        expected = all_points(run, frame)
        equal(np.unique(vertices.round(9), axis=0), np.unique(expected.round(9), axis=0))
        own = read_mesh(file)
        assert (own.positions == expected).all()
        assert {name: len(own.groups[name]) for name in ("shirt", "left", "right", "still", "kick")} == {
            "shirt": 16,
            "left": 8,
            "right": 8,
            "still": 20,
            "kick": 20,
        }
    cloth = read_mesh(done.files[0], group="shirt")
    equal(cloth.texture, read_mesh(run.directory.parent / "panels.obj").texture)


def test_ply_files_have_stretch_and_colours(run, tmp_path):
    import meshio
    import trimesh

    done = run.export(tmp_path / "a.ply")
    for frame, file in enumerate(done.files):
        mesh = meshio.read(file)
        data = mesh.point_data
        cloth = data["surface"] == 0
        assert cloth.sum() == 18  # three vertices of the seam twice, as their texture differs
        equal(mesh.points[cloth][:15], run.positions(frame))
        equal(mesh.points[~cloth], all_points(run, frame)[15:])
        assert (data["stretch"][~cloth] == 1).all()
        assert np.ptp(data["t"][cloth]) == pytest.approx(0.2)
    loaded = trimesh.load(done.files[-1], process=False)
    assert len(loaded.faces) == 16 + 40


@pytest.mark.parametrize("ending", [".pc2", ".mdd"])
def test_point_caches_have_the_layout_of_their_documentation(run, tmp_path, ending):
    done = run.export(tmp_path / f"a{ending}")
    names = [file.name for file in done.files]
    assert names == [f"a{ending}", "a.obj", "a_still.obj", f"a_kick{ending}", "a_kick.obj"]
    for name, points in ((f"a{ending}", run.positions), (f"a_kick{ending}", lambda k: run.bodies(k)[1][1])):
        content = (tmp_path / name).read_bytes()
        count = len(points(0))
        if ending == ".pc2":
            assert struct.unpack_from("<12s", content)[0] == b"POINTCACHE2\0"
            assert struct.unpack_from("<iiffi", content, 12) == (1, count, 0.0, 1.0, 4)
            values = np.frombuffer(content, "<f4", offset=32)
        else:
            assert struct.unpack_from(">ii", content) == (4, count)
            np.testing.assert_allclose(np.frombuffer(content, ">f4", 4, 8), run.times, atol=1e-7)
            values = np.frombuffer(content, ">f4", offset=24)
        assert len(values) == 4 * count * 3
        for frame, own in enumerate(values.reshape(4, count, 3)):
            equal(own, points(frame))
    assert (read_mesh(tmp_path / "a.obj").positions == run.positions(0)).all()


def test_vtkhdf_takes_unit_axis_and_rate(run, tmp_path):
    import pyvista

    run.export(tmp_path / "a.vtkhdf", scale=100, up="y", fps=12.5)
    reader = pyvista.get_reader(tmp_path / "a.vtkhdf")
    for step, frame in enumerate((0, 2)):
        reader.reader.SetStep(step)
        blocks = reader.read()
        equal(blocks["shirt"].points / 100, run.positions(frame) @ Y_UP.T)
        equal(blocks["kick"].points / 100, run.bodies(frame)[1][1] @ Y_UP.T)
        assert len(blocks["shirt"].cell_data["stretch"]) == 16


@pytest.mark.parametrize("ending", [".usda", ".usdc", ".usd"])
def test_usd_has_time_samples_unit_axis_panels_and_texture(run, tmp_path, ending):
    pytest.importorskip("pxr", reason="needs clothsim[usd]")
    from pxr import Usd, UsdGeom

    run.export(tmp_path / f"a{ending}", scale=100, up="y")
    stage = Usd.Stage.Open(str(tmp_path / f"a{ending}"))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (25, 0, 3)
    cloth, still, kick = (UsdGeom.Mesh.Get(stage, f"/World/{name}") for name in ("shirt", "still", "kick"))
    assert still.GetPointsAttr().GetNumTimeSamples() == 0
    for frame in range(4):
        equal(0.01 * np.array(cloth.GetPointsAttr().Get(frame)), run.positions(frame) @ Y_UP.T)
        for mesh, (_, points, _) in zip((still, kick), run.bodies(frame), strict=True):
            equal(0.01 * np.array(mesh.GetPointsAttr().Get(frame)), points @ Y_UP.T)
        np.testing.assert_allclose(np.linalg.norm(cloth.GetNormalsAttr().Get(frame), axis=1), 1, atol=1e-6)
    assert np.reshape(cloth.GetFaceVertexIndicesAttr().Get(), (-1, 3)).tolist() == run.triangles.tolist()
    st = UsdGeom.PrimvarsAPI(cloth).GetPrimvar("st")
    equal(np.reshape(st.ComputeFlattened(), (-1, 3, 2)), read_mesh(run.directory.parent / "panels.obj").texture)
    subsets = UsdGeom.Subset.GetGeomSubsets(cloth, "face", "panel")
    assert {each.GetPrim().GetName(): len(each.GetIndicesAttr().Get()) for each in subsets} == {"left": 8, "right": 8}
    stretch = UsdGeom.PrimvarsAPI(cloth).GetPrimvar("stretch")
    assert stretch.GetInterpolation() == "uniform"
    assert len(stretch.Get(3)) == 16
    assert len(cloth.GetDisplayColorAttr().Get(3)) == 15


def test_a_frame_alone_is_one_file_without_a_time(run, tmp_path):
    done = run.export(tmp_path / "last.obj", frame=-1)
    assert [file.name for file in done.files] == ["last.obj"]
    assert (read_mesh(done.files[0]).positions == all_points(run, 3)).all()
    run.export(tmp_path / "last.glb", frame=-1, colour="plain")
    document, _ = read_glb(tmp_path / "last.glb")
    assert "animations" not in document
    assert "COLOR_0" not in document["meshes"][0]["primitives"][0]["attributes"]


def test_frames_between_those_of_the_run_are_counted_and_linear(run, tmp_path):
    done = run.export(tmp_path / "a.obj", fps=50)
    assert (done.frames, done.interpolated, done.rate) == (7, 3, 50.0)
    middle = read_mesh(done.files[3]).positions
    np.testing.assert_allclose(middle, 0.5 * (all_points(run, 1) + all_points(run, 2)), rtol=0, atol=1e-15)
    assert (read_mesh(done.files[4]).positions == all_points(run, 2)).all()


def test_far_from_the_origin_points_keep_a_micrometre(tmp_path):
    run = exported_run(tmp_path, offset=(1000.0, 2000.0, 30.0))
    run.export(tmp_path / "a.glb")
    document, buffer = read_glb(tmp_path / "a.glb")
    origin = np.array(document["nodes"][0]["translation"])
    mesh = document["meshes"][0]["primitives"][0]
    view = document["bufferViews"][document["accessors"][mesh["attributes"]["POSITION"]]["bufferView"]]
    points = np.frombuffer(buffer, "<f4", view["byteLength"] // 4, view["byteOffset"]).reshape(-1, 3)[:15]
    equal(points.astype(float) + origin, run.positions(0) @ Y_UP.T)


def test_a_scene_with_y_up_stays_as_it_is_in_gltf(tmp_path):
    effects = {"inertia": {}, "gravity": {"acceleration": [0.0, -9.81, 0.0]}}
    run = exported_run(tmp_path, effects=effects)
    assert run.export(tmp_path / "a.obj", frame=0).up == "y"
    run.export(tmp_path / "a.glb")
    equal(glb_frames(tmp_path / "a.glb", [run.times[-1]])[0][0][:15], run.positions(-1))


def test_without_its_mesh_file_a_run_loses_texture_and_panels_with_a_note(tmp_path):
    run = exported_run(tmp_path)
    (tmp_path / "panels.obj").unlink()
    done = open_run(run.directory).export(tmp_path / "a.obj", frame=0)
    assert len(done.notes) == 1
    mesh = read_mesh(done.files[0], group="shirt")
    assert len(mesh.positions) == 15
    assert not len(mesh.texture)


@pytest.mark.parametrize(
    "settings",
    [
        {"name": "a.abc"},
        {"name": "a"},
        {"name": "missing/a.obj"},
        {"name": "a.glb", "scale": 100},
        {"name": "a.glb", "up": "z"},
        {"name": "a.obj", "up": "x"},
        {"name": "a.obj", "scale": 0},
        {"name": "a.obj", "scale": 1e300},
        {"name": "a.usda", "scale": 1e-300},
        {"name": "a.obj", "scale": "big"},
        {"name": "a.obj", "fps": 1e9},
        {"name": "a.obj", "fps": float("nan")},
        {"name": "a.obj", "frame": 4},
        {"name": "a.obj", "frame": 1, "fps": 25},
        {"name": "a.obj", "colour": "red"},
        {"name": "a.obj", "rate": 25},
    ],
)
def test_bad_settings_are_refused_and_leave_no_file(run, tmp_path, settings):
    given = dict(settings)
    with pytest.raises(InputError):
        run.export(tmp_path / given.pop("name"), **given)
    assert not list(tmp_path.iterdir())


def test_files_that_exist_are_kept_unless_they_are_to_be_replaced(run, tmp_path):
    (tmp_path / "a_0002.obj").write_text("mine")
    with pytest.raises(InputError, match=r"a_0002\.obj exists"):
        run.export(tmp_path / "a.obj")
    assert [file.name for file in tmp_path.iterdir()] == ["a_0002.obj"]
    run.export(tmp_path / "a.obj", overwrite=True)
    assert len(read_mesh(tmp_path / "a_0002.obj").positions) == 39


def test_surfaces_of_like_names_stay_apart(tmp_path):
    names = ["coat a", "coat_a", "coat/a"]
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    cloths = [clothsim.Cloth(triangle + np.array([0, 0, k]), [[0, 1, 2]], name=name) for k, name in enumerate(names)]
    scene = clothsim.Scene(cloths, effects=[clothsim.Inertia()], run=clothsim.RunSettings(duration=0.04))
    run = clothsim.simulate(scene, tmp_path / "run")
    files = run.export(tmp_path / "a.pc2").files
    assert len(set(files)) == len(files) == 6
    (tmp_path / "b").mkdir()
    mesh = read_mesh(run.export(tmp_path / "b/a.obj", frame=0).files[0])
    assert [len(own) for own in mesh.groups.values()] == [1, 1, 1]
    if importlib.util.find_spec("pxr") is not None:
        mesh = read_mesh(run.export(tmp_path / "a.usda").files[0])
        assert [len(own) for own in mesh.groups.values()] == [1, 1, 1]


def test_a_directory_of_the_name_is_never_replaced(run, tmp_path):
    (tmp_path / "a.glb").mkdir()
    with pytest.raises(InputError, match="directory"):
        run.export(tmp_path / "a.glb", overwrite=True)


def test_the_command_exports_and_refuses_in_one_sentence(run, tmp_path, capsys):
    where = str(run.directory)
    assert main(["export", where, "-o", str(tmp_path / "a.glb"), "--fps", "50"]) == 0
    assert "7 frames (3 interpolated) at 50 a second" in capsys.readouterr().out
    for words in (
        [where, "-o", str(tmp_path / "a.glb")],
        [where, "-o", str(tmp_path / "a.fbx")],
        [where, "-o", str(tmp_path / "b.obj"), "--frame", "9"],
        [where, "-o", str(tmp_path / "b.obj"), "--frame", "x"],
        [str(tmp_path), "-o", str(tmp_path / "b.obj")],
        [where],
    ):
        refused(capsys, "export", *words)


def test_every_format_has_its_files_and_its_writer():
    for ending, kind in FORMATS.items():
        assert ending == ending.lower()
        assert callable(kind.writer.files)
        assert callable(kind.writer.write)
        assert kind.meaning


def test_a_cache_without_times_says_that_its_frames_are_not_even(tmp_path):
    uneven = exported_run(tmp_path, run={"duration": 0.1, "frames_per_second": 25})
    assert np.ptp(np.diff(uneven.times)) > 0.01
    for ending, fps, noted in (
        (".pc2", None, True),
        (".pc2", 50.0, False),
        (".mdd", None, False),
        (".obj", None, True),
    ):
        done = uneven.export(tmp_path / f"a{ending}", fps=fps, overwrite=True)
        assert any("0.12 s" in note for note in done.notes) == noted
