"""Drapes of moving bodies, networks against linear models: `python -m tests.benchmarks.motion_networks WALK TURN`.

Each farm has one garment in varied fabrics on one moving body, with all frames, the first of the same fabrics as the
others. Drapes are brought to the rest pose of the body (`transfer.canonical`). Two questions:

* `new fabric`: the last fabrics are held out. From one frame of a held-out fabric, what are its other frames?
* `new motion`: the last frames of the last farm are held out. From frames of the first farm, what are they?

Each is answered by the motion-invariant encoding of Wang et al. and by models in closed form.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.file_writing import write_atomically
from clothsim.engine import character_of_scene
from clothsim.scene.assembly.scene_world import world_of
from clothsim.study.farm.plan import Farm, open_farm
from clothsim.study.farm.publication import processor
from clothsim.study.farm.reading import CLOTH
from clothsim.study.farm.status import manifest
from tests.benchmarks.drape_networks import flat_metric
from transfer.canonical import kernel_average
from transfer.motion_encoding import MotionTraining, motion_windows, trained_motion_encoding
from transfer.subspace import Subspace, metric_components, nearest, ridge

GIVEN_FRAMES = 5
"""Frames of the first farm, evenly spaced, from each of which the others are predicted."""
MOTION_COMPONENTS = 12
"""Principal components of the motion that ridge regression takes."""


@dataclass(frozen=True, eq=False)
class Frames:
    """All frames of all fabrics: f fabrics, in each the t frames of all motions one after the other.

    Attributes
    ----------
    canonical : (f, t, 3k) ndarray [m]
    motions : (t, p) ndarray
    fabrics : (f, q) ndarray
        Logarithms of the varied numbers.
    starts : (m + 1,) ndarray
        First frame of each motion, and t.
    triangles : (n, 3) ndarray
    """

    canonical: Floats
    motions: Floats
    fabrics: Floats
    starts: Ints
    triangles: Ints


def frames_of(farms: Sequence[Farm]) -> Frames:
    """The frames of the fabrics that all farms have."""
    rows = [{row["index"]: row for row in manifest(farm) if row["usable"]} for farm in farms]
    common = sorted(set.intersection(*map(set, rows)))
    shapes, motions = [], []
    for farm, found in zip(farms, rows, strict=True):
        names = [found[index]["id"] for index in common]
        own, motion = _canonical(farm, names)
        shapes.append(own)
        motions.append(motion)
    keys = list(farms[0].settings["boxes"])
    fabrics = np.log([[rows[0][index]["parameters"][key] for key in keys] for index in common])
    starts = np.cumsum([0, *map(len, motions)])
    triangles = world_of(farms[0].scene).cloths[0].triangles
    return Frames(np.concatenate(shapes, axis=1), np.concatenate(motions), fabrics, starts, triangles)


def _canonical(farm: Farm, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Canonical drapes (f, t, 3k) [m] and the motion (t, p)."""
    made, _ = character_of_scene(farm.scene)
    world = world_of(farm.scene)
    reference = made.character.positions
    average = kernel_average(world.bodies[0].positions + world.origin, made.character.triangles)
    rows = average.averaging(world.cloths[0].positions + world.origin)
    posed = [np.load(farm.directory / "drapes" / name / CLOTH).astype(np.float64) for name in names]
    times = np.arange(len(posed[0])) / farm.scene.run_settings.frames_per_second
    bodies = [made.skinning(float(time), reference) for time in times]
    shapes = [[body.unposed(points, rows).ravel() for body, points in zip(bodies, each, strict=True)] for each in posed]
    moves = np.array([made.character.skeleton.transforms(made.pose(float(time))) for time in times])
    return np.array(shapes), motion_windows(moves[:, :, :3, 3], moves[:, 0, :3, :3])


def _rms(one: Floats, other: Floats) -> float:
    return float(np.sqrt(3 * np.mean((one - other) ** 2)))


