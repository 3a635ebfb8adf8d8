"""Scenes in scenes/: each starts, takes its first steps and satisfies the bounds of its effects."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clothsim
from clothsim.physics.energies.key_values import selected_vertices
from clothsim.scene.assembly.scene_world import world_of

LARGE = {"dress"}
"""Scenes too large to step in a test; each has a test of its start."""
VIOLENT = {"impact": 5.0}
"""Scenes whose cloth stretches by more than 2 in the first steps, and the most that it may."""
STRIPS = {"study_cantilever", "study_over", "study_strip"}
"""Scenes of strips that are held at one end and cannot fold."""
SCENES = [path for path in sorted((Path(__file__).parents[2] / "scenes").glob("*.toml")) if path.stem not in LARGE]


def short(path):
    """The first two steps of the scene, as it is in the file."""
    scene = clothsim.load_scene(path)
    for body in scene.bodies:
        if "." in body.get("mesh", "") and not (path.parent / body["mesh"]).is_file():
            pytest.skip(f"{body['mesh']} is not there: the real bodies do not come with the package")
    dt = scene.solver_settings.dt
    return replace(scene, run={"duration": 2 * dt, "frames_per_second": 0.5 / dt})


def test_there_are_scenes():
    assert len(SCENES) >= 5


def test_cloth_that_can_fold_has_self_contact():
    every = sorted((Path(__file__).parents[2] / "scenes").glob("*.toml"))
    without = {path.stem for path in every if "self_contact" not in clothsim.load_scene(path).effects}
    assert without == STRIPS


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_first_steps_of_a_scene(path, tmp_path):
    scene = short(path)
    run = clothsim.simulate(scene, tmp_path / "run")
    assert run.status == "completed", run.reason
    certificate = run.summary["certificate"]
    assert certificate["intersection_free"] is True
    most = VIOLENT.get(path.stem, 2.0)
    if scene.cloths:
        assert 1 / most < certificate["stretch_min"] <= certificate["stretch_max"] < most
    implied = ({"rigidity"} if scene.rigid_bodies else set()) | ({"rods"} if scene.rods else set())
    assert set(run.summary["effects"]) | set(scene.effects) == set(scene.effects) | implied
    first, last = run.positions(0), run.positions(-1)
    if "gravity" in scene.effects:
        down = np.asarray(scene.effects["gravity"].get("acceleration", (0, 0, -9.81)))
        assert (last - first).mean(axis=0) @ down > 0
    pins = scene.effects.get("pins", {})
    if "select" in pins and "motion" not in pins:
        held = selected_vertices("pins", world_of(scene), pins["select"])
        assert np.array_equal(last[held], first[held])
