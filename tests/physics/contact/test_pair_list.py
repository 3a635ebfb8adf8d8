"""Distinct contact features: inclusion and exclusion against ipctk's distances, invariance, smoothness, derivatives."""

from dataclasses import replace
from itertools import combinations

import ipctk
import numpy as np
import pytest
from contact_configurations import D_HAT, at_random, close
from contacts import ball, jittered, sheet
from differences import dense_hessian, gradient_error, hessian_error, taylor_slopes
from effect_builders import body_contact, self_contact

from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world
from clothsim.physics.contact import barrier_kernels as kernels

POSES = {**at_random(2), **close((1e-2, 1e-6))}


def barrier(distance_squared, d_hat):
    """b of a squared distance [m]."""
    y = distance_squared / d_hat**2
    return 0.0 if y >= 1 else -d_hat * (y - 1) ** 2 * np.log(y)


def sum_over_complex(contact, x):
    """E of points and triangles for a stiffness of 1, term by term, with ipctk's distances."""
    surface, total = contact.candidates.surface, 0.0
    areas = surface.vertex_areas.copy()
    areas[surface.flat.points] = 0.0
    groups = [(surface.first.points, surface.second.triangles)]
    if not surface.is_self_contact:
        groups.append((surface.second.points, surface.first.triangles))
    for points, triangles in groups:
        for p in points:
            own = [t for t in triangles if p not in t and surface.allowed[surface.labels[p], surface.labels[t[0]]]]
            edges, vertices = {}, {}
            for t in own:
                for edge in combinations(sorted(t), 2):
                    edges[edge] = edges.get(edge, 0) + 1
                for v in t:
                    vertices[v] = vertices.get(v, 0) + 1
            terms = [barrier(ipctk.point_triangle_distance(x[p], *x[t]), contact.d_hat) for t in own]
            for (a, b), count in edges.items():
                terms.append((1 - count) * barrier(ipctk.point_edge_distance(x[p], x[a], x[b]), contact.d_hat))
            for v, count in vertices.items():
                coefficient = 1 - count + sum(n - 1 for edge, n in edges.items() if v in edge)
                terms.append(coefficient * barrier(ipctk.point_point_distance(x[p], x[v]), contact.d_hat))
            total += areas[p] / 4 * sum(terms)
    return total


def of_points(contact, x):
    """E of points and triangles for a stiffness of 1, and their weights."""
    pairs = contact.distinct(x)
    arguments = pairs.elements, pairs.weights, pairs.thresholds, pairs.n_points, 0.0, contact.d_hat
    kernels.evaluate(records := np.empty((len(pairs), kernels.RECORD_SIZE)), x, *arguments)
    return records[: pairs.n_points, kernels.VALUE].sum(), pairs.weights[: pairs.n_points]


@pytest.mark.parametrize("name", POSES)
def test_energy_is_the_sum_over_the_complex(name):
    pose = POSES[name]
    contact = pose.contact()
    mine, weights = of_points(contact, pose.x)
    assert mine == pytest.approx(sum_over_complex(contact, pose.x), rel=1e-9)
    assert len(weights) < contact.candidates.active(pose.x).n_points


def valley(angle):
    """A sheet high over a V of two faces of 1 m, which rise by `angle`."""
    rise = np.tan(angle)
    points = np.array([[-1, -1, rise], [0, -1, 0], [1, -1, rise], [-1, 1, rise], [0, 1, 0], [1, 1, rise]])
    triangles = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    return make_world([sheet(0.5, cells=4)], [make_body("valley", points, triangles)])


