"""Facing: bodies that face elsewhere wear their garment in front all the same."""

import numpy as np
import pytest
from capsule_bodies import person
from scipy.spatial.transform import Rotation
from sewing_patterns import skirt

from clothsim.garments import inputs
from clothsim.garments.dress.placement import arm_line, placed_on, turn_to_front
from clothsim.garments.inputs import BodyMesh, usual_front
from clothsim.garments.pictures import view_of
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


@pytest.fixture(scope="module")
def mannequin() -> BodyMesh:
    """A body with feet, z upward."""
    return BodyMesh("mannequin", *GENERATORS["mannequin"](), 1.0, ())


@pytest.mark.parametrize("degrees", [0, 10, 90, 180, -120])
def test_front_of_a_turned_body(mannequin, degrees):
    turn = Rotation.from_euler("z", degrees, degrees=True)
    body = BodyMesh("turned", turn.apply(mannequin.positions), mannequin.triangles, 1.0, ())
    expected = usual_front(body.up) if abs(degrees) <= 10 else turn.apply([0, -1, 0])
    assert np.allclose(body.front, expected, atol=1e-3)
    placed, notes = placed_on(mesh_pattern(pattern_of(skirt()), 0.05), body)
    front, back = (placed.positions[placed.vertices[name]].mean(axis=0) for name in ("front", "back"))
    assert np.allclose((front - back) / np.linalg.norm(front - back), expected, atol=1e-3)
    assert len(notes) == (abs(degrees) > 10)


def test_the_front_of_a_body_is_looked_for_once(mannequin, monkeypatch):
    body = BodyMesh("alone", mannequin.positions, mannequin.triangles, 1.0, ())
    first = body.front
    monkeypatch.setattr(inputs, "body_frame", None)
    assert body.front is first


def test_a_body_without_feet_faces_the_usual_way():
    body = BodyMesh("person", *person(0.1), 1.0, ())
    assert np.array_equal(body.front, [0, 0, 1])
    assert np.array_equal(view_of((0.3, 0.1, 1.0), body), [0.3, 0.1, 1.0])


@pytest.mark.parametrize("up", [[0, 1, 0], [0, 0, 1]])
def test_the_turn_takes_the_usual_front_to_the_given_one(up):
    axis = np.array(up, float)
    body = BodyMesh("box", np.eye(3) + 5 * np.outer([0, 0, 1], axis), np.array([[0, 1, 2]]), 1.0, ())
    front = Rotation.from_rotvec(2.1 * axis).apply(usual_front(axis))
    assert np.allclose(turn_to_front(body, front).apply(usual_front(axis)), front)


def test_a_pattern_stands_on_the_floor_of_a_body_whose_clothes_hang_below_its_soles(mannequin):
    hem = mannequin.positions - 0.12 * mannequin.up
    both = np.concatenate([mannequin.positions, hem, hem + np.cross(mannequin.up, mannequin.front)])
    dressed = BodyMesh("dressed", both, mannequin.triangles, 1.0, (), mannequin)
    assert np.ptp(both @ dressed.up) > mannequin.height + 0.1
    mesh = mesh_pattern(pattern_of(skirt()), 0.05)
    for origin in ("floor", "waist"):
        alone, above = (placed_on(mesh, body, origin)[0].positions for body in (mannequin, dressed))
        np.testing.assert_array_equal(above, alone)
    assert (dressed.floor, dressed.height) == (mannequin.floor, mannequin.height)
    right = np.cross(mannequin.up, mannequin.front)
    own, other = (arm_line(body, right, mannequin.middle) for body in (mannequin, dressed))
    np.testing.assert_array_equal(other.point, own.point)


@pytest.mark.parametrize(("aside", "follows"), [(0.1, False), (3.0, True)])
def test_a_pattern_follows_a_body_that_stands_aside(mannequin, aside, follows):
    shift = aside * np.array([0.6, -0.8, 0.0]) + [0.0, 0.0, 0.5]
    body = BodyMesh("aside", mannequin.positions + shift, mannequin.triangles, 1.0, ())
    mesh = mesh_pattern(pattern_of(skirt()), 0.05)
    (own, _), (other, notes) = (placed_on(mesh, each) for each in (mannequin, body))
    middle = mannequin.middle * [1, 1, 0]
    expected = shift + middle if follows else np.array([0.0, 0.0, 0.5])
    np.testing.assert_allclose(other.positions - own.positions, np.broadcast_to(expected, own.positions.shape))
    assert any("vertical axis" in note for note in notes) == follows
