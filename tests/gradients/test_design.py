"""Design of a skirt of two panels: a hem at a height and a girth by Bezier control points (G-8), and its parts."""

import numpy as np
import pytest
from small_skirt import LENGTH, hanging_skirt, skirt_mesh

from clothsim import InputError
from clothsim.gradients.design import _Search, design, mirror_matrix
from clothsim.gradients.design_aims import HemAt, Measured, StretchBelow
from clothsim.gradients.losses import Girth, Height
from clothsim.gradients.pattern_numbers import PatternNumbers
from clothsim.gradients.scene_of_pattern import shaped_scene

CONTROLS = [f"pattern.{panel}.edge[0].control[{k}].y" for panel in ("front", "back") for k in (0, 1)]
FREE = ["pattern.front+back.height", "pattern.front+back.flare", *CONTROLS]


@pytest.fixture(scope="module")
def mesh():
    return skirt_mesh(True, 0.07)


def test_a_hem_and_a_girth_by_control_points(mesh):
    """Six parameters; the end is certified, and hangs so when it is run again."""
    scene = hanging_skirt(mesh, steps=4)
    shaped = shaped_scene(scene, mesh)
    hem = np.unique(np.concatenate([shaped.edge_rows(panel, 0) for panel in ("front", "back")]))
    aims = [HemAt(hem, -0.225, 1e-3), Measured(Girth(-0.2), 0.56, 2e-3), StretchBelow(1.1)]
    seen = []
    found = design(scene, aims, FREE, mesh, progress=seen.append)
    assert len(seen) == len(found.runs) <= 40
    assert found.runs[0].aims[0] > 50
    assert found.best.met
    assert found.best.intersecting_pairs == 0
    assert abs(found.best.newton_error) < 1e-6
    assert found.best.stretch < 1.12
    rest = np.asarray(found.scene.cloths[0]["mesh"].rest)
    np.testing.assert_allclose(rest, shaped.numbers.material_coordinates(found.best.values), atol=1e-12)


def test_the_area_of_the_fabric_is_a_bound(mesh):
    """A longer skirt is asked for than the fabric is enough for, its width free to give way."""
    scene = hanging_skirt(mesh, steps=1)
    hem = shaped_scene(scene, mesh).edge_rows("front", 0)
    free = ["pattern.front+back.height", "pattern.front+back.width"]
    area = (0.24 + 0.30) * LENGTH / 100
    found = design(scene, [HemAt(hem, -0.25, 1e-3)], free, mesh, largest_area=area, most_runs=6)
    assert found.best.area <= area * (1 + 1e-6)
    assert found.best.loss < found.runs[0].loss
    assert found.best.values[free[0]] > 0.24
    assert found.best.values[free[1]] < 0.30


def test_the_slope_of_a_run_is_that_of_differences_of_its_loss(mesh):
    """By the shape in which the skirt hangs, and by the rest shape that the stretch is measured from."""
    shaped = shaped_scene(hanging_skirt(mesh, steps=1), mesh)
    paths, numbers = ("pattern.front+back.height", CONTROLS[0]), shaped.numbers
    hem = shaped.edge_rows("front", 0)
    origin = np.array([numbers.value(path) for path in paths])
    search = _Search(shaped, (HemAt(hem, -0.2, 1e-2), StretchBelow(1.0001)), paths, origin, np.eye(2))
    direction = np.array([1.0, -0.7])
    middle, more, less = (search._run(search.values(step * direction), None, {}) for step in (0.0, 1e-5, -1e-5))
    assert min(middle.aims) > 0
    assert middle.slope @ direction == pytest.approx((more.loss - less.loss) / 2e-5, rel=1e-3)
    assert search.by_area(np.zeros(2))[0] == pytest.approx(0.24 + 0.30, rel=1e-3)  # mean widths of two panels


@pytest.mark.parametrize("aim", [HemAt([0, 2], 0.1, 0.2), Measured(Girth(0.2), 0.5, 0.1), StretchBelow(1.01)])
def test_derivatives_of_aims(aim):
    rng = np.random.default_rng(3)
    x = np.array([[0, 0, 0], [1, 0, 0.1], [0, 1, 0.3], [1.1, 1.2, 0.5]]) + 0.01 * rng.standard_normal((4, 3))
    triangles = np.array([[0, 1, 2], [1, 3, 2]])
    if isinstance(aim, StretchBelow):
        flat = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
        aim = aim.cut_to(flat[triangles])
    value, derivative = aim.evaluate(x, triangles)
    direction = rng.standard_normal(x.shape)
    sides = [aim.evaluate(x + sign * 1e-6 * direction, triangles)[0] for sign in (1, -1)]
    assert value > 0
    assert float(np.vdot(derivative, direction)) == pytest.approx((sides[0] - sides[1]) / 2e-6, rel=1e-6)


