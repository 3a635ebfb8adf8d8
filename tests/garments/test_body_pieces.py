"""Bodies in pieces: which pieces are the body, and the closed surface that has its landmarks."""

import numpy as np
import pytest
from fitting_cases import in_file, task, tube_garment
from pieced_figures import figure

import clothsim
from clothsim.base.errors import InputError
from clothsim.files import read_mesh
from clothsim.garments import inputs
from clothsim.garments.fit.pipeline import seed_fit
from clothsim.garments.inputs import BodyMesh, is_closed, read_body_mesh
from clothsim.mesh.generators.shapes import sphere

POSITIONS, TRIANGLES, PIECES = figure(seed=1)


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    monkeypatch.setattr(inputs, "CELL", 0.012)


@pytest.fixture(scope="module")
def closed():
    """A figure in one closed piece."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(inputs, "CELL", 0.012)
        return BodyMesh("figure", POSITIONS, TRIANGLES, 1.0, ()).closed


def test_all_pieces_of_a_jointed_figure_are_the_body(tmp_path):
    body = read_body_mesh(in_file(tmp_path, "figure.obj", 100 * POSITIONS, TRIANGLES))
    assert len(body.positions) == len(POSITIONS)
    assert body.scale == 0.01  # of the whole, not of a piece
    assert any(str(PIECES) in note for note in body.notes)
    assert body.closed is not body
    assert is_closed(body.closed.triangles)
    assert body.parts.hands.shape == (2, len(POSITIONS))
    assert body.parts.landmarks == body.closed.parts.landmarks
    np.testing.assert_array_equal(body.up, [0, 1, 0])


def test_of_a_closed_body_with_eyes_nothing_is_wrapped(tmp_path, closed):
    assert closed.closed is closed
    eye, faces = sphere(radius=0.02, subdivisions=1)
    eyes = eye + np.array((0.0, 1.6, 0.1))
    positions = np.concatenate([closed.positions, eyes])
    triangles = np.concatenate([closed.triangles, faces + len(closed.positions)])
    in_memory = BodyMesh("seeing", positions, triangles, 1.0, ())
    assert in_memory.closed is in_memory
    read = read_body_mesh(in_file(tmp_path, "seeing.obj", positions, triangles))
    assert len(read.positions) == len(closed.positions)
    assert read.closed is read


def test_holes_of_a_scan_are_closed_in_the_wrap_alone(closed):
    middles = closed.positions[closed.triangles].mean(axis=1)
    holes = np.linalg.norm(middles - [0.0, 1.1, 0.12], axis=1) > 0.06
    scan = BodyMesh("scan", closed.positions, closed.triangles[holes & (middles[:, 1] > 0.02)], 1.0, ())
    assert not is_closed(scan.triangles)
    assert is_closed(scan.closed.triangles)
    assert scan.parts.landmarks["armpit"] == pytest.approx(closed.parts.landmarks["armpit"], abs=0.04)


def test_pieces_that_make_no_body_are_the_fault_that_is_named(closed):
    half = POSITIONS[:, 1] > 0.95  # no legs
    body = BodyMesh("bust", POSITIONS, TRIANGLES[half[TRIANGLES].all(axis=1)], 1.0, ())
    assert body.closed is body
    assert "legs" in body.fault
    with pytest.raises(InputError, match="legs"):
        seed_fit(task(tube_garment(0.2), closed, body, None))


def test_a_garment_is_seeded_on_the_wrap_and_ends_on_the_pieces(tmp_path, closed):
    body = BodyMesh("figure", POSITIONS, TRIANGLES, 1.0, ())
    skirt = tube_garment(0.24, height=0.3, cells=(24, 6))
    worn = inputs.Garment("skirt", skirt.positions[:, [1, 2, 0]] + [0.0, 0.75, 0.0], skirt.triangles)
    state = seed_fit(task(worn, closed, body, tmp_path))
    assert not state.failure
    assert state.stages[-1].name == "pieces"
    assert len(state.worn.body_triangles) == len(TRIANGLES)
    assert state.last.counts.clean


def test_parts_of_a_file_are_several_groups(tmp_path):
    file = tmp_path / "two.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng skin\nf 1 2 3\ng hair\nf 1 2 4\ng hat\nf 2 3 4\n")
    mesh = read_mesh(file, parts=["hat", "skin"])
    assert mesh.triangles.tolist() == [[0, 1, 2], [1, 2, 3]]
    with pytest.raises(InputError, match="beard"):
        read_mesh(file, parts=["skin", "beard"])
    with pytest.raises(InputError, match="parts"):
        read_mesh(file, parts=["skin"], group="hat")
    body = {"mesh": "two.obj", "parts": ["skin", "hair"], "scale": 2.0}
    with pytest.raises(InputError, match="nose"):
        clothsim.Scene(cloth={"mesh": "rectangle"}, body={**body, "parts": "nose"}, effects={}, directory=tmp_path)
