"""Welding of closed pairs: those within a limit become one vertex, those whose weld would intersect do not."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import panel, specification, stitch

from clothsim.garments.dress import pipeline, sewing_state
from clothsim.garments.dress.sewing_state import SewingState, as_placed, welded_and_untangled, welded_where_closed
from clothsim.garments.penetration import count_penetrations
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

SPACING, TILT = 0.05, 0.02
"""Size of the mesh [m], and the gap at the far end of the seam [m]."""


@pytest.fixture(scope="module")
def surface():
    return body_surface(*person(0.08))


def side_by_side(distance: float = 5.0) -> SewingState:
    """Two squares of 50 cm, `distance` metres from the body, sewn along one side."""
    square = [[0, 0], [50, 0], [50, 50], [0, 50]]
    panels = {"left": panel(square), "right": panel([[x + 50, y] for x, y in square])}
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [stitch(("left", 1), ("right", 3))])), SPACING))
    return state.moved_to(state.positions + np.array([distance, 0.0, 0.0]))


def opened(state: SewingState) -> SewingState:
    """The same with the right panel turned away: gaps from 0 to `TILT` along the seam."""
    positions = state.positions.copy()
    rows = state.mesh.vertices["right"]
    positions[rows, 0] += TILT * positions[rows, 1] / 0.5
    return state.moved_to(positions)


def test_pairs_within_the_limit_are_welded(surface):
    state = opened(side_by_side())
    seam = state.mesh.seams[0]
    gaps = state.gaps(seam)
    assert np.isclose(gaps.max(), TILT)
    welded = welded_where_closed(state, TILT / 2.01, surface)
    assert len(welded.pairs(seam)) == (gaps > TILT / 2.01).sum()
    assert len(welded.positions) == len(state.positions) - (gaps <= TILT / 2.01).sum()
    assert welded.open_seams == (0,)
    assert welded.welded == ()
    whole = welded_where_closed(welded, np.inf, surface)
    assert whole.open_seams == ()
    assert whole.welded == (0,)
    assert welded_where_closed(whole, np.inf, surface) is whole


def test_welding_in_two_parts_is_welding_at_once(surface):
    state = opened(side_by_side())
    parts = welded_where_closed(welded_where_closed(state, TILT / 3, surface), np.inf, surface)
    whole = welded_where_closed(state, np.inf, surface)
    assert np.array_equal(parts.triangles, whole.triangles)
    assert np.allclose(parts.positions, whole.positions, atol=1e-15)


def test_a_far_gap_is_not_welded_without_a_limit(surface):
    """Sides 40 cm apart on a mesh of 5 cm stay open, also where the cloth could be untangled after the weld."""
    state = side_by_side()
    positions = state.positions.copy()
    positions[state.mesh.vertices["right"], 0] += 0.4
    state = state.moved_to(positions)
    assert welded_where_closed(state, np.inf, surface) is state
    assert welded_and_untangled(state, surface) is state


def test_all_pairs_but_the_one_that_would_intersect_are_welded(surface, monkeypatch):
    state = opened(side_by_side())
    pairs = state.mesh.seams[0].pairs
    first, second = pairs[3]  # neighbours on both sides
    monkeypatch.setattr(sewing_state, "_is_clean", lambda tried, _: tried.number[first] != tried.number[second])
    welded = welded_where_closed(state, np.inf, surface)
    assert [k for k, pair in enumerate(pairs) if np.ptp(welded.number[pair])] == [3]


def test_pairs_whose_weld_would_meet_the_body_stay_open(surface, monkeypatch):
    monkeypatch.setattr(sewing_state, "FARTHEST", np.inf)  # the sides lie before and behind the body
    state = side_by_side(0.0)
    positions = state.positions.copy()
    positions[:, 0] -= 0.5
    positions[:, 1] += 0.9
    half = state.mesh.vertices["right"]
    positions[:, 2] += 0.3
    positions[half] += [0.0, 0.0, -0.6]
    state = state.moved_to(positions)
    assert count_penetrations(state.positions, state.triangles, surface).clean
    tried = welded_where_closed(state, np.inf, surface)
    assert count_penetrations(tried.positions, tried.triangles, surface).clean
    left = [pair for pair in tried.mesh.seams[0].pairs if np.ptp(tried.number[pair])]
    alone = [tried.join(pair[None]) for pair in left]
    assert left
    assert not any(count_penetrations(each.positions, each.triangles, surface).clean for each in alone)
    assert tried.open_seams == (0,)
    assert len(tried.pairs(tried.mesh.seams[0])) >= 1


def with_a_flap_between(reach: float) -> SewingState:
    """Two squares 1 cm apart, and a flap that stands between them and reaches through by `reach` [m]."""
    square = [[0, 0], [50, 0], [50, 50], [0, 50]]
    panels = {
        "left": panel(square),
        "right": panel([[x + 51, y] for x, y in square]),
        "flap": panel([[0, 5], [8, 5], [8, 45], [0, 45]]),
    }
    state = as_placed(mesh_pattern(pattern_of(specification(panels, [stitch(("left", 1), ("right", 3))])), SPACING))
    positions, flap = state.positions + np.array([5.0, 0.0, 0.0]), state.mesh.vertices["flap"]
    across = positions[flap, 0] - 5.0
    positions[flap, 0], positions[flap, 2] = 5.505, across - reach
    return state.moved_to(positions)


def test_cloth_between_the_sides_is_moved_out(surface):
    state = with_a_flap_between(0.01)
    assert count_penetrations(state.positions, state.triangles, surface).clean
    refused = welded_where_closed(state, np.inf, surface)
    assert refused.open_seams == (0,)
    welded = welded_and_untangled(refused, surface)
    assert welded.welded == (0,)
    assert count_penetrations(welded.positions, welded.triangles, surface).clean
    flap = welded.number[state.mesh.vertices["flap"]]
    assert welded.positions[flap, 2].min() > 0.0
    assert np.percentile(welded.stretches(), 1) > 0.5


@pytest.mark.parametrize(("moved", "welded"), [(0.01, (0,)), (0.2, ())])
def test_what_opens_another_seam_is_not_taken(surface, monkeypatch, moved, welded):
    """Three squares in a row: the weld of the second seam intersects, and that of the first moves the last square."""
    square = [[0, 0], [50, 0], [50, 50], [0, 50]]
    panels = {name: panel([[x + 51 * k, y] for x, y in square]) for k, name in enumerate(("left", "middle", "right"))}
    stitches = [stitch(("left", 1), ("middle", 3)), stitch(("middle", 1), ("right", 3))]
    state = as_placed(mesh_pattern(pattern_of(specification(panels, stitches)), SPACING))

    def untangled(positions, triangles, **_):
        last = np.unique(triangles[state.mesh.faces["right"]])
        return Mock(positions=positions + moved * np.isin(np.arange(len(positions)), last)[:, None])

    monkeypatch.setattr(sewing_state, "untangle", untangled)
    monkeypatch.setattr(sewing_state, "_is_clean", lambda tried, _: 1 not in tried.welded)
    assert welded_and_untangled(state, surface).welded == welded


def test_a_state_without_open_seams_stays(surface):
    whole = welded_where_closed(side_by_side(), np.inf, surface)
    assert welded_and_untangled(whole, surface) is whole


def test_a_halved_garment_is_the_same_surface_welded_where_it_was(surface):
    state = replace(welded_where_closed(opened(side_by_side()), TILT / 2, surface), tight=("left",))
    fine = state.halved()
    assert fine.tight == state.tight
    ends, ends_fine = (each.number[each.mesh.seams[0].pairs] for each in (state, fine))
    closed, closed_fine = (int((each[:, 0] == each[:, 1]).sum()) for each in (ends, ends_fine))
    assert 1 < closed < len(ends)
    assert (closed_fine, len(ends_fine)) == (2 * closed - 1, 2 * len(ends) - 1)
    assert fine.gaps(fine.mesh.seams[0]).max() == pytest.approx(state.gaps(state.mesh.seams[0]).max())
    corners, corners_fine = (each.positions[each.triangles] for each in (state, fine))
    assert corners_fine.reshape(-1, 4, 3, 3).mean(axis=(1, 2)) == pytest.approx(corners.mean(axis=1))
    assert len(fine.positions) < len(state.halved().mesh.positions)


def refined(state: SewingState, surface, halvings: int) -> pipeline.DressState:
    """The garment after the stage that divides its triangles."""
    body = Mock(body=None, surface=surface)
    task = Mock(halvings=halvings, on_stage=lambda stage: None)
    return pipeline._refine(task, pipeline.DressState(state, body, ()))


def test_what_is_refined_twice_has_sixteen_triangles_and_is_welded_where_its_sides_touch(surface):
    state = side_by_side()
    done = refined(state, surface, 2)
    assert len(done.state.triangles) == 16 * len(state.triangles)
    assert state.open_seams == (0,)
    assert done.state.open_seams == ()
    assert done.failure == ""


def test_what_intersects_when_it_is_refined_has_failed(surface):
    state = side_by_side()
    positions = state.positions.copy()
    rows = state.mesh.vertices["right"]
    positions[rows] = positions[rows][:, [2, 1, 0]] + np.array([5.25, 0.0, -5.5])
    done = refined(state.moved_to(positions), surface, 1)
    assert "intersects" in done.failure
