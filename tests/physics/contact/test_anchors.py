"""Anchors of static friction: return mapping, inheritance by material points, rotation, coefficients, resumed bits."""

import json
from dataclasses import replace

import numpy as np
import pytest
from contacts import sheet_on_ball

from clothsim import Friction, Scene, simulate
from clothsim.physics.contact.anchors import Anchors, adjoint_by_rows, anchors_at, anchors_from
from clothsim.physics.contact.friction_coefficients import coefficient_tables

E = 1e-3
UP = np.array([0.0, 0.0, 1.0])
X = np.array([[0.2, 0.2, 0.01], [0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.7, 0.9, 0.01]])
LABELS = np.array([0, 1, 1, 1, 1, 0])


def one(slip=(0.0, 0.0, 0.0), slides=False):
    """Vertex 0 over the triangle 1, 2, 3."""
    elements, weights = np.array([[0, 1, 2, 3]]), np.array([[1, -0.6, -0.2, -0.2]])
    return anchors_at(X, elements, weights, UP[None], np.array([slip]), np.array([slides]))


def moved(*displacement):
    x = X.copy()
    x[0] += displacement
    return x


def test_slip_grows_to_the_largest_and_is_drawn_along():
    held = one().after(moved(0.3 * E, 0.4 * E, 1.0), E, np.ones(1))
    assert held.slips[0] == pytest.approx([0.3 * E, 0.4 * E, 0.0], rel=1e-12)
    assert not held.slides[0]
    drawn = one().after(moved(3 * E, 4 * E, 1.0), E, np.ones(1))
    assert drawn.slips[0] == pytest.approx([0.6 * E, 0.8 * E, 0.0], rel=1e-12)
    assert drawn.slides[0]
    back = one((0.6 * E, 0.8 * E, 0.0), True).after(moved(-0.6 * E, -0.8 * E, 0.0), E, np.ones(1))
    assert np.abs(back.slips).max() < 1e-15


@pytest.mark.parametrize("fraction", [0.1, 0.5, 0.95])
def test_a_contact_that_comes_to_rest_keeps_its_force(fraction):
    """f0' = 2 q - q^2 of the slip over the largest, times mu."""
    static, kinetic = 0.6, 0.35
    rests = one((E, 0.0, 0.0), True).after(moved(-(1 - fraction) * E, 0.0, 0.0), E, np.array([kinetic / static]))
    q = rests.slips[0, 0] / E
    assert not rests.slides[0]
    assert static * (2 * q - q**2) == pytest.approx(kinetic * (2 * fraction - fraction**2), rel=1e-12)


def test_adjoints_of_a_function_of_rows_are_exact_to_the_fourth_order():
    """Of |a|^2 b + a, whose derivatives by a and b are known; a row of zeros has none."""
    a, b, by = np.random.default_rng(0).standard_normal((3, 5, 3))
    a[2] = 0.0
    by_a, by_b = adjoint_by_rows(lambda a, b: (a * a).sum(axis=1, keepdims=True) * b + a, (a, b), by)
    along = (by * b).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(by_a, np.where(a.any(axis=1, keepdims=True), 2 * a * along + by, 0.0), rtol=1e-9)
    np.testing.assert_allclose(by_b, (a * a).sum(axis=1, keepdims=True) * by, rtol=1e-9)


def test_slip_turns_with_the_second_surface():
    x, angle = X.copy(), 0.3
    c, s = np.cos(angle), np.sin(angle)
    x = x @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    turned = one((0.5 * E, 0.0, 0.0)).after(x, E, np.ones(1))
    assert turned.slips[0] == pytest.approx([0.5 * E * c, 0.5 * E * s, 0.0], rel=1e-12)


CONTACTS = {
    "face": ([0, 1, 2, 3], [1, -0.6, -0.2, -0.2]),
    "edges": ([0, 5, 2, 3], [0.4, 0.6, -0.5, -0.5]),
    "edge along the axis": ([0, 1, 2, 2], [1, -0.8, -0.2, 0]),
}