@pytest.mark.parametrize("angle", [0.3, -0.3])
def test_derivatives_over_a_valley_and_a_ridge(angle):
    """In a valley both faces push, and their common edge has a negative weight."""
    world = valley(angle)
    x = jittered(world.start(), world.n_cloth, 0.003, 1)
    x[: world.n_cloth, 2] += -0.48 + np.abs(x[: world.n_cloth, 0]) * np.tan(angle) + 0.01 * (angle < 0)
    contact = body_contact(world, d_hat=D_HAT, stiffness=3.0)
    assert (of_points(contact, x)[1].min() < 0) == (angle > 0)
    assert gradient_error(contact, x, 1e-7) < 1e-6
    assert hessian_error(contact, x, 1e-7) < 1e-4
    first, second = taylor_slopes(contact, x, sizes=(2e-4, 1e-4, 5e-5))
    assert first == pytest.approx(2, abs=0.1)
    assert second == pytest.approx(3, abs=0.3)
    projected, exact = contact.hessian(x, True).blocks, contact.hessian(x, False).blocks
    scale = np.abs(exact).max(axis=(1, 2))
    assert (np.linalg.eigvalsh(projected)[:, 0] >= -1e-12 * scale).all()
    assert (np.linalg.eigvalsh(projected - exact)[:, 0] >= -1e-9 * scale).all()
    assert np.abs(contact.gradient(x).sum(axis=0)).max() < 1e-12 * np.abs(contact.gradient(x)).max()


def test_energy_has_no_jump_where_the_closest_feature_changes():
    """A sheet that moves over a ball: second differences of the energy stay of second order."""
    world = make_world([sheet(0.32, cells=3)], [ball(subdivisions=2)])
    contact = body_contact(world, d_hat=D_HAT, stiffness=1.0)
    x, n = jittered(world.start(), world.n_cloth, 0.01), world.n_cloth

    def energies(step, count):
        """Along x."""
        moved = [
            x + np.where(np.arange(len(x))[:, None] < n, [k * step, 0.3 * k * step, 0.0], 0.0) for k in range(count)
        ]
        return np.array([contact.value(y) for y in moved])

    coarse, fine = (np.abs(np.diff(energies(step, count), 2)).max() for step, count in ((2e-4, 600), (1e-4, 1200)))
    assert fine == pytest.approx(coarse / 4, rel=0.1)
    features = {tuple(contact.distinct(x + [k * 1e-3, 3e-4 * k, 0] * (np.arange(len(x))[:, None] < n)).elements.ravel())
                for k in range(60)}  # fmt: skip
    assert len(features) > 10


def test_a_vertex_over_a_flat_cloth_is_pushed_along_the_normal():
    """Self-contact: the same formula on cloth. Without edges, whose pairs are those of the other cloth's own."""
    low, high = sheet(0.0, "low", 8), sheet(0.02, "high", 2)
    world = make_world([low, replace(high, positions=0.3 * (high.positions - [0, 0, 0.02]) + [0, 0, 0.02])], [])
    contact = self_contact(world, d_hat=D_HAT, stiffness=1.0)
    rows, start = world.cloth_slices[1], world.start()
    rng = np.random.default_rng(1)
    found = []
    for _ in range(10):
        x = start.copy()
        x[rows, :2] += rng.uniform(-0.2, 0.2, 2)
        pairs = contact.distinct(x)
        upper = (pairs.elements[:, 0] >= rows.start) & (np.arange(len(pairs)) < pairs.n_points)
        assert np.bincount(pairs.elements[upper, 0], minlength=len(x))[rows].tolist() == [1] * 9
        assert pairs.weights[upper] == pytest.approx(world.vertex_areas[rows] / 4, rel=1e-12)
        found.append(pairs)
    assert len({tuple(pairs.elements[: pairs.n_points].ravel()) for pairs in found}) == 10


def test_restricted_barrier_has_the_derivatives_of_the_whole_at_moving_vertices():
    pose = POSES["random 0, itself"]
    contact, moving = pose.contact(), np.zeros(len(pose.x), bool)
    moving[::7] = True
    part = contact.restricted_to(moving, pose.x)
    whole = contact.gradient(pose.x)[moving]
    assert part.gradient(pose.x)[moving] == pytest.approx(whole, abs=1e-12 * np.abs(whole).max())
    rows = np.repeat(moving, 3)
    of_whole = dense_hessian(contact, pose.x)[np.ix_(rows, rows)]
    of_part = dense_hessian(part, pose.x)[np.ix_(rows, rows)]
    assert of_part == pytest.approx(of_whole, abs=1e-12 * np.abs(of_whole).max())
