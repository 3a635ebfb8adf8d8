"""Rounds of closing: the distance at which the cloth begins to touch itself, and rounds that bring nothing nearer."""

from unittest.mock import Mock

import pytest
from sewing_patterns import panel, specification, stitch

from clothsim import Scene
from clothsim.engine import build
from clothsim.garments.dress import closing as closing_rounds
from clothsim.garments.dress.closing import FURTHER, NEAR, WIDE, SewingPhase, close, contact_gap, insets
from clothsim.garments.dress.limbs import Wearer
from clothsim.garments.dress.sewing_state import Fabrics, SewingState, as_placed, mean_edge, worst_gap
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.shapes import slab
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface


@pytest.mark.parametrize("keys", [{}, {"d_hat": 2e-3}], ids=["of the mesh", "given"])
def test_the_gap_is_that_of_the_scene_with_its_body(keys):
    effects = {"gravity": {}, "membrane": {}, "self_contact": keys, "body_contact": {}}
    cloth = {"mesh": "rectangle", "size": [0.3, 0.2], "cells": [6, 4], "position": [0.0, 0.0, 0.5]}
    scene = Scene(cloth=cloth, body={"mesh": "sphere", "radius": 0.1}, effects=effects)
    assert contact_gap(scene) == build(scene).energies["self_contact"].activation_distance
    if keys:
        assert contact_gap(scene) == pytest.approx(2e-3)


def skirt_with_a_godet() -> SewingState:
    """Front with a slit, back, and a godet that is drawn beside the front; both sides of the skirt are seams."""
    front = [[-30, 0], [-5, 0], [0, 20], [5, 0], [30, 0], [25, 40], [-25, 40]]
    back = [[-30, 0], [30, 0], [25, 40], [-25, 40]]
    panels = {
        "front": panel(front, translation=[0, 40, 25]),
        "back": panel(back, translation=[0, 40, -25]),
        "godet": panel([[0, 0], [10, 0], [5, 20]], translation=[40, 40, 25]),
    }
    sides = [stitch(("front", 4), ("back", 1), "right_wrong"), stitch(("front", 6), ("back", 3), "right_wrong")]
    slit = [stitch(("godet", 2), ("front", 1)), stitch(("godet", 1), ("front", 2))]
    return as_placed(mesh_pattern(pattern_of(specification(panels, [*sides, *slit])), 0.06))


def test_a_godet_is_sewn_into_its_slit_before_the_sides_close():
    state = skirt_with_a_godet()
    assert insets(state.mesh) == {"godet"}
    positions, triangles = slab((0.1, 0.1, 0.1))
    springs = SewingPhase(tuple(state.mesh.seams)).springs(state, body_surface(positions, triangles)).springs
    ends = {tuple(each.pairs[0]): (each.start, each.end) for each in springs}
    left, right, *slit = (ends[tuple(state.pairs(seam)[0])] for seam in state.mesh.seams)
    assert left == right
    assert all(end == left[0] and start == 0 for start, end in slit)


def on_both_sides_of_a_slab(thickness: float) -> tuple[SewingState, Wearer]:
    """Two squares of 30 cm, a seam between their lower edges, and a slab 2 m wide between them."""
    square = [[-15, 0], [15, 0], [15, 30], [-15, 30]]
    depth = 50 * thickness + 5
    panels = {name: panel(square, translation=[0, 0, z]) for name, z in (("front", depth), ("back", -depth))}
    seam = stitch(("front", 0), ("back", 0), "right_wrong")
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [seam])), 0.075))
    positions, triangles = slab((2.0, 2.0, thickness))
    positions = positions - positions.mean(axis=0)
    return state, Wearer(BodyMesh("slab", positions, triangles, 1.0, ()), body_surface(positions, triangles))


def test_a_seam_that_stiffer_springs_do_not_bring_nearer_is_given_up(tmp_path):
    state, wearer = on_both_sides_of_a_slab(0.2)
    closing = close(state, wearer, Fabrics("cotton"), tmp_path, None)
    assert closing.between == ("body",)
    assert len(closing.runs) == 2 < 1 + FURTHER
    assert worst_gap(closing.state)[0] > WIDE * mean_edge(closing.state)


def test_a_closing_whose_budget_is_spent_names_the_seam_and_what_is_between(tmp_path):
    state, wearer = on_both_sides_of_a_slab(0.2)
    closing = close(state, wearer, Fabrics("cotton"), tmp_path, None, ends=0.0)
    assert (len(closing.runs), len(closing.runs[0].record()), closing.between) == (1, 1, ("body",))
    assert state.mesh.seams[0].name in closing.failure
    assert "the body" in closing.failure


def test_stiffer_rounds_end_where_one_welds_nothing(tmp_path):
    state, wearer = on_both_sides_of_a_slab(0.02)
    closing = close(state, wearer, Fabrics("cotton"), tmp_path, None)
    assert (closing.failure, len(closing.runs)) == ("", 2)
    assert len(closing.state.open_seams) == 1


@pytest.mark.parametrize("status", ["completed", "stopped"])
def test_a_stiffer_round_that_opens_a_seam_is_not_taken(tmp_path, monkeypatch, status):
    state, wearer = on_both_sides_of_a_slab(0.02)
    real, rounds = closing_rounds.simulate_stage, []

    def simulated(*given, ends):
        rounds.append(
            real(*given) if not rounds else Mock(**{"status": status, "positions.return_value": state.positions})
        )
        return rounds[-1]

    monkeypatch.setattr(closing_rounds, "simulate_stage", simulated)
    closing = close(state, wearer, Fabrics("cotton"), tmp_path, None)
    assert closing.failure == ""
    assert closing.runs == (rounds[0],)
    assert len(rounds) == 2
    assert 0 < worst_gap(closing.state)[0] <= NEAR * mean_edge(state)


@pytest.mark.parametrize("level", [0, 7, 70, 133])
def test_panels_that_lie_level_have_no_upper_and_no_lower_edges(level):
    """Their heights are round-off, which says nothing of what hangs from what."""
    square = [[0, 0], [30, 0], [30, 30], [0, 30]]
    lying = {
        name: panel(square, translation=[0, level, along], rotation=[90, 0, 0]) for name, along in (("a", 0), ("b", 35))
    }
    seams = [stitch(("a", 0), ("b", 2)), stitch(("a", 2), ("b", 0))]
    state = as_placed(mesh_pattern(pattern_of(specification(lying, seams)), 0.05))
    assert [closing_rounds.order_of(seam, state) for seam in state.mesh.seams] == [closing_rounds.WITHIN] * 2
