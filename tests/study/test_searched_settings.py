"""Study of a scene with solver.error: one search, whose settings are the base."""

import json

import pytest
from analytic_study import SHEET, Runners

from clothsim import simulate
from clothsim.scene import paths
from clothsim.study import study as module
from clothsim.study.evaluation import FOLDER
from clothsim.study.study import searched_settings, study_accuracy
from tests.known_answers.error_scenes import ERROR_SCENES
from tests.known_answers.error_table import without_step

ASKED = 5e-3


@pytest.fixture(scope="module")
def scene():
    short = paths.replace(without_step(ERROR_SCENES["landing"]), "run.duration", 0.08)
    return paths.replace(short, "solver.error", ASKED)


@pytest.fixture
def searches(monkeypatch):
    """The scenes for which a search was made."""
    made = []
    monkeypatch.setattr(module, "simulate", lambda scene, folder: made.append(scene) or simulate(scene, folder))
    return made


def test_a_scene_without_a_requested_error_stays_as_it_is(tmp_path):
    scene = ERROR_SCENES["landing"]
    assert searched_settings(scene, tmp_path, 1.0) == (scene, None)


def test_a_search_is_made_once_and_its_settings_are_those_of_its_run(scene, searches, tmp_path):
    (tmp_path / FOLDER).mkdir()
    found, statement = searched_settings(scene, tmp_path, 100.0)
    again = searched_settings(scene, tmp_path, 100.0)
    assert len(searches) == 1
    assert again[0].to_text() == found.to_text()
    assert again[1] == statement
    assert statement["asked"] == ASKED
    chosen = simulate(scene, tmp_path / "run").summary["certificate"]["error_estimate"]["chosen"]
    assert found.solver["dt"] == chosen["dt"]
    assert found.solver["integrator"] == chosen["integrator"]
    assert "error" not in found.solver
    assert [list(keys["cells"]) for keys in found.cloths] == chosen["cells"]
    assert found.effects["body_contact"]["d_hat"] == chosen["d_hat"]["body_contact"]
    searched_settings(paths.replace(scene, "solver.error", 2 * ASKED), tmp_path, 100.0)
    assert len(searches) == 2


def test_a_study_varies_the_settings_that_were_found(scene, searches, tmp_path):
    study = study_accuracy(scene, tmp_path, ("dt",), budget=1e6, workers=1, runners=Runners())
    assert len(searches) == 1
    assert study.result["searched"]["asked"] == ASKED
    chosen = json.loads((tmp_path / FOLDER / module.SEARCHED_NAME).read_text())["resolution"]
    frame = 1 / scene.run_settings.frames_per_second
    assert study.result["base"]["settings"]["dt"] == pytest.approx(frame / chosen[0])
    assert "solver.error" in str(study)


def test_a_study_without_a_search_says_none(tmp_path):
    study = study_accuracy(SHEET, tmp_path, ("dt",), budget=1e9, workers=1, runners=Runners())
    assert study.result["searched"] is None
