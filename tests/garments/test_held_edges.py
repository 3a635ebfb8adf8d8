"""Upper edges taken in to the girth of the body: their length, what stays, and what is said of an edge that slid."""

import numpy as np
import pytest
from sewn_tubes import tube

from clothsim.base.errors import InputError
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.waistband import LEAST_HELD, TIGHT, bands, border_loops, edges_held, panels_at, rest_length, slid
from clothsim.mesh.generators.table import GENERATORS

LOW, TOP = 0.6, 1.02


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """The mannequin, y upward."""
    positions, triangles = GENERATORS["mannequin"]()
    return BodyMesh("mannequin", positions[:, [0, 2, 1]] * [1, 1, -1], triangles, 1.0, ())


def waist_of(body: BodyMesh) -> float:
    """Girth of the body at the top of the tubes [m]."""
    state = tube(0.2, LOW, TOP)
    (band,) = bands(body.parts.frame.local(state.positions), state.triangles, body, body.parts)
    return band.girth


def top_of(state):
    return max(border_loops(state.triangles), key=lambda edges: state.positions[edges, 1].mean())


def test_a_wide_edge_is_taken_in_along_itself_alone(body):
    girth = waist_of(body)
    state = tube(1.15 * girth / (2 * np.pi), LOW, TOP)
    held, notes = edges_held(state, body)
    assert rest_length(state, top_of(state)) == pytest.approx(1.15 * girth, rel=1e-9)
    assert rest_length(held, top_of(state)) == pytest.approx(TIGHT * girth, rel=1e-3)
    assert len(notes) == 1
    assert np.array_equal(held.positions, state.positions)
    before, after = state.mesh.material_coordinates, held.mesh.material_coordinates
    sides = [each[:, 1:] - each[:, :1] for each in (before, after)]
    assert np.allclose(sides[0][..., 0], sides[1][..., 0], atol=1e-4)  # along the warp
    low = state.positions[state.triangles, 1].max(axis=1) < TOP - 0.1
    assert np.array_equal(before[low], after[low])
    areas = [np.linalg.det(each) for each in sides]
    assert (areas[1] / areas[0]).min() > 0.8
    assert (areas[1] <= areas[0] * (1 + 1e-9)).all()


def test_a_tight_edge_and_one_far_too_wide_stay(body):
    girth = waist_of(body)
    for factor, said in ((0.9 * TIGHT, 0), (1.2 * TIGHT / LEAST_HELD, 1)):
        state = tube(factor * girth / (2 * np.pi), LOW, TOP)
        held, notes = edges_held(state, body)
        assert held.mesh.material_coordinates is state.mesh.material_coordinates
        assert len(notes) == said


def test_a_garment_that_reaches_over_the_armpits_has_no_such_edge(body):
    state = tube(0.25, LOW, 1.6)
    assert edges_held(state, body)[1] == ()


def test_the_edge_is_named_by_its_panels(body):
    state = tube(0.2, LOW, TOP)
    assert sorted(panels_at(state, top_of(state))) == ["back", "front"]


def test_what_slid_is_said(body):
    state = tube(0.2, LOW, TOP)
    lower = state.moved_to(state.positions - [0, 0.08, 0])
    (note,) = slid(state, lower, body)
    assert "80 mm" in note
    assert f"{200 * np.pi * 0.2:.1f} cm" in note
    assert slid(state, state, body) == ()
    assert len(slid(state, state.moved_to(state.positions - [0, 0.5, 0]), body)) == 1


def test_a_body_without_a_trunk(body):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.8)
    round_ = BodyMesh("ball", np.asarray(ball.vertices), np.asarray(ball.faces), 1.0, ())
    with pytest.raises(InputError):
        edges_held(tube(0.2, LOW, TOP), round_)
    assert slid(tube(0.2, LOW, TOP), tube(0.2, LOW, TOP), round_) == ()
