"""Rendered truth in a small form: pictures of a skirt fit the drape that they were made of, and not another."""

from clothsim.gradients.camera import Obstacle
from clothsim.gradients.run import traced
from clothsim.gradients.views import read_views
from clothsim.mesh.generators.shapes import sphere
from tests.benchmarks import views


def test_pictures_fit_the_drape_that_they_show(tmp_path):
    scene = views.skirt(views.meshed(0.06, **views.TRUTH), views.BENDING, duration=0.1)
    made = views.cameras(2, (160, 120))[1:]
    ball, faces = sphere(views.BALL["radius"], 3)
    obstacle = Obstacle(ball + views.BALL["position"], faces)
    trace = traced(scene)
    (view,) = read_views(views.write_views(tmp_path, made, trace), {}, obstacle)
    x, triangles = trace.cloth_positions(), trace.session.built.world.triangles
    for loss in view.losses.values():
        true, longer = (loss.residuals(y, triangles) for y in (x, x * [1.0, 1.0, 1.05]))
        assert (true.values**2).mean() < 1.5**2
        assert longer.mean > 1.05 * true.mean


def test_the_true_numbers_are_those_of_the_pattern():
    shaped = views.meshed(0.1, **views.TRUTH).pattern.panels
    truth = views.true_values(views.TRUTH)
    for name in ("front", "back"):
        low = shaped[name].vertices[:2]
        assert abs(low[1, 0] - low[0, 0] - views.HEM * truth[f"pattern.{name}.flare"]) < 1e-12
        assert abs(shaped[name].extent[1] - truth["pattern.front+back.height"]) < 1e-12
