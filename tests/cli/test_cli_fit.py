"""`clothsim fit` in this process: printed text, output files, and bad input in one sentence."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fitting_cases import capsule_figure, in_file, tube_garment

from clothsim import InputError
from clothsim.cli import main
from clothsim.garments import stages
from clothsim.garments.fit import pipeline
from clothsim.mesh.generators.shapes import rectangle

BODY = capsule_figure(segments=10)
TUBE = tube_garment(0.096, height=0.12, cells=(10, 3))
SCENE = """
[cloth]
mesh = "rectangle"
cells = [2, 2]
[effects.inertia]
"""


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    monkeypatch.setattr("clothsim.garments.pictures.SIZE", (64, 96))
    monkeypatch.setattr(stages, "FIT_DRAPE", replace(stages.FIT_DRAPE, run={"duration": 0.02, "frames_per_second": 50}))
    monkeypatch.setattr(pipeline, "FALLING", 1.0)
    in_file(tmp_path, "tube.obj", TUBE.positions, TUBE.triangles)
    in_file(tmp_path, "body.obj", BODY.positions, BODY.triangles)
    in_file(tmp_path, "flat.obj", *rectangle(size=(1, 1), cells=(2, 2)))
    in_file(tmp_path, "nan.obj", np.where(np.arange(len(BODY.positions))[:, None] == 3, np.nan, 1) * BODY.positions,
            BODY.triangles)  # fmt: skip
    in_file(tmp_path, "tubenan.obj", np.where(np.arange(len(TUBE.positions))[:, None] == 3, np.nan, 1) * TUBE.positions,
            TUBE.triangles)  # fmt: skip
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    (tmp_path / "bodiless.toml").write_text(SCENE)
    (tmp_path / "broken.mhclo").write_text("obj_file tube.obj\nverts 0\n1 2\n")


def test_a_fit_prints_its_stages_and_leaves_its_files(tmp_path, capsys):
    assert main(["fit", "tube.obj", "--to", "body.obj", "-o", "out", "--fabric", "cotton"]) == 0
    output = capsys.readouterr().out
    for word in ("garment", "refine", "simulate", "completed", "fitted    0 vertices inside", "stretch", "moved"):
        assert word in output
    assert (tmp_path / "out" / "fit.png").read_bytes().startswith(b"\x89PNG")
    assert "fit.png, fitted.obj" in output


def test_json_is_the_summary_and_nothing_else(capsys):
    assert main(["fit", "tube.obj", "--to", "body.obj", "--json", "--no-picture", "--quiet"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["status"] == "completed"
    assert [stage["name"] for stage in summary["stages"]] == ["garment", "refine", "simulate"]


def test_an_earlier_fit_is_replaced_only_when_asked(tmp_path, capsys):
    words = ["fit", "tube.obj", "--to", "body.obj", "-o", "out", "--no-picture", "--quiet"]
    assert main(words) == 0
    before = (tmp_path / "out" / "fitted.obj").read_bytes()
    assert main([*words, "--fabric", "denim"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "out" / "fitted.obj").read_bytes() == before
    assert main([*words, "--overwrite"]) == 0


def test_a_fit_that_fails_names_the_place_and_exits_with_one(tmp_path, capsys):
    in_file(tmp_path, "sheet.obj", *rectangle(size=(0.5, 0.5), cells=(6, 6)))
    assert main(["fit", "sheet.obj", "--to", "body.obj", "--no-picture", "--quiet"]) == 1
    output = capsys.readouterr().out
    assert output.startswith("failed: No deflation of body.obj frees the garment")
    assert "worst near (" in output


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["none.obj", "--to", "body.obj"], "none.obj"),
        (["tube.obj", "--to", "none.obj"], "none.obj"),
        (["tube.obj", "--to", "body.obj", "--made-for", "none.obj"], "none.obj"),
        (["none.mhclo", "--to", "body.obj"], "none.mhclo"),
        (["none.toml", "--to", "body.obj"], "none.toml"),
        (["broken.mhclo", "--to", "body.obj"], "broken.mhclo, line 3"),
        (["tube.obj"], "--to"),
        (["tube.obj", "--to", "body.obj", "--part", "1-9"], "'1-9'"),
        (["tube.obj", "--to", "body.obj", "--part", "9:1"], "vertices[1]"),
        (["tube.obj", "--to", "body.obj", "--part", "0:4000"], "4000"),
        (["tube.obj", "--to", "body.obj", "--scale", "-1"], "'-1'"),
        (["tube.obj", "--to", "body.obj", "--scale", "nan"], "'nan'"),
        (["tube.obj", "--to", "body.obj", "--weld", "wide"], "'wide'"),
        (["tube.obj", "--to", "body.obj", "--fabric", "steel"], "'steel'"),
        (["tube.obj", "--to", "body.obj", "--body-group", "skin"], "skin"),
        (["tube.obj", "--to", "flat.obj"], "encloses no volume"),
        (["tube.obj", "--to", "body.obj", "--made-for", "flat.obj"], "encloses no volume"),
        (["bodiless.toml", "--to", "body.obj"], "has no body"),
        (["tube.obj", "--to", "empty.obj"], "empty.obj"),
        (["empty.obj", "--to", "body.obj"], "empty.obj"),
        (["tube.obj", "--to", "points.obj"], "points.obj"),
        (["points.obj", "--to", "body.obj"], "points.obj"),
        (["tube.obj", "--to", "nan.obj"], "nan.obj"),
        (["tubenan.obj", "--to", "body.obj"], "tubenan.obj"),
        (["body.obj", "--to", "body.obj"], "are the same mesh"),
        (["body.obj", "--made-for", "body.obj", "--to", "nan.obj"], "nan.obj"),
        (["tube.obj", "--to", "body.obj", "-o", "tube.obj"], "cannot be made a directory"),
        (["tube.obj", "--to", "."], "."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_bad_input_is_a_sentence_and_a_remedy(words, sentence, capsys):
    assert main(["fit", *words, "--no-picture"]) == 2
    output = capsys.readouterr().err
    lines = output.strip().splitlines()
    assert len(lines) == 2
    assert sentence in lines[0]
    assert "Traceback" not in output
    assert lines[1]


@pytest.mark.parametrize("there", [False, True], ids=["nothing", "a directory of that name"])
def test_a_garment_may_be_an_installed_scene_by_name(tmp_path, monkeypatch, there):
    """Also where an earlier run has left a directory of that name."""
    monkeypatch.chdir(tmp_path)
    given = []

    def recorded(file):
        given.append(file.name)
        raise InputError("Far enough.")

    if there:
        (tmp_path / "shirt").mkdir()
    monkeypatch.setattr("clothsim.garments.fitted.worn_in_scene", recorded)
    assert main(["fit", "shirt", "--to", "shirt_large", "-o", "out", "--quiet", "--no-picture"]) == 2
    assert given == ["shirt.toml"]
