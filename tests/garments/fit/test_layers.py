"""Order of the pieces of a garment."""

import numpy as np
from fitting_cases import RADIUS, capsule_figure, task
from tangles import joined

from clothsim.garments.fit.pieces import layers_of
from clothsim.garments.fit.pipeline import seed_fit
from clothsim.garments.inputs import Garment
from clothsim.mesh.generators.shapes import tube
from clothsim.mesh.topology import components


def tubes(*radii, shift=0.0):
    return joined(
        *((x + np.array([0, 0, k * shift]), t) for k, (x, t) in enumerate(tube(r, 0.3, cells=(24, 10)) for r in radii))
    )


def levels(x, triangles):
    distance = np.linalg.norm(x[:, :2], axis=1) - RADIUS
    layer, piece = layers_of(x, triangles, distance), components(triangles, len(x))
    return [set(layer[piece == number].tolist()) for number in np.unique(piece)]


def test_the_outer_piece_has_the_larger_layer_in_any_order():
    assert levels(*tubes(0.11)) == [{0}]
    assert levels(*tubes(0.11, 0.12)) == [{0}, {1}]
    assert levels(*tubes(0.13, 0.11, 0.12)) == [{2}, {0}, {1}]


def test_pieces_that_do_not_overlap_or_are_alike_are_not_ordered():
    assert levels(*tubes(0.11, 0.12, shift=0.5)) == [{0}, {0}]
    x, triangles = tube(0.11, 0.3, cells=(24, 10))
    half = len(x)
    waves = x * (1 + 0.1 * np.sin(9 * np.arctan2(x[:, 1], x[:, 0]))[:, None] * [1, 1, 0])
    assert levels(np.concatenate([x, waves]), np.concatenate([triangles, triangles + half])) == [{0}, {0}]


def test_a_repair_keeps_the_order(tmp_path):
    """Two layers of which a patch of the outer one lies inside the inner one, and most of it outside."""
    x, triangles = tubes(0.12, 0.112)
    outer = np.arange(len(x)) < len(x) // 2
    angle = np.arctan2(x[:, 1], x[:, 0])
    dent = outer & (np.abs(angle) < 0.5) & (np.abs(x[:, 2]) < 0.12)
    x[dent] *= [0.109 / 0.12, 0.109 / 0.12, 1.0]
    figure = capsule_figure()
    found = seed_fit(task(Garment("layers", x, triangles), figure, figure, tmp_path))
    assert found.stages[0].counts.self_pairs > 50
    assert found.last.counts.clean
    moved = found.last.positions
    radius = np.linalg.norm(moved[:, :2], axis=1)
    at = {
        tuple(np.round(row, 6)): r
        for row, r in zip(np.column_stack([angle, x[:, 2]])[~outer], radius[~outer], strict=True)
    }
    inner = np.array([at[tuple(np.round(row, 6))] for row in np.column_stack([angle, x[:, 2]])[outer]])
    assert (radius[outer] > inner).all()
