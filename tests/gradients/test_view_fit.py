"""Errors of numbers from pictures: as large as noise makes them, and the choice of folds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sewing_patterns import panel, specification
from views import looking

from clothsim import load_scene
from clothsim.geometry.intersection.crossings import crossings
from clothsim.gradients.camera import Obstacle
from clothsim.gradients.loss_of_numbers import derivatives, problem_of
from clothsim.gradients.losses import Custom
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.pixel_losses import Normals
from clothsim.gradients.run import traced
from clothsim.gradients.scene_of_pattern import halved
from clothsim.gradients.view_fit import Seen, ViewFit, errors_of, finer_fit, finer_positions, of_finer_cloth
from clothsim.gradients.views import View
from clothsim.mesh.generators.shapes import rectangle, sphere
from clothsim.mesh.refinement import refined
from clothsim.mesh.world import SurfaceRows
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


SCENE = """
[cloth]
mesh = "towel_specification.json"
size = 0.07
youngs_modulus = 4e4
rotation_degrees = [90, 0, 0]
[effects.membrane]
[effects.gravity]
[effects.pins]
select = "top"
[solver]
linear = "superlu"
dt = 0.05
tolerance = 1e-9
[run]
duration = 0.1
frames_per_second = 20
"""


@pytest.fixture(scope="module")
def towel(tmp_path_factory):
    """The problem of a towel's height and stiffness, with the mean of its heights for the loss."""
    folder = tmp_path_factory.mktemp("towel")
    (folder / "towel_specification.json").write_text(json.dumps(specification({"towel": panel()})))
    (folder / "towel.toml").write_text(SCENE)
    loss = Custom(lambda x: (float(x[:, 2].mean()), np.tile([0.0, 0.0, 1.0 / len(x)], (len(x), 1))))
    return problem_of(load_scene(folder / "towel.toml"), loss, ["pattern.towel.height", "youngs_modulus"])


def test_derivatives_of_the_finer_cloth_are_differences_of_its_runs(towel):
    def run(at):
        return traced(halved(towel.scene_at(at))[0], towel.stiffness)

    at = towel.origin
    found = derivatives(towel.values(at), run(at).gradient(towel.loss), towel.shaped, halvings=1)
    for k, path in enumerate(towel.paths):
        step = 1e-4 * np.eye(len(at))[k]
        sides = [towel.loss.evaluate(run(at + sign * step).cloth_positions(), None)[0] for sign in (1, -1)]
        difference = (sides[0] - sides[1]) / 2e-4
        assert found[k] * towel.values(at)[path] == pytest.approx(difference, rel=1e-5)


def test_pictures_of_the_finer_cloth(towel):
    """Its vertices, their derivatives, its triangles, and labels of four triangles for one."""
    camera = looking((0.1, -0.7, 0.05), np.zeros(3))
    mask = np.zeros((camera.height, camera.width))
    mask[40:80, 40:80] = 1.0
    losses = {"mask": MaskBorder(camera, mask), "label towel": MaskBorder(camera, mask, label=np.array([0, 2]))}
    trace = traced(towel.scene)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    fit = ViewFit(towel, (View("from here", camera, losses),), triangles, towel.origin, np.zeros((2, 2)))
    finer, weights = finer_fit(fit, towel.origin)
    assert (finer.halvings, len(finer.triangles)) == (1, 4 * len(triangles))
    assert weights.shape == (finer.triangles.max() + 1, len(x))
    np.testing.assert_array_equal(finer.views[0].losses["label towel"].label, [0, 1, 2, 3, 8, 9, 10, 11])
    moves = np.random.default_rng(0).normal(size=(x.size, 2))
    expected = weights @ moves[:, 1].reshape(-1, 3)
    np.testing.assert_allclose(of_finer_cloth(weights, moves)[:, 1].reshape(-1, 3), expected)
    begun = finer_positions(fit, finer, x)
    np.testing.assert_array_equal(begun[: len(x)], x)
    assert finer.trace(towel.origin, begun).cloth_positions().shape == begun.shape


def test_a_run_of_the_finer_cloth_begins_without_intersections(skirt):
    """Under a level sheet, which a smooth surface through the vertices of an arch would cross."""
    fit, _, _ = skirt
    flat, faces = rectangle((5.0, 3.0), (5, 3))
    arch = flat - np.outer((flat[:, 0] - flat[:, 0].mean()) ** 2 - 0.25, [0.0, 0.0, 1.0])
    layers = np.concatenate([arch, flat + np.array([0.0, 0.0, 0.05])])
    triangles = np.concatenate([faces, faces + len(flat)])
    weights, fine = refined(triangles, len(layers))
    coarse, finer = (replace(fit, triangles=each) for each in (triangles, fine))

    def pairs(x, triangles):
        return crossings(x, [SurfaceRows("cloth", "cloth", slice(0, len(x)), triangles, True)])

    assert not pairs(layers, triangles)
    assert not pairs(finer_positions(coarse, finer, layers), fine)
    assert pairs(weights @ layers, fine)
