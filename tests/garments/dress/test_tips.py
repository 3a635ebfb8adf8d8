"""Tips of panels that touch in a point are drawn back into their panels; other vertices stay."""

import numpy as np
from sewing_patterns import panel, specification

from clothsim.garments.dress.corrections import parted
from clothsim.garments.dress.sewing_state import as_placed
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of

GODET = [[0, 0], [20, 0], [10, 30]]


def godets(apart):
    """Two triangles in one plane, `apart` cm between the tips of their bases."""
    panels = {name: panel(GODET, translation=[at, 90, 20]) for name, at in (("a", 0), ("b", 20 + apart))}
    return as_placed(mesh_pattern(pattern_of(specification(panels, [])), 0.05))


def test_two_tips_are_drawn_apart_and_nothing_else_moves():
    state = godets(0)
    moved, notes = parted(state)
    changed = np.flatnonzero((moved.positions != state.positions).any(axis=1))
    assert len(notes) == 1
    assert len(changed) == 2
    a, b = moved.positions[changed]
    assert np.linalg.norm(state.positions[changed[0]] - state.positions[changed[1]]) < 1e-12
    assert 2e-3 < np.linalg.norm(a - b) < 0.02
    assert a[0] < state.positions[changed[0], 0] < b[0]


def test_panels_that_do_not_touch_stay():
    state = godets(0.1)
    moved, notes = parted(state)
    assert moved is state
    assert notes == ()
