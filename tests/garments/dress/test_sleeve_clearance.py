"""Sleeves that springs of the torso run through move outward along the arms."""

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress.corrections import sleeves_cleared
from clothsim.garments.dress.placement import arm_line
from clothsim.garments.dress.sewing_state import as_placed, crosses_body
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

SIDE, DEPTH, INNER = 25.0, 22.0, 15.0
"""Half the width of the torso and half the distance of its panels; half that of the panels of a sleeve [cm]."""


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    return BodyMesh("person", *person(0.05), 1.0, ())


@pytest.fixture(scope="module")
def surface(body):
    return body_surface(body.positions, body.triangles)


def shirt(start: float, length: float = 20, height: float = 20) -> dict:
    """Front and back, and a sleeve between them on either side that begins `start` cm from the middle."""
    torso = [[-SIDE, 0], [SIDE, 0], [SIDE, 40], [-SIDE, 40]]
    panels = {"front": panel(torso, translation=[0, 90, DEPTH]), "back": panel(torso, translation=[0, 90, -DEPTH])}
    stitches = [stitch(("front", k), ("back", k), "right_wrong") for k in (1, 3)]
    for name, sign in (("left", 1), ("right", -1)):
        sleeve = [[0, 0], [sign * length, 0], [sign * length, height], [0, height]]
        for part, z in (("f", INNER), ("b", -INNER)):
            panels[f"{name}_sleeve_{part}"] = panel(sleeve, translation=[sign * start, 115, z], label="arm")
        stitches += [stitch((f"{name}_sleeve_f", k), (f"{name}_sleeve_b", k), "right_wrong") for k in (0, 2)]
    return specification(panels, stitches)


def through_sleeves(state) -> int:
    """Springs of the sides of the torso within the outline of a sleeve, seen from the front: panels are parallel."""
    found = 0
    for name, rows in state.mesh.vertices.items():
        if "sleeve" not in name:
            continue
        low, high = state.positions[rows].min(axis=0), state.positions[rows].max(axis=0)
        for seam in state.mesh.seams[:2]:
            at = state.positions[state.pairs(seam)].mean(axis=1)
            found += int(((at > low) & (at < high))[:, :2].all(axis=1).sum())
    return found


def test_sleeves_between_the_panels_of_the_torso_move_out(body, surface):
    state = as_placed(mesh_pattern(pattern_of(shirt(10)), 0.04))
    assert through_sleeves(state) > 0
    moved, notes = sleeves_cleared(state, body, surface)
    assert through_sleeves(moved) == 0
    assert len(notes) == 2
    for name, rows in state.mesh.vertices.items():
        way = moved.positions[rows] - state.positions[rows]
        assert np.allclose(way, way[0], atol=1e-12)
        outward = np.array([-1.0 if "right" in name else 1.0, 0, 0])
        along = arm_line(body, outward, body.middle).direction if "sleeve" in name else np.zeros(3)
        assert np.allclose(way[0], np.linalg.norm(way[0]) * along, atol=1e-12)
        assert ("sleeve" in name) == (np.linalg.norm(way[0]) > 0.02)


def test_sleeves_beside_the_torso_stay(body, surface):
    state = as_placed(mesh_pattern(pattern_of(shirt(27)), 0.04))
    assert through_sleeves(state) == 0
    moved, notes = sleeves_cleared(state, body, surface)
    assert notes == ()
    assert np.array_equal(moved.positions, state.positions)


def test_sleeves_that_are_welded_to_the_torso_stay(body, surface):
    entries = shirt(10)
    panels = entries["pattern"]["panels"]
    for name in ("left_sleeve_f", "right_sleeve_f"):
        panels[name]["translation"][2] = DEPTH
    entries["pattern"]["stitches"] += [stitch(("front", 2), ("left_sleeve_f", 3))]
    state = as_placed(mesh_pattern(pattern_of(entries), 0.04)).weld([len(entries["pattern"]["stitches"]) - 1])
    moved, _ = sleeves_cleared(state, body, surface)
    left = state.number[state.mesh.vertices["left_sleeve_f"]]
    assert np.array_equal(moved.positions[left], state.positions[left])


@pytest.mark.parametrize(("height", "through", "farthest"), [(8, 8, 0.0), (20, 16, 0.15)])
def test_a_sleeve_stays_on_the_hand_where_springs_wait_for_the_arm(body, surface, height, through, farthest):
    """A long sleeve moves past the hand only for springs that do not run through the arm, as those of a wide one."""
    state = as_placed(mesh_pattern(pattern_of(shirt(10, length=55, height=height)), 0.04))
    springs = np.concatenate([state.positions[state.pairs(seam)] for seam in state.mesh.seams[:2]])
    assert through_sleeves(state) == through
    assert crosses_body(springs, surface).any()
    moved, _ = sleeves_cleared(state, body, surface)
    way = np.linalg.norm(moved.positions - state.positions, axis=1).max()
    assert (way > farthest) == (farthest > 0)
