"""Every sequence of stages, end to end, on a capsule."""

import re
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from fitting_cases import capsule_figure, folded_sheet, task, tube_garment, wider

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.garments.fit import pipeline
from clothsim.garments.fit.pipeline import seed_fit
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.geometry.untangling import untangle as search
from clothsim.mesh.generators.shapes import rectangle

FIGURE = capsule_figure()
COARSE = capsule_figure(segments=8)


@pytest.fixture
def without_clear(monkeypatch):
    """The garment cannot be untangled from the body."""
    real = pipeline.untangle

    def untangle(*arguments, body=None, **keys):
        done = real(*arguments, body=body, **keys)
        return done if body is None else replace(done, end="stalled")

    monkeypatch.setattr(pipeline, "untangle", untangle)


def names(found):
    return [stage.name for stage in found.stages]


def test_a_clean_garment_needs_no_stage(tmp_path):
    garment, on_stage = tube_garment(0.11), []
    found = seed_fit(task(garment, FIGURE, FIGURE, tmp_path, on_stage=on_stage.append))
    assert names(found) == ["garment"]
    assert on_stage == list(found.stages)
    assert found.last.positions is garment.positions
    assert (found.failure, found.notes, found.worn.self_contact) == ("", (), True)
    assert not list(tmp_path.iterdir())


def test_a_tube_five_millimetres_inside_is_refined(tmp_path):
    garment = tube_garment(0.095)
    found = seed_fit(task(garment, FIGURE, FIGURE, tmp_path))
    assert names(found) == ["garment", "refine"]
    assert found.stages[0].counts.penetrating_vertices == len(garment.positions)
    assert found.last.counts.clean
    assert not found.failure
    assert found.worn.rest is garment.positions


def test_where_the_first_refinement_leaves_something_inside_the_second_goes_along_the_normals(
    tmp_path, monkeypatch, without_clear
):
    garment, asked = tube_garment(0.095), []
    freed = tube_garment(0.11).positions

    def refined(positions, *_, along_normals):
        asked.append((positions, along_normals))
        return (freed if along_normals else 0.99 * positions), "refined"

    monkeypatch.setattr(pipeline, "_refine", refined)
    found = seed_fit(task(garment, FIGURE, FIGURE, tmp_path))
    assert names(found) == ["garment", "refine", "refine"]
    assert [along for _, along in asked] == [False, True]
    assert all(positions is garment.positions for positions, _ in asked)  # the second does not go on from the first
    assert found.last.positions is freed


def test_a_tube_that_no_formula_frees_is_grown_out(tmp_path, monkeypatch, without_clear):
    """Refinement is taken away: growth alone has to bring the tube from 3 mm inside to the outside."""
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    garment = tube_garment(0.097, height=0.12, cells=(10, 3))
    found = seed_fit(task(garment, COARSE, COARSE, tmp_path))
    assert names(found)[-1] == "grow"
    assert found.last.counts.clean
    assert not found.failure
    assert "mm thinner, from refine, grown back under IPC" in found.last.description
    assert {"body000.obj", "body001.obj", "summary.json"} <= {file.name for file in (tmp_path / "grow").iterdir()}


def test_a_garment_is_transferred_to_a_wider_body(tmp_path):
    garment, wide = tube_garment(0.11), wider(FIGURE, 1.4)
    found = seed_fit(task(garment, FIGURE, wide, tmp_path))
    assert names(found) == ["garment", "transfer"]
    assert found.last.counts.clean
    assert found.worn.rest is found.last.positions
    np.testing.assert_allclose(np.linalg.norm(found.last.positions[:, :2], axis=1), 0.151, rtol=0.01)
    own_size = seed_fit(task(garment, FIGURE, wide, tmp_path, resize=False))
    assert own_size.worn.rest is garment.positions


def test_a_garment_that_meets_itself_is_untangled_first(tmp_path):
    garment = folded_sheet()
    found = seed_fit(task(garment, FIGURE, FIGURE, tmp_path))
    assert names(found) == ["garment", "untangle"]
    assert found.stages[0].counts.self_pairs > 0
    assert found.stages[0].counts.on_body
    assert found.last.counts.clean
    assert found.worn.rest is garment.positions
    assert re.search(r"\d+ pairs parted in \d+ rounds", found.last.description)


