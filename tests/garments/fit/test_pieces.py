"""Pieces of a garment: what follows, what is stitched, what is simulated."""

import numpy as np
import pytest
from fitting_cases import RADIUS, in_file, task, wider
from fitting_cases import capsule_figure as capsule
from tangles import joined

import clothsim
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.garments.fit.moving_body import StageSettings, draped
from clothsim.garments.fit.pieces import UNDIVIDED, divided, embed
from clothsim.garments.fit.pipeline import seed_fit
from clothsim.garments.inputs import read_garment
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.generators.shapes import disk, rectangle, tube

HOST = RADIUS + 0.01
SHIRT = tube(radius=HOST, height=0.3, cells=(24, 10))


def wrapped(mesh, angle, height, out):
    """A flat mesh around the shirt, `out` [m] outside it."""
    (x, y, _), radius = mesh[0].T, HOST + out
    points = np.column_stack([radius * np.cos(x / HOST + angle), radius * np.sin(x / HOST + angle), y + height])
    return points, mesh[1]


def button(height, angle=0.0, out=-0.001):
    """A disc half sunk into the shirt."""
    return wrapped(disk(radius=0.008, cells=4), angle, height, out)


POCKET = wrapped(rectangle(size=(0.06, 0.08), cells=(5, 6)), 1.5, 0.0, 0.003)
STRAP = wrapped(rectangle(size=(0.02, 0.2), cells=(2, 16)), 3.0, 0.22, 0.003)
FAR = wrapped(disk(radius=0.01, cells=4), 2.0, 0.0, 0.03)


@pytest.mark.parametrize(
    ("more", "following", "stitched"),
    [
        ([], 0, 0),
        ([button(-0.05), button(0.0), button(0.05)], 3, 0),
        ([POCKET], 1, 0),
        ([STRAP], 0, 1),
        ([FAR], 1, 0),
        ([(SHIRT[0], SHIRT[1][:, ::-1])], 1, 0),
        ([button(0.0), POCKET, STRAP, (SHIRT[0], SHIRT[1][:, ::-1])], 3, 1),
        ([tube(radius=0.13, height=0.3, cells=(24, 10))], 0, 0),
    ],
)
def test_pieces_follow_are_stitched_or_are_simulated(more, following, stitched):
    x, triangles = joined(SHIRT, *more)
    division = divided(x, triangles)
    assert division.as_dict() == {"following": following, "stitched": stitched}
    assert (division is UNDIVIDED) == (not following and not stitched)
    assert np.allclose(division.complete(x[division.vertices] if following else x), x, atol=1e-12)
    for rows in division.stitched:
        assert (np.linalg.norm(x[division.vertices][rows, :2], axis=1) < HOST + 0.005).all()
        assert 4 < len(rows) < 30


@pytest.mark.parametrize(("shift", "joins"), [(0.0, True), (-0.03, False)])
def test_a_buckle_on_two_pieces_joins_them(shift, joins):
    def sheet(middle):
        points, triangles = rectangle(size=(0.3, 0.3), cells=(30, 30))
        return points + np.array([0.0, middle, 0.0]), triangles

    buckle = disk(radius=0.012, cells=4)
    x, triangles = joined(sheet(0.153), sheet(-0.153), (buckle[0] + np.array([0.0, shift, 0.002]), buckle[1]))
    division = divided(x, triangles)
    assert division.as_dict() == {"following": 1, "stitched": int(joins)}
    for rows in division.stitched:
        points = x[division.vertices][rows]
        assert len(rows) > 2
        assert (np.abs(points) < [0.03, 0.03, 1e-9]).all()
        assert len(set(np.sign(points[:, 1]))) == 1  # of one piece, drawn to the other


def test_what_follows_moves_with_its_host_and_a_button_stays_rigid():
    x, triangles = joined(SHIRT, button(0.0), POCKET)
    division = divided(x, triangles)
    host = x[division.vertices] * [1.3, 1.3, 1.0]
    whole = division.complete(host)
    own, pocket = slice(len(SHIRT[0]), len(x) - len(POCKET[0])), slice(len(x) - len(POCKET[0]), None)
    lengths = [np.linalg.norm(points[own] - points[own][0], axis=1) for points in (x, whole)]
    np.testing.assert_allclose(lengths[1], lengths[0], atol=1e-12)
    apart = np.linalg.norm(whole[own][:, :2], axis=1) - 1.3 * HOST
    assert np.abs(apart).max() < 0.003
    assert np.ptp(whole[pocket], axis=0)[:2].max() > 1.2 * np.ptp(x[pocket], axis=0)[:2].max()
    np.testing.assert_allclose(np.linalg.norm(whole[pocket][:, :2], axis=1), 1.3 * HOST + 0.003, atol=0.002)


