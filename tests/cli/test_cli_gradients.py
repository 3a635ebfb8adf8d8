"""`clothsim gradient`, `recover` and `design` in this process: printed text, files, and bad input in one sentence."""

import json
import re

import numpy as np
import pytest
from command_line import refused
from sewing_patterns import panel, specification

import clothsim
from clothsim import load_scene
from clothsim.cli import main
from clothsim.files.meshes.readers.obj import write_obj
from clothsim.gradients.run import traced
from clothsim.gradients.scene_of_pattern import shaped_scene

SCENE = """
[cloth]
mesh = "rectangle"
size = [0.2, 0.2]
cells = [3, 3]
youngs_modulus = 4e4
rotation_degrees = [3.0, 2.0, 0.0]
[effects.membrane]
[effects.bending]
model = "hinge"
[effects.gravity]
[effects.pins]
select = [0, 3]
[solver]
linear = "superlu"
dt = 0.05
[run]
duration = 0.1
frames_per_second = 20
"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sheet.toml").write_text(SCENE)


def test_a_gradient_in_json_and_in_a_file(capsys):
    words = ["gradient", "sheet.toml", "--loss", "height", "--wrt", "youngs_modulus"]
    words += ["--wrt", "force,effects.gravity.acceleration"]
    assert main([*words, "--json", "-o", "gradient.npz"]) == 0
    content = json.loads(capsys.readouterr().out)
    arrays = np.load("gradient.npz")
    assert set(arrays) == set(content["gradient"])
    assert arrays["force"].shape == (16, 3)
    assert content["gradient"]["youngs_modulus"] == float(arrays["youngs_modulus"]) > 0
    assert abs(content["newton_error"]) < 1e-9
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "d/d youngs_modulus" in out
    assert "16 rows" in out


def test_a_recovery_leaves_a_run_and_its_numbers(capsys, tmp_path):
    assert (
        main(["run", "sheet.toml", "-o", "true", "--no-picture", "--quiet", "--set", "cloth.youngs_modulus=3e4"]) == 0
    )
    capsys.readouterr()
    words = ["recover", "sheet.toml", "--target", "true", "--free", "youngs_modulus", "--starts", "1", "-o", "found"]
    assert main([*words, "--json"]) == 0
    out, err = capsys.readouterr()
    content = json.loads(out)
    assert content == json.loads((tmp_path / "found" / "recovery.json").read_text())
    assert content["values"]["cloth.youngs_modulus"] == pytest.approx(3e4, rel=1e-3)
    assert content["loss"]["name"] == "Distance"
    assert json.loads((tmp_path / "found" / "summary.json").read_text())["status"] == "completed"
    assert err.count("start 1 of 1: cloth.youngs_modulus") > 3
    refused(capsys, *words)  # there is a run in "found"


@pytest.fixture
def towel(tmp_path):
    """A panel of a pattern file that hangs from its top edge."""
    (tmp_path / "towel_specification.json").write_text(json.dumps(specification({"towel": panel()})))
    text = SCENE.replace('"rectangle"', '"towel_specification.json"').replace("[0.2, 0.2]", "0.05")
    text = text.replace("cells = [3, 3]", "").replace("[3.0, 2.0, 0.0]", "[90, 0, 0]").replace("[0, 3]", '"top"')
    (tmp_path / "towel.toml").write_text(text)


@pytest.mark.usefixtures("towel")
def test_a_hem_is_designed(capsys, tmp_path):
    words = ["design", "towel.toml", "--free", "pattern.towel.height", "--stretch", "1.1"]
    assert main([*words, "--hem", "towel.0=-0.02", "--json", "-o", "designed"]) == 0
    out, err = capsys.readouterr()
    content = json.loads(out)
    assert content == json.loads((tmp_path / "designed" / "design.json").read_text())
    assert content["met"] is True
    assert content["aims"].keys() == {"hem", "stretch"}
    assert 0.213 < content["values"]["pattern.towel.height"] < 0.222  # it stretches under its weight
    assert content["intersecting_pairs"] == 0
    assert err.count("tolerances off") == content["runs"] - 1
    assert json.loads((tmp_path / "designed" / "summary.json").read_text())["status"] == "completed"
    assert main([*words, "--hem", "towel.0=-0.02", "--runs", "1", "--quiet"]) == 1  # not met
    assert "pattern.towel.height" in capsys.readouterr().out
    refused(capsys, *words, "--hem", "towel.9=0.1")
    refused(capsys, *words, "--hem", "0.1")
    refused(capsys, *words, "--girth", "0.1=wide")
    refused(capsys, *words[:-2])  # nothing to design for
    refused(capsys, "design", "sheet.toml", "--free", "pattern.towel.height", "--stretch", "1.1")


@pytest.mark.usefixtures("towel")
def test_the_height_of_a_panel_from_a_pattern_file_and_from_a_run(capsys, tmp_path):
    shaped = shaped_scene(load_scene(tmp_path / "towel.toml"))
    path = "pattern.towel.height"
    trace = traced(shaped.with_numbers({path: 0.21}))
    write_obj(tmp_path / "longer.obj", trace.cloth_positions(), trace.session.built.world.triangles)
    words = ["--target", "longer.obj", "--free", path, "--starts", "1", "--json", "--quiet"]
    assert main(["recover", "towel.toml", *words]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["values"][path] == pytest.approx(0.21, abs=1e-5)
    assert content["loss"]["name"] == "Distance"
    assert clothsim.simulate(shaped.scene, tmp_path / "run").status == "completed"
    of_run = ["run", "--pattern", "towel_specification.json", "--size", "5cm"]
    assert main(["recover", *of_run, *words]) == 0
    assert json.loads(capsys.readouterr().out)["values"][path] == pytest.approx(0.21, abs=1e-5)
    refused(capsys, "recover", "run", "--pattern", "towel_specification.json", *words[:-2])  # another size


@pytest.mark.parametrize(
    "words",
    [
        ["gradient", "sheet.toml", "--loss", "beauty", "--wrt", "start"],
        ["gradient", "sheet.toml", "--loss", "girth=wide", "--wrt", "start"],
        ["gradient", "sheet.toml", "--loss", "height", "--wrt", ","],
        ["gradient", "sheet.toml", "--loss", "height", "--wrt", "body.position"],
        ["gradient", "sheet.toml", "--loss", "height", "--wrt", "start", "-o", "gradient.txt"],
        ["gradient", "sheet.toml", "--wrt", "start"],
        ["recover", "sheet.toml", "--target", "missing.obj", "--free", "density"],
        ["recover", "sheet.toml", "--target", "sheet.toml", "--free", "density"],
        ["recover", "sheet.toml", "--target", ".", "--free", "density"],
        ["recover", "sheet.toml", "--target", "sheet.toml", "--free", "pattern.front.width"],
    ],
)
def test_bad_input(capsys, words):
    refused(capsys, *words)


def test_a_gradient_by_key_frames_does_not_add_times_and_values(capsys, tmp_path):
    (tmp_path / "shrinking.toml").write_text(
        SCENE.replace("[effects", "shrinkage_warp = [[0, 0], [1, 0.1]]\n[effects", 1)
    )
    words = ["gradient", str(tmp_path / "shrinking.toml"), "--loss", "height", "--wrt", "cloth.shrinkage_warp"]
    assert main(words) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "shrinkage_warp" in line)
    assert re.search(r"times \[[^\[,]+, [^,]+\].*values \[[^,]+, [^,]+\]", line)
    assert "sum" not in line
