"""Drape of a sewn garment: one that hangs on the shoulders is shaken down with little friction, others are not."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from capsule_bodies import person
from house import ROOT
from sewing_patterns import panel, specification

from clothsim.garments.dress import pipeline
from clothsim.garments.dress.limbs import Wearer
from clothsim.garments.dress.pipeline import DressState, DressTask, _drape, drape_sewn, end_of_drape, fallen, not_worn
from clothsim.garments.dress.placement import hangs_on_shoulders, surrounds
from clothsim.garments.dress.sewing_state import Fabrics, SewingState, as_placed
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.stages import DRESS_DRAPE
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from clothsim.run.results import open_run
from transfer.signed_distance import body_surface


@pytest.fixture(scope="module")
def ball() -> BodyMesh:
    """A ball of .3 m about the origin, as a body."""
    made = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    return BodyMesh("ball", np.asarray(made.vertices), np.asarray(made.faces), 1.0, ())


def task_on(body: BodyMesh, folder: Path, ends: float = np.inf) -> DressTask:
    """A task of cotton on a body, with the `process_time` at which its budget is spent."""
    surface = body_surface(body.positions, body.triangles)
    return DressTask(body, surface, Fabrics("cotton"), False, folder, lambda stage: None, None, None, ends)


def sheet_over(body: BodyMesh, aside: float = 0.0) -> SewingState:
    """A square of 30 cm, level, 5 mm above the ball, its middle `aside` metres from the axis."""
    state = as_placed(mesh_pattern(pattern_of(specification({"a": panel([[0, 0], [30, 0], [30, 30], [0, 30]])})), 0.06))
    flat = state.positions - state.positions.mean(axis=0)
    first = np.roll(body.up, 1)
    across = np.cross(body.up, first)
    return state.moved_to(0.305 * body.up + (flat[:, :1] + aside) * first + flat[:, 1:2] * across)


def test_what_hangs_on_the_shoulders_is_shaken_down(ball, tmp_path):
    state = sheet_over(ball)
    run = drape_sewn(state, task_on(ball, tmp_path))
    assert run.status == "completed"
    shaken = open_run(tmp_path / "shaken")
    assert np.array_equal(shaken.positions(0), state.positions)
    assert np.array_equal(run.positions(0), shaken.positions(-1))
    assert len(run.record()) < len(shaken.record())  # what is in equilibrium with less friction is so with more


def test_what_friction_alone_holds_is_draped_as_it_was_sewn(ball, tmp_path):
    state = sheet_over(ball, aside=0.05)
    run = drape_sewn(state, task_on(ball, tmp_path))
    assert np.array_equal(run.positions(0), state.positions)


def test_a_drape_ends_with_the_budget(ball, tmp_path):
    run = drape_sewn(sheet_over(ball, aside=0.05), task_on(ball, tmp_path, ends=0.0))
    assert (run.status, run.summary["failure"]["cause"], len(run.record())) == ("failed", "budget", 1)
    assert run.scene.run_settings.budget is None  # else one that resumes it ends after a step, too


@pytest.mark.parametrize(("lifted", "is_taken"), [(0.02, True), (-0.03, False)])
def test_a_drape_that_is_stopped_ends_at_its_last_frame_where_that_is_free_of_intersections(
    ball, tmp_path, monkeypatch, lifted, is_taken
):
    state, task = sheet_over(ball), task_on(ball, tmp_path)
    last = state.positions + lifted * ball.up
    stopped = SimpleNamespace(status="failed", reason="At 0.8 s: stopped.", times=[0.0, 0.8], positions=lambda k: last)
    monkeypatch.setattr(pipeline, "drape_sewn", lambda state, task: stopped)
    done = _drape(task, DressState(state, Wearer(ball, task.surface), ()))
    assert (done.status, done.run, done.reason[:18]) == ("sewn", stopped, "At 0.8 s: stopped.")
    assert np.array_equal(done.state.positions, last if is_taken else state.positions)
    assert [stage.name for stage in done.stages] == ["drape"] * is_taken


@pytest.mark.parametrize(("top", "hangs"), [(0.85, True), (0.76, False)])
def test_the_level_of_the_shoulders_decides(top, hangs):
    body = BodyMesh("person", *person(0.1), 1.0, ())
    levels = body.positions @ body.up
    positions = np.outer(levels.min() + np.linspace(0.4, top, 5) * np.ptp(levels), body.up)
    assert hangs_on_shoulders(positions, body) == hangs


@pytest.mark.parametrize(("at_rest", "status"), [(True, "completed"), (False, "sewn")])
def test_a_garment_rests_only_where_its_drape_came_to_rest(ball, at_rest, status):
    run = SimpleNamespace(summary={"certificate": {"at_rest": at_rest, "fastest_speed": 0.037}})
    found, reason = end_of_drape(sheet_over(ball), run, "ball")
    assert found == status
    assert ("37 mm/s" in reason) is not at_rest


@pytest.mark.parametrize(("hips", "status"), [(0.5, "completed"), (1.2, "failed")])
def test_a_garment_that_slid_off_is_not_worn(ball, hips, status, tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "HIPS", hips)  # the sheet rests at 1.01 of the height of the ball
    state = sheet_over(ball, aside=0.05)
    state = replace(state, mesh=replace(state.mesh, positions=state.positions + 0.2 * ball.up))
    task = task_on(ball, tmp_path)
    done = _drape(task, DressState(state, Wearer(ball, task.surface), ()))
    assert done.status == status
    assert ("slid off" in done.reason) is (status == "failed")


@pytest.fixture(scope="module")
def wearer() -> BodyMesh:
    """A person of 1.7 m with level arms, on the floor; its crotch is at .47 of its height."""
    positions, triangles = person(0.04, arm_drop=0.0)
    positions = positions - np.array([0.0, positions[:, 1].min(), 0.0])
    body = BodyMesh("person", 1.7 / positions[:, 1].max() * positions, triangles, 1.0, ())
    body.__dict__["parts"] = SimpleNamespace(landmarks={"crotch": 0.8})
    return body


def tube(levels: tuple[float, float], aside: float = 0.0, turns: float = 1.0, name: str = "skirt") -> SewingState:
    """A panel rolled round a vertical axis, between two levels as fractions of 1.7 m, 25 cm from it."""
    mesh = mesh_pattern(pattern_of(specification({name: panel([[0, 0], [30, 0], [30, 30], [0, 30]])})), 0.02)
    state = as_placed(mesh)
    flat = (state.positions - state.positions.min(axis=0)) / 0.3
    low, high = 1.7 * np.array(levels)
    angle = 2 * np.pi * turns * flat[:, 0]
    rolled = np.stack([0.25 * np.sin(angle) + aside, low + (high - low) * flat[:, 1], 0.25 * np.cos(angle)], axis=1)
    return replace(state, positions=rolled, mesh=replace(mesh, positions=rolled))


@pytest.mark.parametrize(
    ("placed", "worn", "reason"),
    [
        ((0.10, 0.62), (0.10, 0.62), ""),
        ((0.10, 0.62), (0.02, 0.49), ""),  # low-slung
        ((0.10, 0.62), (0.01, 0.30), "slid off"),
        ((0.10, 0.40), (0.01, 0.30), ""),  # of the legs alone
        ((0.10, 0.50), (0.01, 0.45), ""),  # placed at the crotch: it is where it was
        ((0.45, 0.85), (0.35, 0.55), ""),
        ((0.45, 0.85), (0.20, 0.48), "slid off"),
        ((0.80, 1.20), (0.75, 1.10), "above the head"),
        ((0.90, 1.10), (0.90, 1.10), ""),  # a hat
    ],
)
def test_where_the_top_of_a_garment_ends_says_whether_it_is_worn(wearer, placed, worn, reason):
    state = tube(placed)
    found = not_worn(state.moved_to(tube(worn).positions), wearer)
    assert (reason in found) if reason else not found


@pytest.mark.parametrize(("share", "falls"), [(0.4, False), (0.49, False), (0.51, True), (-0.6, True)])
def test_what_moves_by_more_than_half_of_the_height_falls_off(wearer, share, falls):
    worn = tube((0.10, 0.62)).positions
    moved = worn - [0.0, share * np.ptp(wearer.positions[:, 1]), 0.0]
    assert ("falls off" in fallen(worn, moved, wearer)) is falls


@pytest.mark.parametrize(
    ("placed", "worn", "waistband", "offered"),
    [
        ((0.10, 0.62), (0.01, 0.30), False, True),
        ((0.10, 0.62), (0.01, 0.30), True, False),
        ((0.45, 0.85), (0.20, 0.48), False, False),
    ],
)
def test_what_slid_off_the_waist_is_offered_a_waistband(wearer, placed, worn, waistband, offered):
    state = tube(placed)
    assert ("--waistband" in not_worn(state.moved_to(tube(worn).positions), wearer, waistband)) == offered


@pytest.mark.parametrize(("landmarks", "reason"), [({"crotch": 0.8}, ""), ({"crotch": 0.9}, "slid off"), (None, "")])
def test_a_body_has_a_crotch_of_its_own_or_none(wearer, landmarks, reason):
    body = replace(wearer)  # without feet: where it has no parts, nothing slides down its legs
    if landmarks:
        body.__dict__["parts"] = SimpleNamespace(landmarks=landmarks)
    found = not_worn(tube((0.10, 0.62)).moved_to(tube((0.02, 0.50 if landmarks else 0.3)).positions), body)
    assert (reason in found) if reason else not found


def test_a_hood_may_reach_above_the_head(wearer):
    assert "above the head" in not_worn(tube((0.7, 1.1)), wearer)
    assert not not_worn(tube((0.7, 1.1), name="hood"), wearer)


@pytest.mark.parametrize(
    ("aside", "turns", "worn"), [(0.0, 1.0, True), (0.0, 0.7, True), (0.0, 0.4, False), (1.2, 1.0, False)]
)
def test_a_garment_that_surrounds_no_part_of_the_body_is_not_worn(wearer, aside, turns, worn):
    state = tube((0.3, 0.6), aside, turns)
    assert surrounds(state.positions, state.triangles, wearer) == worn
    assert ("surrounds no part" in not_worn(state, wearer)) is not worn


def test_a_sleeve_surrounds_an_arm_that_is_level(wearer):
    state = tube((0.0, 0.2))
    level = state.positions[:, [1, 0, 2]] + [0.4, 1.35, 0.0]
    assert surrounds(level, state.triangles, wearer)
    assert not surrounds(level + np.array([0.0, 0.4, 0.0]), state.triangles, wearer)


def test_the_longest_drape_is_that_of_the_reference():
    page = (ROOT / "docs" / "reference" / "dressing.md").read_text(encoding="utf-8")
    assert f"at rest, for {DRESS_DRAPE.run['duration']:g} s at most" in page
