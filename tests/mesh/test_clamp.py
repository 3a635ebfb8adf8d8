"""Ghost triangles behind clamped edges: positions, hinges, rejected groups."""

from dataclasses import replace

import numpy as np
import pytest
from effect_builders import bending
from meshes import UNIT, cloth, grid, irregular_grid, random_rotation

from clothsim.base.errors import InputError
from clothsim.mesh.body import make_body
from clothsim.mesh.clamp import clamped
from clothsim.mesh.cloth import dihedral_angles, make_cloth
from clothsim.mesh.world import make_world

NONE = np.zeros(0, np.int64)


def left_and_right(world, which=0):
    """The vertices on x = 0 and on x = 1 of one cloth, world numbers."""
    rows = world.cloth_slices[which]
    x = world.cloths[which].positions[:, 0]
    return [rows.start + np.flatnonzero(x < 1e-9), rows.start + np.flatnonzero(x > 1 - 1e-9)]


def sheet(nx=4, ny=3, **keywords):
    return cloth(*grid(nx, ny), **keywords)


def test_ghosts_mirror_the_border_triangles():
    world = make_world([sheet()])
    held, (left, right) = clamped(world, left_and_right(world))
    assert left.tolist() == [20, 21, 22]
    assert right.tolist() == [23, 24, 25]
    assert held.n_vertices == 26
    x = held.start()
    assert np.allclose(sorted(x[left, 1]), [1 / 3, 2 / 3, 1])
    assert np.allclose(x[left, 0], -0.25)
    assert np.allclose(x[right, 0], 1.25)
    assert not x[:, 2].any()
    assert np.array_equal(x[:20], world.start())


def test_ghost_hinges_are_flat_twice_as_stiff_and_as_large_as_two_border_triangles():
    world = make_world([sheet()])
    held, (left, right) = clamped(world, left_and_right(world))
    old, new = len(world.hinges.vertices), slice(len(world.hinges.vertices), None)
    assert np.array_equal(held.hinges.vertices[:old], world.hinges.vertices)
    assert np.array_equal(held.hinges.stiffness[:old], world.hinges.stiffness)
    assert held.hinges.vertices[new, 3].tolist() == [*left, *right]
    assert (held.hinges.stiffness[new] == 2 * UNIT.bending_stiffness).all()
    assert np.allclose(held.hinges.edge_lengths[new], 1 / 3)
    assert np.allclose(held.hinges.areas[new], 2 * (1 / 12) / 2)
    assert np.abs(dihedral_angles(held.start(), held.hinges.vertices)).max() < 1e-15
    assert (held.hinges.held[:old] == -1).all()
    assert (held.hinges.held[new] == 1).all()


@pytest.mark.parametrize("model", ["hinge", "quadratic", "midedge"])
def test_a_sheet_turned_about_its_clamped_edge_is_bent_and_one_turned_with_it_is_not(model):
    world = make_world([sheet(fabric=replace(UNIT, poisson_ratio=0.0))])
    (left, _), angle = left_and_right(world), 0.1
    held, (ghosts,) = clamped(world, [left])
    x = held.start()
    free = np.setdiff1d(np.arange(world.n_cloth), left)
    turned = x.copy()
    turned[free] = x[free] * [np.cos(angle), 1, 0] - x[free, :1] * [0, 0, np.sin(angle)]
    energy = bending(held, model=model)
    # one hinge of twice D over the cell 1/4: E = 2 D angle^2 / (2 * 1/4)
    exact = 2 * UNIT.bending_stiffness * angle**2 / (2 * 0.25)
    assert energy.value(turned) == pytest.approx(exact, rel=1e-3)
    turned[ghosts] = x[ghosts] * [np.cos(angle), 1, 0] - x[ghosts, :1] * [0, 0, np.sin(angle)]
    assert energy.value(turned) < 1e-25
    assert bending(world, model=model).value(turned[: world.n_cloth]) < 1e-25