@pytest.mark.parametrize("name", ["face", "edges"])
@pytest.mark.parametrize("axis", range(3))
def test_a_contact_that_turns_as_a_rigid_body_does_not_slip(name, axis):
    elements, weights = (np.array([part]) for part in CONTACTS[name])
    gap = (weights[0] @ X[elements[0]]) * [0, 0, 1]
    x = X.copy()
    x[elements[0, weights[0] > 0]] -= (weights[0] @ X[elements[0]]) - gap  # the gap is normal to both
    anchors = anchors_at(x, elements, weights, UP[None], np.zeros((1, 3)), np.zeros(1, bool))
    turned = x @ rotation(axis, 0.05).T
    assert np.abs(anchors.after(turned, E, np.ones(1)).slips).max() < 1e-16
    slid = turned.copy()
    slid[elements[0, weights[0] > 0]] += rotation(axis, 0.05) @ [0.3 * E, 0, 0]
    assert np.linalg.norm(anchors.after(slid, E, np.ones(1)).slips) == pytest.approx(0.3 * E, rel=0.01)


TRIANGLES_AT = {"of the face": [[-1] * 3, [1, 2, 3], [1, 2, 3], [1, 2, 3], [-1] * 3, [-1] * 3],
                "of the vertex": [[0, 4, 5], [-1] * 3, [-1] * 3, [-1] * 3, [0, 4, 5], [0, 4, 5]]}  # fmt: skip


@pytest.mark.parametrize("body", TRIANGLES_AT)
@pytest.mark.parametrize("axis", range(3))
def test_the_body_turns_the_gap_whichever_surface_has_the_vertex(body, axis):
    elements, weights = (np.array([part]) for part in CONTACTS["face"])
    at = np.array(TRIANGLES_AT[body])
    anchors = anchors_at(X, elements, weights, UP[None], np.zeros((1, 3)), np.zeros(1, bool), at)
    assert anchors.turners.tolist() == [[1, 2, 3] if body == "of the face" else [0, 4, 5]]
    of_body = (at >= 0).all(axis=1)
    turn = rotation(axis, 0.05)
    gap = anchors.origins[0]
    np.testing.assert_allclose(
        anchors.turning(np.where(of_body[:, None], X @ turn.T, X))[0], turn @ gap - gap, rtol=0, atol=1e-15
    )
    assert not anchors.turning(np.where(of_body[:, None], X, X @ turn.T)).any()
    again = anchors_from(anchors.as_array(), at)
    assert all(np.array_equal(getattr(again, name), getattr(anchors, name)) for name in ("turners", "directions"))


def test_of_an_edge_the_rotation_of_its_direction_counts():
    elements, weights = (np.array([part]) for part in CONTACTS["edge along the axis"])
    x = X.copy()
    x[0] = [0.2, 0.0, 0.01]
    anchors = anchors_at(x, elements, weights, UP[None], np.zeros((1, 3)), np.zeros(1, bool))
    assert np.abs(anchors.after(x @ rotation(1, 0.05).T, E, np.ones(1)).slips).max() < 1e-16
    assert not anchors.turning(x @ rotation(0, 0.05).T).any()  # about its own axis an edge shows nothing
    assert not anchors.turning(x + np.array([1.0, 2.0, 3.0])).any()


