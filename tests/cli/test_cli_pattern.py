"""`clothsim check` and `clothsim dress` with sewing patterns of JSON and DXF."""

import json

import numpy as np
import pytest
from dxf_files import sewing_text, write_drawing
from PIL import Image
from sewing_patterns import panel, skirt, specification

import clothsim
from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.cli.arguments import meshed
from clothsim.files.patterns.pattern_file import read_pattern
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "skirt.json").write_text(json.dumps(skirt()))
    return tmp_path


def test_check_lists_edges_and_seams_and_draws_their_numbers(place, capsys):
    assert main(["check", "skirt.json", "-o", "edges.png"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "  front: 10.0 x 20.0 cm; edges [cm] 0: 10.0, 1: 20.0, 2: 10.0, 3: 20.0"
    assert lines[3] == "  seam 0: edge 1 of front to edge 3 of back, 20.0 and 20.0 cm"
    assert lines[-1] == "Nothing is wrong."
    with Image.open(place / "edges.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 20


def test_check_of_a_drawing_needs_no_seams_and_dress_does(place, capsys):
    pytest.importorskip("ezdxf")
    middles = write_drawing(place / "skirt.dxf", pattern_of(skirt()))
    assert main(["check", "skirt.dxf", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["errors"] == []
    assert main(["dress", "skirt.dxf", "--on", "shirt"]) == 2
    assert "skirt.toml" in capsys.readouterr().err
    (place / "seams.toml").write_text(sewing_text(pattern_of(skirt()), middles))
    assert main(["check", "skirt.dxf", "--seams", "seams.toml"]) == 0
    assert "seam 1: edge 3 of front to edge 1 of back" in capsys.readouterr().out


def test_check_finds_a_pattern_of_the_package(place, capsys):
    assert main(["check", "tunic", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["errors"] == []
    assert any(note.startswith("seam 0: ") for note in found["notes"])


def test_check_names_a_panel_that_crosses_itself(place, capsys):
    bow = specification({"bow": panel([[0, 0], [10, 20], [10, 0], [0, 20]])})
    (place / "bow.json").write_text(json.dumps(bow))
    assert main(["check", "bow.json", "--json"]) == 1
    assert "bow" in json.loads(capsys.readouterr().out)["errors"][0]


@pytest.mark.parametrize(
    "words",
    [
        ["check", "skirt.json", "--body"],
        ["check", "skirt.json", "--part", "0:3"],
        ["check", "skirt.obj", "--seams", "a.toml"],
        ["dress", "skirt.json", "--on", "shirt", "--seams", "a.toml"],
    ],
)
def test_options_of_others_are_refused(place, words):
    (place / "skirt.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert main(words) == 2


@pytest.mark.parametrize(("option", "coarse"), [([], True), (["--no-coarse-sewing"], False)])
def test_sewing_on_a_coarser_mesh_can_be_left_out(place, monkeypatch, option, coarse):
    given = {}

    def refused(*inputs, **settings):
        given.update(settings)
        raise InputError("Not sewn.")

    monkeypatch.setattr(clothsim, "dress", refused)
    assert main(["dress", "skirt.json", "--on", "shirt", *option]) == 2
    assert given["coarse_sewing"] is coarse


def test_a_drawing_without_ezdxf_names_the_extra(place, monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "ezdxf", None)
    (place / "a.dxf").write_text("0\nEOF\n")
    assert main(["dress", "a.dxf", "--on", "shirt", "--seams", "a.toml"]) == 2
    (place / "a.toml").write_text("")
    assert main(["dress", "a.dxf", "--on", "shirt"]) == 2
    assert "clothsim[dxf]" in capsys.readouterr().err


def test_an_upper_case_ending_is_a_drawing(place):
    pytest.importorskip("ezdxf")
    pattern = pattern_of(skirt())
    (place / "SKIRT.toml").write_text(sewing_text(pattern, write_drawing(place / "SKIRT.DXF", pattern)))
    assert read_pattern(place / "SKIRT.DXF").stitches == pattern.stitches


@pytest.mark.parametrize(("size", "halvings"), [("2cm", 0), ("2cm", 1), ("15mm", 2)])
def test_the_mesh_of_a_pattern_is_divided_as_often_as_the_cloth_that_was_dressed(place, size, halvings):
    mesh = mesh_pattern(pattern_of(skirt()), {"2cm": 0.02, "15mm": 0.015}[size], halvings)
    for _ in range(halvings):
        mesh, _parents = mesh.halved()
    cloth = clothsim.Cloth(mesh.positions, mesh.triangles, rest=mesh.material_coordinates)
    scene = clothsim.Scene(cloth, effects={"membrane": {}})
    found = meshed(place / "skirt.json", size, scene)
    assert np.array_equal(found.material_coordinates, mesh.material_coordinates)


def test_the_mesh_of_a_pattern_that_was_not_dressed_is_of_its_size(place):
    scene = clothsim.Scene(clothsim.Cloth(np.eye(3), [[0, 1, 2]]), effects={"membrane": {}})
    found = meshed(place / "skirt.json", "2cm", scene)
    assert len(found.triangles) == len(mesh_pattern(pattern_of(skirt()), 0.02).triangles)
