"""Errors of numbers from pictures: as large as noise makes them, and the choice of folds."""

from dataclasses import replace

import numpy as np
import pytest

from clothsim.gradients.loss_of_numbers import problem_of
from clothsim.gradients.losses import Custom
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.picture_loss import Obstacle
from clothsim.gradients.pixel_losses import Normals
from clothsim.gradients.view_fit import Seen, ViewFit, errors_of
from clothsim.gradients.views import View
from clothsim.mesh.generators.shapes import sphere
from clothsim.scene.assembly.scene_world import world_of
from tests.benchmarks import views

SEEDS, STEP = 7, 0.01
OWN = np.zeros((0, 3))


@pytest.fixture(scope="module")
def skirt():
    """The fit of a coarse skirt without pictures, its drape and its derivatives by hem, length and bending."""
    mesh = views.meshed(0.06)
    scene = views.skirt(mesh, views.BENDING, duration=0.2)
    free = (views.FREE[0], *views.FREE[2:])
    problem = problem_of(scene, Custom(lambda x: (0.0, np.zeros_like(x))), free, mesh)
    fit = ViewFit(problem, (), world_of(problem.scene).triangles, problem.origin, np.zeros((3, 3)))
    x = fit.trace(problem.origin, OWN).cloth_positions()
    beside = [fit.trace(problem.origin + STEP * row, OWN).cloth_positions() for row in np.eye(3)]
    return fit, x, np.column_stack([(each - x).ravel() / STEP for each in beside])


def seen(fit, x, seed, grain):
    """The fit of two pictures of the drape with noise, and what is left of them."""
    rng = np.random.default_rng(seed)
    ball, faces = sphere(views.BALL["radius"], 3)
    obstacle, made = Obstacle(ball + views.BALL["position"], faces), []
    for name, camera in enumerate(views.cameras(2, (240, 180))):
        mask, normals = views.pictures(camera, x, fit.triangles, rng, (1.0, 5.0), grain)
        losses = {"mask": MaskBorder(camera, mask, obstacle=obstacle), "normals": Normals(camera, normals, 5.0)}
        made.append(View(str(name), camera, losses))
    fit = replace(fit, views=tuple(made))
    parts, at = fit.residuals(x), fit.problem.origin
    return fit, Seen(at, fit.total(parts, at), x, parts, OWN)


@pytest.mark.parametrize("grain", [0.0, 6.0])
def test_noise_moves_numbers_by_their_stated_errors(skirt, grain):
    """Also where the noise of neighbouring pixels is alike, which independent pixels would miss."""
    fit, x, moves = skirt
    by_blocks, independent = [], []
    for seed in range(SEEDS):
        own, end = seen(fit, x, seed, grain)
        _, hessian, blocks = own.linearised(end, moves)
        off = own.left(end, moves)
        by_blocks.append(off / errors_of(own.covariance(hessian, blocks)))
        independent.append(off / np.sqrt(np.diag(np.linalg.inv(hessian))))
    scatter, of_pixels = (np.sqrt(np.mean(np.square(each))) for each in (by_blocks, independent))
    assert np.mean(np.abs(by_blocks) < 2.0) > 5 / 6
    assert 0.6 < scatter < 1.5
    assert of_pixels > (2.0 if grain else 0.6)


def test_the_hessian_weighs_each_residual_by_its_pull_over_its_size(skirt):
    """psi(r)/r of Huber's function; and the gradients of all blocks add up to that of the pictures."""
    fit, x, moves = skirt
    own, end = seen(fit, x, 0, 0.0)
    gradient, hessian, blocks = own.linearised(end, moves)
    wanted = own.precision.copy()
    for each in end.parts:
        rows, values = each.jacobian @ moves, each.values
        pull = each.weights * np.clip(values, -each.huber, each.huber) / values
        wanted += np.einsum("i,ij,ik->jk", pull, rows, rows)
    np.testing.assert_allclose(hessian, wanted, rtol=1e-10)
    of_pictures = gradient - own.precision @ (end.at - own.mean)
    np.testing.assert_allclose(blocks.sum(axis=0), of_pictures, rtol=1e-9, atol=1e-12 * np.abs(of_pictures).max())


def test_normals_that_are_left_out_count_as_those_at_60_degrees(skirt):
    """|n - m| is 1 there, and the Huber function of it over the noise is h (r - h/2)."""
    fit, x, _ = skirt
    own, end = seen(fit, x, 0, 0.0)
    parts = tuple(replace(each, left_out=1.0) for each in end.parts)
    h, r = parts[1].huber, 1.0 / np.radians(5.0)
    assert own.folds_misfit(replace(end, parts=parts)) == pytest.approx(h * (r - h / 2), rel=1e-12)


def test_the_folds_that_pictures_show_fit_best(skirt):
    fit, x, _ = skirt
    own, end = seen(fit, x, 0, 0.0)
    turned = x @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    other = replace(end, positions=turned, parts=own.residuals(turned))
    assert own.folds_misfit(end) < 1.5 < own.folds_misfit(other)
    assert own.folds_misfit(replace(end, parts=())) == np.inf
