"""The end of a search on a finer cloth: its derivatives, and what of the pictures follows it."""

import json

import numpy as np
import pytest
from sewing_patterns import panel, specification
from views import looking

from clothsim import load_scene
from clothsim.gradients.finer_cloth import halved
from clothsim.gradients.finer_fit import finer_fit, of_finer_cloth
from clothsim.gradients.loss_of_numbers import derivatives, problem_of
from clothsim.gradients.losses import Custom
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.run import traced
from clothsim.gradients.view_fit import ViewFit
from clothsim.gradients.views import View

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
    begun = np.asarray(weights @ x)
    assert finer.trace(towel.origin, begun).cloth_positions().shape == begun.shape
