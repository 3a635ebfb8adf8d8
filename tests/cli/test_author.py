"""The command `author`: keys as text, the clip and its answer."""

import json

import pytest
from small_scenes import EFFECTS, small_scene

import clothsim
from clothsim import InputError, simulate
from clothsim.cli import main
from clothsim.cli.author_command import as_keys
from clothsim.garments import author as garments_author


@pytest.mark.parametrize("text", ["", ",", "5", "x=a.obj", "-1=a.obj", "5=", "5=a.obj,5=b.obj", "1.5=a.obj"])
def test_keys_that_are_none_are_refused(text):
    with pytest.raises(InputError):
        as_keys(text)


def test_author_writes_a_run_and_prints_its_distances(tmp_path, capsys):
    run = simulate(small_scene(effects=EFFECTS | {"self_contact": {}}), tmp_path / "run")
    run.export(tmp_path / "edited.obj", frame=3)
    words = [
        "author",
        str(run.directory),
        "--keys",
        f"3={tmp_path / 'edited.obj'}",
        "--quick",
        "-o",
        str(tmp_path / "c"),
    ]
    assert main([*words, "--json", "--quiet"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["intersecting_frames"] == []
    assert answer["keys"][0]["frame"] == 3
    assert answer["keys"][0]["after"] < 2e-3
    assert main(words) == 2  # the output is there


def test_author_prints_what_explains_the_edit(tmp_path, capsys):
    run = simulate(small_scene(effects=EFFECTS | {"self_contact": {}}), tmp_path / "run")
    run.export(tmp_path / "edited.obj", frame=3)
    words = ["author", str(run.directory), "--keys", f"3={tmp_path / 'edited.obj'}", "--free", "stretch", "--no-floor"]
    assert main([*words, "-o", str(tmp_path / "clip"), "--quiet"]) == 0
    printed = capsys.readouterr().out
    assert "stretch" in printed
    assert "x 1 " in printed  # nothing was edited
    assert ("targets.npy" in printed) is (tmp_path / "clip" / "targets.npy").exists()
    assert json.loads((tmp_path / "clip" / "author.json").read_text())["explained"]["misfit"]["before"] < 1e-6
    assert main([*words[:4], "--free", "colour", "-o", str(tmp_path / "other")]) == 2


def test_an_unknown_number_is_refused_before_the_twins_run(tmp_path, monkeypatch):
    def no_floor(run):
        raise AssertionError

    monkeypatch.setattr(garments_author, "floor_of", no_floor)
    run = simulate(small_scene(effects=EFFECTS), tmp_path / "run")
    with pytest.raises(InputError, match="colour"):
        clothsim.author(run, {3: run.positions(3)}, tmp_path / "clip", free=["colour"])
