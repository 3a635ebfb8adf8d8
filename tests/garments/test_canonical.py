"""Canonical garments of a run: back to its frames, other bodies, files and faults."""

import numpy as np
import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.garments.unpose import character_of_scene, read_canonical, unposed, write_canonical

BODY = {"model": "mannequin", "motion": {"clip": "turn", "lead_in": 0.1}, "position": [0.3, -0.2, 0.1]}


def scene(**body):
    cloth = {"name": "skirt", "mesh": "skirt", "edge": 0.04, "position": [0.3, -0.2, 0.1]}
    return clothsim.Scene(cloth=cloth, body={**BODY, **body}, effects={"membrane": {}}, run={"duration": 0.08})


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Quasi-static, without contact: the skirt stays, the body goes."""
    return clothsim.simulate(scene(), tmp_path_factory.mktemp("run") / "turn")


@pytest.fixture(scope="module")
def canonical(run):
    return unposed(run, scene())


def test_posed_again_they_are_the_frames(run, canonical):
    made, _ = character_of_scene(scene())
    assert canonical.residuals.max() < 1e-9
    for k, frame in enumerate(run):
        np.testing.assert_allclose(
            canonical.posed(k, made.skinning(float(run.times[k]), canonical.body)),
            frame.positions["skirt"],
            rtol=0,
            atol=1e-9,
        )


def test_in_the_rest_pose_they_are_the_start(run, canonical):
    np.testing.assert_allclose(canonical.positions[0] + (0.3, -0.2, 0.1), run[0].positions["skirt"], atol=1e-5)


def test_the_field_has_small_residuals(run):
    made = unposed(run, scene(), field=True)
    character, _ = character_of_scene(scene())
    assert np.mean(made.residuals <= 1e-3) >= 0.99
    again = made.posed(1, character.skinning(float(run.times[1]), made.body))
    off = np.linalg.norm(again - run[1].positions["skirt"], axis=1)
    np.testing.assert_allclose(off, made.residuals[1], rtol=0, atol=1e-9)


def test_another_shape_moves_them_with_the_body(canonical):
    taller, _ = character_of_scene(scene(shape={"height": 1.87}))
    found = canonical.posed(0, taller.skinning(0.0, canonical.body))
    np.testing.assert_allclose(np.ptp(found[:, 2]) / np.ptp(canonical.positions[0][:, 2]), 1.1, rtol=0.01)


def test_the_file_keeps_them(canonical, tmp_path):
    write_canonical(tmp_path / "canonical.npz", canonical)
    read = read_canonical(tmp_path / "canonical.npz")
    for name in ("positions", "residuals", "times", "triangles", "starts", "body", "body_triangles"):
        assert np.array_equal(getattr(read, name), getattr(canonical, name)), name
    assert read.names == ("skirt",)
    assert abs(read.rows - canonical.rows).max() == 0


def test_commands(run, tmp_path):
    target, garment, other = tmp_path / "canonical.npz", tmp_path / "skirt.obj", tmp_path / "other.toml"
    assert main(["unpose", str(run.directory), "-o", str(target)]) == 0
    other.write_text('[cloth]\nmesh = "skirt"\n[[body]]\nmodel = "mannequin"\nshape = { height = 1.8 }\n')
    assert main(["repose", str(target), str(other), "-o", str(garment), "--frame", "0"]) == 0
    assert len(read_mesh(garment).positions) == len(run[0].positions["skirt"])
    assert main(["repose", str(target), str(other), "-o", str(garment), "--frame", "99"]) == 2
    assert main(["repose", str(target), str(other), "-o", str(garment), "--time", "nan"]) == 2
    assert main(["repose", str(garment), str(other), "-o", str(garment)]) == 2


def test_faults_are_named(canonical, tmp_path):
    without = clothsim.Scene(cloth={"mesh": "skirt"}, body={"mesh": "mannequin"})
    with pytest.raises(InputError):
        character_of_scene(without)
    with pytest.raises(InputError):
        canonical.rows_of("shirt")
    np.savez(tmp_path / "other.npz", positions=np.zeros(3))
    with pytest.raises(InputError):
        read_canonical(tmp_path / "other.npz")
