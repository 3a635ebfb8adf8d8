"""A body that overlaps itself: two capsules whose walls cross, and tubes around them that have no room between."""

from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from fitting_cases import capsule_figure, task, tube_garment
from scipy.spatial import cKDTree

from clothsim.garments.fit import pipeline
from clothsim.garments.fit.guaranteed_path import NO_OVERLAP, OPENING_DEPTHS, flypapered_rows, overlaps_at
from clothsim.garments.fit.pipeline import drape_fitted, seed_fit
from clothsim.garments.fitted import Fit
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.garments.penetration import count_penetrations
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from transfer.signed_distance import body_surface

THROUGH = 0.004
"""Width by which the two capsules overlap [m]."""


def twice(positions, triangles, apart):
    """Two copies, `apart` [m] along x."""
    half = np.array([0.5 * apart, 0.0, 0.0])
    return np.concatenate([positions - half, positions + half]), np.concatenate([triangles, triangles + len(positions)])


ONE = capsule_figure()
LEGS = BodyMesh("legs", *twice(ONE.positions, ONE.triangles, 0.2 - THROUGH), 1.0, ())
BODY = body_surface(LEGS.positions, LEGS.triangles)


def test_a_body_without_overlap_has_none():
    assert not list(overlaps_at(body_surface(ONE.positions, ONE.triangles), np.zeros(3)))


def test_it_has_none_far_from_the_place():
    assert not list(overlaps_at(BODY, np.array([0.1, 0.0, 0.9])))


def test_the_body_is_pressed_in_there_and_nowhere_else():
    found = list(overlaps_at(BODY, np.zeros(3)))
    assert [one.depth for one in found] == list(OPENING_DEPTHS)
    for one in found:
        moved = np.linalg.norm(one.opened - LEGS.positions, axis=1)
        held = one.holds(LEGS.positions)
        assert 0.9 * one.depth < moved.max() <= (1 + 1e-9) * one.depth
        assert (moved[~held] == 0).all()
        assert 0 < held.sum() < len(held)
        assert np.abs(one.points[:, 0]).max() < THROUGH
        assert (moved[np.abs(LEGS.positions[:, 0]) > 0.1] == 0).all()
    deepest = found[-1]
    middle = np.abs(LEGS.positions[BODY.triangles][:, :, 2]).max(axis=1) < 0.02
    pairs = intersecting_pairs(deepest.opened, BODY.triangles[middle])
    assert not len(pairs)


def test_nothing_is_carried_without_an_overlap():
    assert not len(NO_OVERLAP)
    found = next(overlaps_at(BODY, np.zeros(3)))
    positions = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.01, 0.0]])
    assert flypapered_rows(found, positions, np.array([True, True, False])).tolist() == [0]


def test_what_is_carried_is_not_counted_and_all_else_is():
    one = tube_garment(0.102)
    garment = Garment("tubes", *twice(one.positions, one.triangles, 0.2 - THROUGH))
    plain = count_penetrations(garment.positions, garment.triangles, BODY)
    assert plain.penetrating_vertices
    assert plain.self_pairs
    between = np.flatnonzero(np.abs(garment.positions[:, 0]) < 0.03)
    held = count_penetrations(garment.positions, garment.triangles, BODY, between)
    assert held.clean
    assert held.flypapered == len(between)
    assert f"{len(between)} vertices carried" in str(held)
    moved = garment.positions.copy()
    moved[np.argmax(moved[:, 0])] -= [0.02, 0.0, 0.0]
    assert count_penetrations(moved, garment.triangles, BODY, between).penetrating_vertices == 1


def test_cloth_between_the_legs_is_carried_and_all_other_is_free(tmp_path, monkeypatch):
    """From a growth that stops there: opened, grown, closed in the drape."""
    tube = tube_garment(0.096, height=0.12, cells=(16, 3))
    garment = Garment("tubes", *twice(tube.positions, tube.triangles, 0.2 - THROUGH))
    coarse = capsule_figure(segments=12)
    legs = BodyMesh("legs", *twice(coarse.positions, coarse.triangles, 0.2 - THROUGH), 1.0, ())
    moved, ends = pipeline.moved_with_body, []

    class Blocked:
        status, reason = "failed", "blocked"
        summary: ClassVar = {"failure": {"position": [0.0, -0.01, 0.04]}}

        def positions(self, _):
            return garment.positions

    def moved_with_body(*arguments, **keys):
        ends.append(arguments[2][-1])
        return Blocked() if len(ends) < 3 else moved(*arguments, **keys)

    monkeypatch.setattr(pipeline, "moved_with_body", moved_with_body)
    found = seed_fit(task(garment, legs, legs, tmp_path))
    assert not found.failure
    assert [stage.name for stage in found.stages[-2:]] == ["grow", "grow"]
    assert cKDTree(legs.positions).query(ends[0])[0].max() == 0
    assert cKDTree(found.overlap.opened).query(ends[2])[0].max() == 0  # of the part near the garment
    assert found.last.counts.penetrating_vertices  # counted on the body as it is
    ended = drape_fitted(task(garment, legs, legs, tmp_path), found)
    assert ended.status == "completed", ended.reason
    assert ended.stages[-1].counts.clean
    assert 0 < len(ended.flypapered) < 16
    assert np.abs(ended.stages[-1].positions[ended.flypapered, :2]).max() < 0.05
    assert ended.run.summary["certificate"]["carried"]["now"] == len(ended.flypapered)
    bare = count_penetrations(ended.stages[-1].positions, garment.triangles, found.body)
    assert bare.body_pairs + bare.self_pairs > 0


def test_the_earlier_name_of_flypapered_vertices_warns():
    rows = np.array([3])
    with pytest.warns(DeprecationWarning, match="flypapered"):
        assert Fit.carried.fget(SimpleNamespace(flypapered=rows)) is rows
