"""Normals and depths of pixels: a sphere in closed form, derivatives on a drape in contact, what is left out."""

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, falling_scene, halved_errors
from views import looking, seen

from clothsim import InputError
from clothsim.gradients.camera import Obstacle
from clothsim.gradients.pixel_losses import Depth, Normals
from clothsim.gradients.run import traced
from clothsim.mesh.generators.shapes import rectangle, slab, sphere
from clothsim.scene.paths import override

CAMERA = looking((1.0, 0.3, 0.2), focal=500.0)


def ball_seen(camera, radius):
    """Depths and normals of a ball at the origin, in closed form; nan beside it."""
    v, u = np.indices((camera.height, camera.width))
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    a, b, c = (rays**2).sum(axis=1), rays @ camera.position, camera.position @ camera.position - radius**2
    with np.errstate(invalid="ignore"):
        depths = (-b - np.sqrt(b**2 - a * c)) / a
    normals = (camera.position + depths[:, None] * rays) @ camera.rotation.T / radius
    return depths.reshape(v.shape), normals.reshape(*v.shape, 3)


def test_a_coarse_ball_has_the_normals_and_depths_of_a_smooth_one():
    ball, triangles = sphere(0.2, 2)
    depths, normals = ball_seen(CAMERA, 0.2)
    found = Normals(CAMERA, normals, noise=1.0).residuals(ball, triangles)
    assert np.sqrt((found.values**2).mean()) < 1.0  # degrees, where triangles are off by 8
    assert found.left_out < 0.1
    flat, smooth = (Depth(CAMERA, depths, refinements=k).residuals(ball, triangles) for k in (0, 1))
    off = [5e-3 * np.sqrt((each.values**2).mean()) for each in (flat, smooth)]
    assert off[1] < 0.35 * off[0]
    assert off[1] < 2e-3


def test_a_drape_in_contact():
    """Pixels found anew: by positions, and by Young's modulus through the run."""
    scene = falling_scene(ELASTIC | CONTACT)
    trace = traced(scene)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    camera = looking((0.4, -0.3, 1.2), (0.0, 0.0, 0.2), focal=250.0)
    bent = x + 0.01 * np.sin(9.0 * x[:, [1, 2, 0]])
    part, depths = seen(camera, bent[triangles])
    v, u = np.indices(part.shape)
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    measured = np.where(part == 0, depths / np.linalg.norm(rays, axis=1).reshape(part.shape), 0.0)
    both = [Depth(camera, measured), Normals(camera, (part == 0)[:, :, None] * np.array([0.2, -0.3, -1.0]))]
    d = np.random.default_rng(4).standard_normal(x.shape)
    for loss in both:
        by_x = loss.evaluate(x, triangles)[1]
        assert (
            halved_errors(np.vdot(by_x, d), lambda h, own=loss: own.evaluate(x + h * d, triangles)[0], 1e-6)[1] < 1e-6
        )
    gradient = trace.gradient(both)
    assert gradient.value == sum(loss.evaluate(x, triangles)[0] for loss in both) > 0.0
    sides = [traced(override(scene, f"cloth.youngs_modulus={1e5 + h}")).gradient(both).value for h in (10, -10)]
    assert float(gradient["cloth.youngs_modulus"]) == pytest.approx((sides[0] - sides[1]) / 20, rel=1e-5)


def test_what_is_hidden_or_of_another_fold_is_left_out():
    sheet, triangles = rectangle((0.6, 0.4), (12, 8))
    camera = looking((0.0, -0.01, 2.0), focal=700.0)
    towards = np.where(seen(camera, sheet[triangles])[0][:, :, None] == 0, [0.0, 0.0, -1.0], 0.0)
    bar, faces = slab((0.1, 0.8, 0.02))
    body = Obstacle(bar + np.array([0.05, 0.0, 0.3]), faces)
    free, hidden = (Normals(camera, towards, obstacle=o).residuals(sheet, triangles) for o in (Obstacle(), body))
    assert free.left_out == 0.0
    assert 0.1 < hidden.left_out < 0.3
    turned = towards * 1.0
    turned[:, :160] = -turned[:, :160, 2:] * [1.0, 0.0, -0.1]
    assert Normals(camera, turned).residuals(sheet, triangles).left_out == pytest.approx(0.5, abs=0.03)
    for back in (sheet, sheet[:, [1, 0, 2]]):  # both sides: also with the triangles turned over
        assert Normals(camera, towards).residuals(back, triangles).mean < 1e-3


def test_what_is_no_picture():
    sheet, triangles = rectangle((0.6, 0.4), (2, 2))
    camera = looking((0.0, -0.01, 2.0))
    for kind, shape in ((Normals, (240, 320, 3)), (Depth, (240, 320))):
        for picture in (np.zeros(shape), np.full(shape, np.nan), np.ones((3, *shape[1:]))):
            with pytest.raises(InputError):
                kind(camera, picture).residuals(sheet, triangles)
        with pytest.raises(InputError, match="noise"):
            kind(camera, np.ones(shape), noise=-1.0).residuals(sheet, triangles)
        with pytest.raises(InputError):
            kind(camera, np.ones(shape)).residuals(sheet + np.array([9.0, 0.0, 0.0]), triangles)
    with pytest.raises(InputError, match="60 degrees"):
        Normals(camera, np.tile([0.0, 0.0, 1.0], (240, 320, 1))).residuals(sheet, triangles)