def test_ghosts_lie_in_the_plane_of_the_start_and_come_after_the_bodies():
    positions, triangles = irregular_grid(3, 3, 3)
    start = 1.2 * positions @ random_rotation(4).T + [0, 0, 5]
    body = make_body("table", np.eye(3), np.array([[0, 1, 2]]))
    limp = cloth(*irregular_grid(1), name="other")
    world = make_world([limp, make_cloth("sheet", positions, triangles, UNIT, positions=start)], [body])
    border = world.cloth_slices[1].start + np.array([0, 1, 2])
    held, (ghosts,) = clamped(world, [border])
    assert ghosts[0] == world.n_vertices
    x = held.start()
    rows = np.isin(held.hinges.vertices[:, 3], ghosts)
    a, b, c, ghost = (x[held.hinges.vertices[rows, k]] for k in range(4))
    middle = (c + ghost) / 2
    assert np.linalg.norm(ghost - a, axis=1) == pytest.approx(np.linalg.norm(c - a, axis=1))
    assert np.linalg.norm(ghost - b, axis=1) == pytest.approx(np.linalg.norm(c - b, axis=1))
    assert np.abs(np.cross(middle - a, b - a)).max() < 1e-14
    assert np.linalg.norm(c - ghost, axis=1).min() > 0.1
    at_rest = held.hinges.corners[rows]
    assert np.linalg.norm(b - a, axis=1) == pytest.approx(1.2 * at_rest[:, 1, 0])
    assert np.linalg.norm(c - ghost, axis=1) == pytest.approx(1.2 * 2 * at_rest[:, 2, 1])


def test_whole_pinned_triangles_double_the_hinges_on_their_line_and_need_no_ghost():
    world = make_world([sheet()])
    band = np.flatnonzero(world.start()[:, 0] < 0.3)
    held, (ghosts,) = clamped(world, [band])
    ratio = held.hinges.stiffness / world.hinges.stiffness
    middle = world.start()[world.hinges.vertices[:, :2]].mean(axis=1)
    on_line = np.ptp(world.start()[world.hinges.vertices[:, :2], 0], axis=1) < 1e-9
    line = on_line & (np.abs(middle[:, 0] - 0.25) < 1e-9)
    assert line.sum() == 3
    assert (ratio == np.where(line, 2.0, 1.0)).all()
    pinned = np.isin(held.hinges.vertices[:, 2:], band)
    assert (held.hinges.held == np.where(line, np.where(pinned[:, 0], 0, 1), -1)).all()
    assert len(ghosts) == 0
    assert held.n_vertices == world.n_vertices


def test_an_edge_between_two_groups_is_not_clamped_and_an_empty_group_has_no_ghosts():
    world = make_world([sheet()])
    held, ghosts = clamped(world, [np.array([0, 1]), NONE, np.array([2, 3])])
    assert [len(g) for g in ghosts] == [1, 0, 1]
    assert len(held.hinges.vertices) == len(world.hinges.vertices) + 2
    same, (none,) = clamped(world, [NONE])
    assert same is world
    assert len(none) == 0


def test_each_cloth_has_its_own_stiffness():
    soft = sheet(fabric=replace(UNIT, bending_stiffness=0.1), name="soft")
    world = make_world([sheet(name="stiff"), soft])
    groups = [left_and_right(world, 0)[0], left_and_right(world, 1)[0]]
    held, ghosts = clamped(world, groups)
    for rows, stiffness in zip(ghosts, (2 * 0.7, 2 * 0.1), strict=True):
        mine = np.isin(held.hinges.vertices[:, 3], rows)
        assert mine.sum() == 3
        assert (held.hinges.stiffness[mine] == stiffness).all()


@pytest.mark.parametrize("group", [[0], [0, 19], [5, 6]])
def test_a_group_with_nothing_to_clamp_is_refused(group):
    world = make_world([sheet()])
    with pytest.raises(InputError, match=r"\b1\b"):
        clamped(world, [left_and_right(world)[0], np.array(group)])


def test_a_border_triangle_without_area_at_the_start_is_refused():
    flat = grid(4, 3)[0]
    world = make_world([make_cloth("sheet", *grid(4, 3), UNIT, positions=flat * [0.0, 1.0, 1.0])])
    with pytest.raises(InputError):
        clamped(world, [np.arange(4)])
