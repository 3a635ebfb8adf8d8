"""Measured errors of the presets: one line a scene, and the table written by the study."""

from pathlib import Path

import pytest

from clothsim.build import preset_errors
from clothsim.build.preset_errors import MEASURED, Measured
from clothsim.build.presets import PRESETS
from clothsim.cli import main
from tests.benchmarks.measure_presets import written_into


@pytest.mark.parametrize("preset", PRESETS)
def test_each_preset_has_numbers_of_several_scenes(preset):
    rows = [row for row in MEASURED if row.preset == preset]
    assert len({row.scene for row in rows}) >= 3
    assert all(row.error > 0 and 0 < row.relative_error < 1 and row.seconds > 0 for row in rows)
    lines = preset_errors.measured(preset)
    assert len(lines) == len(rows)
    assert all(" mm (" in line and " % of its size) in " in line for line in lines)


@pytest.mark.parametrize("scene", sorted({row.scene for row in MEASURED}))
def test_a_finer_preset_is_more_accurate(scene):
    errors = {row.preset: row.error for row in MEASURED if row.scene == scene}
    assert errors["fine"] < errors["draft"]


def test_the_table_is_written_and_read_again():
    source = Path(preset_errors.__file__).read_text(encoding="utf-8")
    rows = [Measured("fine", "b", 0.25, 0.001, 0.01, 9.0), Measured("draft", "a", 20.0, 0.05, 0.01, 0.2)]
    once = written_into(source, rows, "2031-01-02")
    names: dict = {"__name__": "clothsim.build.preset_errors"}
    exec(compile(once, "written", "exec"), names)
    assert names["DATE"] == "2031-01-02"
    assert [(row.preset, row.error) for row in names["MEASURED"]] == [("draft", 20.0), ("fine", 0.25)]
    assert written_into(written_into(once, [], "x"), rows, "2031-01-02") == once
    assert "def measured(" in once


def test_run_prints_what_a_preset_sets_and_how_wrong_it_was(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "sheet.toml"
    scene.write_text(
        '[cloth]\nmesh = "rectangle"\ncells = [4, 4]\n[effects.gravity]\n[effects.inertia]\n[run]\nduration = 0.04\n'
    )
    assert main(["run", "sheet.toml", "--preset", "draft", "--no-picture"]) == 0
    out = capsys.readouterr().out
    assert "preset draft: cells x 1/2, dt 0.04 s, tolerance 0.01 m/s" in out
    assert "9 vertices and 8 triangles" in out
    for line in preset_errors.measured("draft"):
        assert line in out
    assert main(["run", "sheet.toml", "--preset", "drat"]) == 2
    assert "'draft'" in capsys.readouterr().err
