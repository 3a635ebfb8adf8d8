"""Checks of meshes and scenes from Python."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from small_scenes import BALL, EFFECTS, SHEET, small_scene

import clothsim
from clothsim import InputError
from clothsim.base.record import write_summary
from clothsim.cli import main

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SOUND, TWICE = [[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, 3], [0, 1, 2]]


def kinds(what, **keys):
    return [(finding.severity, finding.kind) for finding in clothsim.check(what, **keys)]


@pytest.mark.parametrize(
    "make", [lambda v, t: (v, t), clothsim.Cloth, lambda v, t: trimesh.Trimesh(v, t, process=False)]
)
def test_a_mesh_in_any_form(make):
    assert kinds(make(SQUARE, SOUND)) == []
    assert kinds(make(SQUARE, TWICE)) == [("error", "duplicate")]
    assert kinds(make(SQUARE, TWICE), role="body") == [("warning", "duplicate")]
    [finding] = clothsim.check(make(SQUARE, TWICE))
    assert finding.indices.tolist() == [2]
    assert finding.remedy


def test_a_body_is_no_cloth():
    assert kinds(clothsim.Body(SQUARE, TWICE)) == [("warning", "duplicate")]
    assert kinds(clothsim.Body(SQUARE, TWICE), role="cloth") == [("error", "duplicate")]


@pytest.mark.parametrize(("size", "found"), [(170.0, [("warning", "size")]), (1.7, []), (1e-3, [("warning", "size")])])
def test_a_mesh_in_another_unit_is_asked_about(tmp_path, size, found):
    """A body of 170 units: "Nothing is wrong"."""
    trimesh.creation.box((size / 4, size / 4, size)).export(tmp_path / "body.obj")
    assert kinds(tmp_path / "body.obj", role="body") == found
    assert main(["check", str(tmp_path / "body.obj"), "--scale", f"{1 / size}"]) == 0


def test_a_run_whose_cloth_is_held_inside_a_body_is_warned_of(tmp_path):
    inside = SHEET | {"size": [0.1, 0.1], "position": [0.0, 0.0, 0.0]}
    scene = small_scene(inside, run={"duration": 0.02, "frames_per_second": 50, "allow_inside": True})
    run = clothsim.simulate(scene, tmp_path)
    assert kinds(tmp_path) == [("warning", "run")]
    for spoilt in (None, [3]):
        write_summary(tmp_path / "summary.json", {**run.summary, "warnings": spoilt})
        assert kinds(tmp_path) == []


def test_raw_arrays_may_have_any_fault():
    found = kinds((SQUARE * [1, 1, np.nan], [[0, 1, 7]]))
    assert ("error", "not finite") in found
    assert ("error", "index out of range") in found
    assert ("warning", "size") not in kinds((SQUARE * np.nan, [[0, 1, 2]]))


def test_files(tmp_path):
    (tmp_path / "square.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 1 2 3\n")
    assert ("error", "duplicate") in kinds(tmp_path / "square.obj")
    (tmp_path / "scene.toml").write_text('[cloth]\nmesh = "square.obj"\n[effects.inertia]\n')
    assert {kind for _, kind in kinds(str(tmp_path / "scene.toml"))} == {"scene"}
    with pytest.raises(InputError):
        clothsim.check(tmp_path / "nothing.obj")
    with pytest.raises(InputError):
        clothsim.check(3.0)


def test_scenes():
    assert kinds(small_scene()) == []
    through = SHEET | {"position": [0.0, 0.0, 0.2]}
    assert kinds(small_scene(cloth=through)) == [("error", "scene")]
    without = {name: keys for name, keys in EFFECTS.items() if name != "body_contact"}
    assert kinds(small_scene(cloth=through, effects=without)) == [("warning", "intersection")]
    assert kinds(small_scene(body=BALL | {"position": [0, 0, -9]}, effects=without)) == []


CROSSED = """
[cloth]
mesh = "rectangle"
cells = [3, 3]
position = [0.0, 0.0, 0.2]
[[body]]
name = "ball"
mesh = "sphere"
radius = 0.3
subdivisions = 1
[effects.inertia]
[effects.gravity]
[effects.membrane]
[run]
duration = 0.01
frames_per_second = 100
"""
CONTACT = "[effects.body_contact]\n"


@pytest.mark.parametrize(
    ("text", "severities"),
    [
        (CROSSED, ["warning"]),
        (CROSSED + CONTACT, ["error"]),
        (CROSSED.replace("0.2]", "0.34]") + CONTACT, []),
        (CROSSED.replace("0.2]", "0.31]") + CONTACT, ["warning"]),  # within d_hat
        (CROSSED.replace("[3, 3]", "[9000, 9000]"), ["error"]),
        (CROSSED.replace("[run]", "[runn]"), ["error"]),
    ],
    ids=["without contact", "with contact", "sound", "close", "costly", "unknown key"],
)
def test_both_doors_give_one_answer_for_a_scene(text, severities, tmp_path, capsys):
    file = tmp_path / "scene.toml"
    file.write_text(text)
    assert [finding.severity for finding in clothsim.check(file)] == severities
    assert_one_answer(file, capsys)


def test_both_doors_give_one_answer_for_a_run_and_a_mesh(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(CROSSED)
    scene = clothsim.load_scene(tmp_path / "scene.toml")
    with pytest.warns(clothsim.IntersectionWarning):
        run = clothsim.simulate(scene, tmp_path / "run")
    assert kinds(run.directory) == [("error", "intersection")]
    assert kinds(replace(scene, run={**scene.run, "duration": 1e9}))[0] == ("error", "cost")
    (tmp_path / "square.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 1 2 3\n")
    for target in (run.directory, tmp_path / "square.obj"):
        assert clothsim.check(target)
        assert_one_answer(target, capsys)


def assert_one_answer(target, capsys):
    """The command prints what Python returns, as text and as JSON, and its exit code follows."""
    found = clothsim.check(target)
    code = int(any(finding.severity == "error" for finding in found))
    assert main(["check", str(target)]) == code
    printed = capsys.readouterr().out
    assert main(["check", str(target), "--json"]) == code
    document = json.loads(capsys.readouterr().out)
    assert document["code"] == code
    assert [(each["severity"], each["kind"], each["sentence"], each["remedy"]) for each in document["findings"]] == [
        (finding.severity, finding.kind, finding.sentence, finding.remedy) for finding in found
    ]
    assert document["errors"] == [finding.sentence for finding in found if finding.severity == "error"]
    assert all(f"  {finding.severity}: {finding.sentence}" in printed for finding in found)
    assert all(note in printed for note in document["notes"])


def test_each_mesh_of_a_scene_is_examined_where_one_is_refused(tmp_path):
    (tmp_path / "line.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\n", encoding="utf-8")
    (tmp_path / "alone.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 3 3 3\nf 1 2 3\n", encoding="utf-8")
    cloths = [{"name": name, "mesh": f"{name}.obj"} for name in ("line", "alone")]
    for body in ({}, {"name": "flat", "mesh": "line.obj"}):
        scene = clothsim.Scene(cloths, body or (), effects=EFFECTS, directory=tmp_path)
        found = [finding.sentence for finding in clothsim.check(scene)]
        for name in ("line", "alone", *([body["name"]] if body else [])):
            assert sum(sentence.startswith(f"{name}:") for sentence in found) == 1, (name, found)
