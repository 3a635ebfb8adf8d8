"""Untangling: tangles of every kind end free, by the exact check; what is not tangled stays."""

import numpy as np
import pytest
from tangles import (
    crossed_skirts,
    crossing_sheets,
    folded_corner,
    joined,
    poking_pocket,
    random_layers,
    sleeve_through_sheet,
    tube_into_tube,
)

from clothsim.base.errors import InputError
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.geometry.kinematics.deformation_gradient import deformation_gradients
from clothsim.geometry.untangling.untangle import untangle
from clothsim.mesh.cloth import triangle_planes
from clothsim.mesh.generators.shapes import rectangle, sphere, tube

KINDS = {
    "folded corner": folded_corner,
    "poking pocket": poking_pocket,
    "crossing sheets": crossing_sheets,
    "sheets that cross along a whole side": lambda: crossing_sheets((0.0, 0.02, 0.01)),
    "sheets that cross at a border": lambda: crossing_sheets((0.21, 0.02, 0.22)),
    "sleeve through a sheet": sleeve_through_sheet,
    "skirts through one another": crossed_skirts,
    "tube into a tube": tube_into_tube,
}


def pairs(x, triangles):
    return len(intersecting_pairs(x, triangles))


def stretches(x, triangles, rest):
    planes = triangle_planes(rest, triangles)
    inverses = np.linalg.inv(np.stack([planes[:, 1] - planes[:, 0], planes[:, 2] - planes[:, 0]], axis=2))
    return np.linalg.svd(deformation_gradients(x, triangles, inverses), compute_uv=False)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_tangle_ends_free(kind):
    x, triangles, rest = KINDS[kind]()
    result = untangle(x, triangles, rest)
    assert result.pairs_before == pairs(x, triangles) > 20
    assert result.free
    assert result.pairs == pairs(result.positions, triangles) == 0
    assert result.rounds < 60
    stretch = stretches(result.positions, triangles, rest)
    assert 0.4 < stretch.min() <= stretch.max() < 1.5


@pytest.mark.parametrize("seed", range(6))
def test_random_layers_end_free(seed):
    x, triangles, rest = random_layers(seed)
    result = untangle(x, triangles, rest)
    assert result.pairs_before > 0
    assert result.free
    assert np.linalg.norm(result.positions - x, axis=1).max() < 0.2


def test_what_does_not_intersect_keeps_its_bits():
    x, triangles = rectangle(cells=(4, 4))
    result = untangle(x, triangles)
    assert np.array_equal(result.positions, x)
    assert (result.pairs_before, result.rounds, result.end) == (0, 0, "free")


def test_cloth_far_from_the_tangle_stays():
    x, triangles, _ = poking_pocket()
    far, more = rectangle(size=(1.0, 1.0), cells=(5, 5))
    both, faces = joined((x, triangles), (far + np.array([3, 0, 0]), more))
    result = untangle(both, faces)
    assert result.free
    assert np.array_equal(result.positions[len(x) :], both[len(x) :])


def test_fixed_vertices_stay_and_the_others_give_way():
    x, triangles, rest = poking_pocket()
    fixed = np.arange(len(x)) < 441
    result = untangle(x, triangles, rest, fixed=fixed)
    assert result.free
    assert np.array_equal(result.positions[fixed], x[fixed])


@pytest.mark.parametrize("upper", [0, 1])
def test_layers_decide_the_sides(upper):
    """A patch half above and half below a sheet ends above or below it as the layers say."""
    sheet, patch = rectangle(size=(1.0, 1.0), cells=(20, 20)), rectangle(size=(0.4, 0.4), cells=(9, 9))
    tilted = patch[0] + [0.013, 0.021, 0.0] + 0.1 * patch[0][:, :1] * [0, 0, 1]
    x, triangles = joined(sheet, (tilted, patch[1]))
    layers = np.where(np.arange(len(x)) < len(sheet[0]), 1 - upper, upper)
    result = untangle(x, triangles, layers=layers)
    assert result.free
    apart = result.positions[len(sheet[0]) :, 2].mean() - result.positions[: len(sheet[0]), 2].mean()
    assert (apart > 0) == bool(upper)


def test_coincident_sheets_part():
    x, triangles = rectangle(cells=(6, 6))
    both, faces = joined((x, triangles), (x, triangles[:, ::-1]))
    assert pairs(both, faces) > 500
    assert untangle(both, faces).free


def test_cloth_leaves_a_body_that_stays():
    ball = sphere(radius=0.3, subdivisions=3)
    x, triangles = tube(radius=0.29, height=0.4, cells=(24, 10))
    result = untangle(x, triangles, body=ball)
    assert result.pairs_before > 0
    assert result.free
    assert np.linalg.norm(result.positions, axis=1).min() > 0.29


def test_what_cannot_be_freed_ends_by_name_with_a_place():
    x, triangles, _ = crossing_sheets()
    result = untangle(x, triangles, fixed=np.ones(len(x), bool))
    assert result.end == "stalled"
    assert result.pairs == result.pairs_before
    assert result.where.shape == (3,)
    assert untangle(x, triangles, rounds=2).end == "rounds"


@pytest.mark.parametrize("name", ["fixed", "layers"])
def test_arrays_of_another_length_are_refused(name):
    x, triangles = rectangle(cells=(2, 2))
    with pytest.raises(InputError, match=name):
        untangle(x, triangles, **{name: np.zeros(3, int)})
