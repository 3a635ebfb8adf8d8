"""Mid-edge bending against the elastica and the loaded ring, on strips cut at any angle and on random meshes."""

from functools import lru_cache

import numpy as np
import pytest

from tests.known_answers.plates import DEFLECTION, INNER, OUTER, drooped, elastica, ring_deflection
from tests.known_answers.strips import cut, lattice_strip, random_ring, random_strip

MESHES = {
    **{f"cut at {degrees}": lambda cells, d=degrees: lattice_strip(cells, d) for degrees in (0, 45, 90, 135)},
    "random": lambda cells: random_strip(cells, 3),
}
every_mesh = pytest.mark.parametrize("name", MESHES)


@lru_cache
def error(name, cells, gamma):
    return drooped(*MESHES[name](cells), "midedge", gamma) / elastica(gamma) - 1


@pytest.mark.parametrize(("gamma", "ratio"), [(1, 0.12456177), (10, 1.06680232), (100, 5.88810462)])
def test_reference(gamma, ratio):
    assert elastica(gamma) == pytest.approx(ratio, abs=1e-8)


@every_mesh
@pytest.mark.parametrize("gamma", [1, 10, 100])
def test_a_free_strip_hangs_as_the_elastica_however_it_is_cut(name, gamma):
    """Half a per cent at 40 cells; so the spread over the cuts is below 1 %, half of what it may be."""
    assert abs(error(name, 40, gamma)) < 5e-3


@pytest.mark.parametrize("name", ["cut at 0", "cut at 45"])
def test_the_cantilever_is_second_order(name):
    assert np.log2(abs(error(name, 20, 1)) / abs(error(name, 40, 1))) > 1.9


def test_the_cantilever_is_second_order_on_random_meshes():
    """Meshes at random are not nested: the error of one is 5 % this or that side of its size's mean."""
    coarse, fine = (
        np.mean([drooped(*random_strip(cells, seed), "midedge", 1) / elastica(1) - 1 for seed in range(4)])
        for cells in (20, 40)
    )
    assert np.log2(coarse / fine) > 1.9


@pytest.mark.parametrize("model", ["hinge", "midedge"])
def test_the_ring_converges_with_the_convergent_model_alone(model):
    coarse, fine = (
        abs(ring_deflection(*random_ring(cells, 0, INNER, OUTER), model) / DEFLECTION - 1) for cells in (4, 8)
    )
    if model == "midedge":
        assert np.log2(coarse / fine) > 1.8
        assert fine < 0.015
    else:
        assert fine > 0.15


def test_hinges_belong_to_the_mesh():
    """The strip with stiff diagonals droops by half, the other by too much."""
    along, across = (drooped(*lattice_strip(12, d), "hinge", 1) / elastica(1) for d in (45, 135))
    assert along > 1.2
    assert across < 0.7


@every_mesh
@pytest.mark.parametrize("cells", [10, 40])
def test_strips_fill_their_rectangle_without_slivers(name, cells):
    points, triangles = MESHES[name](cells)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert area.sum() == pytest.approx(0.2, rel=1e-12)
    longest = np.max([np.linalg.norm(u - v, axis=1) for u, v in ((a, b), (b, c), (c, a))], axis=0)
    assert (2 * area / longest**2).min() > 0.2
    assert len(np.unique(points.round(9), axis=0)) == len(points) == triangles.max() + 1


def test_cut_shares_the_vertices_on_the_line():
    points = np.array([[0.0, 0], [2, 0], [2, 2], [0, 2]])
    kept, triangles = cut(points, np.array([[0, 1, 2], [0, 2, 3]]), np.array([1.0, 0]), 0.5)
    assert len(kept) == 5  # two corners, and where the bottom, the top and the diagonal cross x = 0.5
    assert kept[:, 0].max() == 0.5
    assert len(triangles) == 3


def test_ring_has_its_hole():
    points, triangles = random_ring(3, 0, 0.6, 1.0)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2
    assert area == pytest.approx(np.pi * (1 - 0.36), rel=0.01)
