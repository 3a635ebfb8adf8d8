"""The command `body`: a file, a table, measures that are refused."""

import json

import pytest

from clothsim.cli import main
from clothsim.cli.body_command import OPTIONS, POSES
from clothsim.files import read_mesh
from clothsim.mesh.generators.mannequin.generator import POSES as KNOWN_POSES
from clothsim.mesh.generators.mannequin.measures import MEASURES


def test_its_options_are_the_measures():
    assert [name for name, _ in OPTIONS] == list(MEASURES)
    assert tuple(KNOWN_POSES) == POSES


def test_a_body_is_written_once(tmp_path, capsys):
    file = tmp_path / "me.obj"
    words = ["body", "--height", "168cm", "--inside-leg", "0.76", "-o", str(file)]
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["residuals"]["inside_leg"] == pytest.approx(0, abs=2e-5)
    assert found["keys"]["height"] == 1.68
    assert read_mesh(file).positions[:, 2].max() == pytest.approx(1.68, abs=1e-4)
    assert main(words) == 2
    assert main([*words, "--overwrite", "--chest", "140cm"]) == 0
    assert "chest at the end of the range" in capsys.readouterr().out


@pytest.mark.parametrize("wrong", [["--chest", "wide"], ["--chest", "-1"], ["--height", "30cm"], ["-o", "me.stl"]])
def test_bad_words_are_refused(tmp_path, wrong, capsys):
    assert main(["body", "-o", str(tmp_path / "me.obj"), *wrong]) == 2
    assert not list(tmp_path.iterdir())


def test_a_measure_in_inches(tmp_path, capsys):
    words = ["body", "-o", str(tmp_path / "me.obj"), "--height", "66in", "--json"]
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["measures"]["height"] == pytest.approx(66 * 0.0254, abs=1e-3)
    assert main([*words, "--overwrite", "--chest", "38 inches"]) == 2
    assert "--chest 96cm" in capsys.readouterr().err