def rotation(axis, angle):
    """Rotation matrix about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return matrix


def test_a_card_on_a_tilting_slab_keeps_its_place():
    """Without the turning of the gaps it creeps by the gap times the angle: 240 um/s at 10 degrees a second."""
    rate, frames = 10.0, (10, 15)
    scene = Scene(
        cloth={"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "position": [0, 0, 0.0514],
               "bending_stiffness": 1e-3},
        body={"mesh": "slab", "size": [1, 1, 0.1], "motion": {"rotate_degrees_per_second": [0, rate, 0]}},
        effects={"gravity": {}, "membrane": {}, "bending": {}, "inertia": {}, "body_contact": {"d_hat": 2e-3},
                 "friction": {"coefficient": 0.8}},
        solver={"dt": 0.01, "threads": 1, "linear": "superlu"},
        run={"duration": 0.6, "frames_per_second": 25},
    )  # fmt: skip
    run = simulate(scene)
    at = [(run.positions(k) @ rotation(1, np.radians(rate) * run.times[k]))[:, 0].mean() for k in frames]
    assert run.status == "completed", run.reason
    assert abs(at[1] - at[0]) < 2e-6


def test_a_card_on_another_on_a_tilting_slab_keeps_its_place():
    """Of cloth on cloth the rotation of the cloth as a whole is predicted: without, it creeps by .2 mm/s."""
    rate, card = 10.0, {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "bending_stiffness": 1e-3}
    upper = {"name": "upper", "position": [0.004, 0.003, 0.0529], "rotation_degrees": [0, 0, 20]}
    contact = {"d_hat": 2e-3}
    scene = Scene(
        cloth=[{**card, "name": "lower", "position": [0, 0, 0.0514]}, {**card, **upper}],
        body={"mesh": "slab", "size": [1, 1, 0.1], "motion": {"rotate_degrees_per_second": [0, rate, 0]}},
        effects={"gravity": {}, "membrane": {}, "bending": {}, "inertia": {}, "body_contact": contact,
                 "self_contact": contact, "friction": {"coefficient": 0.8}},
        solver={"dt": 0.02, "threads": 1, "linear": "superlu"},
        run={"duration": 0.4, "frames_per_second": 25},
    )  # fmt: skip
    run = simulate(scene)
    turns = [rotation(1, np.radians(rate) * time) for time in run.times]
    at = [(run[k].positions["upper"] @ turns[k])[:, 0].mean() for k in (6, 10)]
    assert run.status == "completed", run.reason
    assert abs(at[1] - at[0]) < 1e-6


def test_a_vertex_keeps_its_anchor_from_face_to_face_and_on_one_side_alone():
    anchors = one((0.5 * E, 0.0, 0.0))
    face, vertex, edge = ([0, 2, 4, 3], [1, -0.1, -0.8, -0.1]), ([0, 4, 4, 4], [1, -1.0, 0, 0]), ([0, 5, 2, 4], None)
    of_edge = [0.5, 0.5, -0.5, -0.5]
    elements = np.array([face[0], vertex[0], [5, 2, 4, 3], edge[0]])
    weights = np.array([face[1], vertex[1], face[1], of_edge])
    parents, slips = anchors.inherited(elements, weights, np.tile(UP, (4, 1)), LABELS)
    assert parents.tolist() == [0, 0, -1, -1]
    assert slips[:2] == pytest.approx(np.tile(anchors.slips, (2, 1)), rel=1e-12)
    assert not slips[2:].any()
    tilted = np.array([[np.sin(0.5), 0.0, np.cos(0.5)], -UP])
    parents, slips = anchors.inherited(elements[:2], weights[:2], tilted, LABELS)
    assert parents.tolist() == [0, -1]
    assert np.linalg.norm(slips[0]) == pytest.approx(0.5 * E, rel=1e-12)
    assert abs(slips[0] @ tilted[0]) < 1e-15
    other = np.array([0, 2, 2, 2, 2, 0])
    assert anchors.inherited(elements[:1], weights[:1], UP[None], np.maximum(other, LABELS))[0].tolist() == [0]


def test_the_nearest_normal_or_the_same_pair_inherits():
    both = [one((0.1 * E, 0, 0)), replace(one((0.2 * E, 0, 0)), normals=np.array([[0.6, 0.0, 0.8]]))]
    names = ("elements", "weights", "normals", "slips", "origins", "directions", "facings", "slides", "turners")
    anchors = Anchors(*(np.concatenate([getattr(each, name) for each in both]) for name in names))
    elements, weights = np.array([[0, 2, 4, 3]]), np.array([[1, -0.2, -0.4, -0.4]])
    for normal, parent in ((UP, 0), (np.array([0.6, 0.0, 0.8]), 1)):
        assert anchors.inherited(elements, weights, normal[None], LABELS)[0].tolist() == [parent]
    mixed = replace(anchors, elements=np.array([[0, 1, 2, 3], [0, 2, 4, 3]]))
    assert mixed.inherited(elements, weights, UP[None], LABELS)[0].tolist() == [1]


def test_a_file_gives_the_same_bits():
    numbers = one((0.1 / 3 * E, np.pi * E, 0.0), True).as_array()
    again = anchors_from(json.loads(json.dumps(numbers.tolist()))).as_array()
    assert np.array_equal(again, numbers)
    assert len(anchors_from(()).as_array()) == 0


@pytest.mark.parametrize(
    ("keys", "static", "kinetic"),
    [
        ({}, 0.3, 0.3),
        ({"mu_static": 0.5}, 0.5, 0.3),
        ({"mu_static": 0.2}, 0.2, 0.2),
        ({"mu_kinetic": 0.2}, 0.3, 0.2),
        ({"mu_kinetic": 0.4}, 0.4, 0.4),
        ({"mu_static": 0.6, "mu_kinetic": 0.5}, 0.6, 0.5),
    ],
)
def test_defaults_of_the_two_coefficients(keys, static, kinetic):
    tables = coefficient_tables(sheet_on_ball(), Friction(coefficient=0.3, **keys))
    assert [table[0, 1] for table in tables] == [static, kinetic]
