"""A walk of a body that has no skeleton in its file: a rig by its landmarks, a fitted shirt, CPU seconds a second.

`python -m tests.benchmarks.walking_body [--body CesiumMan] [--clip walk] [--inward 0] -o DIR`: the skeleton of the
mannequin is placed by the parts of the body, its vertices are bound to it, and a shirt of the mannequin is fitted onto
it; then the body walks for two seconds. `pinch = "carry"`, as arms swing into the sides.
"""

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import clothsim
from clothsim.base.arrays import Floats
from clothsim.files import read_mesh
from clothsim.files.characters.character import Character, bound_at_rest
from clothsim.files.characters.clip import timeline
from clothsim.files.characters.gait import packaged_clip
from clothsim.files.characters.retarget import retargeted
from clothsim.files.characters.skeleton import from_rotation_vectors, product, skeleton_at
from clothsim.garments.inputs import BodyMesh, as_body_mesh, read_body_mesh
from clothsim.mesh.generators.mannequin.generator import JOINTS, PARENTS, joint
from clothsim.mesh.generators.table import GENERATORS
from tests.benchmarks.bodies_table import BODIES, body_named
from transfer.signed_distance import body_surface

LEAD_IN, SECONDS = 0.7, 2.0
RATE = 50
"""Frames of the body in a second."""
BLEND = 0.035
"""Half of the way over which one joint takes over from the next, as a fraction of the height."""
LEG = {"hip": 1.06, "knee": 0.53, "ankle": 0.09}
"""Joints of a leg, as multiples of the height of the crotch."""
ARM = {"shoulder": 1.04, "elbow": 0.62, "wrist": 0.3}
"""Joints of an arm, as fractions of its length from the hand; the shoulder lies within the trunk."""
ARM_BLEND = 0.08
"""As BLEND, along an arm."""
LEVELS = {"pelvis": 1.14, "spine": 1.35, "chest": 1.58}
"""Joints of the trunk, as multiples of the height of the crotch."""


def rigged(body: BodyMesh) -> Character:
    """The body bound to the mannequin's joints, placed by its landmarks; z up, facing -y as the clips do."""
    parts = body.parts
    at = parts.landmarks
    half = BLEND * at["crown"]
    local = parts.frame.local(body.positions)
    joints, weights = np.zeros((len(JOINTS), 3)), np.zeros((len(local), len(JOINTS)))
    trunk = {name: factor * at["crotch"] for name, factor in LEVELS.items()}
    trunk |= {"neck": at["neck"], "head": at["neck"] + 0.25 * (at["crown"] - at["neck"])}
    for name, level in trunk.items():
        joints[joint(name)] = parts.trunk.at(level, parts.trunk.centres) * [0, 0, 1] + [0, level, 0]
    bind(weights, local[:, 1], trunk, half, np.ones(len(local)))
    sides = zip(("left", "right"), (1, -1), parts.legs, parts.arms, parts.hands, strict=True)
    for side, sign, leg, arm, along in sides:
        levels = {f"{side}_{name}": factor * at["crotch"] for name, factor in LEG.items()}
        for name, level in levels.items():
            joints[joint(name)] = leg.at(level, leg.centres) * [1, 0, 1] + [0, level, 0]
        below = rising(at["crotch"] - local[:, 1], half) * (sign * local[:, 0] > 0)
        bind(weights, -local[:, 1], {name: -level for name, level in levels.items()}, half, below)
        fractions = {f"{side}_{name}": fraction for name, fraction in ARM.items()}
        upper = (arm.at(1.0, arm.centres) - arm.at(0.85, arm.centres)) / 0.15
        for name, fraction in fractions.items():
            joints[joint(name)] = arm.at(fraction, arm.centres) + max(0.0, fraction - 1.0) * upper
        reached = rising(1.0 - along, ARM_BLEND)
        bind(weights, -along, {name: -fraction for name, fraction in fractions.items()}, ARM_BLEND, reached)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # left, up and front to x, z and -y
    skeleton = skeleton_at(JOINTS, PARENTS, joints @ turn.T)
    return bound_at_rest(local @ turn.T, body.triangles, weights, skeleton, "z")


