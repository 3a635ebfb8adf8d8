"""Edges of a triangle list, against rows made unique.

Neighbouring triangles and connected pieces.
"""

import numpy as np

from clothsim.mesh.generators.table import GENERATORS
from transfer.triangle_surface import adjacent_triangles, edges_of, largest_component, vertex_components


def test_edges_are_the_unique_sorted_rows_in_their_order():
    rng = np.random.default_rng(3)
    for n in (3, 7, 50):
        triangles = np.stack([rng.permutation(n)[:3] for _ in range(2 * n)])
        rows = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        assert np.array_equal(edges_of(triangles), np.unique(rows, axis=0))
        assert np.array_equal(edges_of(triangles.astype(np.int32)), edges_of(triangles))
    assert edges_of(np.zeros((0, 3), np.int64)).shape == (0, 2)


BALL, TRIANGLES = GENERATORS["sphere"](radius=1.0, subdivisions=1)


def test_each_edge_of_a_closed_surface_gives_one_pair():
    pairs = adjacent_triangles(TRIANGLES)
    assert len(pairs) == 3 * len(TRIANGLES) // 2
    shared = [len(set(TRIANGLES[i]) & set(TRIANGLES[j])) for i, j in pairs]
    assert set(shared) == {2}


def test_an_edge_of_three_triangles_joins_them_in_a_chain():
    fan = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert adjacent_triangles(fan).tolist() == [[0, 1], [1, 2]]


def test_components_leave_out_what_no_triangle_uses():
    triangles = np.vstack([TRIANGLES[:3] * 0 + [[50, 51, 52]], TRIANGLES])
    labels = vertex_components(triangles, 60)
    assert (labels[43:50] == -1).all()
    assert (labels[53:] == -1).all()
    assert len(np.unique(labels[:42])) == 1
    assert largest_component(triangles, labels) == labels[0] != labels[50]
