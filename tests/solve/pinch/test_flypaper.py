"""Patches about supporting triangles, and which of two parts holds a vertex of a pinch."""

from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.mesh.body import LaterMotion, make_body, rigid_motion
from clothsim.mesh.world import make_world
from clothsim.solve.pinch.flypaper import NONE_FLYPAPERED, OWN_PATCH, attached, own_rows
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