def test_values_of_aims():
    """Of a sheet that is stretched by 5 %; of a hem 0.3 and 0.1 off; of a measure 2 off."""
    triangles, x = np.array([[0, 1, 2], [1, 3, 2]]), np.array([[0.0, 0, 0], [1, 0, 0.1], [0, 1, 0.3], [1, 1, 0.5]])
    flat = x[:, :2][triangles]
    plane = x * [1.05, 1.0, 0.0]
    assert StretchBelow(1.02, 0.01).cut_to(flat).evaluate(plane, triangles)[0] == pytest.approx(9.0)
    assert StretchBelow(1.06, 0.01).cut_to(flat).evaluate(plane, triangles)[0] == 0.0
    assert HemAt([1, 2], 0.0, 0.1).evaluate(x, triangles)[0] == pytest.approx(5.0)
    measure = Measured(Height(), 0.0, 0.5)
    height = Height().evaluate(x, triangles)[0]
    assert measure.evaluate(x, triangles)[0] == pytest.approx((height / 0.5) ** 2)


def test_numbers_of_a_pattern(mesh):
    numbers = PatternNumbers(mesh)
    values = {path: numbers.value(path) for path in FREE}
    assert values["pattern.front+back.height"] == pytest.approx(0.24)
    assert values["pattern.front+back.flare"] == 1.0
    np.testing.assert_allclose(numbers.material_coordinates(values), mesh.material_coordinates, atol=1e-15)
    wider = numbers.material_coordinates({"pattern.front.width": 0.33})
    faces = mesh.faces["front"]
    np.testing.assert_allclose(np.ptp(wider[faces][..., 1]), 0.33)
    np.testing.assert_allclose(wider[mesh.faces["back"]], mesh.material_coordinates[mesh.faces["back"]])
    moved = {CONTROLS[0]: -0.03, "pattern.front.vertex[0].y": -0.01}
    field = numbers.field(moved, CONTROLS[0])
    step = numbers.material_coordinates({**moved, CONTROLS[0]: -0.02}) - numbers.material_coordinates(moved)
    np.testing.assert_allclose(0.01 * field, step, atol=1e-12)  # a Bezier curve is linear in its control points
    assert np.abs(field[faces]).max() > 0.2
    assert not field[mesh.faces["back"]].any()


def test_a_pattern_that_is_cut_again_has_its_control_points_where_the_numbers_say(mesh):
    """In the plane of the panel, though a curve is given relative to its ends; also where an end has moved."""
    numbers = PatternNumbers(mesh)
    place = numbers.number(CONTROLS[0])
    cut = numbers.pattern({CONTROLS[0]: -0.02, "pattern.front.vertex[0].y": -0.01}).panels["front"]
    edge = cut.edges[place.edge]
    points = edge.curve.points(cut.vertices[edge.start], cut.vertices[edge.end])
    assert cut.vertices[0, 1] == pytest.approx(-0.01)
    assert points[1:-1][place.control, place.axis] == pytest.approx(-0.02, abs=1e-12)


def test_mirror_images_change_together(mesh):
    paths = [f"pattern.front.edge[0].control[{k}].{axis}" for k in (0, 1) for axis in "xy"]
    tied = mirror_matrix(PatternNumbers(mesh), [*paths, "pattern.front.flare"])
    np.testing.assert_array_equal(tied.T, [[1, 0, -1, 0, 0], [0, 1, 0, 1, 0], [0, 0, 0, 0, 1]])
    with pytest.raises(InputError):
        mirror_matrix(PatternNumbers(mesh), paths[:2])


@pytest.mark.parametrize(
    "path",
    [
        "pattern.front.colour",
        "pattern.sleeve.width",
        "pattern.front.vertex[9].x",
        "pattern.front.edge[1].control[0].x",
        "pattern.front.edge[0].control[2].x",
        "pattern.front+back.vertex[0].x",
        "cloth.density",
    ],
)
def test_what_is_no_number_of_the_pattern(mesh, path):
    with pytest.raises(InputError):
        design(hanging_skirt(mesh, steps=1), [HemAt([0], 0.0)], [path], mesh)
