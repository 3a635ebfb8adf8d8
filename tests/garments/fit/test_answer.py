"""What a fit hands back: best stage, unit of the target, the file that came, progress, displacement."""

import re
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from fitting_cases import capsule_figure, in_file, tube_garment, wider

import clothsim
from clothsim.base.errors import InputError
from clothsim.base.record import read_summary
from clothsim.cli.progress import Lines
from clothsim.files.meshes.mesh_file import read_mesh, read_polygons
from clothsim.garments import stages
from clothsim.garments.fit import pipeline
from clothsim.garments.fit import pipeline as module
from clothsim.mesh.generators.shapes import rectangle
from clothsim.run.step_reports import Progress

BODY = capsule_figure(segments=10)
TUBE = tube_garment(0.125, height=0.12, cells=(10, 3))
SHORT = replace(
    stages.FIT_DRAPE,
    effects={name: keys for name, keys in stages.FIT_DRAPE.effects.items() if name != "friction"},
    run={"duration": 0.05, "frames_per_second": 20},
)


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "FIT_DRAPE", SHORT)
    monkeypatch.setattr(module, "FALLING", 1.0)
    tight = TUBE.positions * [0.776, 0.776, 1.0]
    return {
        "garment": in_file(tmp_path, "garment.obj", TUBE.positions, TUBE.triangles),
        "tight": in_file(tmp_path, "tight.obj", tight, TUBE.triangles),
        "body": in_file(tmp_path, "body.obj", BODY.positions, BODY.triangles),
        "sheet": in_file(tmp_path, "sheet.obj", *rectangle(size=(0.5, 0.5), cells=(6, 6))),
    }


def scaled(tmp_path, name, factor):
    return in_file(tmp_path, name, factor * BODY.positions, BODY.triangles)


def test_a_failed_fit_returns_its_best_stage(files, tmp_path, monkeypatch):
    """A growth that ends with all vertices inside comes after a stage with one."""
    one_inside = TUBE.positions.copy()
    one_inside[15] *= 0.76
    monkeypatch.setattr(pipeline, "_refine", lambda *_, **__: (one_inside, "none"))

    class Stopped:
        status, reason = "failed", "At 0.1 s: Newton did not converge."
        summary: ClassVar = {"failure": {"position": None}}

        def positions(self, _):
            return 0.5 * TUBE.positions

    monkeypatch.setattr(pipeline, "moved_with_body", lambda *_, **__: Stopped())
    done = clothsim.fit(files["tight"], files["body"], output=tmp_path / "out")
    ranks = [stage.counts.rank for stage in done.stages]
    assert done.status == "failed"
    assert done.stages[-1].name == "grow"
    assert ranks[-1] > min(ranks)
    assert done.counts.rank == min(ranks)
    assert (done.answer.name, done.counts.penetrating_vertices) == ("refine", 1)
    assert done.answer is done.stages[done.answer_number]
    np.testing.assert_array_equal(read_mesh(tmp_path / "out" / "fitted.obj").positions, done.answer.positions)
    summary = read_summary(tmp_path / "out" / "summary.json")
    assert summary["fitted_stage"] == done.answer_number < len(done.stages) - 1
    assert summary["failure"]["element"] == str(done.counts)


def test_a_garment_that_fell_off_is_returned_as_it_was_before_it_fell(files, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "FALLING", 0.01)
    done = clothsim.fit(files["garment"], files["body"], output=tmp_path / "out")
    assert done.status == "failed"
    assert [stage.name for stage in done.stages] == ["garment", "simulate"]
    assert done.answer_number == 0
    np.testing.assert_array_equal(done.positions, TUBE.positions)


def test_a_completed_fit_is_its_last_stage(files, tmp_path):
    done = clothsim.fit(files["garment"], files["body"], output=tmp_path / "out")
    assert done.status == "completed"
    assert done.answer is done.stages[-1]
    assert read_summary(tmp_path / "out" / "summary.json")["fitted_stage"] == 1


@pytest.mark.parametrize("height", [3.5, 0.3])
def test_a_giant_or_a_doll_wears_it_where_its_unit_is_given(files, tmp_path, height):
    other = scaled(tmp_path, "other.obj", height)  # no person in any unit
    with pytest.raises(InputError, match="scale_to="):
        clothsim.fit(files["garment"], other, files["body"], tmp_path / "out")
    done = clothsim.fit(files["garment"], other, files["body"], tmp_path / "out", scale_to=1.0)
    assert (done.status, done.source.scale, done.target.scale) == ("completed", 1.0, 1.0)
    assert np.ptp(done.target.positions[:, 2]) == pytest.approx(height)
    ratio = np.ptp(done.stages[1].positions, axis=0) / np.ptp(TUBE.positions, axis=0)
    np.testing.assert_allclose(ratio, height, rtol=0.02)


