"""Numbers that a scene does not allow: an outcome of a trial in every search, and never its end."""

from types import SimpleNamespace

import numpy as np
import pytest

from clothsim import InputError
from clothsim.gradients import design, view_fit
from clothsim.gradients.clips.clip_fit import ClipFit

AT, VALUES = np.zeros(1), {"pattern.front.width": 0.3}
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def refusing(*given):
    raise InputError("bending_bias is 1e-5 N m, which no twisting stiffness gives.")


def of_pictures():
    return view_fit.ViewFit.seen(SimpleNamespace(scene_at=refusing), AT, np.zeros((0, 3)))


def of_a_clip():
    return ClipFit.run(SimpleNamespace(numbers=SimpleNamespace(scene_at=refusing), frames=(1,)), AT)


def of_a_pattern(monkeypatch):
    monkeypatch.setattr(design, "_area", lambda material: 1.0)
    numbers = SimpleNamespace(material_coordinates=lambda values: SQUARE)
    shaped = SimpleNamespace(numbers=numbers, with_numbers=refusing)
    return design._Search._run(SimpleNamespace(shaped=shaped), VALUES, None, {})


@pytest.mark.parametrize("search", [of_pictures, of_a_clip])
def test_a_refused_trial_is_infinitely_far_away(search):
    seen = search()
    assert seen.total == np.inf
    assert seen.failure.startswith("bending_bias is")


def test_a_refused_pattern_is_a_run_that_failed(monkeypatch):
    assert of_a_pattern(monkeypatch).failure.startswith("bending_bias is")
