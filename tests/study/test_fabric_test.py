"""Tests of a fabric by a method, and the command `clothsim test`."""

import json

import pytest

from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.study import fabric_test


def test_a_drape_has_a_table_and_specimens():
    done = fabric_test.fabric_tested({"fabric": "denim"}, "cusick", 2, 0.015)
    assert [row["name"] for row in done.rows] == ["drape coefficient", "n_eff", "sd r"]
    mean = sum(each["coefficient"] for each in done.specimens) / 2
    assert done.rows[0]["mean"] == pytest.approx(100 * mean)
    assert done.rows[0]["sd"] > 0
    assert len(done.specimens[0]["radii"]) == 360


@pytest.mark.parametrize(("method", "rows"), [("tensile", 10), ("bias", 5), ("shear", 10)])
def test_a_strip_has_a_force_at_each_stretch(method, rows):
    done = fabric_test.fabric_tested({"fabric": "wool"}, method, 1)
    forces = [row["mean"] for row in done.rows]
    assert len(forces) == rows
    assert forces[:5] == sorted(forces[:5])
    assert done.rows[0]["sd"] is None


@pytest.mark.parametrize(("method", "size"), [("pilling", 6e-3), ("cusick", 0.05)])
def test_what_cannot_be_tested_is_refused(method, size):
    with pytest.raises(InputError):
        fabric_test.fabric_tested({"fabric": "wool"}, method, 1, size)


def test_the_command_leaves_numbers_and_a_picture(tmp_path, capsys):
    words = ["test", "denim", "--lays", "1", "--size", "15mm", "--json", "-o", str(tmp_path / "out")]
    assert main([*words, "--set", "bending_stiffness=4e-5"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / "out" / "test.json").read_text())
    assert document["values"][0]["name"] == "drape coefficient"
    assert (tmp_path / "out" / "drape.png").is_file()


@pytest.mark.parametrize("method", fabric_test.METHODS)
def test_the_command_knows_every_method(method, capsys):
    assert main(["test", "denim", "--method", method, "--lays", "none"]) == 2
    assert "--lays" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["denin"], ["denim", "--set", "weight"], ["denim", "--method", "pilling"]])
def test_bad_input_is_reported_in_two_lines(words, capsys):
    assert main(["test", *words]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) <= 3
