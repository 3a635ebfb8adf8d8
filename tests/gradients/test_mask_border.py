"""Outlines of masks: bias of a polygon's contour, derivatives on a drape in contact, bodies in front, labels."""

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, falling_scene, halved_errors
from views import looking, seen

from clothsim import InputError
from clothsim.gradients.camera import Obstacle
from clothsim.gradients.losses import Custom
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.run import traced
from clothsim.mesh.generators.shapes import rectangle, slab, sphere
from clothsim.scene.paths import override

NOTHING = np.zeros((0, 3, 3))


def shadow(camera, positions, triangles, others=NOTHING):
    return seen(camera, positions[triangles], others)[0] == 0


def test_the_contour_of_a_coarse_sphere_lies_where_the_smooth_one_does():
    """Of a polygon it lies inside, by h^2/(8 R) at most: 1.7 pixels here."""
    ball, triangles = sphere(0.2, 2)
    camera = looking((1.0, 0.3, 0.2), focal=500.0)
    mask = shadow(camera, *sphere(0.2, 5))
    bias = []
    for refinements in (0, 2):
        found = MaskBorder(camera, mask, refinements=refinements).residuals(ball, triangles)
        bias.append(float(found.weights @ found.values / found.weights.sum()))
    assert bias[0] < -0.7
    assert abs(bias[1]) < 0.2
    assert found.left_out == 0.0
    around = 2 * np.pi * 500 * 0.2 / np.sqrt(camera.position @ camera.position - 0.04)
    assert found.weights.sum() == pytest.approx(2 * around, rel=0.03)  # both ways, each by its length


def test_found_anew_on_a_convex_body():
    """Central differences with the correspondence found anew: it switches, and the loss jumps a little."""
    ball, triangles = sphere(0.2, 2)
    camera = looking((1.0, 0.3, 0.2), focal=500.0)
    loss = MaskBorder(camera, shadow(camera, *sphere(0.2, 5)))
    x = 1.03 * ball
    for direction, bar in ((x, 5e-3), (np.tile([0.1, 0.5, 0.3], (len(x), 1)), 3e-2)):
        derivative = np.vdot(loss.evaluate(x, triangles)[1], direction)
        step = 1e-3 * direction
        sides = [loss.evaluate(x + sign * step, triangles)[0] for sign in (1, -1)]
        assert (sides[0] - sides[1]) / 2e-3 == pytest.approx(derivative, rel=bar)
        share = loss.matched(x + step, triangles).switched(loss.matched(x - step, triangles))
        assert 0.0 < share < 0.1
    assert loss.matched(x, triangles).switched(loss.matched(x, triangles)) == 0.0


def test_a_drape_in_contact():
    """With the correspondence held: by the positions, and by Young's modulus through the run."""
    scene = falling_scene(ELASTIC | CONTACT)
    trace = traced(scene)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    body = Obstacle(*_ball(trace))
    camera = looking((0.9, -0.8, 0.7), (0.0, 0.0, 0.2), focal=250.0)
    bent = x + 0.01 * np.sin(9.0 * x[:, [1, 2, 0]])
    loss = MaskBorder(camera, shadow(camera, bent, triangles, body.corners), noise=1.5, obstacle=body)
    held = loss.matched(x, triangles)
    assert held.residuals(x).mean == loss.evaluate(x, triangles)[0]
    d = np.random.default_rng(4).standard_normal(x.shape)
    derivative = np.vdot(loss.evaluate(x, triangles)[1], d)
    assert halved_errors(derivative, lambda h: held.residuals(x + h * d).mean, 1e-6)[1] < 1e-6
    gradient = trace.gradient(loss)

    own = Custom(lambda y: (held.residuals(y).mean, np.zeros_like(y)))
    sides = [traced(override(scene, f"cloth.youngs_modulus={1e5 + h}")).gradient(own).value for h in (10, -10)]
    assert float(gradient["cloth.youngs_modulus"]) == pytest.approx((sides[0] - sides[1]) / 20, rel=1e-6)


