"""Smooth union against spheres, finite differences and its own lattice form.

Surface nets of functions with known surfaces; lattices that thin ridges run between.

Edge collapse: short edges removed; surface, border and middle preserved.
"""

import numpy as np
import pytest

from clothsim.mesh.checks import examine
from clothsim.mesh.generators.implicit_surface import both_halves, collapsed, half_surface, limb, relaxed, smooth_union
from clothsim.mesh.generators.mannequin.body_limbs import SMOOTHING, body_limbs
from clothsim.mesh.topology import border_edges, border_vertices, unique_edges
from tests.benchmarks.make_mannequin import body_field, body_lattice

X, Y = np.eye(3)[:2]


def random_points(n=400, seed=0):
    return np.random.default_rng(seed).uniform((-0.7, -0.2, 0.0), (0.7, 0.2, 1.7), (n, 3))


def test_a_round_limb_has_the_distance_of_a_capsule():
    one = limb((0, 0, 0), (0, 0.6, 0), X, [(0, 0.1, 0.1), (1, 0.1, 0.1)], (0.1, 0.1))
    points = random_points() * (1, 3, 0.3)
    nearest = np.clip(points[:, 1], 0, 0.6)[:, None] * Y
    np.testing.assert_allclose(one.distance(points)[0], np.linalg.norm(points - nearest, axis=1) - 0.1, atol=1e-12)


def test_the_radii_go_through_the_knots():
    one = limb((0, 0, 0), (0, 0, 1), X, [(0, 0.1, 0.2), (0.3, 0.15, 0.1), (1, 0.05, 0.07)], (0.1, 0.1))
    points = np.array([[0.1, 0, 0], [0.15, 0, 0.3], [0.05, 0, 1], [0, 0.2, 0], [0, 0.1, 0.3], [0, 0.07, 1]])
    np.testing.assert_allclose(one.distance(points)[0], 0, atol=1e-15)


def test_two_equal_spheres_blend_by_log_two():
    ball = limb((0, 0, 0), (0, 0, 0), X, [(0, 0.1, 0.1)], (0.1,) * 2)
    value, _ = smooth_union([ball, ball], np.array([[0.13, 0, 0]]), 0.01)
    np.testing.assert_allclose(value, 0.03 - 0.01 * np.log(2), rtol=1e-9)


def test_the_gradient_of_the_body_is_the_difference_quotient():
    points = random_points()
    step = 1e-6
    value, gradient = body_field(points)
    near = np.abs(value) < 0.1
    assert near.sum() > 50
    for k in range(3):
        move = step * np.eye(3)[k]
        quotient = (body_field(points + move)[0] - body_field(points - move)[0]) / (2 * step)
        np.testing.assert_allclose(gradient[near, k], quotient[near], atol=2e-4)


def test_the_lattice_has_the_same_values_near_the_surface():
    nodes = (np.linspace(-0.01, 0.7, 30), np.linspace(-0.2, 0.2, 18), np.linspace(0, 1.7, 60))
    values = body_lattice(nodes)
    points = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=3).reshape(-1, 3)
    whole = body_field(points)[0].reshape(values.shape)
    near = np.abs(whole) < 0.03
    np.testing.assert_allclose(values[near], whole[near], atol=2e-3)
    assert ((values < 0) == (whole < 0))[np.abs(whole) > 2e-3].all()


def test_the_union_is_no_smaller_than_any_limb():
    points = random_points(seed=1)
    value, _ = smooth_union([one.limb for one in body_limbs()], points, SMOOTHING)
    nearest = np.min([one.limb.distance(points)[0] for one in body_limbs()], axis=0)
    assert (value <= nearest + 1e-12)[nearest < 0.2].all()
    assert value[nearest < 0.2] == pytest.approx(nearest[nearest < 0.2], abs=SMOOTHING * np.log(6))


def lattice(cell, reach=1.3):
    x = np.arange(-0.5 * cell, reach, cell)
    return x, np.arange(-reach, reach, cell), np.arange(-reach, reach, cell)


def at_nodes(function, nodes):
    return function(*np.meshgrid(*nodes, indexing="ij"))


def euler(positions, triangles):
    return len(positions) - len(unique_edges(triangles)) + len(triangles)


def volume(positions, triangles):
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return (a * np.cross(b, c)).sum() / 6


def sphere_field(points):
    r = np.linalg.norm(points, axis=1)
    return r - 1, points / r[:, None]


