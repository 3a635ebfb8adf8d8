"""Accuracy study on an analytic scene with known errors, and once on real processes."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from analytic_study import SHEET, A, B, C, Runners, answer, positions

from clothsim.base.errors import InputError
from clothsim.scene.assembly.meshes import cloth_shape
from clothsim.scene.scene import scene_from_text
from clothsim.study.evaluation import material_of, point_areas
from clothsim.study.parameters import written
from clothsim.study.report import answer_lines as reported
from clothsim.study.study import study_accuracy

PARAMETERS = ("dt", "cells")


def true_error(cells, dt, integrator="backward_euler"):
    """RMS over the base's points, weighted by area, of what is made up [mm]; from finer meshes."""
    dt = dt if integrator == "backward_euler" else 5 * dt**2
    shape = cloth_shape(SHEET.cloth, "cloth", SHEET.directory)
    areas = point_areas(material_of([shape.positions], [shape.triangles]))
    h = 1 / cells[0]
    off = positions(shape.positions, h, dt) - positions(shape.positions, 0, 0)
    return 1e3 * np.sqrt(areas @ (off**2).sum(axis=1) / areas.sum())


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    directory = tmp_path_factory.mktemp("study")
    runners = Runners()
    return study_accuracy(SHEET, directory, PARAMETERS, budget=1e9, workers=1, runners=runners), runners, directory


def test_every_error_is_the_true_one(made):
    result = made[0].result
    checked = [each for each in result["points"] if "cells" in each["settings"] and each["settings"]["cells"][0] >= 4]
    assert len(checked) >= 6
    for each in checked:
        expected = true_error(*(each["settings"].get(key, "backward_euler") for key in ("cells", "dt", "integrator")))
        assert each["error"] == pytest.approx(expected, abs=2 * result["reference"]["own_error"] + 1e-6)
        assert each["unit"] == "mm"
    assert result["reference"]["own_error"] < 0.01 * result["base"]["error"]


def test_slopes_bars_and_remainder(made):
    result = made[0].result
    parameters = result["parameters"]
    assert parameters["dt"]["observed_slope"] == pytest.approx(1, abs=1e-6)
    assert parameters["cells"]["observed_slope"] == pytest.approx(2, abs=1e-6)
    assert (parameters["dt"]["expected_slope"], parameters["cells"]["expected_slope"]) == (1, 2)
    shape = cloth_shape(SHEET.cloth, "cloth", SHEET.directory)
    areas = point_areas(material_of([shape.positions], [shape.triangles]))
    x, y, h, dt = shape.positions[:, 0], shape.positions[:, 1], 0.25, 0.02

    def rms(values):
        return 1e3 * np.sqrt(areas @ values**2 / areas.sum())

    assert parameters["dt"]["adds"] == pytest.approx(rms(B * dt * (1 + y) + C * h**2 * dt * x))
    assert parameters["cells"]["adds"] == pytest.approx(rms(A * h**2 * x + C * h**2 * dt * x))
    assert result["remainder"] == pytest.approx(rms(C * h**2 * dt * x), rel=1e-3)


def test_the_front_the_advice_and_half_the_error(made):
    result = made[0].result
    front = result["front"]
    assert [each["seconds"] for each in front] == sorted(each["seconds"] for each in front)
    assert [each["error"] for each in front] == sorted((each["error"] for each in front), reverse=True)
    for each in result["recommended"]:
        assert each["measured_error"] <= each["error"]
    better = result["half_the_error"]
    assert better["measured_error"] <= 0.5 * result["base"]["error"]
    assert "Half of that error" in " ".join(reported(result))


def test_the_three_files_are_there(made):
    study, _, directory = made
    assert json.loads((directory / "study.json").read_text())["front"] == study.result["front"]
    assert (directory / "study.png").stat().st_size > 10_000
    assert "Half of that error: " in str(study)
    assert "| dt |" in str(study)


def test_called_again_it_runs_nothing_and_reports_the_same(made):
    study, runners, directory = made
    again = Runners()
    second = study_accuracy(SHEET, directory, PARAMETERS, budget=1e9, workers=1, runners=again)
    assert not again.jobs
    assert second.result["reused"] >= len(runners.jobs)
    errors = [{each["key"]: each["error"] for each in some.result["points"]} for some in (study, second)]
    assert errors[0] == errors[1]


