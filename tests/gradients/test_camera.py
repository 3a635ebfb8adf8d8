"""The camera's conventions, and key points against central differences."""

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, falling_scene, halved_errors

import clothsim
from clothsim import InputError
from clothsim.gradients.camera import Camera, KeyPoints
from clothsim.gradients.run import traced
from clothsim.mesh.body import rotation_matrix
from clothsim.scene.paths import override

TURN = rotation_matrix(np.array([0.3, -1.9, 0.4]))
CENTRE = np.array([2.0, 0.5, 0.8])
POINTS = CENTRE + np.random.default_rng(0).uniform([-0.5, -0.5, 1.0], [0.5, 0.5, 3.0], (20, 3)) @ TURN


def camera():
    return Camera(640, 480, (500.0, 520.0), (320.0, 238.0), TURN, CENTRE)


def test_pixels_and_their_derivatives():
    made = camera()
    local = (POINTS - CENTRE) @ TURN.T
    homogeneous = local @ np.array([[500.0, 0, 320], [0, 520, 238], [0, 0, 1]]).T  # K [R | t]
    np.testing.assert_allclose(made.project(POINTS), homogeneous[:, :2] / homogeneous[:, 2:], rtol=1e-12)
    d, weights = np.random.default_rng(1).standard_normal((20, 3)), np.random.default_rng(2).standard_normal((20, 2))
    found = np.einsum("kp,kpc,kc", weights, made.jacobians(POINTS), d)
    assert halved_errors(found, lambda h: np.vdot(weights, made.project(POINTS + h * d)), 1e-6)[1] < 1e-8


def test_cameras_of_blender_and_colmap():
    """The middle of the picture and a pixel to the right and below, of the same camera in each convention."""
    world = np.eye(4)
    world[:3, 3] = 1.0, 2.0, 3.0  # looks down -z of the scene, y up
    blender = Camera.of_blender(640, 480, 2 * np.arctan(0.5), world)
    assert blender.project([[1.0, 2.0, 1.0]])[0] == pytest.approx([319.5, 239.5])
    assert blender.project([[1.1, 1.9, 1.0]])[0] == pytest.approx([319.5 + 32, 239.5 + 32])
    half_turn = [0.0, 1.0, 0.0, 0.0]  # about x: y down, looks along -z
    rotation = np.diag([1.0, -1.0, -1.0])
    colmap = Camera.of_colmap("SIMPLE_PINHOLE", 640, 480, [640.0, 320, 240], half_turn, -rotation @ [1.0, 2.0, 3.0])
    for name in ("focal", "principal", "rotation", "position"):
        np.testing.assert_allclose(getattr(blender, name), getattr(colmap, name), atol=1e-12)


def test_what_is_no_camera():
    good = {"width": 4, "height": 3, "focal": (5, 5), "principal": (2, 1), "rotation": np.eye(3), "position": (0, 0, 0)}
    for name, value in (
        ("focal", (5, -5)),
        ("rotation", -np.eye(3)),
        ("position", (0, 0)),
        ("width", 0),
        ("width", np.nan),
    ):
        with pytest.raises(InputError):
            clothsim.Camera(**good | {name: value})
    with pytest.raises(InputError):
        Camera(**good).project([[0.0, 0.0, -1.0]])
    for model, params in (("SIMPLE_RADIAL", [5.0, 2.0, 1.0, 0.1]), ("PINHOLE", [5.0, 2.0, 1.0])):
        with pytest.raises(InputError, match=model):  # distortion, as many parameters as of PINHOLE; one too few
            Camera.of_colmap(model, 4, 3, params, [1, 0, 0, 0], [0, 0, 0])
    for name, value in (("noise", 0.0), ("noise", -1.0), ("huber", 0.0), ("huber", -1.0)):
        with pytest.raises(InputError, match=name):
            KeyPoints(camera(), np.array([0]), np.zeros((1, 2)), **{name: value}).evaluate(POINTS, np.zeros((0, 3)))
    with pytest.raises(InputError):
        KeyPoints(camera(), np.array([0, 99]), np.zeros((2, 2))).evaluate(POINTS, np.zeros((0, 3)))


def test_key_points_of_a_drape_in_contact():
    """By the positions, and by Young's modulus through the run; one of the points is an outlier."""
    scene = falling_scene(ELASTIC | CONTACT)
    trace = traced(scene)
    x, rows = trace.cloth_positions(), np.array([0, 5, 14, 30, 35])
    view = Camera(640, 480, (600.0, 600.0), (319.5, 239.5), np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 2.0))
    seen = view.project(x[rows]) + np.random.default_rng(3).standard_normal((5, 2)) + 20.0 * np.eye(5)[:, :2]
    loss = KeyPoints(view, rows, seen, noise=1.5)
    value, by_x = loss.evaluate(x, np.zeros((0, 3)))
    d = np.random.default_rng(4).standard_normal(x.shape)
    assert halved_errors(np.vdot(by_x, d), lambda h: loss.evaluate(x + h * d, None)[0], 1e-7)[1] < 1e-6
    gradient = trace.gradient(loss)
    assert gradient.value == value

    def of_stiffer(h):
        return traced(override(scene, f"cloth.youngs_modulus={1e5 + h}")).gradient(loss).value

    assert halved_errors(float(gradient["cloth.youngs_modulus"]), of_stiffer, 20.0)[1] < 1e-6
