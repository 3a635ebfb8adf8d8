"""Edge-triangle intersections, contours and regions of two crossing surfaces whose answer is known."""

import numpy as np
from tangles import crossing_sheets, joined, sleeve_through_sheet

from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.geometry.untangling.contours import contours, edge_triangle_intersections, inner_ends, make_mesh
from clothsim.geometry.untangling.displacement_targets import contour_gradients, slides
from clothsim.mesh.generators.shapes import rectangle


def analysed(x, triangles):
    pairs = intersecting_pairs(x, triangles)
    found = edge_triangle_intersections(x, triangles, pairs)
    mesh = make_mesh(triangles, np.ones(len(triangles)), len(x))
    graph = contours(found, len(pairs))
    return pairs, found, graph, inner_ends(mesh, found, graph, np.zeros(len(x), bool))


def test_piercings_lie_on_both_surfaces():
    x, triangles, _ = sleeve_through_sheet()
    _, found, _, _ = analysed(x, triangles)
    along = found.along[:, None]
    on_edge = (1 - along) * x[found.edges[:, 0]] + along * x[found.edges[:, 1]]
    on_face = np.einsum("ij,ijk->ik", found.barycentric, x[triangles[found.faces]])
    np.testing.assert_allclose(on_edge, on_face, atol=1e-12)
    assert (found.depths.prod(axis=1) <= 0).all()
    assert len(np.unique(np.column_stack([found.edges, found.faces]), axis=0)) == len(found.edges)


def test_a_sleeve_makes_one_contour_of_two_curves_and_its_short_end_is_inside():
    x, triangles, _ = sleeve_through_sheet()
    _, found, graph, chosen = analysed(x, triangles)
    assert graph.n_contours == 1
    assert len(np.unique(graph.edge_curve)) == 2
    assert not chosen.is_open.any()
    end = (np.arange(len(x)) >= 441) & (x[:, 2] < 0)
    assert np.array_equal(chosen.inside, end)
    rows = np.flatnonzero(chosen.inner >= 0)
    assert end[found.edges[rows, chosen.inner[rows]]].all()


def test_two_pokes_are_two_contours():
    sheet, (patch, faces) = rectangle(cells=(12, 12)), rectangle(size=(0.8, 0.8), cells=(14, 14))
    lowered = patch + np.array([0.011, 0.007, 0.05])
    for centre in (-0.2, 0.2):
        lowered[:, 2] -= 0.1 * np.exp(-((patch[:, 0] - centre) ** 2 + patch[:, 1] ** 2) / 0.08**2)
    _, _, graph, chosen = analysed(*joined(sheet, (lowered, faces)))
    assert graph.n_contours == 2
    assert not chosen.is_open.any()


def test_a_contour_that_ends_inside_both_sheets_is_open_and_slides_along_itself():
    x, triangles, _ = crossing_sheets()
    pairs, found, graph, chosen = analysed(x, triangles)
    assert chosen.is_open.all()
    directions = slides(contour_gradients(x, triangles, pairs, found), graph)
    assert (np.abs(directions[:, 0]) > 0.99).all()
    of_first = found.edges[:, 0] < 121
    assert len(np.unique(np.sign(directions[of_first, 0]))) == 1
    assert (np.sign(directions[of_first, 0][0]) != np.sign(directions[~of_first, 0])).all()


def test_the_gradient_at_the_end_of_a_contour_points_into_the_surface():
    """A strip that stands in a sheet: its border edge shortens the contour where it moves inwards."""
    sheet = rectangle(size=(4.0, 4.0), cells=(1, 1))
    strip = np.array([[0.0, 0.1, -1], [1.0, 0.1, -1], [0.0, 0.1, 1], [1.0, 0.1, 1]])
    x, triangles = joined(sheet, (strip, np.array([[0, 1, 3], [0, 3, 2]])))
    pairs = intersecting_pairs(x, triangles)
    found = edge_triangle_intersections(x, triangles, pairs)
    gradient = contour_gradients(x, triangles, pairs, found)
    n = len(sheet[0])
    left = np.flatnonzero((found.edges == [n, n + 2]).all(axis=1))
    right = np.flatnonzero((found.edges == [n + 1, n + 3]).all(axis=1))
    np.testing.assert_allclose(gradient[left], [[1, 0, 0]] * len(left), atol=1e-12)
    np.testing.assert_allclose(gradient[right], [[-1, 0, 0]] * len(right), atol=1e-12)
    assert len(left) == len(right) == 1
