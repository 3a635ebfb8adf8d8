"""Edge collapse: short edges removed; surface, border and middle preserved."""

import numpy as np

from clothsim.mesh.generators.garments.relax import collapsed
from clothsim.mesh.topology import border_edges, border_vertices, unique_edges


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