def rising(x: Floats, half: float) -> Floats:
    """Smooth step from 0 at x = -half to 1 at half."""
    t = np.clip(0.5 + 0.5 * x / half, 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def bind(weights: Floats, along: Floats, starts: Mapping[str, float], half: float, share: Floats) -> None:
    """Give a chain of joints its share of all vertices (n,): each rules from its start along the limb to the next's."""
    weights *= (1 - share)[:, None]
    rules = [np.ones(len(along)), *(rising(along - start, half) for start in [*starts.values()][1:])]
    for name, begun, ended in zip(starts, rules, [*rules[1:], np.zeros(len(along))], strict=True):
        weights[:, joint(name)] += share * (begun - ended)


def frames_of(character: Character, clip: str, inward: float) -> Floats:
    """Positions (frames, n, 3) [m] of the body, which goes from its pose into the clip, and walks for two seconds.

    inward: angle by which each arm of the clip is turned to the body [rad], reached with the clip.
    """
    skeleton = character.skeleton
    motion = retargeted(packaged_clip(clip), skeleton)
    span = (0.0, motion.duration)
    moved = timeline(skeleton, motion, skeleton.rest, LEAD_IN, span, True, True, np.array([0.0, 0.0, 1.0]))
    times = np.arange(round(RATE * (LEAD_IN + SECONDS)) + 1) / RATE
    arms = [joint("left_shoulder"), joint("right_shoulder")]
    found = []
    for time in times:
        pose = moved.pose(time)
        angle = inward * min(1.0, time / LEAD_IN)
        turns = from_rotation_vectors(np.array([[0.0, angle, 0.0], [0.0, -angle, 0.0]]))
        rotations = pose.rotations.copy()
        rotations[arms] = product(turns, rotations[arms])
        found.append(character.vertices(replace(pose, rotations=rotations)))
    return np.stack(found)


def depth_of_arms(character: Character, frames: Floats) -> float:
    """Largest depth of the forearms within the rest of the body [m]; 0 where they stay outside of it."""
    columns = [joint(f"{side}_{name}") for side in ("left", "right") for name in ("elbow", "wrist")]
    arms = character.weights[:, columns].sum(axis=1) > 0.99
    rest = character.triangles[~arms[character.triangles].any(axis=1)]
    return max(0.0, *(-body_surface(x, rest).closest(x[arms]).signed_distance.min() for x in frames))


def walked(name: str, clip: str, inward: float, edge: float, output: Path) -> dict[str, Any]:
    """Measures of a walk of a body in a fitted shirt."""
    given = body_named(name)
    character = rigged(as_body_mesh(given) if isinstance(given, clothsim.Body) else read_body_mesh(given))
    shirt = clothsim.Cloth(*GENERATORS["shirt"](edge=edge), name="shirt")
    standing = clothsim.Body(character.positions, character.triangles, name=name)
    fit = clothsim.fit(shirt, standing, clothsim.Body(*GENERATORS["mannequin"]()), output / "fit", overwrite=True)
    rest = read_mesh(fit.directory / "garment_rest.obj")
    moved = frames_of(character, clip, inward)
    scene = clothsim.Scene(
        cloth=clothsim.Cloth(fit.positions, rest.triangles, rest=rest.positions, name="shirt"),
        body=clothsim.Body(
            character.positions,
            character.triangles,
            frames=moved,
            frames_per_second=RATE,
            name=name,
        ),
        effects={"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}, "damping": {"rate": 3.0}}
        | {"body_contact": {}, "self_contact": {}, "friction": {"coefficient": 0.3}},
        solver={"dt": 0.02},
        contact={"pinch": "carry"},
        run={"duration": LEAD_IN + SECONDS},
    )
    started = process_time()
    run = clothsim.simulate(scene, output=output / "walk", overwrite=True)
    seconds = process_time() - started
    return {
        "body": name,
        "clip": clip,
        "inward_degrees": float(np.degrees(inward)),
        "fit": fit.status,
        "status": run.status,
        "reason": run.reason,
        "vertices": len(fit.positions),
        "steps": len(run.record()),
        "depth": depth_of_arms(character, moved),
        "seconds_simulated": float(run.times[-1]),
        "cpu_seconds": seconds,
        "cpu_seconds_a_second": seconds / float(run.times[-1]),
        "certificate": run.summary["certificate"],
    }


def main() -> None:
    """Run one walk, and print its measures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--body", default="CesiumMan", choices=BODIES)
    parser.add_argument("--clip", default="walk", help="walk, turn, or a kind and a seed, such as gait:3")
    parser.add_argument("--inward", type=float, default=0.0, metavar="DEGREES", help="turn of the arms to the body")
    parser.add_argument("--edge", type=float, default=0.0178, help="edges of the shirt [m]")
    parser.add_argument("-o", "--output", type=Path, required=True, help="directory of the fit and the run")
    arguments = parser.parse_args()
    row = walked(arguments.body, arguments.clip, np.radians(arguments.inward), arguments.edge, arguments.output)
    name = f"{arguments.body}_{arguments.clip.replace(':', '_')}_{arguments.inward:g}.json"
    (arguments.output / name).write_text(json.dumps(row, indent=1) + "\n")
    print(json.dumps(row, indent=1))


if __name__ == "__main__":
    main()
