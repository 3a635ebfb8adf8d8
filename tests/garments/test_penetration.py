"""Penetration counts against known overlaps."""

import re

import numpy as np
import pytest

from clothsim.garments.penetration import count_penetrations
from clothsim.mesh.generators.shapes import rectangle, slab
from transfer.signed_distance import body_surface

BOX = body_surface(*slab(size=(1.0, 1.0, 1.0), cells=(2, 2, 2)))
SHEET, TRIANGLES = rectangle(size=(0.4, 0.4), cells=(4, 4))


def test_a_sheet_above_the_box_is_clean():
    counts = count_penetrations(SHEET + np.array([0.0, 0.0, 0.51]), TRIANGLES, BOX)
    assert counts.clean
    assert counts.on_body
    assert counts.position is None
    assert counts.where == "nowhere"
    assert str(counts) == "0 vertices inside, 0 pairs with the body, 0 with itself"


def test_a_sheet_inside_touches_nothing_and_is_not_clean():
    counts = count_penetrations(SHEET + np.array([0.0, 0.0, 0.47]), TRIANGLES, BOX)
    assert (counts.penetrating_vertices, counts.body_pairs, counts.self_pairs) == (len(SHEET), 0, 0)
    assert counts.depth == pytest.approx(0.03)
    assert not counts.on_body
    assert re.search(r"\b25\b.*\b30 mm", str(counts))
    assert counts.where.endswith("0.47) m")


def test_a_sheet_half_way_in_counts_the_columns_inside():
    shift = np.array([0.451, 0.013, 0.017])  # columns at .251, .351, .451 are inside
    counts = count_penetrations(SHEET + shift, TRIANGLES, BOX)
    assert counts.penetrating_vertices == 15
    assert counts.depth == pytest.approx(0.249)
    assert counts.body_pairs > 0


def test_one_triangle_through_a_face_is_one_pair_or_two_at_its_diagonal():
    spike = np.array([[0.1, 0.07, 0.6], [0.14, 0.08, 0.6], [0.12, 0.09, 0.45]])
    counts = count_penetrations(spike, np.array([[0, 1, 2]]), BOX)
    assert (counts.penetrating_vertices, counts.body_pairs) == (1, 1)
    assert counts.depth == pytest.approx(0.05)
    np.testing.assert_array_equal(counts.position, spike[2])


def test_two_layers_that_cross_are_on_the_body_but_not_clean():
    above = SHEET + np.array([0.0, 0.0, 0.8])
    upright = np.column_stack([SHEET[:, 0] + 0.03, np.full(len(SHEET), 0.013), SHEET[:, 1] + 0.8])
    counts = count_penetrations(
        np.concatenate([above, upright]), np.concatenate([TRIANGLES, TRIANGLES + len(SHEET)]), BOX
    )
    assert counts.self_pairs > 0
    assert counts.on_body
    assert not counts.clean
    assert counts.position[2] == pytest.approx(0.8, abs=1e-9)