def new_fabric(data: Frames, held: int, training: MotionTraining) -> dict[str, Any]:
    """Errors [m] on held-out fabrics, of which one frame is given, in each motion."""
    known, asked = data.canonical[:-held], data.canonical[-held:]
    flat = known.reshape(-1, known.shape[2])
    metric = flat_metric(flat.mean(axis=0).reshape(-1, 3), data.triangles)
    space = metric_components(flat, training.latent_size, metric)
    given = np.linspace(0, data.starts[1] - 1, GIVEN_FRAMES + 1)[1:].astype(int)  # all fabrics are alike at the start
    mean = known.mean(axis=0)

    def closest(frame: int) -> Floats:
        off = np.linalg.norm(space.coefficients(asked[:, None, frame] - known[None, :, frame] + space.mean), axis=2)
        return known[off.argmin(axis=1)]

    def linear(frame: int) -> Floats:
        few = metric_components(known[:, frame], min(4, len(known) - 2), metric)
        fit = ridge(few.coefficients(known[:, frame]), known.reshape(len(known), -1), 0.1)
        return fit(few.coefficients(asked[:, frame])).reshape(asked.shape)

    parameters = ridge(data.fabrics[:-held], known.reshape(len(known), -1), 0.1)(data.fabrics[-held:])
    began = process_time()
    many = metric_components(flat, 200, metric)
    garments = np.repeat(np.arange(len(known)), known.shape[1])
    model = trained_motion_encoding(many, flat, np.tile(data.motions, (len(known), 1)), garments, training)
    seconds = process_time() - began

    def network(frame: int) -> Floats:
        motion = np.repeat(data.motions[[frame]], held, axis=0)
        codes = model.codes(asked[:, frame], motion)
        return np.array([model.drapes(np.tile(code, (len(data.motions), 1)), data.motions) for code in codes])

    def errors(predicted: Callable[[int], Floats]) -> dict[str, float]:
        found = [predicted(int(frame)) for frame in given]
        return {name: float(np.sqrt(np.mean([_rms(each[:, own], asked[:, own]) ** 2 for each in found])))
                for name, own in _motions(data)}  # fmt: skip

    plain = asked.reshape(-1, asked.shape[2])
    return {
        "mean of all training frames": errors(lambda _: np.broadcast_to(space.mean, asked.shape)),
        "mean fabric in that frame": errors(lambda _: np.broadcast_to(mean, asked.shape)),
        "nearest fabric in the given frame": errors(closest),
        "ridge from the given frame": errors(linear),
        "ridge from the fabric's values": errors(lambda _: parameters.reshape(asked.shape)),
        "motion-invariant code": errors(network) | {"training_cpu": seconds},
        "components alone": {"all": _rms(space.drapes(space.coefficients(plain)), plain)},
        "auto-encoder alone": {"all": _rms(model.decoded(model.latent(plain)), plain)},
    }


def new_motion(data: Frames, last: int, training: MotionTraining) -> dict[str, Any]:
    """Errors [m] on the last frames of the last motion, of which no fabric is known."""
    count = len(data.motions) - last
    known, asked = data.canonical[:, :count], data.canonical[:, count:]
    flat = known.reshape(-1, known.shape[2])
    metric = flat_metric(flat.mean(axis=0).reshape(-1, 3), data.triangles)
    space = metric_components(flat, training.latent_size, metric)
    moves, fabrics = data.motions, len(known)
    few = metric_components(moves[:count], MOTION_COMPONENTS)
    inputs = [np.column_stack([np.tile(few.coefficients(part), (fabrics, 1)), np.repeat(data.fabrics, len(part), 0)])
              for part in (moves[:count], moves[count:])]  # fmt: skip
    fitted = ridge(inputs[0], space.coefficients(flat), 1e-3)
    near = [nearest(few.coefficients(moves[:count]), each, few.coefficients(moves[count:]), 4) for each in known]
    many = metric_components(flat, 200, metric)
    garments = np.repeat(np.arange(fabrics), count)
    model = trained_motion_encoding(many, flat, np.tile(moves[:count], (fabrics, 1)), garments, training)
    first = slice(0, int(data.starts[1]))
    codes = [model.codes(each[first], moves[first]).mean(axis=0) for each in known]
    made = [model.drapes(np.tile(code, (last, 1)), moves[count:]) for code in codes]
    predicted = {
        "mean of all training frames": np.broadcast_to(space.mean, asked.shape),
        "last frame that is known": np.broadcast_to(known[:, -1:], asked.shape),
        "nearest motions, the same fabric": np.array(near),
        "ridge from motion and fabric": space.drapes(fitted(inputs[1])).reshape(asked.shape),
        "motion-invariant code": np.array(made),
    }
    return {name: {"all": _rms(each, asked)} for name, each in predicted.items()}


def _motions(data: Frames) -> list[tuple[str, slice]]:
    pairs = zip(data.starts, data.starts[1:], strict=False)
    return [(f"motion {k}", slice(int(one), int(two))) for k, (one, two) in enumerate(pairs)]


def spread_of_codes(data: Frames, space: Subspace, model: Any) -> float:
    """Standard deviation of a garment's code over the frames, over that of all codes."""
    codes = np.array([model.codes(each, data.motions) for each in data.canonical])
    return float(np.sqrt(codes.var(axis=1).mean() / codes.reshape(-1, codes.shape[2]).var(axis=0).mean()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Train all, and print the tables as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("farms", type=Path, nargs="+")
    parser.add_argument("--held-out", type=int, default=3, help="fabrics")
    parser.add_argument("--last", type=int, default=20, help="frames")
    for name in ("steps", "code_steps", "code_size", "seed"):
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=getattr(MotionTraining(), name))
    parser.add_argument("--invariance", type=float, default=MotionTraining().invariance)
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args(arguments)
    chosen = {name: getattr(given, name) for name in ("steps", "code_steps", "code_size", "seed", "invariance")}
    data, training = frames_of([open_farm(each) for each in given.farms]), replace(MotionTraining(), **chosen)
    report = {
        "processor": processor(),
        "fabrics": len(data.canonical),
        "frames": len(data.motions),
        "vertices": data.canonical.shape[2] // 3,
        **chosen,
        "new fabric": new_fabric(data, given.held_out, training),
        "new motion": new_motion(data, given.last, training),
    }
    if given.output is not None:
        write_atomically(given.output, json.dumps(report, indent=1).encode())
    print(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
