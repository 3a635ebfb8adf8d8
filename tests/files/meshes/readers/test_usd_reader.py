"""Meshes of USD files that usd-core wrote."""

import numpy as np
import pytest
from exported_runs import Y_UP, all_points, exported_run

from clothsim import InputError
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.keys.mesh_keys import check_body
from clothsim.scene.assembly.meshes import body_of

pxr = pytest.importorskip("pxr", reason="needs clothsim[usd]")
usd_reader = pytest.importorskip("clothsim.files.meshes.readers.usd_reader")

QUAD = """#usda 1.0
(
    metersPerUnit = {unit}
    upAxis = "{up}"
)
def Xform "World"
{{
    double3 xformOp:translate = (10, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Mesh "quad"{more}
    {{
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = {corners}
        texCoord2f[] primvars:st = [(0, 0), (0.5, 0), (0.5, 1), (0, 1)] ( interpolation = "vertex" )
    }}
}}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return exported_run(tmp_path_factory.mktemp("scene"))


def quad(folder, unit="0.01", up="Z", more="", corners="[0, 1, 2, 3]"):
    path = folder / "quad.usda"
    path.write_text(QUAD.format(unit=unit, up=up, more=more, corners=corners))
    return path


def test_unit_transform_texture_and_polygons(tmp_path):
    mesh = read_mesh(quad(tmp_path))
    np.testing.assert_allclose(mesh.positions, 0.01 * np.array([[10, 0, 0], [11, 0, 0], [11, 2, 0], [10, 2, 0]]))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.texture.max(axis=(0, 1)).tolist() == [0.5, 1.0]
    assert list(mesh.groups) == ["quad"]
    assert any('up = "y"' in message for message in read_mesh(quad(tmp_path, up="Y")).messages)


@pytest.mark.parametrize("ending", [".usda", ".usdc", ".usd"])
def test_what_was_exported_comes_back_in_metres(run, tmp_path, ending):
    run.export(tmp_path / f"a{ending}", scale=100, up="y")
    mesh = read_mesh(tmp_path / f"a{ending}")
    np.testing.assert_allclose(mesh.positions, all_points(run, 0) @ Y_UP.T, rtol=0, atol=1e-6)
    cloth = read_mesh(tmp_path / f"a{ending}", group="shirt")
    assert cloth.triangles.tolist() == run.triangles.tolist()
    assert len(mesh.groups["left"]) == len(mesh.groups["right"]) == 8


@pytest.mark.parametrize("rate", [25.0, 50.0])
def test_a_body_moves_as_in_the_file_at_any_rate(run, tmp_path, rate):
    run.export(tmp_path / "a.usdc", scale=100)
    keys = {"frames": "a.usdc", "group": "kick", "name": "kick", "frames_per_second": rate}
    body, _ = body_of(check_body("body", keys), "body", tmp_path)
    for frame, time in enumerate(run.times):
        np.testing.assert_allclose(body.at(time), run.bodies(frame)[1][1], rtol=0, atol=1e-6)
    assert body.motion.duration == pytest.approx(run.times[-1])


@pytest.mark.parametrize(
    "spoilt",
    [
        {"more": " ( references = @other.usda@ )"},
        {"corners": "[0, 1, 2]"},
    ],
)
def test_faults_are_one_sentence(tmp_path, spoilt):
    with pytest.raises(InputError):
        usd_reader.read_usd(quad(tmp_path, **spoilt))


def test_a_mesh_without_points_is_one_sentence(tmp_path):
    path = tmp_path / "empty.usda"
    path.write_text('#usda 1.0\ndef Mesh "quad"\n{\n}\n')
    with pytest.raises(InputError):
        usd_reader.read_usd(path)


@pytest.mark.parametrize("corners", ["[0, 1, 2, 3", "[0, 1, 2, 9]"])
def test_what_the_readers_process_or_the_mesh_refuses_is_one_sentence(tmp_path, corners):
    with pytest.raises(InputError):
        read_mesh(quad(tmp_path, corners=corners))


def test_a_file_that_is_no_usd_is_refused(tmp_path):
    path = tmp_path / "a.usdc"
    path.write_bytes(b"not a crate file")
    with pytest.raises(InputError):
        read_mesh(path)


@pytest.mark.parametrize(
    "header",
    [
        "startTimeCode = nan\n    endTimeCode = 10",
        "startTimeCode = 0\n    endTimeCode = inf",
        "startTimeCode = 0\n    endTimeCode = 10\n    timeCodesPerSecond = 0",
        "startTimeCode = 0\n    endTimeCode = 10\n    timeCodesPerSecond = nan",
        "startTimeCode = 0\n    endTimeCode = 10\n    timeCodesPerSecond = -24",
        "startTimeCode = 10\n    endTimeCode = 0",
    ],
)
def test_time_codes_that_are_no_times(tmp_path, header):
    """They ended in a ValueError, OverflowError or ZeroDivisionError."""
    path = quad(tmp_path)
    path.write_text(path.read_text().replace('upAxis = "Z"', f'upAxis = "Z"\n    {header}'))
    with pytest.raises(InputError, match=r"quad\.usda"):
        usd_reader.read_usd_frames(path, 25.0, 100)
