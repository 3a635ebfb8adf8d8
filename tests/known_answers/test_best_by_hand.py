"""The cheapest fixed settings of a short scene, against all of the grid that is as cheap."""

from clothsim.scene import paths
from tests.known_answers import best_by_hand as module
from tests.known_answers.best_by_hand import best_by_hand
from tests.known_answers.error_reference import Refinement, distance, reference_scene, solution
from tests.known_answers.error_scenes import ERROR_SCENES


def test_the_cheapest_run_with_the_error_is_found(monkeypatch):
    scene = paths.replace(ERROR_SCENES["twisted"], "run.duration", 0.08)
    reference = solution(reference_scene(scene, Refinement(4, 2, 1, 1e-3)))
    runs = []
    monkeypatch.setattr(module, "solution", lambda some: runs.append(solution(some)) or runs[-1])
    best = best_by_hand(scene, 5e-4, reference)
    enough = [run.seconds for run in runs if distance(run, reference) <= 5e-4]
    assert len(runs) > len(enough) >= 1
    assert best.seconds == min(enough)
    assert best.error <= 5e-4


def test_no_fixed_settings_have_no_error(monkeypatch):
    scene = paths.replace(ERROR_SCENES["twisted"], "run.duration", 0.04)
    reference = solution(reference_scene(scene, Refinement(2, 2, 1, 1e-3)))
    monkeypatch.setattr(module, "STEPS", (1,))
    assert best_by_hand(scene, 1e-12, reference) is None
