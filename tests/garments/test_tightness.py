"""Tight parts of a worn garment, against closed forms, and of a tube that is too small for its body."""

import json

import numpy as np
import pytest
from fitting_cases import capsule_figure, in_file, tube_garment

import clothsim
from clothsim.garments.tightness import Tightness, tight_notes, tight_parts

AREAS = np.array([1.0, 1.0, 3.0, 1.0])
STRETCHES = np.array([[1.2, 1.0], [0.9, 1.3], [1.0, 1.04], [1.5, 1.5]])


def test_a_part_is_tight_by_the_median_of_its_stretch_the_largest_first():
    found = tight_parts(STRETCHES, AREAS, {"front": np.array([0, 1]), "back": np.array([2, 1]), "cuff": np.array([3])})
    assert list(found) == ["cuff", "front"]
    assert found["cuff"] == Tightness(1.5, None)
    assert found["cuff"].ease == pytest.approx(-1 / 3)
    assert found["front"].stretch == 1.2
    assert tight_parts(STRETCHES, AREAS, {"none": np.zeros(0, np.int64)}) == {}


def test_cloth_that_nothing_presses_is_not_tight():
    triangles = np.array([[0, 1, 2], [0, 1, 2], [0, 1, 2], [3, 4, 5]])
    parts = {"front": np.array([0, 1]), "cuff": np.array([3])}
    found = tight_parts(STRETCHES, AREAS, parts, triangles, np.array([600.0, 0.0, 0.0, 9.0, 9.0, 9.0]))
    assert {name: each.pressure for name, each in found.items()} == {"front": 200.0}


def test_a_note_names_what_differs_in_its_side_once():
    found = dict.fromkeys(["left_sleeve_front", "right_sleeve_front", "left_sleeve_back"], Tightness(1.25, 812.0))
    (note,) = tight_notes({**found, "front": Tightness(1.1)})
    sleeves, front = "sleeves (stretched 1.25, pressure 0.81 kPa, ease -20 %)", "front (stretched 1.10, ease -9 %)"
    assert note == f"too tight: {sleeves}, {front}"
    assert tight_notes({}) == ()


def test_a_fit_that_is_too_small_says_so(tmp_path):
    figure = capsule_figure(segments=10)
    small = tube_garment(0.125, height=0.12, cells=(10, 3))
    body = in_file(tmp_path, "body.obj", figure.positions, figure.triangles)
    notes = {}
    for name, factor in (("small", 0.76), ("own", 1.0)):
        worn = in_file(tmp_path, f"{name}.obj", small.positions * [factor, factor, 1.0], small.triangles)
        done = clothsim.fit(worn, body, output=tmp_path / name)
        notes[name] = [note for note in done.notes if note.startswith("too tight")]
        entries = json.loads((tmp_path / name / "summary.json").read_text())["tight"]
        assert set(entries) == set(done.tight)
    assert len(notes["small"]) == 1
    assert notes["own"] == []
    assert all(each["ease"] < -0.05 and each["pressure"] > 100 for each in done.tight.values())
