"""Borders that cross themselves by a millimetre are mended, with a note; by more they are refused."""

import numpy as np
import pytest
from sewing_patterns import panel, specification

from clothsim.base.errors import InputError
from clothsim.patterns.borders import MENDED, borders, crossing_sides, mended
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


def dart(past: float):
    """A panel of 40 by 40 cm whose dart from its lower edge ends `past` mm above its upper one."""
    loop = [[0, 0], [18, 0], [20, 40 + past / 10], [22, 0], [40, 0], [40, 40], [0, 40]]
    return pattern_of(specification({"front": panel(loop)}))


def neckline(bow: float):
    """A panel whose neckline leaves its corner outside the shoulder, by a bow of its curve."""
    entries = panel([[0, 0], [30, 0], [30, 40], [10, 46], [0, 25]])
    entries["edges"][3]["curvature"] = {"type": "quadratic", "params": [[-0.05, bow]]}
    return pattern_of(specification({"front": entries}))


@pytest.mark.parametrize("past", [0.0, 0.4, 1.0])
def test_a_dart_past_the_edge_is_shortened(past):
    pattern = dart(past)
    assert [note.split()[0] for note in mesh_pattern(pattern, 0.03).pattern.notes if "mended" in note] == ["front"]
    border = borders(pattern, 0.03)["front"]
    after, note = mended(pattern.panels["front"], border)
    assert "edges" in note
    assert np.isclose(after.points[border.starts[2], 1], 0.399)


def test_a_border_without_crossing_stays():
    pattern = dart(-5.0)
    border = borders(pattern, 0.03)["front"]
    assert mended(pattern.panels["front"], border) == (border, "")


def test_a_dart_far_past_the_edge_is_refused():
    with pytest.raises(InputError, match="front crosses itself"):
        mesh_pattern(dart(5.0), 0.03)


def crossed_necklines() -> list[float]:
    """Bows of the neckline, the least crossing first, at which it crosses the shoulder."""
    found = []
    for bow in np.arange(0.4, 0.1, -0.002):
        pattern = neckline(float(bow))
        if len(crossing_sides(borders(pattern, 0.01)["front"].points)):
            found.append(float(bow))
    return found


def test_a_neckline_outside_the_shoulder_is_bent_inside():
    bow = crossed_necklines()[0]
    pattern = neckline(bow)
    border = borders(pattern, 0.01)["front"]
    after, note = mended(pattern.panels["front"], border)
    assert "edges 2 and 3" in note
    assert not len(crossing_sides(after.points))
    moved = np.linalg.norm(after.points - border.points, axis=1)
    assert 0 < moved.max() <= MENDED
    assert moved[: border.starts[3]].max() == 0  # the shoulder stays