def _ball(trace):
    body = trace.session.built.world.bodies[0]
    rows = trace.session.built.world.body_slices[0]
    world = trace.session.built.world
    return trace.steps[-1].end.positions[rows] + world.origin, body.triangles


def test_a_body_in_front():
    """A bar before a sheet: the borders that it makes are left out, and what is left fits."""
    sheet, triangles = rectangle((0.6, 0.4), (12, 8))
    camera = looking((0.0, -0.01, 2.0), focal=700.0)
    bar, faces = slab((0.1, 0.8, 0.02))
    bar = bar + np.array([0.05, 0.0, 0.3])
    mask = shadow(camera, sheet, triangles, bar[faces])
    alone = MaskBorder(camera, mask).residuals(sheet, triangles)
    found = MaskBorder(camera, mask, obstacle=Obstacle(bar, faces)).residuals(sheet, triangles)
    assert np.abs(alone.values).max() > 5.0
    assert np.abs(found.values).max() < 1.0
    assert 0.2 < found.left_out < 0.5
    behind = Obstacle(bar - [0.0, 0.0, 0.6], faces)  # nothing is hidden: nothing is left out
    assert MaskBorder(camera, mask, obstacle=behind).residuals(sheet, triangles).left_out == 0.0


def test_labels_have_outlines_of_their_own():
    sheet, triangles = rectangle((0.6, 0.4), (12, 8))
    left = np.flatnonzero(sheet[triangles].mean(axis=1)[:, 0] < 0)
    camera = looking((0.1, -0.4, 2.0), focal=700.0)
    mask = seen(camera, sheet[triangles[left]], np.delete(sheet[triangles], left, axis=0))[0] == 0
    assert np.abs(MaskBorder(camera, mask, label=left).residuals(sheet, triangles).values).max() < 1.0
    assert np.abs(MaskBorder(camera, mask).residuals(sheet, triangles).values).max() > 20.0


def test_an_inner_fold_is_no_border_of_the_mask():
    """Two sheets of one cloth, the nearer one within the other's outline."""
    sheet, triangles = rectangle((0.6, 0.4), (12, 8))
    both = np.concatenate([sheet, 0.5 * sheet + [0.0, 0.0, 0.2]])
    twice = np.concatenate([triangles, triangles + len(sheet)])
    camera = looking((0.0, -0.01, 2.0), focal=700.0)
    loss = MaskBorder(camera, shadow(camera, both, twice))
    assert loss.contour(both, twice)[0].points[:, 2].max() < 1e-12
    assert np.abs(loss.residuals(both, twice).values).max() < 1.0


@pytest.mark.parametrize(
    "mask",
    [
        np.ones((3, 4), bool),
        np.zeros((240, 320)),
        np.ones((240, 320)),
        np.full((240, 320), 65535),
        np.full((240, 320), "a"),
    ],
)
def test_what_is_no_mask(mask):
    with pytest.raises(InputError, match="mask"):
        MaskBorder(looking((0.0, -0.1, 2.0)), mask).residuals(*rectangle((0.6, 0.4), (2, 2)))


def test_what_is_not_seen():
    mask = np.zeros((240, 320), bool)
    mask[100:140, 100:200] = True
    sheet, triangles = rectangle((0.6, 0.4), (2, 2))
    with pytest.raises(InputError, match="in front of the camera"):
        MaskBorder(looking((0.0, -0.1, -2.0), (0.0, 0.0, -4.0)), mask).residuals(sheet, triangles)
    with pytest.raises(InputError, match="contour"):
        MaskBorder(looking((0.0, -0.1, 2.0), (0.0, 5.0, 0.0)), mask).residuals(sheet, triangles)
    with pytest.raises(InputError, match="triangle 99"):
        MaskBorder(looking((0.0, -0.1, 2.0)), mask, label=np.array([99])).residuals(sheet, triangles)
