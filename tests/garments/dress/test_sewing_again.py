"""Garments that are sewn again: on a finer mesh, or in another pose, where the first try fails."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from capsule_bodies import person
from sewing_patterns import capsule_skirt

from clothsim.base.errors import InputError
from clothsim.garments import sewing_attempts as attempts
from clothsim.garments.dress.limbs import Wearer
from clothsim.garments.dress.pipeline import DressState, DressTask
from clothsim.garments.dress.sewing_state import Fabrics, as_placed
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

PATTERN, SPACING = pattern_of(capsule_skirt(40)), 0.06


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """A person of capsules, 1.7 m tall, arms half raised."""
    return BodyMesh("person", *person(0.05), 1.0, ())


def task_of(body: BodyMesh) -> DressTask:
    """The task of dressing a body; nothing of it is run."""
    return DressTask(
        body, body_surface(body.positions, body.triangles), Fabrics("cotton"), False, Path(), id, None, None
    )


def sewn_by(monkeypatch, failures: dict[int, str]) -> list:
    """Tasks, meshes and notes that would be sewn; failures: reason by the halvings of a task."""
    tasks = []

    def sewn(task, mesh, notes):
        tasks.append((task, mesh, notes))
        done = DressState(as_placed(mesh), Wearer(task.body, task.surface), ())
        return done, done.failed(failures.get(task.halvings, ""))

    monkeypatch.setattr(attempts, "_sewn_in_poses", sewn)
    return tasks


@pytest.mark.parametrize(
    ("size", "coarse", "halvings"), [(0.047, True, 0), (0.023, True, 1), (0.01, True, 2), (0.01, False, 0)]
)
def test_how_often_a_mesh_is_halved_follows_from_its_size_and_the_body(body, monkeypatch, size, coarse, halvings):
    tasks = sewn_by(monkeypatch, {})
    attempts.sewn_at(task_of(body), PATTERN, size, "auto", coarse, ())
    ((task, mesh, _),) = tasks
    assert task.halvings == halvings
    assert len(mesh.positions) == len(mesh_pattern(PATTERN, size * 2**halvings).positions)


def test_what_cannot_be_sewn_on_the_coarser_mesh_is_sewn_on_the_fine_one(body, monkeypatch):
    tasks = sewn_by(monkeypatch, {1: "Seam a stays open."})
    _, done = attempts.sewn_at(task_of(body), PATTERN, 0.02, "auto", True, ("cut",))
    assert [task.halvings for task, _, _ in tasks] == [1, 0]
    assert not done.failure
    assert [note for note in tasks[1][2] if "seam a stays open" in note]
    spent = sewn_by(monkeypatch, {1: "Seam a stays open."})
    _, done = attempts.sewn_at(replace(task_of(body), ends=0.0), PATTERN, 0.02, "auto", True, ())
    assert len(spent) == 1
    assert done.failure == "Seam a stays open."


@pytest.mark.parametrize(
    ("farther", "failure", "result"),
    [
        (0.05, "Seam b stays open.", "Seam a stays open."),
        (0.0, "Seam b stays open.", "Seam b stays open."),
        (-0.05, "Seam b stays open.", "Seam b stays open."),
        (0.05, "", ""),
    ],
)
def test_of_two_poses_in_which_a_garment_fails_the_one_with_the_smaller_gap_is_the_result(
    body, tmp_path, monkeypatch, farther, failure, result
):
    """farther: distance by which the panels of the second try are farther apart than those of the first [m]."""
    failures = ["Seam a stays open.", failure]

    def sewn(task, mesh, on, notes):
        begun = DressState(as_placed(mesh), on, ())
        (task.directory / "close0").mkdir()
        (task.directory / "close0" / "record.jsonl").write_text(str(len(failures)))
        x = begun.state.positions + (len(failures) == 1) * farther * np.sign(begun.state.positions * [0, 0, 1])
        return begun, replace(begun, state=begun.state.moved_to(x)).failed(failures.pop(0))

    monkeypatch.setattr(attempts, "_sewn", sewn)
    asked: list[tuple[str, ...]] = []

    def pose(own, limbs):
        asked.append(tuple(limbs))
        return own, "the arms raised" if len(asked) == 2 else ""

    monkeypatch.setattr(attempts, "sewing_pose", pose)
    mesh = mesh_pattern(PATTERN, SPACING)
    for folder in ("close1", "close2"):
        (tmp_path / folder).mkdir()
    (tmp_path / "close1" / "record.jsonl").write_text("of an earlier command")
    _, done = attempts._sewn_in_poses(replace(task_of(body), directory=tmp_path), mesh, ())
    assert failures == []
    assert asked == [(), ("left arm", "right arm")]  # only cloth is between the sides: it may hang over the arms
    assert done.failure == result
    assert sorted(file.name for file in tmp_path.iterdir()) == ["close0", "close2"]
    assert (tmp_path / "close0" / "record.jsonl").read_text() == ("2" if "a" in result.split() else "1")


@pytest.mark.parametrize("raised", [False, True])
@pytest.mark.parametrize(("run", "number"), [(None, 2), (SimpleNamespace(status="completed"), 1)])
def test_a_garment_that_was_sewn_and_slid_off_is_not_sewn_again(body, tmp_path, monkeypatch, run, number, raised):
    """raised: the arms, at the first try."""
    wearer = Wearer(body, body_surface(body.positions, body.triangles))
    begun = DressState(as_placed(mesh_pattern(PATTERN, SPACING)), wearer, ())
    failed = replace(begun, run=run).failed("The garment slid off, or a seam stays open.")
    tries = []
    monkeypatch.setattr(attempts, "_sewn", lambda *given: tries.append(given) or (begun, failed))
    monkeypatch.setattr(attempts, "arms_between", lambda state, own: ("left hand",) * raised)
    monkeypatch.setattr(attempts, "sewing_pose", lambda own, limbs: (own, "the arms raised" * bool(limbs)))
    attempts._sewn_in_poses(replace(task_of(body), directory=tmp_path), begun.state.mesh, ())
    assert len(tries) == number


@pytest.mark.parametrize(
    ("open_seams", "status", "number", "result"),
    [
        ((2, 1), "completed", 2, 1),
        ((2, 0), "completed", 2, 0),
        ((1, 2), "completed", 2, 1),
        ((2, 0), "sewn", 2, 2),
        ((2, 0), "failed", 2, 2),
        ((0, 0), "completed", 1, 0),
    ],
)
def test_where_springs_hold_a_seam_beside_the_legs_the_better_of_two_poses_is_the_result(
    body, tmp_path, monkeypatch, open_seams, status, number, result
):
    """open_seams: numbers of them after either attempt, all beside the legs; status: that of the second."""
    wearer = Wearer(body, body_surface(body.positions, body.triangles))
    begun = DressState(as_placed(mesh_pattern(PATTERN, SPACING)), wearer, (), run=SimpleNamespace())
    tries = []

    def sewn(*given):
        left = open_seams[len(tries)]
        state = begun.state.weld(range(2 - left)) if left < 2 else begun.state
        tries.append(given)
        return begun, replace(begun, state=state, status="completed" if len(tries) == 1 else status)

    monkeypatch.setattr(attempts, "_sewn", sewn)
    monkeypatch.setattr(attempts, "legs_beside", lambda state, body: ("left leg",) * bool(state.open_seams))
    monkeypatch.setattr(attempts, "sewing_pose", lambda own, limbs: (own, "legs parted" * bool(limbs)))
    _, done = attempts._sewn_in_poses(replace(task_of(body), directory=tmp_path), begun.state.mesh, ())
    assert (len(tries), len(done.state.open_seams)) == (number, result)
    kept = number == 2 and result == open_seams[0]
    assert any("no better" in note for note in done.notes) is kept
    tries.clear()
    attempts._sewn_in_poses(replace(task_of(body), directory=tmp_path, ends=0.0), begun.state.mesh, ())
    assert len(tries) == 1  # the budget is spent


def test_less_is_left_of_a_garment_that_is_sewn_at_rest_and_welded(body):
    begun = DressState(as_placed(mesh_pattern(PATTERN, SPACING)), Wearer(body, body_surface(*person(0.05))), ())
    wider = replace(begun, state=begun.state.moved_to(1.1 * begun.state.positions))
    welded = replace(begun, state=begun.state.weld((0,)))
    order = [welded, begun, wider, replace(welded, status="sewn"), begun.failed("A seam."), wider.failed("A seam.")]
    assert [each.what_is_left for each in order] == sorted(each.what_is_left for each in order)
    assert len({each.what_is_left for each in order}) == len(order)


@pytest.mark.parametrize("error", [KeyboardInterrupt, InputError("A seam is of no length.")])
def test_the_runs_of_the_first_try_stay_where_the_second_ends_with_an_error(body, tmp_path, monkeypatch, error):
    wearer = Wearer(body, body_surface(body.positions, body.triangles))
    begun = DressState(as_placed(mesh_pattern(PATTERN, SPACING)), wearer, (), run=SimpleNamespace())

    def sewn(task, mesh, on, notes):
        (task.directory / "close0").mkdir()
        (task.directory / "close0" / "record.jsonl").write_text(str(len(notes)))
        if notes:
            raise error
        return begun, begun

    monkeypatch.setattr(attempts, "_sewn", sewn)
    monkeypatch.setattr(attempts, "legs_beside", lambda state, body: ("left leg",))
    monkeypatch.setattr(attempts, "sewing_pose", lambda own, limbs: (own, "legs parted" * bool(limbs)))
    with pytest.raises(error if isinstance(error, type) else type(error)):
        attempts._sewn_in_poses(replace(task_of(body), directory=tmp_path), begun.state.mesh, ())
    assert [file.name for file in tmp_path.iterdir()] == ["close0"]
    assert (tmp_path / "close0" / "record.jsonl").read_text() == "0"


def test_a_pattern_that_has_no_coarser_mesh_is_sewn_on_the_fine_one(body, monkeypatch):
    tasks = sewn_by(monkeypatch, {})
    made = attempts.mesh_pattern

    def refusing(pattern, size, halvings=0):
        if halvings:
            raise InputError("A seam joins two corners of one triangle.")
        return made(pattern, size)

    monkeypatch.setattr(attempts, "mesh_pattern", refusing)
    attempts.sewn_at(task_of(body), PATTERN, 0.02, "auto", True, ())
    ((task, _, notes),) = tasks
    assert task.halvings == 0
    assert [note for note in notes if "two corners of one triangle" in note]
