"""Patches about supporting triangles, and which of two parts holds a vertex of a pinch."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.mesh.body import LaterMotion, make_body, rigid_motion
from clothsim.mesh.world import make_world
from clothsim.solve.pinch.flypaper import (
    NONE_FLYPAPERED,
    OWN_PATCH,
    TO_LIMITS,
    TO_MIDDLE,
    HeldChoices,
    attached,
    closest_weights,
    line_meets,
    own_rows,
)
from clothsim.solve.pinch.pinch import with_supports
from clothsim.solve.pinch.pinch_gaps import PinchedVertices


def over_a_plate(turned_up=False):
    """A sheet with a cell of 0.05 m, and a plate with cells of 0.1 m, as a body; half of the plate turned up."""
    sheet, triangles = grid(4, 4)
    plate, faces = grid(16, 16)
    plate = 1.6 * plate - [0.8, 0.8, 0.0]
    if turned_up:
        beyond = np.maximum(plate[:, 0] - 0.05, 0.0)
        plate = np.column_stack([plate[:, 0] - beyond, plate[:, 1], plate[:, 2] + beyond])
    sheet = cloth(0.2 * sheet + [-0.1, -0.1, 0.01], triangles)
    return make_world([sheet], [make_body("plate", plate, faces)])


def supported(world, rows):
    """Vertices of the sheet on the triangles of the plate below them."""
    x, triangles = world.start(), world.body_triangles
    centres = x[triangles].mean(axis=1)
    near = triangles[[int(np.linalg.norm(centres - x[row], axis=1).argmin()) for row in rows]]
    thirds = np.full((len(rows), 3), 1 / 3)
    return attached(x, np.array(rows), (near, thirds), (near, thirds))


@pytest.mark.parametrize("turned_up", [False, True])
def test_a_patch_has_the_triangles_near_the_point_that_supports_a_vertex(turned_up):
    """Those of a plate that come within OWN_PATCH longest edges of it by the sphere about their centre."""
    world = over_a_plate(turned_up)
    x, triangles = world.start(), world.body_triangles
    flypapered = supported(world, [3, 12])
    centres = x[triangles].mean(axis=1)
    sizes = np.linalg.norm(x[triangles] - centres[:, None], axis=2).max(axis=1)
    wanted = []
    for row, point in zip(flypapered.vertices, flypapered.points(x), strict=True):
        away = np.linalg.norm(centres - point, axis=1) - sizes
        rows = np.unique(triangles[away <= OWN_PATCH * 0.05 * np.sqrt(2)])
        assert 10 < len(rows) < 60
        wanted += (row * len(x) + rows).tolist()
    assert own_rows(world, x, flypapered).tolist() == wanted


def test_a_patch_does_not_go_round_an_edge_that_faces_away():
    """A strip of triangles folded back on itself: its other half is near, and faces away."""
    flat, faces = grid(8, 1)
    folded = np.column_stack([np.minimum(flat[:, 0], 1.0 - flat[:, 0]), flat[:, 1], 0.001 * (flat[:, 0] > 0.5)])
    sheet = cloth(0.2 * grid(2, 2)[0] + [0.1, 0.4, -0.01], grid(2, 2)[1])
    world = make_world([sheet], [make_body("fold", folded, faces)])
    found = own_rows(world, world.start(), supported(world, [4])) % len(world.start())
    other_half = world.body_slices[0].start + np.flatnonzero(flat[:, 0] > 0.51)
    assert len(found)
    assert not np.isin(found, other_half).any()


@pytest.mark.parametrize("place", [0.0, 500.0])
def test_the_neighbour_of_a_vertex_is_held_by_the_same_part_wherever_the_scene_is(place):
    """The narrowest gap is held by the lower plate; the vertex beside it is too, though the upper one is closer."""
    flat, faces = grid(1, 1)
    beside = np.array([place, 0.0, 0.0])
    sheet = cloth(grid(4, 4)[0] + beside, grid(4, 4)[1])
    bodies = [make_body(name, flat + beside + [0, 0, z], faces) for name, z in (("lower", -0.01), ("upper", 0.01))]
    world = make_world([sheet], bodies)
    x = world.start()
    below, above = (rows.start + faces[:1] for rows in world.body_slices)
    above = above[:, ::-1]  # its normal is down, to the gap
    near, far = np.concatenate([below, above]), np.concatenate([above, below])
    thirds = np.full((2, 3), 1 / 3)
    found = PinchedVertices(np.array([6, 7]), near, thirds, far, thirds, np.array([0.001, 0.002]))
    made = with_supports(world, x, x.copy(), found, NONE_FLYPAPERED)
    assert made.vertices.tolist() == [6, 7]
    assert made.triangles.tolist() == np.concatenate([below, below]).tolist()
    assert made.far.tolist() == np.concatenate([above, above]).tolist()


def between_plates(upper: float, moved_by_hand: bool = False):
    """A sheet 10 mm above a lower plate at the start and `upper` [m] below another, which is 5 mm above it now."""
    flat, faces = grid(1, 1)
    up = np.array([0.0, 0.0, 1.0])
    bodies = [make_body(name, flat + z * up, faces) for name, z in (("lower", -0.01), ("upper", upper))]
    if moved_by_hand:
        bodies[1] = replace(bodies[1], motion=LaterMotion(flat + 0.005 * up, rigid_motion(), 0.5))
    world = make_world([cloth(*grid(4, 4))], bodies)
    below, above = (rows.start + faces[:1] for rows in world.body_slices)
    x = world.start()
    x[above, 2] = 0.005
    on_edge = 0.5 * np.isin(faces[:1], faces[1])  # the middle of the plate, where the two triangles meet
    return world, x, (below, on_edge), (above[:, ::-1], on_edge[:, ::-1])


@pytest.mark.parametrize("moved_by_hand", [False, True])
@pytest.mark.parametrize(("upper", "of_lower"), [(0.01, False), (0.018, False), (0.022, True), (0.3, True)])
def test_a_vertex_is_held_by_the_part_that_was_much_nearer_at_the_start_of_the_run(upper, of_lower, moved_by_hand):
    """The upper plate has come closer than the lower one; neither moves now."""
    world, x, lower, higher = between_plates(upper, moved_by_hand)
    found = PinchedVertices(np.array([12]), *higher, *lower, np.array([0.001]))
    made = with_supports(world, x, x.copy(), found, NONE_FLYPAPERED)
    assert made.triangles.tolist() == (lower if of_lower else higher)[0].tolist()


@pytest.mark.parametrize(("upper", "of_lower"), [(0.01, False), (0.3, True)])
def test_the_part_that_was_much_nearer_holds_a_vertex_also_where_it_moves_more(upper, of_lower):
    world, x, lower, higher = between_plates(upper)
    end = x.copy()
    end[lower[0], 0] += 0.02
    found = PinchedVertices(np.array([12]), *lower, *higher, np.array([0.001]))
    made = with_supports(world, x, end, found, NONE_FLYPAPERED)
    assert made.triangles.tolist() == (lower if of_lower else higher)[0].tolist()


@pytest.mark.parametrize(("upper", "of_lower"), [(0.01, False), (0.3, True)])
def test_a_neighbour_that_is_carried_decides_only_where_no_part_was_much_nearer(upper, of_lower):
    world, x, lower, higher = between_plates(upper)
    beside = attached(x, np.array([7]), higher, lower)
    found = PinchedVertices(np.array([12]), *lower, *higher, np.array([0.001]))
    made = with_supports(world, x, x.copy(), found, beside)
    assert made.triangles[made.vertices == 12].tolist() == (lower if of_lower else higher)[0].tolist()


CHOICES = {
    "known": {"rises": 0},
    "raised": {"rises": 1},
    "lowered": {"rises": -1},
    "at twice the limit": {"rises": TO_LIMITS},
    "in the middle of the gap at the start": {"rises": TO_MIDDLE},
    "in the middle of the gap ahead": {"rises": TO_MIDDLE, "at_end": True},
    "new": {"before": -1},
    "new, of an edge": {"before": -1, "corners": [True, False, True]},
    "new, of a corner": {"before": -1, "corners": [False, True, False]},
    "new, of the far side": {"before": -1, "of_far": True},
}


@pytest.mark.parametrize("name", CHOICES)
def test_the_adjoint_of_held_choices_is_that_of_differences(name):
    """Three vertices above triangles that deform; far and opposite triangles above them."""
    given = {"before": 0, "of_far": False, "corners": [True] * 3, "rises": 0, "at_end": False} | CHOICES[name]
    random = np.random.default_rng(6)
    count, limit = 3, 0.02
    below = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.01], [0.02, 0.1, 0.0]])
    above = below[[0, 2, 1]] + np.array([0.01, 0.0, 0.03])
    corners = np.concatenate([below, above, above]) + 0.002 * random.standard_normal((count, 9, 3))
    if given["of_far"]:
        corners = corners[:, [3, 4, 5, 0, 1, 2, 6, 7, 8]]
    ahead, end = corners + 0.003 * random.standard_normal((2, count, 9, 3))
    vertex = np.array([0.04, 0.03, 0.01]) + 0.002 * random.standard_normal((count, 1, 3))
    weights, offsets = random.dirichlet(np.ones(3), count), 0.01 * random.standard_normal((count, 3))
    inputs = np.hstack([vertex, corners]), ahead, end[:, :3], weights, offsets, np.full((count, 1), limit)
    held = [np.tile(value, (count, 1)) if key == "corners" else np.full(count, value) for key, value in given.items()]
    before, of_far, acting, rises, at_end = held
    choices = HeldChoices(NONE_FLYPAPERED, before, of_far, acting, rises, NONE_FLYPAPERED.far, at_end)
    by = random.standard_normal((3, count, 3))
    found = choices.adjoint(inputs, tuple(by))
    for number, array in enumerate(inputs):
        along, h = random.standard_normal(array.shape), 1e-6

        def value(h, number=number, along=along):
            varied = [each + h * along if k == number else each for k, each in enumerate(inputs)]
            return sum(float(np.vdot(a, b)) for a, b in zip(by, choices.follow(*varied), strict=True))

        numeric = (value(h) - value(-h)) / (2 * h)
        assert float(np.vdot(found[number], along)) == pytest.approx(numeric, rel=1e-6, abs=1e-7)


def test_the_closest_point_of_the_span_of_corners():
    random = np.random.default_rng(7)
    corners, points = random.standard_normal((5, 3, 3)), random.standard_normal((5, 3))
    for acting in ([True, True, True], [True, False, True], [False, True, False]):
        weights = closest_weights(points, corners, np.tile(acting, (5, 1)))
        assert weights.sum(axis=1) == pytest.approx(np.ones(5))
        assert np.abs(weights[:, ~np.array(acting)]).max(initial=0.0) < 1e-14
        away = points - np.einsum("kc,kcd->kd", weights, corners)
        own = corners[:, acting] - corners[:, acting][:, :1]
        assert np.abs(np.einsum("kcd,kd->kc", own, away)).max() < 1e-12


def test_a_line_meets_a_triangle_by_its_weights():
    random = np.random.default_rng(8)
    corners, points, along = (random.standard_normal(shape) for shape in ((5, 3, 3), (5, 3), (5, 3)))
    lengths, weights = line_meets(points, along, corners)
    assert np.einsum("kc,kcd->kd", weights, corners) == pytest.approx(points + lengths[:, None] * along)