def crossing_sheets():
    """Two sheets through one another beside the body."""
    positions, triangles = rectangle(size=(0.3, 0.3), cells=(3, 3))
    upright = positions[:, [0, 2, 1]] + np.array([0.03, 0.02, 0.01])
    two = np.concatenate([positions, upright]) + np.array([0.5, 0.0, 0.0])
    return Garment("two", two, np.concatenate([triangles, triangles + len(positions)]))


def test_crossing_sheets_are_parted_first(tmp_path):
    found = seed_fit(task(crossing_sheets(), FIGURE, FIGURE, tmp_path))
    assert names(found) == ["garment", "untangle"]
    assert found.last.counts.clean


@pytest.mark.parametrize("to", [FIGURE, wider(FIGURE, 1.2)])
def test_a_garment_that_cannot_be_untangled_fails_at_once_with_a_place(tmp_path, monkeypatch, to):
    monkeypatch.setattr(search, "ATTEMPTS", ())
    found = seed_fit(task(crossing_sheets(), FIGURE, to, tmp_path))
    assert names(found) == ["garment"]
    assert re.search(rf"\b{found.last.counts.self_pairs} triangle pairs.*garment, near \(.*\) m", found.failure)
    assert not list(tmp_path.iterdir())


def test_what_nothing_frees_fails_with_a_sentence_and_a_place(tmp_path):
    sheet = Garment("sheet", *rectangle(size=(0.5, 0.5), cells=(4, 4)))
    found = seed_fit(task(sheet, COARSE, COARSE, tmp_path))
    assert found.failure.startswith("No deflation of capsule frees the garment: ")
    assert "worst near (" in found.failure
    assert found.failure.endswith(" m.")
    assert not found.last.counts.clean
    assert not (tmp_path / "grow").exists()


def test_a_growth_that_stops_is_a_failure_with_its_reason(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))

    class Stopped:
        status, reason = "failed", "At 0.1 s: Newton did not converge."
        summary: ClassVar = {"failure": {"position": None}}

        def positions(self, _):
            return tube_garment(0.097, cells=(8, 2)).positions

    monkeypatch.setattr(pipeline, "moved_with_body", lambda *_, **__: Stopped())
    found = seed_fit(task(tube_garment(0.097, cells=(8, 2)), COARSE, COARSE, tmp_path))
    assert re.search(r"grow.*0\.1 s", found.failure)


def test_where_a_growth_fails_the_next_start_is_tried(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    garment, frames = tube_garment(0.097, cells=(8, 2)), []

    class Grown:
        reason = "At 0.1 s: the scripted motion is blocked."
        summary: ClassVar = {"failure": {"position": None}}

        def __init__(self, status):
            self.status = status

        def positions(self, _):
            return tube_garment(0.12, cells=(8, 2)).positions

    def moved_with_body(_worn, _start, bodies, *_, **slips):
        frames.append((len(bodies), bool(slips)))
        return Grown("failed" if len(frames) < 3 else "completed")

    monkeypatch.setattr(pipeline, "moved_with_body", moved_with_body)
    found = seed_fit(task(garment, COARSE, COARSE, tmp_path))
    assert frames == [(2, False), (2, True), (3, False)]
    assert not found.failure
    assert found.last.counts.clean
    assert "without folds" in found.last.description
    assert [note for note in found.notes if re.search(r"5 mm.*grow.*0\.1 s", note)]


def test_a_growth_that_cannot_begin_is_a_failure_with_its_reason(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))

    def refuse(*_):
        raise InputError("body: triangle 3 has no area.")

    monkeypatch.setattr(pipeline, "moved_with_body", refuse)
    found = seed_fit(task(tube_garment(0.097, cells=(8, 2)), COARSE, COARSE, tmp_path))
    assert re.search(r"grow.*body.*triangle 3\b", found.failure)


