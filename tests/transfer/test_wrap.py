"""The union of a body's pieces as one closed surface."""

import numpy as np
import pytest
import trimesh
from pieced_figures import figure

from transfer.body_parts import body_parts
from transfer.errors import TransferError
from transfer.signed_distance import body_surface
from transfer.wrap import union

CELL = 0.02


def capsules_apart(gap):
    """Two capsules in a line, `gap` [m] between their ends: positions and triangles."""
    one = trimesh.creation.capsule(0.3, 0.06, count=(16, 12))
    other = one.copy()
    other.apply_translation([0.0, 0.0, np.ptp(one.vertices[:, 2]) + gap])
    both = trimesh.util.concatenate([one, other])
    return np.asarray(both.vertices, float), np.asarray(both.faces, np.int64)


@pytest.mark.parametrize(("gap", "slack"), [(-0.05, 0.02), (0.03, 0.04)])
def test_the_union_is_closed_in_one_piece_and_on_the_pieces(gap, slack):
    surface = body_surface(*capsules_apart(gap))
    made = trimesh.Trimesh(*union(surface, CELL), process=False)
    assert made.is_watertight
    assert made.body_count == 1
    assert made.volume > 0  # outward
    distance = surface.closest(made.vertices).signed_distance
    assert np.abs(distance).max() < slack  # a bridged gap is filled
    assert np.median(np.abs(distance)) < 0.1 * CELL


def test_pieces_far_apart_are_refused_with_their_number():
    with pytest.raises(TransferError, match=r"80 mm.* 2 parts"):
        union(body_surface(*capsules_apart(0.2)), CELL)


def test_a_fragment_is_left_out_and_a_hole_is_closed():
    whole = trimesh.creation.icosphere(3, 0.3)
    crumb = trimesh.creation.icosphere(1, 0.021)
    crumb.apply_translation([0.8, 0.0, 0.0])
    keep = np.linalg.norm(whole.triangles_center - [0.0, 0.0, 0.3], axis=1) > 0.08
    positions = np.concatenate([whole.vertices, crumb.vertices])
    triangles = np.concatenate([whole.faces[keep], crumb.faces + len(whole.vertices)])
    made = trimesh.Trimesh(*union(body_surface(positions, triangles), CELL), process=False)
    assert made.is_watertight
    np.testing.assert_allclose(made.bounds, [[-0.3] * 3, [0.3] * 3], atol=0.6 * CELL)


def test_a_figure_in_pieces_has_the_landmarks_that_it_was_made_with():
    positions, triangles, pieces = figure(seed=3, gap=0.012)
    assert pieces > 20
    parts = body_parts(*union(body_surface(positions, triangles), CELL))
    np.testing.assert_allclose(parts.frame.front, [0, 0, 1], atol=0.05)
    assert 0.74 < parts.landmarks["crotch"] < 0.86  # between the thighs, whose axes end at .87 m
    assert 1.15 < parts.landmarks["armpit"] < 1.36  # below the shoulder joint at 1.37 m
    assert 1.38 < parts.landmarks["neck"] < 1.54
