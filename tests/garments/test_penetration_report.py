"""Penetration report from arrays, from files and by the command."""

import numpy as np
import pytest
from real_data import DATA, needs_data

from clothsim.cli import main
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.garments.penetration import deepest_vertices, penetration_report, read_penetration_report
from clothsim.mesh.generators.shapes import rectangle, slab, tube

BODY = BodyMesh("box", *slab(size=(0.4, 0.4, 1.8), cells=(4, 4, 9)), 1.0, ())
LOOSE, TRIANGLES = tube(radius=0.3, height=0.6, cells=(24, 8))


def write_obj(path, positions, triangles):
    lines = [f"v {x} {y} {z}" for x, y, z in positions.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist())]) + "\n")
    return str(path)


def test_a_loose_garment_is_clean():
    found = penetration_report(Garment("loose", LOOSE, TRIANGLES), BODY)
    assert found.counts.clean
    assert len(found.inside) == len(found.body_pairs) == len(found.self_pairs) == 0


def test_vertices_inside_are_named_the_deepest_first():
    moved = LOOSE + np.array([0.15, 0.013, 0.0])
    found = penetration_report(Garment("moved", moved, TRIANGLES), BODY)
    depths = ([0.2, 0.2, 0.9] - np.abs(moved)).min(axis=1)
    truth = np.flatnonzero(depths > 0)
    np.testing.assert_array_equal(np.sort(found.inside), truth)
    assert found.counts.penetrating_vertices == len(truth) > 0
    vertex, depth, place = deepest_vertices(found)[0]
    assert depth == pytest.approx(depths.max(), abs=1e-9)
    assert depths[vertex] == pytest.approx(depths.max(), abs=1e-9)
    np.testing.assert_array_equal(place, moved[vertex])
    assert len(found.body_pairs) == found.counts.body_pairs > 0


def test_a_triangle_that_cuts_the_body_with_no_vertex_inside_is_found():
    wide = np.array([[-1.0, 0.11, 0.03], [1.0, 0.12, 0.02], [0.0, 0.13, 2.0]])
    found = penetration_report(Garment("sheet", wide, np.array([[0, 1, 2]])), BODY)
    assert found.counts.penetrating_vertices == 0
    assert len(found.body_pairs) > 0
    assert not found.counts.clean


def test_the_command_reports_and_draws(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    body = write_obj(tmp_path / "box.obj", BODY.positions, BODY.triangles)
    loose = write_obj(tmp_path / "loose.obj", LOOSE, TRIANGLES)
    tight = write_obj(tmp_path / "tight.obj", LOOSE + np.array([0.15, 0.013, 0.0]), TRIANGLES)
    assert main(["check", loose, "--on", body]) == 0
    assert "Nothing is wrong." in capsys.readouterr().out
    picture = tmp_path / "tight.png"
    monkeypatch.setattr("clothsim.garments.penetration.SIZE", (96, 128))
    assert main(["check", tight, "--on", body, "--scale", "1", "-o", str(picture)]) == 1
    printed = capsys.readouterr().out
    assert "of 216 vertices" in printed
    assert "the garment and the body intersect in" in printed
    assert "the garment and itself do not intersect" in printed
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_command_refuses_what_does_not_go_together(tmp_path, capsys):
    loose = write_obj(tmp_path / "loose.obj", LOOSE, TRIANGLES)
    assert main(["check", loose, "--body-group", "body"]) == 2
    assert "need --on" in capsys.readouterr().err
    assert main(["check", loose, "--on", str(tmp_path / "none.obj")]) == 2
    assert main(["check", loose, "--on", loose, "--body"]) == 2
    assert main(["check", loose, "--on", loose, "--part", "1-2"]) == 2
    assert "--part" in capsys.readouterr().err
    assert main(["check", loose, "--on", loose, "-o", str(tmp_path / "none" / "a.png")]) == 2
    assert "There is no directory" in capsys.readouterr().err


def test_the_body_s_scale_is_not_the_garment_s(tmp_path):
    body = write_obj(tmp_path / "box.obj", 100 * BODY.positions, BODY.triangles)
    loose = write_obj(tmp_path / "loose.obj", LOOSE, TRIANGLES)
    found = read_penetration_report(loose, body, body_scale=0.01)
    np.testing.assert_allclose(found.garment.positions, LOOSE, atol=1e-6)
    np.testing.assert_allclose(found.wearer.positions, BODY.positions, atol=1e-6)
    both = read_penetration_report(loose, body, scale=0.5, body_scale=0.01)
    np.testing.assert_allclose(both.garment.positions, 0.5 * LOOSE, atol=1e-6)
    np.testing.assert_allclose(both.wearer.positions, BODY.positions, atol=1e-6)


def test_a_garment_that_nobody_wears_is_seen_by_its_distance(tmp_path, capsys):
    body = write_obj(tmp_path / "box.obj", BODY.positions, BODY.triangles)
    far = write_obj(tmp_path / "far.obj", LOOSE + np.array([40.0, 0.0, 0.0]), TRIANGLES)
    assert main(["check", far, "--on", body]) == 0
    assert "39.5 m" in capsys.readouterr().out


def test_a_picture_that_cannot_be_written_is_bad_input(tmp_path, capsys, monkeypatch):
    body = write_obj(tmp_path / "box.obj", BODY.positions, BODY.triangles)
    loose = write_obj(tmp_path / "loose.obj", LOOSE, TRIANGLES)
    assert main(["check", loose, "--on", body, "-o", str(tmp_path)]) == 2
    assert "is a directory" in capsys.readouterr().err

    def full(found, file):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("clothsim.cli.on_demand.draw_penetrations", full)
    assert main(["check", loose, "--on", body, "-o", str(tmp_path / "a.png")]) == 2
    assert "a.png" in capsys.readouterr().err


def test_a_flat_body_is_refused_in_a_sentence(tmp_path, capsys):
    loose = write_obj(tmp_path / "loose.obj", LOOSE, TRIANGLES)
    flat = write_obj(tmp_path / "flat.obj", *rectangle(cells=(2, 2)))
    assert main(["check", loose, "--on", flat]) == 2
    assert "flat.obj" in capsys.readouterr().err


@needs_data
@pytest.mark.parametrize(("suit", "fraction"), [("casual", 0.2103), ("sport", 0.1269)])
def test_the_makehuman_suits_start_inside(suit, fraction):
    found = read_penetration_report(
        DATA / f"garments/female_{suit}suit01.mhclo",
        DATA / "bodies/makehuman_hm08_base.obj",
        scale=0.1,
        body_group="body",
    )
    assert len(found.inside) / len(found.garment.positions) == pytest.approx(fraction, abs=1e-4)
    assert not found.counts.clean


def test_a_garment_that_nobody_wears_is_no_clean_bill(tmp_path, capsys):
    body = write_obj(tmp_path / "box.obj", BODY.positions, BODY.triangles)
    away = write_obj(tmp_path / "away.obj", LOOSE + np.array([5.0, 0.0, 0.0]), TRIANGLES)
    assert main(["check", away, "--on", body]) == 0
    printed = capsys.readouterr().out
    assert "Nothing is wrong" not in printed
    assert "4.5 m" in printed
