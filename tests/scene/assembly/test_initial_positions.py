"""Initial positions, untangled."""

import numpy as np
import pytest
from meshes import UNIT, cloth, grid

from clothsim import InputError, Scene
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.geometry.untangling import untangle as search
from clothsim.mesh.body import make_body
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.generators.shapes import sphere
from clothsim.mesh.world import make_world
from clothsim.run.fields import world_stretches
from clothsim.scene.assembly.initial_positions import untangled
from clothsim.scene.assembly.scene_world import build


def crossings(world):
    x = world.start()
    return len(intersecting_pairs(x, world.triangles)) + len(
        intersecting_pairs(x, world.triangles, world.body_triangles)
    )


def test_nothing_moves_where_nothing_intersects():
    world = make_world([cloth(*grid(4, 4))])
    freed, output = untangled(world)
    assert np.array_equal(freed.start(), world.start())
    assert "nothing intersected" in output


def test_a_vertex_drawn_through_the_other_layer_goes_back_and_the_rest_shape_stays():
    points, faces = grid(10, 10)
    x, y, _ = points.T
    start = np.column_stack([0.5 - np.abs(x - 0.5), y, np.where(x > 0.55, 0.05, 0.0)])  # folded double
    assert crossings(make_world([make_cloth("cloth", points, faces, UNIT, positions=start)])) == 0
    start[27, 2] = 0.08
    world = make_world([make_cloth("cloth", points, faces, UNIT, positions=start)])
    assert crossings(world) > 0
    freed, output = untangled(world)
    assert crossings(freed) == 0
    moved = np.linalg.norm(freed.start() - world.start(), axis=1)
    assert 0 < np.median(moved) < 0.3 * moved.max()
    assert moved.max() < 0.1
    assert f"{np.count_nonzero(moved)} vertices were moved" in output
    assert np.array_equal(freed.cloths[0].rest_positions, points)
    assert np.array_equal(freed.rest_areas, world.rest_areas)


def test_cloth_is_pushed_off_a_body_which_stays():
    points, faces = grid(10, 10)
    body = make_body("ball", sphere(radius=0.3, subdivisions=2)[0] + [0.5, 0.5, -0.29], sphere(0.3, subdivisions=2)[1])
    world = make_world([cloth(points, faces)], [body])
    assert crossings(world) > 0
    freed, _ = untangled(world)
    assert crossings(freed) == 0
    assert np.array_equal(freed.start()[freed.n_cloth :], world.start()[world.n_cloth :])
    assert freed.start()[:, 2][: freed.n_cloth].max() < 0.03


def test_triangles_squeezed_to_nothing_come_back():
    points, faces = grid(10, 10)
    start = points.copy()
    start[60] += 0.999 * (points[61] - points[60])
    world = make_world([make_cloth("cloth", points, faces, UNIT, positions=start)])
    assert world_stretches(world, world.start()).min() < 0.01
    freed, output = untangled(world)
    stretches = world_stretches(freed, freed.start())
    assert 0.3 <= stretches.min() <= stretches.max() <= 1.4
    assert crossings(freed) == 0
    assert "stretched beyond (0.3, 1.4)" in output


def two_crossing():
    """Two sheets, one through the other along a line of vertices."""
    points, faces = grid(6, 6)
    through = points[:, [2, 1, 0]] + [0.5, 0.0, -0.5]
    return make_world([cloth(points, faces), cloth(through, faces, name="other")])


def test_two_crossing_sheets_part():
    world = two_crossing()
    assert crossings(world) > 100
    assert crossings(untangled(world)[0]) == 0


def test_what_cannot_be_freed_is_named(monkeypatch):
    monkeypatch.setattr(search, "ATTEMPTS", ())
    with pytest.raises(InputError, match=r"\b0 rounds.*\(.*\) m"):
        untangled(two_crossing())


@pytest.mark.parametrize("untangle", [False, True])
def test_a_scene_asks_for_it(untangle):
    scene = Scene(
        cloth={"mesh": "rectangle", "cells": [10, 10], "position": [0, 0, 0.29]},
        body={"mesh": "sphere", "radius": 0.3, "name": "ball"},
        effects={"membrane": {}},
        seed={"untangle": untangle},
    )
    built = build(scene)
    assert (crossings(built.world) == 0) == untangle
    assert any("seed.untangle" in note for note in built.notes) == untangle
