"""Overlaps of rods: distances of segments against brute force, neighbours, triangles, names of what crosses."""

from types import SimpleNamespace

import numpy as np
import pytest

from clothsim.geometry.centre_lines import edges_through, overlapping_edges, segment_distances
from clothsim.geometry.intersection.crossings import crossings
from clothsim.mesh.rod import make_rod
from clothsim.mesh.world import make_world, world_surfaces


def line(first, n, radius):
    rows = np.arange(first, first + n)
    return SimpleNamespace(edges=np.column_stack([rows[:-1], rows[1:]]), radius=radius)


def test_distances_are_those_of_many_points():
    a, b, c, d = np.random.default_rng(2).standard_normal((4, 40, 3))
    t = np.linspace(0, 1, 201)[:, None, None]
    first, second = a + t * (b - a), c + t * (d - c)
    brute = np.array([np.linalg.norm(first[:, k, None] - second[None, :, k], axis=2).min() for k in range(40)])
    found = segment_distances(a, b, c, d)
    assert (found <= brute + 1e-12).all()
    np.testing.assert_allclose(found, brute, atol=0.02)


def test_parallel_segments_are_as_far_apart_as_their_lines():
    a, b = np.zeros((1, 3)), np.array([[1.0, 0, 0]])
    up = np.array([[0.0, 0, 0.3]])
    assert segment_distances(a, b, a + up, b + up) == pytest.approx(0.3)
    assert segment_distances(a, b, b + up + [1.0, 0, 0], b + up + [2.0, 0, 0]) == pytest.approx(np.hypot(1.0, 0.3))


@pytest.mark.parametrize("is_loop", [False, True])
def test_neighbours_along_a_rod_do_not_overlap(is_loop):
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    x = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    world = make_world([make_rod("ring", x, 0.2, 1.0, 1.0, is_loop=is_loop)])
    surface = world_surfaces(world)[0]
    assert (len(overlapping_edges(x, surface, surface)) == 0) == is_loop  # the ends of an open one meet
    flat = x * [1.0, 0.05, 1.0]
    assert len(overlapping_edges(flat, surface, surface)) > 0


def test_an_edge_through_a_triangle_is_found_and_one_beside_it_not():
    x = np.array([[0.2, 0.2, -1], [0.2, 0.2, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0], [2.0, 2, -1], [2, 2, 1]])
    triangles = np.array([[2, 3, 4]])
    assert edges_through(x, line(0, 2, 0.01), triangles).tolist() == [[0, 0]]
    assert not len(edges_through(x, line(5, 2, 0.01), triangles))
    assert not len(edges_through(x, line(0, 2, 0.01), triangles[:0]))


def test_a_crossing_of_rods_has_their_names():
    first = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    rods = [make_rod("a", first, 0.1, 1.0, 1.0), make_rod("b", first[:, [1, 0, 2]] + [0.3, 0, 0.15], 0.1, 1.0, 1.0)]
    world = make_world(rods)
    found = crossings(world.start(), world_surfaces(world))
    assert [(each.first, each.second, each.role, each.parts) for each in found] == [
        ("a", "b", "cloth", ("edge", "edge"))
    ]
    apart = make_world([rods[0], make_rod("b", first[:, [1, 0, 2]] + [0.3, 0, 0.21], 0.1, 1.0, 1.0)])
    assert crossings(apart.start(), world_surfaces(apart)) == ()
