"""Tight panels: those whose cloth is stretched by more than a tenth over half of their area."""

import numpy as np
from sewing_patterns import skirt

from clothsim.garments.dress.measurements import tight_notes, tight_panels
from clothsim.garments.dress.sewing_state import SewingState, as_placed
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


def stretched(front: float, back: float, below: float = 0.0) -> SewingState:
    """The skirt with both panels widened by factors, the front's above the height `below` [m] alone."""
    state = as_placed(mesh_pattern(pattern_of(skirt()), 0.01))
    positions = state.positions.copy()
    for name, factor in (("front", front), ("back", back)):
        rows = state.mesh.vertices[name]
        wide = positions[rows, 1] >= below if name == "front" else True
        positions[rows, 0] *= np.where(wide, factor, 1.0)
    return state.moved_to(positions)


def test_panels_as_cut_are_not_tight():
    assert tight_panels(stretched(1.0, 1.09)) == {}
    assert tight_notes(stretched(1.0, 1.09)) == ()


def test_tight_panels_are_named_with_their_median_the_largest_first():
    found = tight_panels(stretched(1.2, 1.5))
    assert list(found) == ["back", "front"]
    assert np.allclose(list(found.values()), [1.5, 1.2], rtol=1e-12)
    (note,) = tight_notes(stretched(1.2, 1.5))
    assert "back (1.50), front (1.20)" in note


def test_less_than_half_of_a_panel_is_not_tight_and_more_is():
    assert tight_panels(stretched(1.3, 1.0, below=0.14)) == {}
    assert list(tight_panels(stretched(1.3, 1.0, below=0.05))) == ["front"]
