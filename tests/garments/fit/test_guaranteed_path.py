"""Clearings of a garment by deflation of the body."""

import numpy as np
import pytest
from fitting_cases import capsule_figure, tube_garment, wider

from clothsim.garments.fit import guaranteed_path
from clothsim.garments.fit.guaranteed_path import DEPTHS, clearings
from clothsim.garments.penetration import count_penetrations
from clothsim.mesh.generators.shapes import rectangle
from transfer.signed_distance import body_surface


def clearing(*arguments):
    """The first."""
    return next(clearings(*arguments), None)


FIGURE = capsule_figure()
BODY = body_surface(FIGURE.positions, FIGURE.triangles)


def clear(garment, positions):
    return count_penetrations(garment.positions, garment.triangles, body_surface(positions, BODY.triangles)).on_body


def test_a_garment_that_is_clear_needs_no_thinner_body():
    garment = tube_garment(0.11)
    found = clearing(garment.positions, garment.triangles, BODY)
    assert len(found.frames) == 1
    assert found.body is BODY.positions


@pytest.mark.parametrize("inside", [0.003, 0.009, 0.03])
def test_the_least_depth_is_picked(inside):
    garment = tube_garment(0.1 - inside)
    found = clearing(garment.positions, garment.triangles, BODY)
    least = next(depth for depth in DEPTHS if depth > inside)
    assert f"{1e3 * least:.3g} mm" in found.description
    middle = np.abs(BODY.positions[:, 2]) < 0.2
    np.testing.assert_allclose(np.linalg.norm(found.body[middle, :2], axis=1), 0.1 - least, rtol=1e-3)
    assert clear(garment, found.body)
    assert found.frames[-1] is BODY.positions


def test_where_no_depth_frees_it_folds_are_opened_first(monkeypatch):
    monkeypatch.setattr(guaranteed_path, "DEPTHS", ())
    garment = tube_garment(0.075)
    found = clearing(garment.positions, garment.triangles, BODY)
    assert "20 mm" in found.description
    thin, opened, whole = found.frames
    assert clear(garment, thin)
    assert not clear(garment, opened)
    assert whole is BODY.positions


def test_a_sheet_through_the_body_is_never_free():
    positions, triangles = rectangle(size=(0.5, 0.5), cells=(6, 6))
    assert clearing(positions, triangles, BODY) is None


def test_a_wider_body_of_the_same_mesh_needs_more():
    garment = tube_garment(0.097)
    wide = wider(FIGURE, 1.2)
    found = clearing(garment.positions, garment.triangles, body_surface(wide.positions, wide.triangles))
    assert "40 mm" in found.description


def test_after_the_least_depth_comes_the_unfolded_body():
    garment = tube_garment(0.091)
    first, second = clearings(garment.positions, garment.triangles, BODY)
    assert "10 mm" in first.description
    assert second.description.startswith("without folds and ")
    assert clear(garment, second.body)
    assert len(list(clearings(tube_garment(0.11).positions, garment.triangles, BODY))) == 1
