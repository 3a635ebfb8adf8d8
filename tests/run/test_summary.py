"""Warnings of a completed run."""

from time import process_time, sleep

import numpy as np
import pytest
from small_scenes import BALL, EFFECTS, RUN, SHEET, SOLVER, small_scene, without

from clothsim import check, resume, simulate
from clothsim.base.errors import InputError
from clothsim.cli import main
from clothsim.run.certificate import Pinches, pinched_vertices
from clothsim.run.summary import LARGEST_STRETCH, certificate_rows
from clothsim.scene.assembly.scene_world import build
from clothsim.viewer.served import state_text

SHORT = RUN | {"duration": 0.04}
SMALL = SHEET | {"size": [0.2, 0.2], "position": [0, 0, 0]}


def plates(below, above):
    """Two slabs whose faces are so far below and above z = 0 [m]."""
    sizes = {"mesh": "slab", "size": [2, 2, 0.1], "cells": [3, 3, 1]}
    faces = {"table": -0.05 - below, "press": 0.05 + above}
    return [sizes | {"name": name, "position": [0.01, 0.02, z]} for name, z in faces.items()]


def pressed(below, above, d_hat=0.01):
    effects = without("gravity") | {"body_contact": {"d_hat": d_hat}}
    return small_scene(SMALL, plates(below, above), effects, run=SHORT)


def test_a_cloth_inside_a_body_is_in_the_certificate(tmp_path):
    run = simulate(small_scene(SMALL, BALL, EFFECTS, run=SHORT | {"allow_inside": True}), tmp_path)
    forced = simulate(small_scene(SMALL, BALL, EFFECTS, run=SHORT), tmp_path / "forced", force=True)
    assert forced.summary["certificate"]["held_inside"] == run.summary["certificate"]["held_inside"]
    assert forced.scene.run.allow_inside
    (inside,) = run.summary["certificate"]["held_inside"]
    assert (inside["cloth"], inside["body"], inside["pieces"], inside["of"]) == ("cloth", "ball", 1, 1)
    assert run.intersection_free
    assert len(run.summary["warnings"]) == 1
    assert "INSIDE" in dict(certificate_rows(run.summary))["contact"]
    assert "inside ball" in state_text(run)


def test_without_contact_too(tmp_path):
    run = simulate(small_scene(SMALL, BALL, without("body_contact"), run=SHORT), tmp_path)
    (inside,) = run.summary["certificate"]["held_inside"]
    assert (inside["cloth"], inside["body"]) == ("cloth", "ball")
    (warning,) = run.summary["warnings"]
    assert "effects.body_contact" in warning


@pytest.mark.parametrize(
    ("end", "velocity", "solver"),
    [
        ("at rest", [0, 0, 0], SOLVER),
        ("time is over", [0, 0, 1], SOLVER),
        ("stopped", [0, 0, 0], SOLVER | {"max_iterations": 1}),
    ],
)
def test_each_end_has_its_word(tmp_path, end, velocity, solver):
    effects = {"inertia": {}, "membrane": {}}
    if end == "stopped":
        effects |= {"gravity": {"acceleration": [0.0, -9.81, 0.0]}, "pins": {"select": "left"}}
    run = {"duration": 0.4, "frames_per_second": 25, "until": "rest"}
    made = simulate(small_scene(SMALL | {"velocity": velocity}, (), effects, solver, run), tmp_path)
    assert made.summary["end"] == end
    assert made.summary["certificate"]["at_rest"] == (end == "at rest")
    assert made.status == ("failed" if end == "stopped" else "completed")


def test_cloth_that_starts_inside_a_body_is_refused():
    scene = small_scene(SMALL, BALL, EFFECTS, run=SHORT)
    with pytest.raises(InputError, match="cloth starts inside ball"):
        build(scene)
    assert [each.severity for each in check(scene) if "inside" in each.sentence] == ["error"]
    assert build(small_scene(SMALL, BALL, without("body_contact"), run=SHORT))


def test_cpu_seconds_are_those_of_the_process_and_not_of_the_clock(tmp_path):
    started = process_time()
    run = simulate(small_scene(run=SHORT), tmp_path, on_step=lambda _: sleep(0.1))
    spent = process_time() - started
    assert 0.0 < run.summary["cpu_seconds"] <= spent
    assert run.summary["wall_seconds"] > 0.1 * run.summary["steps"]


