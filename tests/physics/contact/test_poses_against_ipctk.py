"""Contact in random and hard configurations against ipctk: active set, regions, gap, energy and derivatives."""

import ipctk
import numpy as np
import pytest
from contact_configurations import D_HAT, adversarial, at_random, close
from contacts import jittered
from differences import dense_hessian
from ipctk_barrier import by_ipctk

from clothsim.base.vectors import four_points
from clothsim.physics.contact import barrier_kernels as kernels
from clothsim.physics.contact.distance import closest_points

POSES = {**at_random(), **adversarial(), **close()}
TIES = [name for name, pose in POSES.items() if pose.tie]
GENERAL = [name for name, pose in POSES.items() if not pose.tie]


@pytest.mark.parametrize("name", POSES)
def test_energy_gradient_and_gap_against_ipctk(name):
    pose = POSES[name]
    mine, oracle = pose.contact(), by_ipctk(pose.contact())
    energy, gradient = oracle.value(pose.x), oracle.gradient(pose.x)
    assert energy > 0
    assert mine.value(pose.x) == pytest.approx(energy, rel=1e-12)
    # over needles the terms of ipctk that cancel here leave 1.07e-10 where the force is 0
    assert np.abs(mine.gradient(pose.x) - gradient).max() <= 2e-10 * np.abs(gradient).max()
    assert mine.minimum_gap(pose.x) == pytest.approx(oracle.minimum_gap(pose.x), rel=1e-10)


def assert_same_hessian(pose, x):
    hessian = dense_hessian(by_ipctk(pose.contact()), x)
    assert np.abs(dense_hessian(pose.contact(), x) - hessian).max() <= 1e-8 * np.abs(hessian).max() > 0


@pytest.mark.parametrize("name", GENERAL)
def test_hessian_against_ipctk(name):
    assert_same_hessian(POSES[name], POSES[name].x)


@pytest.mark.parametrize("name", TIES)
def test_hessian_on_either_side_of_a_tie(name):
    """On the border of two regions the second derivative jumps, and each of the two may take either side."""
    for seed in range(3):
        assert_same_hessian(POSES[name], jittered(POSES[name].x, len(POSES[name].x), 1e-7, seed))


def pairs_by_ipctk(surface, x, activation_distance):
    """Every point-triangle and edge-edge pair within the activation distance by ipctk, without a broad phase."""
    first, second = surface.first, surface.second
    groups = [(first, second)] if surface.is_self_contact else [(first, second), (second, first)]
    all_pairs = [(p, *t) for a, b in groups for p in a.points for t in b.triangles if p not in t]
    count = len(all_pairs)
    all_pairs += [
        (*e, *f)
        for i, e in enumerate(first.edges)
        for f in second.edges[i + 1 if surface.is_self_contact else 0 :]
        if not set(e) & set(f)
    ]
    close_pairs = [
        tuple(map(int, rows))
        for k, rows in enumerate(all_pairs)
        if (ipctk.point_triangle_distance if k < count else ipctk.edge_edge_distance)(*x[list(rows)])
        < activation_distance**2
    ]
    return sorted(close_pairs)


@pytest.mark.parametrize("name", POSES)
def test_the_pairs_closer_than_d_hat_are_all_that_ipctk_measures(name):
    pose = POSES[name]
    contact = pose.contact()
    expected = pairs_by_ipctk(contact.candidates.surface, pose.x, D_HAT)
    found = contact.candidates.active(pose.x).elements.tolist()
    assert len(expected) > 5
    assert sorted(map(tuple, found)) == expected


def features(contact, x):
    """{the two features that hold the closest points: area}: pairs at the same features merged, as ipctk does.

    Edges that are mollified stay pairs of edges, whichever of their points are closest.
    """
    pairs, found = contact.distinct(x), {}
    for k, (rows, area) in enumerate(zip(pairs.elements, pairs.weights, strict=True)):
        split = 1 if k < pairs.n_points else 2
        points = four_points(x, pairs.elements, k)
        g = np.array(closest_points(points, split == 2)[0])
        mollified = split == 2 and kernels.cross_squared(points) < pairs.thresholds[k]
        used = np.ones(4, bool) if mollified else g != 0.0
        key = frozenset(frozenset(rows[part][used[part]].tolist()) for part in (slice(split), slice(split, None)))
        found[key] = found.get(key, 0.0) + area
    return without_zeros(found)


def without_zeros(areas):
    """Areas by feature but those that cancel."""
    return {key: area for key, area in areas.items() if abs(area) > 1e-12 * max(map(abs, areas.values()))}


def features_of_ipctk(contact, x):
    """`features` of ipctk's collisions."""
    mesh = contact.candidates.mesh
    edges, faces = mesh.edges, mesh.faces
    found = {}
    for collisions in contact.candidates.collisions(x):
        for one, other, listed in (
            (lambda c: [c.vertex0_id], lambda c: [c.vertex1_id], collisions.vv_collisions),
            (lambda c: [c.vertex_id], lambda c: edges[c.edge_id], collisions.ev_collisions),
            (lambda c: edges[c.edge0_id], lambda c: edges[c.edge1_id], collisions.ee_collisions),
            (lambda c: [c.vertex_id], lambda c: faces[c.face_id], collisions.fv_collisions),
        ):
            for each in listed:
                if each.compute_distance(each.dof(np.asfortranarray(x), edges, faces)) < D_HAT**2:
                    key = frozenset((frozenset(map(int, one(each))), frozenset(map(int, other(each)))))
                    found[key] = found.get(key, 0.0) + each.weight
    return without_zeros(found)


@pytest.mark.parametrize("name", GENERAL)
def test_regions_and_areas_against_ipctk(name):
    pose = POSES[name]
    expected = features_of_ipctk(by_ipctk(pose.contact()), pose.x)
    found = features(pose.contact(), pose.x)
    assert found.keys() == expected.keys()
    areas = np.array([(area, expected[key]) for key, area in found.items()])
    assert areas[:, 0] == pytest.approx(areas[:, 1], rel=1e-12)


def test_every_kind_of_collision_occurs():
    sizes = {
        tuple(sorted(map(len, key)))
        for name in GENERAL
        for key in features_of_ipctk(by_ipctk(POSES[name].contact()), POSES[name].x)
    }
    assert sizes == {(1, 1), (1, 2), (2, 2), (1, 3)}