def test_points_that_are_broken_are_computed_again(made, tmp_path):
    """A cut archive ended in a BadZipFile."""
    shutil.copytree(made[2], tmp_path / "study")
    whole = sorted((tmp_path / "study/points").glob("*.npz"))[:3]
    for file, content in zip(whole, (b"", b"PK\x03\x04", whole[2].read_bytes()[:200]), strict=True):
        file.write_bytes(content)
    runners = Runners()
    study_accuracy(SHEET, tmp_path / "study", PARAMETERS, budget=1e9, workers=1, runners=runners)
    assert {Path(job.target) for job in runners.jobs} >= {*whole}
    assert all(len(file.read_bytes()) > 200 for file in whole)


def test_points_of_another_scene_are_not_reused(made, tmp_path):
    (tmp_path / "study.json").write_text((made[2] / "study.json").read_text())
    runners = Runners()
    other = replace(SHEET, run={"duration": 0.4})
    result = study_accuracy(other, tmp_path, PARAMETERS, budget=1e9, workers=1, runners=runners).result
    assert result["reused"] == 0
    assert runners.jobs


def test_without_a_run_of_two_parameters_no_remainder_is_reported(tmp_path):
    result = study_accuracy(SHEET, tmp_path, ["dt"], budget=1e9, workers=1, runners=Runners()).result
    assert result["remainder"] is None
    assert "not measured" in (tmp_path / "study.md").read_text()


def test_an_output_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made a directory"):
        study_accuracy(SHEET, tmp_path / "file", ["dt"], budget=1e9, workers=1, runners=Runners())


def test_what_does_not_fit_is_not_run_and_named(tmp_path):
    runners = Runners(lambda job: answer(job, seconds=25.0))
    result = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=100.0, workers=1, runners=runners).result
    ran = {each["label"] for each in result["points"]}
    assert "cells +1" in ran  # the coarser cells show that it fits
    assert "fine" not in ran
    assert "it would take about" in result["left_out"]["fine"]
    assert not ran & set(result["left_out"])


def test_a_small_budget_says_how_much_is_needed(tmp_path):
    def dear(job):
        """Seconds that grow with the vertices: finer cells do not fit."""
        cells = scene_from_text(job.scene).cloth["cells"][0]
        return answer(job, seconds=25.0 * (cells / 4) ** 2)

    result = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=60.0, workers=1, runners=Runners(dear)).result
    headline = result["headline"]
    assert (headline["known"], headline["status"], headline["error"]) == (False, "unfinished", None)
    assert headline["missing"] == ["cells"]
    assert headline["certificate"] == pytest.approx(10.001)
    assert headline["needed_seconds"] > 100.0 + 100.0  # finer cells, and with them a finer dt
    assert "it would take about" in result["left_out"]["cells +1"]
    assert result["recommended"] == result["front"] == []
    assert not (tmp_path / "study.png").exists()
    assert "continues from the runs so far" in (tmp_path / "study.md").read_text()


def only(*allowed):
    """A runner for which every job but those with such settings fails."""

    def reply(job):
        cells, dt = scene_from_text(job.scene).cloth["cells"][0], scene_from_text(job.scene).solver["dt"]
        return answer(job) if (cells, dt) in allowed else {"failed": "It fell apart."}

    return Runners(reply)


def test_without_any_finer_run_no_error_is_reported(tmp_path):
    done = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=100.0, workers=1, runners=only((4, 0.02), (2, 0.02)))
    headline = done.result["headline"]
    assert (headline["known"], headline["status"], headline["error"]) == (False, "unfinished", None)
    assert headline["missing"] == ["dt", "cells"]
    assert headline["so_far"] == {}
    assert done.result["base"]["error"] is None
    assert done.result["front"] == done.result["recommended"] == []
    kept = json.loads((tmp_path / "study.json").read_text())["points"]
    assert {"base", "cells -1"} <= {each["label"] for each in kept}


def test_a_parameter_without_a_finer_run_is_reported_as_unknown(tmp_path):
    runners = only((4, 0.02), (4, 0.01), (4, 0.005))
    result = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=1e9, workers=1, runners=runners).result
    assert result["parameters"]["cells"]["adds"] is None
    headline = result["headline"]
    assert (headline["status"], headline["error"], headline["missing"]) == ("unfinished", None, ["cells"])
    assert headline["needed_seconds"] is None  # it failed: no budget helps
    assert headline["so_far"]["dt"] == pytest.approx(result["parameters"]["dt"]["adds"])
    assert "the finer run of cells is not a data point" in " ".join(reported(result))