def test_scale_to_is_of_the_target_alone(files, tmp_path):
    large = scaled(tmp_path, "large.obj", 20.0)  # read as dm without
    garment, body = files["garment"], files["body"]
    assert clothsim.fit(garment, large, body, tmp_path / "guessed").target.scale == 0.1
    done = clothsim.fit(garment, large, body, tmp_path / "given", scale_to=0.06)
    assert (done.source.scale, done.target.scale) == (1.0, 0.06)
    grown = clothsim.fit(garment, body, output=tmp_path / "grown", scale=1.0, scale_to=1.2)
    assert grown.target is not grown.source  # the same file in another unit is another body
    assert clothsim.fit(garment, body, output=tmp_path / "same", scale=1.0, scale_to=1.0).source.scale


def test_scale_to_is_refused_for_what_has_its_own_unit(files, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text('[cloth]\nmesh = "garment.obj"\n[body]\nmesh = "body.obj"\n[effects.inertia]\n')
    for body in (scene, clothsim.Body(BODY.positions, BODY.triangles)):
        with pytest.raises(InputError, match="scale_to"):
            clothsim.fit(files["garment"], body, files["body"], tmp_path / "out", scale_to=1.0)


def test_the_fitted_file_has_the_quads_of_the_one_that_came(files, tmp_path):
    ring = 0.125 * np.column_stack([np.cos(np.arange(10) * np.pi / 5), np.sin(np.arange(10) * np.pi / 5)])
    points = np.concatenate([np.column_stack([ring, np.full(10, z)]) for z in (-0.03, 0.03)])
    quads = [[i, (i + 1) % 10, (i + 1) % 10 + 10, i + 10] for i in range(10)]
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist()) + "vt 0 0\nvt 1 1\ng ring\nusemtl wool\n"
    text += "".join("f " + " ".join(f"{c + 1}/{k % 2 + 1}" for k, c in enumerate(q)) + "\n" for q in quads)
    (tmp_path / "ring.obj").write_text(text)
    done = clothsim.fit(tmp_path / "ring.obj", files["body"], output=tmp_path / "out")
    before, after = (read_polygons(file) for file in (tmp_path / "ring.obj", tmp_path / "out" / "fitted.obj"))
    assert np.array_equal(after.corners, before.corners)
    assert np.array_equal(after.starts, before.starts)
    assert np.array_equal(after.texture, before.texture)
    assert after.groups.keys() == {"ring"}
    assert np.array_equal(after.positions, done.positions)
    assert not np.array_equal(after.positions, before.positions)


def test_the_distance_moved_is_that_from_where_it_was_worn(files, tmp_path):
    far = wider(BODY, 1.0)
    turned = far.positions[:, [1, 2, 0]] + np.array([1.85, 0.0, 4.0])
    to = in_file(tmp_path, "far.obj", turned, BODY.triangles)
    done = clothsim.fit(files["garment"], to, files["body"], tmp_path / "out")
    assert np.linalg.norm(done.positions - TUBE.positions, axis=1).max() > 4.0
    assert done.cost.displacement < 0.05
    assert read_summary(tmp_path / "out" / "summary.json")["cost"]["displacement"] == done.cost.displacement


def test_a_growth_reports_its_steps_as_the_drape_does(files, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pipeline, "_refine", lambda positions, *_, **__: (positions, "none"))
    seen = []
    done = clothsim.fit(files["tight"], files["body"], output=tmp_path / "out", progress=seen.append)
    assert "grow" in [stage.name for stage in done.stages]
    grown = [progress for progress in seen if progress.stage == "grow"]
    assert len(grown) >= 10
    assert grown[-1].time == pytest.approx(grown[-1].duration) == stages.MOTION_SECONDS
    assert [progress.stage for progress in seen if progress.stage != "grow"] == ["simulate"] * (len(seen) - len(grown))


def test_the_time_left_begins_again_with_each_stage(capsys):
    lines = Lines()
    for stage, duration in (("grow", 0.5), ("grow", 0.5), ("simulate", 1.0)):
        for step in range(1, 6):
            lines(Progress(step * duration / 5, duration, step, 4, 2e-3, 0.5, "moving", 0.1, stage))
    err = capsys.readouterr().err.splitlines()
    assert [re.match(r"(\w+): ([\d.]+) of ([\d.]+) s", line).groups() for line in err] == [
        ("grow", "0.100", "0.5"),
        ("grow", "0.500", "0.5"),
        ("grow", "0.100", "0.5"),
        ("grow", "0.500", "0.5"),
        ("simulate", "0.200", "1"),
        ("simulate", "1.000", "1"),
    ]
