"""Names, triangle numbers and positions of intersections, and the pairs of surfaces that are checked."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.geometry.intersection.crossings import crossings, edges_through, overlapping_edges, segment_distances
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.geometry.intersection.proved_separations import ProvedSeparations
from clothsim.mesh.body import make_body
from clothsim.mesh.rod import make_rod
from clothsim.mesh.world import make_world, world_surfaces

FACES = np.array([[0, 1, 2], [3, 4, 5]])


@pytest.fixture
def scene():
    """A sheet; a banner across it, folded onto itself; two pegs whose second triangle goes through the sheet."""
    positions, triangles = grid(2, 2)
    banner = [[0.1, 0.5, -1], [0.9, 0.5, -1], [0.5, 0.5, 1], [0.2, 0.5, 0.9], [0.8, 0.5, 0.9], [0.5, 0.5, -1.5]]
    away, peg = [[9, 9, 9], [9, 9, 8], [9, 8, 9]], [[0.7, 0.2, -0.1], [0.7, 0.2, 0.2], [0.8, 0.2, -0.1]]
    cloths = [cloth(positions, triangles, name="sheet"), cloth(np.array(banner), FACES, name="banner")]
    bodies = [make_body(name, np.array([*away, *peg], float), FACES) for name in ("peg", "other peg")]
    world = make_world(cloths, bodies)
    return world_surfaces(world), world.start()


def names_of(found):
    return [(crossing.first, crossing.second, crossing.role) for crossing in found]


def test_cloth_is_checked_against_everything_and_bodies_never_against_each_other(scene):
    surfaces, x = scene
    assert names_of(crossings(x, surfaces)) == [
        ("sheet", "banner", "cloth"),
        ("sheet", "peg", "body"),
        ("sheet", "other peg", "body"),
        ("banner", "banner", "cloth"),
    ]


def test_a_cloth_alone_and_bodies_alone(scene):
    surfaces, x = scene
    assert names_of(crossings(x, surfaces[1:2])) == [("banner", "banner", "cloth")]
    assert crossings(x, surfaces[:1]) == ()
    assert crossings(x, surfaces[2:]) == ()


def test_triangles_are_counted_in_their_own_surface_and_the_position_is_near(scene):
    surfaces, x = scene
    peg = crossings(x, surfaces)[1]
    assert [j for _, j in peg.pairs] == [1] * len(peg.pairs)
    hit = [k for k, corners in enumerate(x[surfaces[0].triangles]) if inside([0.75, 0.2], corners)]
    assert peg.pairs[0, 0] == hit[0]
    assert np.allclose(peg.position, [0.75, 0.2, 0], atol=0.06)
    assert (peg.first, peg.second) == ("sheet", "peg")
    assert {"sheet", "peg", str(hit[0])} <= set(peg.sentence.split())
    assert {"sheet", "peg"} <= set(peg.summary.split())


def inside(point, corners):
    matrix = np.vstack([corners[:, :2].T, np.ones(3)])
    return (np.linalg.solve(matrix, [*point, 1]) > 0).all()


def test_a_cloth_with_itself_is_named_once(scene):
    surfaces, x = scene
    found = [crossing for crossing in crossings(x, surfaces) if crossing.first == crossing.second]
    assert found[0].summary.count("banner") == 1
    assert found[0].sentence.count("banner") == 1


def test_pairs_of_many_cloths_are_those_of_each_two(scene):
    surfaces, x = scene
    for found in crossings(x, surfaces):
        one, other = (next(part for part in surfaces if part.name == name) for name in (found.first, found.second))
        pairs = intersecting_pairs(x, one.triangles, None if other is one else other.triangles)
        assert np.array_equal(found.pairs, pairs)


def test_a_limit_holds_for_cloth_and_for_bodies(scene):
    surfaces, x = scene
    found = crossings(x, surfaces, limit=1)
    assert [len(crossing.pairs) for crossing in found] == [1, 1]
    assert {crossing.role for crossing in found} == {"cloth", "body"}


def test_proofs_change_nothing_where_a_rigid_body_flies_through_another_and_leaves(scene):
    surfaces, start = scene
    surfaces = [replace(part, rigid=part.name == "peg") for part in surfaces]
    peg = next(part for part in surfaces if part.rigid)
    proofs, roles = ProvedSeparations(), []
    for k in range(41):
        x = start.copy()
        x[peg.rows] += [0.0, 0.06 * (k - 20) * (1.0 + 0.01 * k), 0.0]
        plain, proved = crossings(x, surfaces), crossings(x, surfaces, proofs=proofs)
        assert names_of(plain) == names_of(proved)
        assert all(np.array_equal(a.pairs, b.pairs) for a, b in zip(plain, proved, strict=True))
        roles.append({each.role for each in plain})
    assert "rigid" in roles[20]
    assert "rigid" not in roles[0] | roles[-1]


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