def test_a_cloth_on_a_body_is_as_it_should_be(tmp_path):
    run = simulate(small_scene(), tmp_path)
    certificate = run.summary["certificate"]
    assert run.summary["end"] == "time is over"
    assert certificate["held_inside"] == []
    assert certificate["pinched"] == {"frames": 0, "most_vertices": 0, "first_time": None, "first_vertex": ""}
    assert run.summary["warnings"] == []


def test_a_cloth_between_two_plates_is_pinched_and_on_one_it_is_not(tmp_path):
    run = simulate(pressed(0.004, 0.004), tmp_path / "both")
    pinched = run.summary["certificate"]["pinched"]
    assert pinched["frames"] == len(run.times) - 1
    assert pinched["most_vertices"] == 25
    assert pinched["first_time"] == pytest.approx(0.04)
    assert len(run.summary["warnings"]) == 1
    for name, gaps in {"below": (0.004, 0.5), "above": (0.5, 0.004), "none": (0.02, 0.02)}.items():
        one = simulate(pressed(*gaps), tmp_path / name)
        assert one.summary["certificate"]["pinched"]["frames"] == 0


def test_a_stopped_run_keeps_its_pinches(tmp_path):
    class StoppedError(Exception):
        pass

    def stop(state):
        if state.step == 3:
            raise StoppedError

    scene = small_scene(SMALL, plates(0.004, 0.004), without("gravity") | {"body_contact": {"d_hat": 0.01}}, run=RUN)
    with pytest.raises(StoppedError):
        simulate(scene, tmp_path, on_step=stop)
    assert resume(tmp_path).summary["certificate"]["pinched"]["frames"] == 4


class Forces:
    """Contact of one point on one side of a body vertex, or on two."""

    stiffness = 1.0

    def __init__(self, *lines, force=1.0):
        self.lines, self.force = lines, force

    def distinct(self, x):
        return None

    def normal_forces(self, x, stiffness):
        n = len(self.lines)
        rows = np.tile([0, 25, 26, 27], (n, 1))
        weights = np.tile([1.0, -0.2, -0.3, -0.5], (n, 1))
        return rows, weights, np.array(self.lines, float), np.full(n, self.force)


@pytest.mark.parametrize(
    ("lines", "pinched"),
    [
        ([[0, 0, 1]], 0),
        ([[0, 0, 1], [0, 0, 3]], 0),
        ([[0, 0, 1], [1, 0, 0]], 0),
        ([[0, 0, 1], [0, 0, -2]], 1),
        ([[1, 0, 0.1], [-1, 0, 0.1]], 1),
    ],
)
def test_opposed_forces_pinch_a_vertex_and_those_of_a_corner_do_not(lines, pinched):
    from clothsim.scene.assembly.scene_world import build

    world = build(small_scene()).world
    rows = pinched_vertices(world, [Forces(*lines)], world.start())
    assert rows.tolist() == [0] * pinched
    assert len(pinched_vertices(world, [Forces(*lines, force=0.0)], world.start())) == 0
    after = Pinches().after(world, [Forces(*lines)], world.start(), 0.5)
    assert after.first_vertex == ("vertex 0 of cloth" if pinched else "")


def test_an_overstretched_cloth_is_named(tmp_path):
    pins = {
        "group": [{"select": side, "motion": {"velocity": [s * 10, 0, 0]}} for side, s in (("left", -1), ("right", 1))]
    }
    effects = without("body_contact", "gravity") | {"pins": pins}
    run = simulate(small_scene(body=(), effects=effects, run=RUN | {"duration": 0.08}), tmp_path)
    assert run.summary["certificate"]["stretch_max"] > LARGEST_STRETCH
    assert len(run.summary["warnings"]) == 1


def test_the_warnings_are_printed_under_quiet(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "inside.toml").write_text(
        '[cloth]\nmesh = "rectangle"\nsize = [0.2, 0.2]\ncells = [3, 3]\n[[body]]\nname = "ball"\nmesh = "sphere"\n'
        "[effects.inertia]\n[effects.membrane]\n[effects.body_contact]\n"
        '[solver]\nlinear = "superlu"\n[run]\nduration = 0.04\nallow_inside = true\n'
    )
    assert main(["run", "inside.toml", "--quiet", "--no-picture"]) == 0
    assert "cloth is inside ball" in capsys.readouterr().out
