"""Pre-flight check of a motion: arms that swing into the trunk, legs through each other, joints that turn fast."""

import numpy as np
import pytest

from clothsim.cli import main
from clothsim.files.characters.character import mannequin_character
from clothsim.files.characters.motion_check import closing_folds, fastest_turn, meetings, part_pairs, vertices_of_parts


@pytest.fixture(scope="module")
def character():
    return mannequin_character()


def swings(character, joint, axis, degrees):
    """A pose by time: `joint` turned by `degrees` sin(pi t)."""

    def pose(time):
        angle = np.radians(degrees) * np.sin(np.pi * time)
        return character.skeleton.turned({joint: angle * np.asarray(axis, float)})

    return pose


TIMES = np.linspace(0, 1, 11).tolist()


def test_the_parts_cover_the_body(character):
    parts = vertices_of_parts(character)
    assert set(parts) == {"trunk", "left arm", "right arm", "left leg", "right leg"}
    assert sum(map(len, parts.values())) == len(character.positions)
    for name, rows in parts.items():
        side = character.positions[rows, 0].mean()
        assert (side > 0.05) == name.startswith("left")
        assert (side < -0.05) == name.startswith("right")


def test_an_arm_in_the_trunk_is_found_at_its_times(character):
    found = meetings(character, swings(character, "left_shoulder", (0, 1, 0), 40), TIMES, 0.005)
    deep = [met for met in found if met.parts == ("left arm", "trunk")]
    assert len(deep) == 1
    assert deep[0].nearest < -0.02
    assert deep[0].at == pytest.approx(0.5)
    assert 0 < deep[0].start < 0.5 < deep[0].end < 1
    assert deep[0].start + deep[0].end == pytest.approx(1)


def test_a_leg_meets_the_other(character):
    found = meetings(character, swings(character, "left_hip", (0, 1, 0), 25), [0.0, 0.5], 0.005)
    assert {"left leg", "right leg"} in [set(met.parts) for met in found]


def test_nothing_meets_at_rest(character):
    assert meetings(character, swings(character, "left_shoulder", (0, 1, 0), 0), TIMES[:2], 0.005) == ()


def test_an_armpit_closes_under_cloth_alone(character):
    down, everywhere = swings(character, "left_shoulder", (0, 1, 0), 25), np.ones(len(character.positions), bool)
    times = TIMES[::2]
    folds = closing_folds(character, down, times, 0.01, everywhere)
    assert {fold.parts for fold in folds} == {("left arm", "trunk")}
    assert folds[0].vertices > 0
    assert 0 < folds[0].nearest < 0.01
    assert 0 < folds[0].start <= folds[0].at <= folds[0].end < 1
    assert 1.2 < folds[0].place[2] < 1.5  # the armpit, not a finger
    assert closing_folds(character, down, times, 0.01, ~everywhere) == ()
    assert closing_folds(character, swings(character, "left_shoulder", (0, 1, 0), 0), times[:2], 0.01, everywhere) == ()


def test_boxes_bound_the_distance_from_below(character):
    points = character.vertices(character.skeleton.rest)
    for pair in part_pairs(character, points):
        assert pair.boxes_apart(points) <= pair.distance(points)[0] + 1e-12


def test_the_fastest_turn(character):
    found = fastest_turn(character, swings(character, "left_shoulder", (1, 0, 0), 40), TIMES)
    assert found.degrees == pytest.approx(40 * np.sin(0.1 * np.pi), rel=1e-6)
    assert found.joint in ("left_shoulder", "left_elbow", "left_wrist")
    assert found.steps == 4  # .1 to .2 s: 11.1 degrees


def test_the_command(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    body = '[[body]]\nmodel = "mannequin"\nmotion = { clip = "walk", lead_in = 0.0 }\n[run]\nduration = 0.6\n'
    scene.write_text(f'[cloth]\nmesh = "skirt"\nedge = 0.04\n{body}[solver]\ndt = 0.3\n[effects.body_contact]\n')
    assert main(["check", str(scene), "--motion"]) == 0
    assert "warning" in capsys.readouterr().out
    assert main(["check", str(tmp_path), "--motion"]) == 2
