"""Neighbouring triangles and connected pieces."""

import numpy as np

from clothsim.mesh.generators.table import GENERATORS
from transfer.triangle_surface import adjacent_triangles, largest_component, vertex_components

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
