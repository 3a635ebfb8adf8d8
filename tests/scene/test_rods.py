"""Rods of scenes: a run with its certificate, what a trajectory keeps of them, ends as selections, refused tables."""

from dataclasses import replace

import numpy as np
import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.files.runs.trajectory import read_trajectory
from clothsim.garments.wrinkled import refuse_unfit
from clothsim.run.check import examined
from clothsim.run.pictures import field_settings, frame_surfaces
from clothsim.run.summary import certificate_rows
from clothsim.scene.assembly.scene_world import build, world_of

WIRE = {"name": "wire", "points": [[-0.2, 0, 0], [0.2, 0, 0]], "edge": 0.02, "radius": 1e-3, "youngs_modulus": 1e7}
ACROSS = {**WIRE, "name": "across", "points": [[0, -0.1, 0.02], [0, 0.1, 0.02]]}
EFFECTS = {"inertia": {}, "gravity": {}, "damping": {}, "self_contact": {}}


def scene(rods, effects=EFFECTS, **keys):
    return clothsim.Scene(rod=rods, effects=effects, solver={"dt": 0.01}, **keys)


def test_a_rod_falls_onto_another_one_and_never_into_it(tmp_path):
    pinned = EFFECTS | {"pins": {"select": [0, 20]}}
    run = clothsim.simulate(scene([WIRE, ACROSS], pinned, run={"duration": 0.3}), tmp_path)
    assert run.status == "completed", run.reason
    certificate = run.summary["certificate"]
    assert certificate["intersection_free"] is True
    assert "every step" in certificate["rods"]
    x = run.positions(-1)
    assert 1.9e-3 < x[26, 2] - x[10, 2] < 6e-3  # on the wire, two radii above its centre line
    assert x[26, 2] < 0.015
    surfaces = read_trajectory(tmp_path / "trajectory.vtkhdf").surfaces
    assert [(len(each.edges), each.radius, len(each.triangles)) for each in surfaces] == [(20, 1e-3, 0), (10, 1e-3, 0)]
    drawn = frame_surfaces(run.trajectory, -1)
    assert [len(each.triangles) for each in drawn] == [400, 200]


def test_without_contact_a_rod_may_pass_and_the_certificate_says_so(tmp_path):
    falling = {**ACROSS, "velocity": [0, 0, -10]}
    run = clothsim.simulate(scene([WIRE, falling], {"inertia": {}}, run={"duration": 0.02}), tmp_path)
    assert run.positions(0)[26, 2] > 0 > run.positions(-1)[26, 2]
    assert run.summary["certificate"]["rods"].endswith("without self_contact")
    rows = dict(certificate_rows(run.summary))
    assert "may pass between two" in rows["contact"]
    assert "centre lines" in rows["checked"]
    assert "exactly" not in rows["checked"]


def test_a_scene_of_rods_is_one_after_its_text():
    given = scene([WIRE, ACROSS])
    assert clothsim.Scene.from_text(given.to_text()).rods == given.rods
    assert [keys.name for keys in given.rods] == ["wire", "across"]


def test_a_line_is_cut_into_equal_edges():
    bent = {**WIRE, "points": [[0, 0, 0], [0.3, 0, 0], [0.3, 0.3, 0]], "edge": 0.05}
    rod = world_of(scene(bent)).cloths[0]
    assert len(rod.lengths) == 12
    np.testing.assert_allclose(rod.lengths, 0.05)
    loop = world_of(scene({**bent, "loop": True})).cloths[0]
    assert len(loop.lengths) == len(loop.positions)


