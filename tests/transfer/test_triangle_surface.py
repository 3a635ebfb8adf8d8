"""Edges of a triangle list, against rows made unique."""

import numpy as np

from transfer.triangle_surface import edges_of


def test_edges_are_the_unique_sorted_rows_in_their_order():
    rng = np.random.default_rng(3)
    for n in (3, 7, 50):
        triangles = np.stack([rng.permutation(n)[:3] for _ in range(2 * n)])
        rows = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        assert np.array_equal(edges_of(triangles), np.unique(rows, axis=0))
        assert np.array_equal(edges_of(triangles.astype(np.int32)), edges_of(triangles))
    assert edges_of(np.zeros((0, 3), np.int64)).shape == (0, 2)