def test_the_source_body_becomes_the_target_where_no_deflation_helps(tmp_path, monkeypatch, without_clear):
    """Without deflation and refinement: the garment is clean on its body and moves with the body to the wider one."""
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    monkeypatch.setattr(pipeline, "clearings", lambda *_: iter(()))
    monkeypatch.setattr(
        pipeline,
        "transferred",
        lambda garment, _, target, *__: pipeline.Transferred(garment.positions, target.positions, ""),
    )
    garment, wide = tube_garment(0.11, height=0.12, cells=(10, 3)), wider(COARSE, 1.15)
    found = seed_fit(task(garment, COARSE, wide, tmp_path))
    assert names(found)[-1] == "morph"
    assert not found.failure
    assert found.last.counts.clean
    assert re.search(r"capsule.*wide", found.last.description)
    assert np.linalg.norm(found.last.positions[:, :2], axis=1).min() > 0.1


@pytest.mark.parametrize("flat", ["source", "target"])
def test_a_flat_body_is_bad_input(tmp_path, flat):
    sheet = BodyMesh("sheet", *rectangle(cells=(2, 2)), 1.0, ())
    bodies = {"source": FIGURE, "target": FIGURE, flat: sheet}
    with pytest.raises(InputError):
        seed_fit(task(tube_garment(0.11), bodies["source"], bodies["target"], tmp_path))


def test_a_growth_that_fails_with_friction_is_tried_without(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    real, named = pipeline.moved_with_body, []

    def moved_with_body(*arguments, **slips):
        run = real(*arguments, **slips)
        named.append("friction" in run.summary["effects"])
        return replace(run, summary={**run.summary, "status": "failed"}) if len(named) == 1 else run

    monkeypatch.setattr(pipeline, "moved_with_body", moved_with_body)
    found = seed_fit(task(tube_garment(0.097, cells=(8, 2)), COARSE, COARSE, tmp_path))
    assert named == [True, False]
    assert found.last.counts.clean
    assert found.last.description.endswith("grown back under IPC, without friction")


def test_a_garment_that_crosses_the_body_is_cleared(tmp_path):
    positions, triangles = tube_garment(0.105).positions, tube_garment(0.105).triangles
    dented = positions - 0.01 * np.cos(np.arctan2(positions[:, 1], positions[:, 0]))[:, None] * [1, 0, 0]
    found = seed_fit(task(Garment("tube", dented, triangles), FIGURE, FIGURE, tmp_path))
    assert names(found) == ["garment", "clear"]
    assert found.stages[0].counts.body_pairs > 0
    assert found.last.counts.clean
    assert np.linalg.norm(found.last.positions - dented, axis=1).max() < 0.02


def test_where_the_near_part_of_the_body_is_not_enough_the_whole_body_grows(tmp_path, monkeypatch, without_clear):
    """The part is put at the head of the capsule, where it pushes nothing: the check on the whole body finds that."""
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    real, sizes = pipeline.moved_with_body, []

    def head_only(_, frames, triangles):
        head = COARSE.positions[triangles][:, :, 2].min(axis=1) > 0.45
        used, renumbered = np.unique(triangles[head], return_inverse=True)
        return tuple(frame[used] for frame in frames), renumbered.reshape(-1, 3)

    def moved_with_body(worn, *arguments, **slips):
        sizes.append(len(worn.body_triangles))
        return real(worn, *arguments, **slips)

    monkeypatch.setattr(pipeline, "near_body", head_only)
    monkeypatch.setattr(pipeline, "moved_with_body", moved_with_body)
    found = seed_fit(task(tube_garment(0.097, height=0.12, cells=(10, 3)), COARSE, COARSE, tmp_path))
    assert len(sizes) == 2
    assert sizes[0] < sizes[1] == len(COARSE.triangles)
    assert not found.failure
    assert found.last.counts.clean


def test_a_growth_takes_only_the_body_near_the_garment(tmp_path, monkeypatch, without_clear):
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    garment = tube_garment(0.097, height=0.12, cells=(10, 3))
    found = seed_fit(task(garment, FIGURE, FIGURE, tmp_path))
    moved = read_mesh(tmp_path / "grow" / "body001.obj")
    assert 0 < len(moved.triangles) < len(FIGURE.triangles)
    assert found.last.counts.clean