def test_the_border_of_a_rod_are_its_ends_and_its_damping_its_own():
    rates = {"damping": {"rate": {"wire": 3.0, "across": 0.0}}}
    for side, ends in (("left", {0, 21}), ("right", {20, 21}), ("boundary", {0, 20, 21, 31})):
        built = build(scene([WIRE, ACROSS], EFFECTS | rates | {"pins": {"select": side}}))
        assert set(built.constraints["pins"].at(0.0).vertices.tolist()) == ends
    weights = built.energies["damping"].masses
    np.testing.assert_allclose(weights, np.where(np.arange(32) < 21, 3.0, 0.0) * built.world.masses)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"points": [[0, 0, 0]]}, "1 point"),
        ({"points": [[0, 0, 0], [1e200, 0, 0]]}, "edge"),
        ({"points": [[0, 0], [1, 1]]}, "points"),
        ({"edge": 1e-7}, "edge"),
        ({"radius": 0.0}, "radius"),
        ({"radius": 0.02}, "thickness"),
    ],
)
def test_a_bad_rod_is_named(keys, words):
    with pytest.raises(InputError, match=words):
        build(scene({**WIRE, **keys}))


def test_contact_with_cloth_is_refused_and_without_contact_it_is_not():
    cloth = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [2, 2], "position": [0, 0, 1]}
    with pytest.raises(InputError, match=r"rods \(wire\) do not touch cloth"):
        build(scene(WIRE, cloth=cloth))
    built = build(scene(WIRE, {"inertia": {}, "membrane": {}, "gravity": {}}, cloth=cloth))
    assert "rods" in built.energies
    assert built.world.names == ("cloth", "wire")


def test_effects_of_cloth_are_off_or_refused_where_there_are_rods_alone():
    line = {"from": {"vertices": [0, 1]}, "to": {"vertices": [20, 19]}}
    assert "pressure" in build(scene(WIRE, EFFECTS | {"pressure": {"value": 10.0}})).off
    for effects in (
        {"stiffeners": {"stiffener": [{"select": [0, 1, 2], "bending_stiffness": 1e-4}]}},
        {"closures": {"zip": [line]}},
    ):
        with pytest.raises(InputError, match=next(iter(effects))):
            build(scene(WIRE, EFFECTS | effects))
    with pytest.raises(InputError, match="rod"):
        clothsim.Scene(rod=3)


def test_rods_beside_cloth_are_checked_drawn_and_get_no_wrinkles(tmp_path):
    sheet = {"mesh": "rectangle", "size": [0.1, 0.1], "cells": [1, 1], "position": [0, 0, 1]}
    effects = {"inertia": {}, "membrane": {}, "gravity": {}}
    crossing = scene([WIRE, {**ACROSS, "points": [[0, -0.1, 0], [0, 0.1, 0]]}], effects, cloth=sheet)
    with pytest.warns(clothsim.IntersectionWarning, match="edge"):
        run = clothsim.simulate(replace(crossing, run=crossing.run.with_keys(duration=0.02)), tmp_path / "run")
    (finding,) = examined(tmp_path / "run").findings
    assert "edge" in finding.sentence
    assert "triangles" not in finding.sentence
    field = field_settings(run, "stress")
    drawn = field["surfaces_of"](run.trajectory, -1)
    assert [len(each.values) for each in drawn] == [4, 0, 0]
    with pytest.raises(InputError, match="rods"):
        refuse_unfit(run, 4)


BALL = {"name": "ball", "mesh": "sphere", "radius": 0.4, "subdivisions": 2}


def test_a_rod_that_starts_inside_a_body_is_one_piece_and_warned_of_or_refused():
    inside = scene([WIRE], {"inertia": {}}, body=BALL)
    [finding] = examined(inside).findings
    assert (finding.severity, finding.kind) == ("warning", "start")
    assert "wire starts inside ball, all of it" in finding.sentence
    with pytest.raises(InputError, match="all of it"):
        build(scene([WIRE], {"inertia": {}, "body_contact": {}}, body=BALL))
    beside = {**WIRE, "points": [[-0.2, 0, 0.5], [0.2, 0, 0.5]]}
    assert examined(scene([beside], {"inertia": {}}, body=BALL)).findings == ()


def test_rows_of_different_lengths_are_named():
    with pytest.raises(InputError, match=r"points\[1\] has 2 entries, the first has 3"):
        build(scene([{**WIRE, "points": [[0, 0, 0], [0.1, 0]]}]))