def test_embedded_vertices_turn_with_the_frames_of_their_triangles():
    rng = np.random.default_rng(1)
    host, points = rng.normal(size=(9, 3)), rng.normal(size=(4, 3))
    corners, whole = np.array([[0, 1, 2], [3, 4, 5], [6, 7, 8], [0, 4, 8]]), np.concatenate([host, points])
    closest = host[corners].mean(axis=1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    for is_rigid in (False, True):
        piece = embed(whole, np.arange(9, 13), corners, np.arange(9), closest, is_rigid)
        np.testing.assert_allclose(piece.positions_on(host @ turn.T + 2.0), points @ turn.T + 2.0, atol=1e-12)


def test_a_garment_with_buttons_sunk_into_it_is_read_without_them(tmp_path):
    x, triangles = joined(SHIRT, *(button(z) for z in (-0.05, 0.0, 0.05)), (SHIRT[0], SHIRT[1][:, ::-1]))
    assert len(intersecting_pairs(x, triangles)) > 100
    garment = read_garment(in_file(tmp_path, "shirt.obj", x, triangles), None, 1.0)
    assert len(garment.positions) == len(SHIRT[0])
    assert garment.division.as_dict() == {"following": 4, "stitched": 0}
    assert sum("pieces" in note for note in garment.notes) == 2
    found = seed_fit(task(garment, capsule(), wider(capsule(), 1.2), tmp_path))
    assert found.last.counts.clean
    assert len(garment.division.complete(found.last.positions)) == len(x)


def test_a_strap_stays_on_what_it_is_stitched_to(tmp_path):
    x, triangles = joined(SHIRT, STRAP)
    garment = read_garment(in_file(tmp_path, "shirt.obj", x, triangles), None, 1.0)
    figure = capsule()
    worn = StageSettings(garment, garment.positions, "cotton", figure.triangles, self_contact=True)
    run = draped(worn, garment.positions, figure.positions, figure.up, tmp_path / "drape", None, None, duration=0.3)
    assert run.status == "completed"
    gaps = [note for note in run.summary["notes"] if "stitches" in note]
    assert len(gaps) == 1
    ends = garment.division.stitched[0]
    moved = run.positions(-1)
    assert np.linalg.norm(moved[ends] - x[ends], axis=1).min() > 0.05  # it slides down with the shirt
    nearest = np.linalg.norm(moved[ends][:, None] - moved[: len(SHIRT[0])], axis=2).min(axis=1)
    assert nearest.max() < 0.03


def test_fitted_obj_has_every_vertex(tmp_path):
    x, triangles = joined(SHIRT, POCKET)
    file = in_file(tmp_path, "shirt.obj", x, triangles)
    body = in_file(tmp_path, "body.obj", capsule().positions, capsule().triangles)
    done = clothsim.fit(file, body, output=tmp_path / "out", scale=1.0)
    fitted = read_mesh(tmp_path / "out" / "fitted.obj")
    assert len(fitted.positions) == len(x) == len(done.complete_positions)
    assert np.array_equal(fitted.triangles, triangles)


def test_a_flat_pocket_partly_sunk_into_a_curved_front_follows_on_one_side():
    flat, faces = rectangle(size=(0.05, 0.06), cells=(5, 6))
    pocket = np.column_stack([np.full(len(flat), HOST - 0.0005), flat[:, 0], flat[:, 1]])
    x, triangles = joined(SHIRT, (pocket, faces))
    assert len(intersecting_pairs(x, triangles)) > 0
    division = divided(x, triangles)
    assert division.as_dict() == {"following": 1, "stitched": 0}
    placed = division.complete(x[division.vertices])
    normal = division.embedded[0].offsets[:, 2]
    assert np.abs(normal).min() >= 0.0005
    assert len(np.unique(np.sign(normal))) == 1
    assert np.linalg.norm(placed[len(SHIRT[0]) :] - pocket, axis=1).max() < 0.004
