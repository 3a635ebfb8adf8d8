"""Bodies of body models in a scene: the mannequin in every height, motion, faults, and nothing where there is none."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.keys.mesh_keys import check_body
from clothsim.scene.assembly.meshes import body_of

HERE = Path(__file__).parent
WALK = {"clip": "walk", "loop": True, "lead_in": 0.5}


def model(**keys):
    return body_of(check_body("body", {"model": "mannequin", **keys}), "body", HERE)[0]


@pytest.mark.parametrize("measures", [{}, {"height": 1.6}, {"height": 1.87, "waist": 1.1}])
def test_the_mannequin_through_the_model_is_the_mannequin(measures):
    generated, _ = body_of(check_body("body", {"mesh": "mannequin", **measures}), "body", HERE)
    found = model(shape=measures)
    np.testing.assert_allclose(found.positions, generated.positions, rtol=0, atol=1e-12)
    assert np.array_equal(found.triangles, generated.triangles)


def test_a_loop_goes_on_from_where_the_body_is():
    body = model(motion=WALK)
    at = [body.motion.apply(body.positions, 0.5 + 1.1 * k) for k in range(3)]
    np.testing.assert_allclose(at[1] - at[0], at[2] - at[1], atol=1e-12)
    np.testing.assert_allclose((at[1] - at[0]).mean(axis=0), (0, -1.24, 0), atol=1e-3)


def test_it_begins_at_rest_in_its_first_pose():
    body = model(motion=WALK)
    assert np.array_equal(body.motion.apply(body.positions, 0.0), body.positions)
    moved = [np.abs(body.motion.apply(body.positions, t) - body.positions).max() for t in (1e-3, 2e-3)]
    assert moved[1] == pytest.approx(4 * moved[0], rel=0.02)


@pytest.mark.parametrize(
    "motion",
    [WALK, {**WALK, "start": 0.2}, {"clip": "walk", "lead_in": 0.4, "end": 0.9}, {"clip": "turn", "start": 0.9}],
)
def test_the_lead_in_meets_the_clip_at_its_speed(motion):
    body, lead_in, h = model(motion=motion), motion.get("lead_in", 0.7), 1e-4
    before, at, after = (body.motion.apply(body.positions, lead_in + t) for t in (-h, 0.0, h))
    speed = np.abs(after - at).max() / h
    assert speed > 0.5
    assert np.abs((after - at) - (at - before)).max() / h < 0.01 * speed


def test_the_lead_in_of_a_walk_never_goes_back():
    body = model(motion=WALK)
    forward = [-body.motion.apply(body.positions, t)[:, 1].mean() for t in np.linspace(0, 0.5, 26)]
    assert np.diff(forward).min() > -2e-3
    assert forward[-1] == pytest.approx(0.5 / 2 * 1.24 / 1.1, abs=0.05)


def test_part_of_a_clip_ends_at_rest():
    body = model(motion={"clip": "turn", "start": 0.2, "end": 0.8, "lead_in": 0.3})
    assert body.motion.duration == pytest.approx(0.9)
    late = [body.motion.apply(body.positions, t) for t in (0.9, 5.0)]
    np.testing.assert_allclose(late[0], late[1], atol=1e-12)


@pytest.mark.parametrize(
    "keys",
    [
        {"model": "body.pkl"},
        {"model": "absent.glb"},
        {"model": "mannequin", "motion": "hop"},
        {"model": "mannequin", "motion": {"clip": "walk", "start": 2.0}},
        {"model": "mannequin", "motion": {"clip": "absent.bvh"}},
        {"model": "mannequin", "pose": {"left_wing": [0, 0, 10]}},
        {"model": "mannequin", "shape": [1.0]},
    ],
)
def test_faults_are_input_errors(keys):
    with pytest.raises(InputError) as caught:
        body_of(check_body("body", keys), "body", HERE)
    assert caught.value.remedy


def test_a_scene_without_a_model_imports_nothing_of_it():
    code = (
        "import sys, pathlib, clothsim\n"
        "from clothsim.scene.assembly.scene_world import build\n"
        "cloth = {'mesh': 'rectangle', 'cells': [2, 2], 'position': [0, 0, 3]}\n"
        "build(clothsim.Scene(cloth=cloth, body={'mesh': 'mannequin'}, effects={'membrane': {}, 'body_contact': {}}))\n"
        "models = ('clothsim.files.characters', 'clothsim.scene.assembly.model_')\n"
        "print([m for m in sys.modules if m.startswith(models)])\n"
    )
    root = Path(clothsim.__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
