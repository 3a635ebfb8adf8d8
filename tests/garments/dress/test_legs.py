"""Legs of trousers turned about the crotch to the legs of the body."""

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.placement import is_of_leg, placed_on, turned_to_legs
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

SPACING, LENGTH, WIDE = 0.05, 80, 24
"""Size of the mesh [m]; length of a leg and width of its hem [cm]."""


def trousers(spread: float) -> dict:
    """Four panels with straight inseams whose hems lie `spread` cm outward of the crotch."""
    panels, sewn = {}, []
    for side, sign in (("right", -1), ("left", 1)):
        loop = [[0, LENGTH], [sign * spread, 0], [sign * (spread + WIDE), 0], [sign * 30, LENGTH]]
        for name, z in (("f", 25), ("b", -25)):
            panels[f"{side}_leg_{name}"] = panel(loop, translation=[0, 5, z], label="leg")
        sewn += [stitch((f"{side}_leg_f", k), (f"{side}_leg_b", k), "right_wrong") for k in (0, 2)]
    return specification(panels, sewn)


def on_person(spread: float, leg_spread: float) -> tuple[PatternMesh, BodyMesh]:
    positions, triangles = person(0.05, leg_spread=leg_spread)
    body = BodyMesh("person", positions, triangles, 1.0, ())
    return placed_on(mesh_pattern(pattern_of(trousers(spread)), SPACING), body)[0], body


@pytest.mark.parametrize("spread", [18, 22])
def test_legs_wider_than_the_stance_turn_rigidly_over_the_legs(spread):
    mesh, body = on_person(spread, 0.25)
    turned, notes = turned_to_legs(mesh, body, body_surface(body.positions, body.triangles))
    assert len(notes) == 2
    for rows in mesh.vertices.values():
        lengths = [np.linalg.norm(np.diff(each.positions[rows], axis=0), axis=1) for each in (mesh, turned)]
        assert np.allclose(*lengths, atol=1e-12)
    before, after = (abs(hem_reach(each, body) - 0.25) for each in (mesh, turned))
    assert after < before
    assert after < 0.02


def hem_reach(mesh: PatternMesh, body: BodyMesh) -> float:
    """Mean distance of the hems from the middle of the body [m]; its feet are at .25 m."""
    low = mesh.positions[:, 1] < body.positions[:, 1].min() + 0.12
    return float(np.abs(mesh.positions[low, 0]).mean())


def test_legs_drawn_across_the_middle_stay():
    mesh, body = on_person(-2, 0.25)
    turned, notes = turned_to_legs(mesh, body, body_surface(body.positions, body.triangles))
    assert notes == ()
    assert np.array_equal(turned.positions, mesh.positions)


def test_legs_over_those_of_the_body_stay():
    mesh, body = on_person(12, 0.25)
    turned, notes = turned_to_legs(mesh, body, body_surface(body.positions, body.triangles))
    assert notes == ()
    assert np.array_equal(turned.positions, mesh.positions)


def test_panels_of_legs_by_label_and_name():
    panels = pattern_of(trousers(10)).panels
    assert all(is_of_leg(each) for each in panels.values())
    named = pattern_of(specification({"pant_f_l": panel(), "skirt_front": panel(), "leg": panel(label="body")})).panels
    assert [is_of_leg(each) for each in named.values()] == [True, False, False]
