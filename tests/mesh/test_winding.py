"""Consistent winding: majority of each component, outwards of a body; what has no two sides stays."""

import numpy as np
import pytest
from fitting_cases import moebius_strip

from clothsim.mesh.checks import examine
from clothsim.mesh.generators.shapes import rectangle, tube
from clothsim.mesh.winding import (
    facing_away,
    joined_half_edges,
    one_sided_edge,
    turned_triangles,
    wound,
)


@pytest.mark.parametrize("seed", range(4))
def test_any_turned_minority_turns_back(seed):
    points, triangles = tube(cells=(12, 6))
    turned = np.random.default_rng(seed).random(len(triangles)) < 0.3
    mixed = np.where(turned[:, None], triangles[:, [0, 2, 1]], triangles)
    result, found = wound(mixed, len(points))
    assert np.array_equal(found, turned)
    assert np.array_equal(result, triangles)


def test_a_consistent_mesh_is_the_same_array():
    points, triangles = rectangle(cells=(4, 4))
    assert wound(triangles, len(points))[0] is triangles


def test_only_pieces_that_were_rewound_turn_away_from_a_body():
    points, triangles = tube(radius=0.2, height=0.4, cells=(12, 6))
    n, m = len(points), len(triangles)
    inwards = triangles[:, [0, 2, 1]]
    both = np.concatenate([inwards, inwards + n])
    both[0] = both[0, [0, 2, 1]]
    positions = np.concatenate([points, points + np.array([1, 0, 0])])
    rewound, turned = wound(both, 2 * n)
    body = np.array([[0, 0, -0.1], [0, 0, 0.1], [1, 0, 0]])
    result = facing_away(positions, rewound, body, turned)
    assert np.array_equal(np.sort(result[:m]), np.sort(triangles))
    assert np.array_equal(result[:m], inwards[:, [0, 2, 1]])
    assert np.array_equal(result[m:], inwards + n)


def test_unsound_triangles_stay():
    triangles = np.array([[0, 1, 2], [2, 1, 3], [0, 0, 9], [2, 4, 3]])
    result, turned = wound(triangles, 5)
    assert turned.tolist() == [False, False, False, True]
    assert np.array_equal(result[2], triangles[2])


@pytest.mark.parametrize("n", [5, 9, 14])
def test_a_moebius_strip_stays_and_its_edge_is_an_inner_one(n):
    points, triangles = moebius_strip(n)
    assert wound(triangles, len(points))[0] is triangles
    joined = joined_half_edges(triangles)
    assert len(turned_triangles(triangles, joined)[1]) == len(triangles)
    edge = one_sided_edge(triangles, joined)
    assert sum(set(edge) <= set(triangle) for triangle in triangles.tolist()) == 2
    kinds = {finding.kind: finding.sentence for finding in examine("strip", points, triangles).errors}
    assert f"edge {edge[0]}-{edge[1]}" in kinds["one-sided"]