def test_a_sphere():
    nodes = lattice(0.1)
    half = half_surface(at_nodes(lambda x, y, z: np.sqrt(x * x + y * y + z * z) - 1, nodes), nodes)
    positions, triangles = both_halves(*half)
    assert examine("sphere", positions, triangles).findings == ()
    assert euler(positions, triangles) == 2
    assert volume(positions, triangles) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    smooth, same = both_halves(*relaxed(*half, sphere_field))
    assert euler(smooth, same) == 2
    np.testing.assert_allclose(np.linalg.norm(smooth, axis=1), 1, atol=1e-6)


def test_a_torus_keeps_its_hole():
    nodes = lattice(0.1)
    values = at_nodes(lambda x, y, z: (np.hypot(x, y) - 0.8) ** 2 + z * z - 0.09, nodes)
    positions, triangles = both_halves(*half_surface(values, nodes))
    assert euler(positions, triangles) == 0
    assert examine("torus", positions, triangles).findings == ()


@pytest.mark.parametrize("seed", range(8))
def test_noise_gives_a_manifold(seed):
    rng = np.random.default_rng(seed)
    nodes = lattice(0.2)
    values = rng.standard_normal([len(axis) for axis in nodes])
    values[-1] = values[:, 0] = values[:, -1] = values[:, :, 0] = values[:, :, -1] = 1.0
    positions, triangles = both_halves(*half_surface(values, nodes))
    kinds = {finding.kind for finding in examine("noise", positions, triangles).findings}
    assert not kinds & {"fin", "mixed winding", "one-sided", "duplicate", "repeated corner"}
    count = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)[1]
    assert (count == 2).all()


def sheet(n=6):
    """A flat sheet of equilateral-like triangles, 1 apart, x from 1: no middle."""
    x, y = np.meshgrid(np.arange(n + 1.0) + 1, np.arange(n + 1.0), indexing="ij")
    positions = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + n + 1, a + n + 2, a + 1
    return positions, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def area(positions, triangles):
    one, two = (positions[triangles[:, k]] - positions[triangles[:, 0]] for k in (1, 2))
    return 0.5 * np.cross(one, two)[:, 2]


def held(positions, triangles):
    marks = np.zeros(len(positions), bool)
    marks[border_vertices(triangles)] = True
    return marks


def test_a_regular_sheet_stays_as_it_is():
    positions, triangles = sheet()
    same, faces = collapsed(positions, triangles, held(positions, triangles))
    np.testing.assert_array_equal(same, positions)
    np.testing.assert_array_equal(faces, triangles)


def test_a_short_edge_is_collapsed():
    positions, triangles = sheet()
    inner = 3 * 7 + 3
    positions[inner] = positions[inner + 8] - 0.1
    positions[inner, 2] = 0
    fewer, faces = collapsed(positions, triangles, held(positions, triangles))
    assert (len(fewer), len(faces)) == (len(positions) - 1, len(triangles) - 2)
    assert len(fewer) - len(unique_edges(faces)) + len(faces) == 1
    assert (area(fewer, faces) > 0).all()
    assert area(fewer, faces).sum() == area(positions, triangles).sum()
    assert len(border_edges(faces)[0]) == len(border_edges(triangles)[0])


def test_a_vertex_of_three_neighbours_is_taken_out():
    positions, triangles = sheet()
    centre = positions[triangles[20]].mean(axis=0)
    a, b, c = triangles[20]
    new = len(positions)
    more = np.concatenate([np.delete(triangles, 20, axis=0), [[a, b, new], [b, c, new], [c, a, new]]])
    fewer, faces = collapsed(np.vstack([positions, centre]), more, np.append(held(positions, triangles), False))
    np.testing.assert_array_equal(fewer, positions)
    assert {frozenset(t) for t in faces.tolist()} == {frozenset(t) for t in triangles.tolist()}


def test_the_middle_and_the_border_keep_their_vertices():
    positions, triangles = sheet()
    positions[:, 0] = np.maximum(positions[:, 0] - 1, 0)
    near = np.flatnonzero(positions[:, 0] == 1)
    positions[near, 0] = 0.05  # a whole row crowds the middle
    fewer, faces = collapsed(positions, triangles, held(positions, triangles) & (positions[:, 0] > 0))
    assert (fewer[:, 0] == 0).sum() == 7
    assert len(fewer) < len(positions)
    middle = fewer[:, 0] == 0
    edges = unique_edges(faces)
    along = edges[middle[edges].all(axis=1)]
    assert len(along) == 6  # no new edge between two vertices of the middle
