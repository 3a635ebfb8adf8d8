"""Bar of a garment that looks worn: each measure fails by its own fault."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from clothsim.garments.fit.transfer_seed import sized
from clothsim.garments.fit.wear_check import check_wear
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.mesh.generators.table import GENERATORS
from transfer.body_parts import body_parts
from transfer.signed_distance import body_surface

FIGURE = BodyMesh("mannequin", *GENERATORS["mannequin"](), 1.0, ())
SHIRT = Garment("shirt", *GENERATORS["shirt"]())


def test_a_garment_as_given_meets_the_bar_at_any_size_and_turn():
    for x, body in ((SHIRT.positions, FIGURE.positions), (1.3 * SHIRT.positions, 1.3 * FIGURE.positions)):
        look = check_wear(
            SHIRT, x * [-1, -1, 1], FIGURE, BodyMesh("turned", body * [-1, -1, 1], FIGURE.triangles, 1.0, ())
        )
        assert look.fault == ""
        assert (look.edge_low, look.edge_high, look.front) == pytest.approx((1, 1, 1))
        assert abs(look.hem) < 1e-9


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda x: x * [-1, -1, 1], "turned"),
        (lambda x: x * [1, 1, 2.4] - [0, 0, 1.4], "edges"),
        (lambda x: x + np.array([0, 0, 0.1]), "hem"),
    ],
)
def test_each_fault_is_named(change, word):
    look = check_wear(SHIRT, change(SHIRT.positions), FIGURE, FIGURE)
    assert word in look.fault
    assert len(look.place) == 3
    assert look.as_dict()["fault"] == look.fault


@pytest.mark.parametrize("every", [1, 2])
def test_a_body_whose_triangles_are_turned_inward_wears_as_another(every):
    """every: second triangle turned, or all."""
    inward = FIGURE.triangles.copy()
    inward[::every] = inward[::every, ::-1]
    look = check_wear(SHIRT, SHIRT.positions, FIGURE, BodyMesh("inward", FIGURE.positions, inward, 1.0, ()))
    assert look.fault == ""
    assert look.front == pytest.approx(1.0)


def test_trousers_on_a_body_that_walks_are_not_turned():
    trousers = Garment("trousers", *GENERATORS["trousers"](edge=0.04))
    walking = BodyMesh("walking", *GENERATORS["mannequin"](pose="walk"), 1.0, ())
    worn = trousers.positions + _moved_with(trousers.positions, walking)
    assert check_wear(trousers, worn, FIGURE, walking).front > 0.8
    assert check_wear(trousers, worn * [-1, -1, 1], FIGURE, walking).front < 0.0


def _moved_with(points, other):
    """Displacements (k, 3) of the vertices of the mannequin nearest to points, to those of one in another pose."""
    near = cKDTree(FIGURE.positions).query(points)[1]
    return other.positions[near] - FIGURE.positions[near]


def test_a_figure_that_is_no_body_leaves_the_transferred_shape():
    ball = BodyMesh("ball", *GENERATORS["sphere"](subdivisions=2), 1.0, ())
    size = sized(SHIRT, ball, FIGURE, SHIRT.positions, body_surface(FIGURE.positions, FIGURE.triangles), graded=True)
    assert size.kind == "transferred"
    assert size.positions is SHIRT.positions


def test_own_size_on_a_larger_body_keeps_the_edges():
    large = BodyMesh("large", FIGURE.positions * 1.1, FIGURE.triangles, 1.0, ())
    body = body_surface(large.positions, large.triangles)
    own, graded = (sized(SHIRT, FIGURE, large, 1.1 * SHIRT.positions, body, graded=flag) for flag in (False, True))
    scales = [check_wear(SHIRT, size.positions, FIGURE, large).scale for size in (own, graded)]
    assert scales[0] == pytest.approx(1.0, abs=0.04)
    assert scales[1] == pytest.approx(1.1, rel=0.01)
    assert graded.factors["chest"] == pytest.approx(1.1)
    assert own.factors == {}
    assert np.isfinite(own.positions).all()


def test_a_hem_is_where_it_was_between_landmarks_of_a_body_with_longer_legs():
    crotch = FIGURE.parts.landmarks["crotch"]
    skirt = Garment("skirt", *GENERATORS["skirt"]())

    def longer(x):
        return x + np.outer(0.2 * np.minimum(x[:, 2], crotch), [0, 0, 1])

    tall = BodyMesh("tall", longer(FIGURE.positions), FIGURE.triangles, 1.0, ())
    look = check_wear(skirt, longer(skirt.positions), FIGURE, tall)
    assert abs(look.hem) < 0.005
    by_height = longer(skirt.positions)[:, 2].min() / tall.frame.height - skirt.positions[:, 2].min() / 1.7
    assert by_height > 0.015  # by the whole height it would seem to have risen


def test_the_parts_of_a_figure_are_found_once(monkeypatch):
    from clothsim.garments import inputs

    calls = []
    monkeypatch.setattr(inputs, "body_parts", lambda *mesh: calls.append(mesh) or body_parts(*mesh))
    large = BodyMesh("large", FIGURE.positions * 1.1, FIGURE.triangles, 1.0, ())
    body = body_surface(large.positions, large.triangles)
    size = sized(SHIRT, large, large, 1.1 * SHIRT.positions, body, graded=True)
    check_wear(SHIRT, size.positions, large, large)
    assert len(calls) == 1
