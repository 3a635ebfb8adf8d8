"""Intersections of a run: by the exact check, in each of its states."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from meshes import cloth, grid
from small_scenes import SOLVER, small_scene

from clothsim import IntersectionWarning, Scene, Simulation, open_run, resume, simulate
from clothsim.base.record import SUMMARY_NAME, read_summary, write_summary
from clothsim.cli import main
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint, write_checkpoint
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.keys.typed_effects import TYPED_EFFECTS
from clothsim.mesh.body import make_body
from clothsim.mesh.world import make_world, world_surfaces
from clothsim.run.intersections import intersection_check_of

ELASTIC = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}}
FLAPS = {"mesh": "rectangle", "size": [0.8, 0.2], "cells": [8, 2], "position": [0.01, 0.0, 0.0], "fabric": "cotton"}
RUN = {"duration": 0.48, "frames_per_second": 12.5}
COUNTS = {"pairs", "most_pairs", "states", "first_step", "first_time", "first_frame", "surfaces", "triangles"}
KINDS = {"cloth_body", "cloth_cloth", "excluded"}


TOML = """
[cloth]
mesh = "rectangle"
size = [0.8, 0.2]
cells = [8, 2]
[effects.inertia]
[effects.membrane]
[effects.bending]
[effects.gravity]
[effects.pins]
select = [4, 13, 22]
[solver]
dt = 0.02
[run]
duration = 0.48
"""


def flaps(*on, **sections):
    """A strip held along its middle: both halves swing down and meet below it."""
    effects = ELASTIC | {"pins": {"select": [4, 13, 22]}} | {name: {} for name in on}
    return Scene(**{"cloth": FLAPS, "effects": effects, "solver": {**SOLVER, "dt": 0.02}, "run": RUN} | sections)


def layers(**self_contact):
    """A sheet and a flag that cross from the start; self_contact: keys of the effect, none: without it."""
    flag = {"name": "flag", "mesh": "rectangle", "size": [0.2, 0.4], "cells": [2, 2], "rotation_degrees": [90, 0, 0]}
    sheet = {"name": "sheet", "mesh": "rectangle", "size": [0.6, 0.6], "cells": [3, 3]}
    effects = {"inertia": {}, "membrane": {}, **({"self_contact": self_contact} if self_contact else {})}
    return Scene(cloth=[sheet, flag], effects=effects, solver=SOLVER, run={"duration": 0.04, "frames_per_second": 25})


@pytest.fixture(scope="module")
def crossed(tmp_path_factory):
    with pytest.warns(IntersectionWarning, match="self_contact"):
        return simulate(flaps(), tmp_path_factory.mktemp("crossed"))


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    with warnings.catch_warnings():
        warnings.simplefilter("error", IntersectionWarning)
        return simulate(flaps("self_contact"), tmp_path_factory.mktemp("clean"))


def test_a_cloth_that_passes_through_itself_is_not_intersection_free(crossed):
    assert crossed.status == "completed"
    assert crossed.intersection_free is crossed.summary["certificate"]["intersection_free"] is False
    assert set(crossed.intersections) == KINDS
    assert {frozenset(each) for each in crossed.intersections.values()} == {frozenset(COUNTS)}
    found = crossed.intersections["cloth_cloth"]
    record = crossed.record()
    assert found["first_time"] == record[found["first_step"] - 1]["time"]
    assert found["most_pairs"] >= found["pairs"] > 0
    assert 1 <= found["states"] <= len(record)
    frames = [k for k in range(len(crossed)) if len(intersecting_pairs(crossed.positions(k), crossed.triangles))]
    assert crossed.summary["certificate"]["intersecting_frames"] == frames
    assert found["first_frame"] == frames[0]
    assert [crossed.intersections[kind]["states"] for kind in ("cloth_body", "excluded")] == [0, 0]
    assert len(crossed.summary["warnings"]) == 1
    assert "self_contact" in crossed.summary["warnings"][0]


def test_the_same_with_self_contact_is(clean):
    assert clean.status == "completed"
    assert clean.intersection_free is True
    assert clean.summary["warnings"] == clean.summary["certificate"]["intersecting_frames"] == []
    assert {each["states"] for each in clean.intersections.values()} == {0}


def test_a_run_shows_it(crossed, clean):
    assert "INTERSECTS" in repr(crossed)
    assert "INTERSECTS" not in repr(clean)
    assert "self_contact" in crossed._repr_html_()
    assert "cloth and cloth never intersect" in clean._repr_html_()
    assert "cloth and cloth INTERSECT" in crossed._repr_html_()
    assert "{" not in clean._repr_html_()


def test_check_of_a_run_ends_with_1_where_its_cloth_intersects(crossed, clean, capsys):
    assert main(["check", str(clean.directory)]) == 0
    assert capsys.readouterr().out.endswith("Nothing is wrong.\n")
    assert main(["check", str(crossed.directory)]) == 1
    out = capsys.readouterr().out
    first = crossed.intersections["cloth_cloth"]["first_frame"]
    assert f"error: cloth intersects itself in frame {first} at " in out
    assert "self_contact" in out


def test_a_run_on_the_command_line_completes_with_a_warning(tmp_path, capsys):
    (tmp_path / "flaps.toml").write_text(TOML)
    output = tmp_path / "out"
    assert main(["run", str(tmp_path / "flaps.toml"), "-o", str(output), "--no-picture", "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert re.search("WARNING +cloth intersects itself", out)
    assert "IntersectionWarning" not in err
    assert open_run(output).intersection_free is False


def test_a_step_between_two_frames_counts(crossed, tmp_path, capsys):
    """The same motion, its last frame before the halves meet and no other: no frame intersects, and a step did."""
    scene = flaps(run={"duration": 0.48, "frames_per_second": 1 / 0.48})
    with pytest.warns(IntersectionWarning):
        run = simulate(scene, tmp_path / "one")
    assert run.intersections["cloth_cloth"]["first_step"] == crossed.intersections["cloth_cloth"]["first_step"]
    summary = run.summary
    summary["certificate"]["intersections"]["cloth_cloth"]["first_frame"] = None
    write_summary(run.directory / SUMMARY_NAME, summary)
    shown = [line for line in _checked(run.directory, capsys) if "between two frames" in line]
    assert len(shown) == 1


def _checked(directory, capsys):
    assert main(["check", str(directory)]) == 1
    return capsys.readouterr().out.splitlines()


def test_a_body_that_passes_through_a_cloth(tmp_path, capsys):
    effects = {"inertia": {}, "membrane": {}, "gravity": {}}
    with pytest.warns(IntersectionWarning, match="body_contact"):
        run = simulate(small_scene(effects=effects), tmp_path / "run")
    found = run.intersections["cloth_body"]
    assert run.intersection_free is False
    assert found["first_step"] > 0
    assert found["pairs"] > 0
    assert run.intersections["cloth_cloth"]["states"] == 0
    assert any("error: cloth and ball intersect in frame" in line for line in _checked(run.directory, capsys))


def test_layers_that_cross_from_the_start_are_named_there(tmp_path, capsys):
    with pytest.warns(IntersectionWarning, match="sheet and flag"):
        run = simulate(layers(), tmp_path / "layers")
    found = run.intersections["cloth_cloth"]
    assert (found["first_step"], found["first_frame"], found["first_time"]) == (0, 0, 0.0)
    assert found["states"] == run.summary["steps"] + 1
    assert "seed.untangle" in run.summary["warnings"][0]
    _checked(run.directory, capsys)


def test_an_excluded_pair_is_counted_and_no_fault(tmp_path, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error", IntersectionWarning)
        run = simulate(layers(exclude=[["sheet", "flag"]]), tmp_path / "excluded")
    assert run.status == "completed"
    assert run.intersection_free is False
    assert run.intersections["excluded"]["states"] == run.summary["steps"] + 1
    assert run.intersections["cloth_cloth"]["states"] == 0
    assert main(["check", str(run.directory)]) == 0
    out = capsys.readouterr().out
    assert "warning: sheet and flag intersect in frame 0" in out
    assert out.endswith("1 warning.\n")


def test_pieces_that_only_share_positions_touch_and_welded_ones_do_not(tmp_path):
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    points, faces = (
        np.concatenate([square, square + np.array([1.0, 0, 0])]),
        [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    )
    for weld, free in ((0.0, False), (1e-6, True)):
        cloth = {"mesh": (points, faces), "weld": weld}
        scene = Scene(cloth=cloth, effects={"inertia": {}}, run={"duration": 0.02}, solver={"threads": 1})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IntersectionWarning)
            run = simulate(scene, tmp_path / str(weld))
        assert run.intersection_free is free


def test_a_resumed_run_has_the_counts_of_one_that_was_not_stopped(crossed, tmp_path):
    class StoppedError(Exception):
        pass

    def stop(progress):
        if progress.step == crossed.intersections["cloth_cloth"]["first_step"] + 3:
            raise StoppedError

    with pytest.raises(StoppedError):
        simulate(flaps(), tmp_path, progress=stop)
    assert read_checkpoint(tmp_path / CHECKPOINT_NAME).state.step > 0
    with pytest.warns(IntersectionWarning):
        again = resume(tmp_path)
    assert again.intersections == crossed.intersections
    assert again.summary["certificate"]["intersecting_frames"] == crossed.summary["certificate"]["intersecting_frames"]


def test_what_an_older_version_began_is_not_known(clean, tmp_path, capsys):
    saved = read_checkpoint(clean.directory / CHECKPOINT_NAME)
    certificate = {key: value for key, value in saved.counters["certificate"].items() if key != "intersections"}
    older = replace(saved, counters={**saved.counters, "certificate": {**certificate, "intersecting_frames": []}})
    for name in ("trajectory.vtkhdf", "record.jsonl"):
        (tmp_path / name).write_bytes((clean.directory / name).read_bytes())
    write_checkpoint(tmp_path / CHECKPOINT_NAME, older)
    run = resume(tmp_path)
    assert run.intersection_free is None
    assert run.summary["certificate"]["intersection_free"] is None
    assert main(["check", str(tmp_path)]) == 0
    assert "not known" in capsys.readouterr().out
    del run.summary["certificate"]["intersections"]
    run.summary["certificate"]["intersection_free"] = True
    write_summary(tmp_path / SUMMARY_NAME, run.summary)
    assert read_summary(tmp_path / SUMMARY_NAME)["certificate"]["intersection_free"] is True
    assert open_run(tmp_path).intersection_free is None


def test_stepping_by_hand_has_the_same_counts(crossed, tmp_path):
    simulation, branches = Simulation(flaps()), []
    assert simulation.intersection_free is True

    def step_to_the_end():
        for state in simulation:
            if state.step == crossed.intersections["cloth_cloth"]["first_step"]:
                branches.append(simulation.branch())

    with pytest.warns(IntersectionWarning, match="self_contact") as given:
        step_to_the_end()
    assert len([each for each in given if each.category is IntersectionWarning]) == 1
    assert simulation.intersections == crossed.intersections
    assert simulation.intersection_free is False
    assert "INTERSECTS" in repr(simulation)
    assert branches[0].intersections["cloth_cloth"]["states"] == 1
    simulation.save(tmp_path / "saved.npz")
    assert Simulation.restore(tmp_path / "saved.npz").intersections == crossed.intersections
    assert Simulation.restore(crossed.directory).intersection_free is False


def test_a_restored_simulation_finds_the_crossing_that_comes_after_it(crossed, tmp_path):
    """It has no proofs: its first state is searched in full, and the later ones from there."""
    found, simulation = crossed.intersections["cloth_cloth"], Simulation(flaps())
    for _ in range(found["first_step"] - 2):
        simulation.step()
    simulation.save(tmp_path / "saved.npz")
    again = Simulation.restore(tmp_path / "saved.npz")
    assert again.intersection_free is True
    again.step()
    assert again.intersection_free is True
    with pytest.warns(IntersectionWarning, match="self_contact"):
        again.step()
    assert again.intersections["cloth_cloth"]["pairs"] == found["pairs"]


ACROSS = np.array([[0.1, 0.3, -1], [0.9, 0.3, -1], [0.5, 0.3, 1]])


def world(*bodies):
    """A sheet and a flag that cross, and bodies of one triangle that cross the sheet."""
    flag = cloth(ACROSS + np.array([0, 0.4, 0]), np.array([[0, 1, 2]]), name="flag")
    return make_world([cloth(*grid(2, 2), name="sheet"), flag], [make_body(b, ACROSS, [[0, 1, 2]]) for b in bodies])


def check_of(scene, effects):
    sections = {name: TYPED_EFFECTS[name].parsed(name, keys) for name, keys in effects.items()}
    return intersection_check_of(world_surfaces(scene), sections, effects)


@pytest.mark.parametrize(
    ("effects", "kinds", "violations"),
    [
        ({}, ["cloth_cloth", "cloth_body"], []),
        ({"body_contact": {}}, ["cloth_cloth", "cloth_body"], ["post"]),
        ({"self_contact": {}}, ["cloth_cloth", "cloth_body"], ["flag"]),
        ({"body_contact": {}, "self_contact": {}}, ["cloth_cloth", "cloth_body"], ["flag", "post"]),
        ({"body_contact": {"exclude": [["post", "sheet"]]}}, ["cloth_cloth", "excluded"], []),
        ({"body_contact": {}, "self_contact": {"exclude": [["sheet", "flag"]]}}, ["excluded", "cloth_body"], ["post"]),
    ],
)
def test_all_pairs_are_checked_and_effects_say_which_must_be_free(effects, kinds, violations):
    scene = world("post")
    check = check_of(scene, effects)
    found = check.crossings(scene.start())
    assert [crossing.second for crossing in found] == ["flag", "post"]
    assert [check.kind(crossing) for crossing in found] == kinds
    assert [crossing.second for crossing in check.violations(found)] == violations
    assert all(len(crossing.pairs) > 1 for crossing in found)


def test_coverage():
    at_every_step = check_of(world("post"), {}).coverage()
    assert set(at_every_step) == {"cloth_body", "cloth_cloth"}
    assert at_every_step["cloth_body"] == at_every_step["cloth_cloth"]
    alone = check_of(world(), {}).coverage()
    assert alone == {**at_every_step, "cloth_body": "no body"}
    assert check_of(world(), {}).coverage(complete=False)["cloth_cloth"] != at_every_step["cloth_cloth"]


def test_positions_are_in_the_coordinates_of_the_scene():
    scene, origin = world("post"), np.array([10.0, -20.0, 5.0])
    check = check_of(scene, {})
    local, shifted = check.crossings(scene.start()), check.crossings(scene.start(), origin)
    for one, other in zip(local, shifted, strict=True):
        assert np.allclose(other.position, one.position + origin, atol=1e-12)
        assert np.array_equal(one.pairs, other.pairs)