def test_a_capped_solve_is_no_data_point(tmp_path):
    def capped(job):
        output = answer(job)
        if '"dt": 0.04' in job.scene:
            output["failed"] = "2 of its steps had to be repeated, first step 1: dt 0.04 s: the iterations ran out."
        return output

    result = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=1e9, workers=1, runners=Runners(capped)).result
    assert not [each for each in result["points"] if each["settings"].get("dt") == 0.04]
    assert [each for each in result["failed"] if each["settings"].get("dt") == 0.04]
    assert "is not a data point: 2 of its steps" in (tmp_path / "study.md").read_text()


def test_a_scene_that_fails_itself_is_one_sentence(tmp_path):
    def fails(job):
        return {"failed": "It fell apart."}

    with pytest.raises(InputError, match="The scene itself is not a data point: It fell apart"):
        study_accuracy(SHEET, tmp_path, PARAMETERS, workers=1, runners=Runners(fails))


def test_chaotic_folds_are_compared_by_their_heights(tmp_path):
    phases = {}

    def folds(job):
        """Each settings' waves have another phase, so places differ and heights do not."""
        output = answer(job)
        with np.load(job.target) as arrays:
            kept = dict(arrays)
        phase = phases.setdefault((job.scene, job.seed), 2.4 * len(phases))  # golden angle: no two are close
        kept["positions"] = (
            kept["positions"] + [[0.0, 0.3, 0.0]] * np.sin(phase + np.arange(len(kept["rest_0"])))[:, None]
        )
        np.savez(job.target, **kept)
        return output

    result = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=1e9, workers=1, runners=Runners(folds)).result
    assert result["chaotic"]
    assert result["twins_differ"] > 10
    assert "histograms of heights" in result["measure"]
    assert result["invariants"]["drape_coefficient"]["seeds"] >= 5
    assert result["base"]["error"] == pytest.approx(true_error([4, 2], 0.02), rel=0.25)


@pytest.mark.parametrize(
    ("change", "parameters", "budget", "sentence"),
    [
        ({}, ["cellls"], 10.0, "parameters has no key 'cellls'"),
        ({}, ["d_hat"], 10.0, "nothing to refine: the scene has no contact"),
        ({}, None, -1.0, "budget must be above 0"),
        ({"cloth": {"mesh": "rectangle", "cells": [0, 4]}}, None, 10.0, "cells"),
    ],
)
def test_bad_input_is_one_sentence(change, parameters, budget, sentence, tmp_path):
    with pytest.raises(InputError) as error:
        study_accuracy(replace(SHEET, **change), tmp_path, parameters, budget, runners=Runners())
    assert sentence in error.value.sentence
    assert "\n" not in error.value.sentence


def test_real_processes(tmp_path):
    scene = replace(
        SHEET,
        cloth={**SHEET.cloth, "cells": [2, 2]},
        effects={**SHEET.effects, "pins": {"select": "left"}},
        run={"duration": 0.04},
    )
    result = study_accuracy(scene, tmp_path, ["dt", "tolerance"], budget=900.0, workers=1).result
    assert not result["chaotic"]
    assert {each["label"] for each in result["points"]} >= {"base", "dt +1", "dt -1", "tolerance +1"}
    assert all(each["seconds"] > 0 for each in result["points"])
    assert result["seconds"] < 900
    assert 0.8 < result["parameters"]["dt"]["observed_slope"] < 1.3


def test_values_for_people():
    assert written("dt", 1 / 60) == "dt 1/60 s"
    assert written("dt", 0.0123) == "dt 0.0123 s"
    assert written("cells", [40, 20]) == "cells 40x20"
    assert written("d_hat", 0.002) == "d_hat 2 mm"


def test_before_the_scene_came_to_its_end_nothing_is_said_about_the_budget(tmp_path):
    """What was spent until then is mostly the start of processes: 260 s were asked for of a study of 49."""
    runners = Runners(lambda job: None)
    result = study_accuracy(SHEET, tmp_path, PARAMETERS, budget=10.0, workers=1, runners=runners).result
    headline = result["headline"]
    assert (headline["status"], headline["missing"], headline["needed_seconds"]) == ("unfinished", ["base"], None)
    assert "--budget 20s" in " ".join(reported(result))
