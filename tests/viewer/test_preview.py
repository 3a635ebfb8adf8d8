"""Live preview of a model of drapes: predictions, their exact verdict and place, and the served page."""

import numpy as np
import pytest

from clothsim import InputError
from clothsim.mesh.generators.mannequin.generator import JOINTS, mannequin, template
from clothsim.scene.assembly.drape_model import DrapeModel, Prediction, Predictor, family
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene

VARIED = ["body.radius", "cloth.density"]


def sheet(**body):
    """A sheet over a ball."""
    return Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.4], "cells": [4, 4], "position": [0, 0, 0.17], "density": 0.2},
        body={"name": "ball", "mesh": "sphere", "radius": 0.15} | body,
        effects={"inertia": {}, "membrane": {}, "gravity": {}, "body_contact": {}},
        solver={"dt": 0.02},
        run={"duration": 0.04, "frames_per_second": 25},
    )


def model_of(scene, slope, inputs=("body.radius",), same=(), low=0.13, high=0.17):
    """A model that raises the cloth of a scene by `slope` per standardised input."""
    world = world_of(scene)
    mean = (world.cloths[0].positions + world.origin).ravel()
    rise = np.tile([0.0, 0.0, 1.0], len(mean) // 3)[:, None]
    names = np.array(inputs)
    copies, sources = np.array([key for key, _ in same], np.str_), np.array([key for _, key in same], np.str_)
    weights = np.vstack([[[0.0]], np.full((len(names), 1), slope)])
    one = np.ones(len(names))
    box = low * one, high * one, 0.5 * (low + high) * one, 0.01 * one
    return DrapeModel(family(scene, [*inputs, *copies]), names, copies, sources, *box, weights, mean, rise)


@pytest.fixture
def file(tmp_path):
    return model_of(sheet(), 0.0, same=[("cloth.density", "body.radius")]).write(tmp_path / "model.npz")


def test_the_prediction_is_that_of_the_model_on_the_body_of_its_inputs(file):
    shown = Predictor.of_model(sheet(), file)
    small, large = shown.predicted([0.14]), shown.predicted([0.17])
    assert np.array_equal(small.cloth, shown.model.positions([0.14]))
    assert np.linalg.norm(large.bodies[0], axis=1) == pytest.approx(0.17)
    assert (small.pairs, small.verdict) == (0, "free of intersections")
    assert large.pairs > 0  # the ball touches the sheet
    assert large.verdict.startswith(f"{large.pairs} ")
    assert shown.values([0.15]) == {"body.radius": 0.15, "cloth.density": 0.15}


def test_a_prediction_inside_the_body_is_not_clear():
    positions = np.zeros((25, 3))
    positions[:, :2] = 0.01 * np.indices((5, 5)).reshape(2, 25).T
    shown = Prediction(positions, (), (), "", 25)
    assert not shown.clean
    assert shown.verdict.startswith("25 of 25 vertices")


def test_a_predicted_sheet_within_the_ball_is_counted(tmp_path):
    scene = sheet(radius=0.6)
    file = model_of(scene, 0.0, low=0.5, high=0.7).write(tmp_path / "model.npz")
    made = Predictor.of_model(scene, file).predicted([0.6])
    assert (made.crossings, made.inside) == ((), 25)


def test_the_place_is_the_part_of_the_mannequin_with_most_pairs(tmp_path):
    body, _ = mannequin()
    forearm = JOINTS.index("left_elbow")
    centre = body[template().weights.argmax(axis=1) == forearm].mean(axis=0)
    cloth = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [2, 2], "position": centre.tolist()}
    scene = Scene(cloth=cloth, body={"mesh": "mannequin"}, effects={"membrane": {}})
    file = model_of(scene, 0.0, ("body.height",), low=1.69, high=1.71).write(tmp_path / "model.npz")
    assert Predictor.of_model(scene, file).predicted([1.7]).place == "at the left elbow"


def test_a_model_of_another_garment_is_refused(file):
    with pytest.raises(InputError):
        Predictor.of_model(sheet(mesh="capsule"), file)


@pytest.mark.parametrize("inputs", [[np.nan], [], [0.15, 0.15], ["wide"], None])
def test_inputs_that_are_no_numbers_are_refused(file, inputs):
    with pytest.raises(InputError, match="inputs"):
        Predictor.of_model(sheet(), file).predicted(inputs)


def test_a_certificate_is_not_shown_beside_another_garment(tmp_path, monkeypatch):
    pytest.importorskip("viser")
    from clothsim import simulate
    from clothsim.viewer.preview import CLEAR, preview

    def moved_meanwhile(*arguments):
        run = simulate(*arguments)
        page.show([0.14])
        return run

    page = preview(sheet(), model_of(sheet(), 0.0).write(tmp_path / "model.npz"), port=18_782)
    try:
        monkeypatch.setattr("clothsim.viewer.preview.simulate", moved_meanwhile)
        assert "completed" in page.drape()
        assert page.controls["verdict"].content.startswith("Prediction: ")
        assert tuple(page.nodes["cloths"][0].color) == CLEAR
        assert not page.controls["drape"].disabled
        with pytest.raises(InputError):
            page.show([np.nan])
        assert page.inputs == [0.14]
    finally:
        page.close()


def test_the_page_shows_predictions_and_drapes(tmp_path):
    pytest.importorskip("viser")
    from clothsim.viewer.preview import CLEAR, CROSSING, DRAPED, preview

    scene = sheet()
    page = preview(scene, model_of(scene, -0.01).write(tmp_path / "model.npz"), port=18_781)
    try:
        cloth, body = page.nodes["cloths"][0], page.nodes["bodies"][0]
        assert not page.show([0.15]).crossings
        assert tuple(cloth.color) == CLEAR
        assert np.allclose(np.linalg.norm(body.vertices, axis=1), 0.15, atol=1e-6)
        assert page.show([0.17]).crossings  # the sheet is .02 m lower, the ball higher
        assert tuple(cloth.color) == CROSSING
        page.show([0.15])
        before = np.array(cloth.vertices)
        assert "free of intersections" in page.drape()
        assert tuple(cloth.color) == DRAPED
        assert not np.array_equal(cloth.vertices, before)
        assert not page.controls["drape"].disabled
    finally:
        page.close()
