"""Intersecting pairs of whole surfaces (grids, folds, random triangles) against the rational oracle and ipctk."""

from itertools import combinations

import ipctk
import numpy as np
import pytest
from meshes import grid, random_rotation
from rational import intersect

from clothsim import InputError
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
from clothsim.mesh.generators.table import GENERATORS


def soup(seed, count, size=0.4):
    rng = np.random.default_rng(seed)
    x = rng.random((count, 1, 3)) + size * rng.standard_normal((count, 3, 3))
    return x.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def brute(x, first, second=None):
    if second is None:
        return [(i, j) for i, j in combinations(range(len(first)), 2) if intersect(x, first[i], first[j])]
    return [(i, j) for i in range(len(first)) for j in range(len(second)) if intersect(x, first[i], second[j])]


def as_list(pairs):
    return [tuple(pair) for pair in pairs.tolist()]


@pytest.mark.parametrize("seed", range(3))
def test_a_soup_against_the_oracle(seed):
    x, triangles = soup(seed, 30)
    pairs = intersecting_pairs(x, triangles)
    assert pairs.dtype == np.int64
    assert len(pairs) > 20
    assert as_list(pairs) == brute(x, triangles)


def test_two_surfaces_against_the_oracle():
    x, triangles = soup(5, 30)
    assert as_list(intersecting_pairs(x, triangles[:12], triangles[12:])) == brute(x, triangles[:12], triangles[12:])


@pytest.mark.parametrize("shape", [np.eye(3), random_rotation(3), np.diag([1.0, 1 / 30, 1.0]) @ random_rotation(4)])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_a_flat_sheet_meets_itself_nowhere(shape, offset):
    """All its triangles touch in one plane, but for round-off. At an offset of 1e6 that is 1e-10: still no overlap."""
    x, triangles = grid(12, 12)
    assert len(intersecting_pairs(x @ shape + offset, triangles)) == 0


def test_a_sheet_folded_flat_onto_itself_exactly():
    x, triangles = grid(4, 2)
    x[:, 0] = np.abs(x[:, 0] - 0.5)
    pairs = intersecting_pairs(x, triangles)
    assert as_list(pairs) == brute(x, triangles)
    assert len(pairs) > 30
    x[:, 2] = 1e-9 * x[:, 0] * (grid(4, 2)[0][:, 0] > 0.5)
    assert len(intersecting_pairs(x, triangles)) == 0


@pytest.mark.parametrize("seed", range(20))
def test_ipctk_agrees_in_general_position(seed):
    x, triangles = soup(seed, 2, size=0.6)
    faces = np.asfortranarray(triangles.astype(np.int32))
    mesh = ipctk.CollisionMesh(np.asfortranarray(x), ipctk.edges(faces), faces)
    assert bool(len(intersecting_pairs(x, triangles))) == ipctk.has_intersections(mesh, np.asfortranarray(x))


def test_a_slab_of_a_few_triangles_and_a_fine_sheet():
    sheet, small = grid(40, 40)
    slab, large = GENERATORS["slab"](size=[1e6, 1e6, 1.0])
    for height, count in ((0.5, len(small)), (0.5 + 1e-9, 0)):
        x = np.concatenate([sheet + np.array([0.1, 0.2, height]), slab])
        pairs = intersecting_pairs(x, small, large + len(sheet))
        assert len(np.unique(pairs[:, 0])) == count
        assert as_list(intersecting_pairs(x, large + len(sheet), small)) == sorted(map(tuple, pairs[:, ::-1].tolist()))


def test_unit_and_place_do_not_matter():
    x, triangles = soup(1, 20)
    expected = intersecting_pairs(x, triangles)
    for factor in (2.0**-600, 2.0**-40, 2.0**400):
        assert np.array_equal(intersecting_pairs(x * factor, triangles), expected)


def test_a_limit_ends_the_search():
    x, triangles = soup(0, 30)
    everything = set(as_list(intersecting_pairs(x, triangles)))
    few = as_list(intersecting_pairs(x, triangles, limit=3))
    assert len(few) == 3
    assert set(few) <= everything
    assert few == sorted(few)


def test_more_pairs_than_fit_at_first():
    x, triangles = soup(0, 40, size=2.0)
    assert len(intersecting_pairs(x, triangles)) > 64
    assert as_list(intersecting_pairs(x, triangles)) == brute(x, triangles)


def test_places_are_in_both_boxes_and_near_the_smaller_triangle():
    x, triangles = soup(2, 30)
    x[:3] *= 100
    pairs = intersecting_pairs(x, triangles)
    points = intersection_points(x, triangles, triangles, pairs)
    assert points.shape == (len(pairs), 3)
    for (i, j), point in zip(pairs, points, strict=True):
        for corners in (x[triangles[i]], x[triangles[j]]):
            assert np.all(corners.min(axis=0) <= point)
            assert np.all(point <= corners.max(axis=0))


def test_nothing_to_test():
    x, triangles = grid(1, 1)
    none = np.zeros((0, 3), np.int64)
    for surfaces in ((none,), (triangles, none), (none, triangles)):
        assert intersecting_pairs(x, *surfaces).shape == (0, 2)
    assert intersection_points(x, none, triangles, none[:, :2]).shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"positions": [[0.0, 0, np.nan]] * 4}, r"positions\[0, 2\] is nan"),
        ({"first": [[0, 1, 9]]}, r"first\[0\]"),
        ({"second": [[0, 1, -1]]}, r"second\[0\]"),
        ({"limit": 0}, r"^limit .*1.* 0"),
    ],
)
def test_bad_arrays_are_named(change, words):
    x, triangles = grid(1, 1)
    with pytest.raises(InputError, match=words):
        intersecting_pairs(**{"positions": x, "first": triangles} | change)
