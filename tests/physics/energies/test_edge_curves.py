"""Curves along edges: order, closed lines, lengths at rest, and refused selections."""

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim.base.errors import InputError
from clothsim.mesh.cloth import PatternLines
from clothsim.mesh.world import make_world
from clothsim.physics.energies.edge_curves import chained, edge_curves


def sheet(**more):
    return make_world([cloth(*grid(2, 2), **more)])


def test_a_side_is_one_open_line_in_order_with_its_lengths():
    (left,) = edge_curves("left", sheet(), "left")
    assert left.vertices.tolist() == [0, 1, 2]
    assert left.edges.tolist() == [[0, 1], [1, 2]]
    np.testing.assert_allclose(left.lengths, 0.5)


def test_a_border_is_a_closed_line_without_the_edges_inside():
    (border,) = edge_curves("all", sheet(), "boundary")
    assert border.vertices[0] == border.vertices[-1]
    assert len(set(border.vertices.tolist())) == len(border.vertices) - 1 == 8
    assert 4 not in border.vertices
    assert border.lengths.sum() == pytest.approx(4.0)


def test_a_box_takes_the_border_within_it():
    lines = edge_curves("box", sheet(), {"box": [[-0.1, -0.1, -1], [0.6, 2, 1]]})
    assert sorted(vertex for line in lines for vertex in line.vertices.tolist()) == [0, 1, 2, 3, 5]


def test_two_cloths_have_a_line_each():
    world = make_world([cloth(*grid(2, 2), name="a"), cloth(*grid(2, 2), name="b")])
    assert [line.vertices.tolist() for line in edge_curves("left", world, "left")] == [[0, 1, 2], [9, 10, 11]]


def test_edges_and_labels_of_a_pattern_are_joined_to_lines():
    edges = {("front", 0): np.array([0, 1, 2]), ("front", 1): np.array([2, 5, 8]), ("back", 0): np.array([7, 6])}
    lines = PatternLines(edges, {"waist": (("front", 1), ("front", 0)), "hem": (("back", 0),)})
    world = sheet(lines=lines)
    assert edge_curves("x", world, {"label": "waist"})[0].vertices.tolist() == [0, 1, 2, 5, 8]
    assert edge_curves("x", world, {"panel": "back", "edge": 0})[0].vertices.tolist() == [6, 7]
    with pytest.raises(InputError, match="whole panel"):
        edge_curves("x", world, {"panel": "back"})


def test_numbers_are_taken_in_their_order_and_must_be_neighbours():
    (line,) = edge_curves("x", sheet(), [2, 1, 0, 3])
    assert line.vertices.tolist() == [2, 1, 0, 3]
    with pytest.raises(InputError, match="2 and 6"):
        edge_curves("x", sheet(), [1, 2, 6])
    with pytest.raises(InputError, match="vertex numbers"):
        edge_curves("x", sheet(), [0.5, 1.2])
    for nothing in ([], [3], {"box": [[-0.1, -0.1, -1], [0.1, 0.1, 1]]}):
        with pytest.raises(InputError, match="no edge"):
            edge_curves("x", sheet(), nothing)


@pytest.mark.parametrize("numbers", [[0, 1, 0], [0, 1, 2, 1], [0, 3, 4, 1, 0, 3]])
def test_an_edge_counts_once(numbers):
    with pytest.raises(InputError, match="twice"):
        edge_curves("x", sheet(), numbers)


def test_a_branching_line_is_refused():
    with pytest.raises(InputError, match="branches at vertex 1"):
        chained("x", np.array([[0, 1], [1, 2], [1, 3]]))
