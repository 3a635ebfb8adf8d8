"""Table of models of a garment in motion: `python -m tests.benchmarks.motion_table FOLDER -o table.json`.

Makes the farm of a recipe in FOLDER/farm, or goes on with it, learns all models, and measures on what was held out (a
kind of motion, and bodies):

* the error, a root mean square distance of a vertex, in mm and in multiples of the twins' floor: the distance of each
  clip to the same clip from a start that is moved by a millionth of its size;
* beside the models, `last frame`: the first frame that is checked, as it was simulated, skinned through the motion;
* vertices inside the body before repair;
* for some clips of each set the verdicts of `checked_motion` on the best model, the time of each part, and that of the
  simulation in the same process.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Simulation
from clothsim.base.arrays import Floats
from clothsim.base.file_writing import write_atomically
from clothsim.base.text import text_table
from clothsim.engine import checked_motion, example_file
from clothsim.study.farm.drape import drape
from clothsim.study.farm.plan import Farm, open_farm, plan
from clothsim.study.farm.publication import processor
from clothsim.study.farm.recipe import load_recipe
from clothsim.study.farm.status import write_manifest
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import work
from clothsim.study.learned_motion import SETS, LearnedMotion, MovingClip, clips_of, learn_motion
from clothsim.study.workers import jittered
from transfer.motion_model import MotionModel
from transfer.motion_regressor import RegressorTraining

HELD = SETS[1:]


def farm_of(folder: Path, recipe: str, count: int, as_it_is: bool) -> Farm:
    """The farm of a recipe in a folder, made as far as it is not; as_it_is: with the clips that are there."""
    directory = folder / "farm"
    if not as_it_is:
        found = load_recipe(example_file(Path(recipe), ".recipe"))
        work(plan(replace(found, count=count or found.count), directory))
    farm = open_farm(directory)
    write_manifest(farm)
    verify(farm, fraction=0)
    return farm


def distance(one: Floats, other: Floats) -> float:
    """Mean square distance of a vertex [m2] of frames (f, k, 3)."""
    return float(((one - other) ** 2).sum(axis=2).mean())


def root(squares: Sequence[float]) -> float:
    """Root of the mean; nan of none."""
    return float(np.sqrt(np.mean(squares))) if len(squares) else float("nan")


def twin(clip: MovingClip, folder: Path) -> Floats:
    """The positions of a clip (f, k, 3) [m] from a start that is moved a little; made once."""
    file, own = folder / f"{clip.id}.npy", folder / clip.id
    if not file.exists():
        own.mkdir(parents=True, exist_ok=True)
        scene = clip.garment.scene
        made = drape(replace(scene, seed=jittered(scene, 1, own)), own, frames="all")
        if made.positions is None or len(made.positions) != len(clip.positions):
            raise RuntimeError(f"The twin of {clip.id} ended: {made.summary['reason']}")
        np.save(file, made.positions)
    return np.asarray(np.load(file), np.float64)


def last_frame(clip: MovingClip) -> Floats:
    """The first settled frame, as it was simulated, skinned through all frames of a clip, (f, k, 3) [m]."""
    garment, first = clip.garment, clip.settled.start
    own = garment.unposed(clip.positions[first], float(clip.times[first]), garment.reference)
    return np.array([garment.posed(own, float(time), garment.reference) for time in clip.times])


def errors(
    learned: LearnedMotion, clips: Sequence[MovingClip], twins: dict[str, Floats]
) -> dict[str, dict[str, dict[str, float]]]:
    """Error [m], multiple of the floor and share of vertices inside, by held-out set and model; the floor itself."""
    found: dict[str, dict[str, dict[str, float]]] = {}
    for part in HELD:
        own = [clips[k] for k in learned.division.rows(part)]
        floor = root([distance(twins[clip.id][clip.settled], clip.positions[clip.settled]) for clip in own])
        held = root([distance(last_frame(clip)[clip.settled], clip.positions[clip.settled]) for clip in own])
        missed = {name: learned.errors[name][part] for name in learned.models} | {"last frame": held}
        found[part] = {name: {"error": error, "floors": error / floor} for name, error in missed.items()}
        for name in learned.models:
            found[part][name]["inside"] = learned.inside[name][part]
        found[part]["twins"] = {"error": floor, "floors": 1.0}
    return found


def simulated(clip: MovingClip) -> float:
    """Processor time of the steps of a clip [s]."""
    simulation, began = Simulation(clip.garment.scene), process_time()
    for _ in simulation:
        pass
    return process_time() - began


def checked(clip: MovingClip, model: MotionModel) -> dict[str, Any]:
    """Verdicts, processor time of each part [s], and the error after repair [m] of a clip as a model predicts it."""
    frames = list(checked_motion(clip.garment, model))
    for frame in frames:
        assert clip.garment.checked(frame.cloth, frame.time).clean, f"{clip.id} at {frame.time:g} s"
    seconds: Counter[str] = Counter()
    for frame in frames:
        seconds.update(frame.seconds)
    made = np.array([frame.cloth for frame in frames])
    return {
        "clip": clip.id,
        "motion": clip.motion,
        "frames": len(frames),
        "verdicts": dict(Counter(frame.verdict for frame in frames)),
        "seconds": dict(seconds),
        "error": root([distance(made[clip.settled], clip.positions[clip.settled])]),
    }


def spread(own: Sequence[MovingClip], count: int) -> list[MovingClip]:
    """Some clips of a set, evenly spaced."""
    return [own[int(k)] for k in np.linspace(0, len(own) - 1, min(count, len(own)))]


def verdicts(learned: LearnedMotion, clips: Sequence[MovingClip], count: int) -> list[dict[str, Any]]:
    """Rows of `checked` for some clips of each held-out set, with the time of the simulation in the same process."""
    rows = []
    for part in HELD:
        for clip in spread([clips[k] for k in learned.division.rows(part)], count):
            row = checked(clip, learned.models[learned.best])
            rows.append({"set": part, "model": learned.best, "simulation": simulated(clip), **row})
            print(json.dumps(rows[-1]), flush=True)
    return rows


def text_of(report: dict[str, Any]) -> str:
    """The tables of a report."""
    names = [*report["models"], "last frame", "twins"]
    lines = [[name, *(_cell(report["errors"][part][name]) for part in HELD)] for name in names]
    rates = []
    for part in HELD:
        rows = [row for row in report["checked"] if row["set"] == part]
        frames, spent = sum(row["frames"] for row in rows), Counter[str]()
        counts: Counter[str] = Counter()
        for row in rows:
            spent.update(row["seconds"] | {"run": row["simulation"]})
            counts.update(row["verdicts"])
        predicted, all_of_it = spent["prediction"] + spent["test"], spent.total() - spent["run"]
        shares = [f"{100 * counts[name] / max(1, frames):.0f} %" for name in ("certified", "repaired", "simulated")]
        speeds = [f"{frames / max(part, 1e-9):.3g}" for part in (predicted, all_of_it, spent["run"])]
        rates.append([part, str(frames), *shares, *speeds])
    header = ["set", "frames", "certified", "repaired", "simulated", "predicted/s", "repaired/s", "simulation/s"]
    return f"{text_table(['model', *HELD], lines)}\n\n{text_table(header, rates)}"


def _cell(entry: dict[str, float]) -> str:
    inside = f", {100 * entry['inside']:.3f} % inside" if "inside" in entry else ""
    return f"{1e3 * entry['error']:.1f} mm, {entry['floors']:.1f} floors{inside}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the farm, learn, measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the farm, the twins and the models")
    parser.add_argument("--recipe", default="shirt_in_motion")
    parser.add_argument("--count", type=int, default=0, help="clips (default: those of the recipe)")
    parser.add_argument("--as-it-is", action="store_true", help="take the clips that are published")
    parser.add_argument("--held-kind", help="kind of motion that is held out (default: drawn)")
    parser.add_argument("--held-bodies", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--checked", type=int, default=2, help="clips of each set that are checked frame by frame")
    parser.add_argument("-o", "--output", type=Path, help="the table as JSON")
    given = parser.parse_args(arguments)
    farm = farm_of(given.folder, given.recipe, given.count, given.as_it_is)
    clips, began = clips_of(farm), process_time()
    training = RegressorTraining(seed=given.seed)
    learned = learn_motion(farm, given.held_kind, given.held_bodies, 48, given.seed, training, clips)
    seconds, sets = process_time() - began, learned.division
    for kind in learned.models:
        learned.write(given.folder / f"{kind}.npz", kind, overwrite=True)
    held = [clips[k] for part in HELD for k in sets.rows(part)]
    twins = {clip.id: twin(clip, given.folder / "twins") for clip in held}
    report: dict[str, Any] = {
        "processor": processor(),
        "clips": {name: [clips[k].id for k in sets.rows(name)] for name in ("training", *SETS)},
        "kind": sets.kind,
        "bodies": sets.bodies,
        "vertices": clips[0].positions.shape[1],
        "learning": seconds,
        "models": list(learned.models),
        "best": learned.best,
        "validation": {name: each["validation"] for name, each in learned.errors.items()},
        "errors": errors(learned, clips, twins),
        "checked": verdicts(learned, clips, given.checked),
    }
    if given.output is not None:
        write_atomically(given.output, json.dumps(report, indent=1).encode())
    print({name: f"{1e3 * error:.1f} mm" for name, error in report["validation"].items()}, "ships", report["best"])
    print({name: len(ids) for name, ids in report["clips"].items()}, report["kind"], f"{seconds:.0f} s of learning")
    print(text_of(report))
    return 0


if __name__ == "__main__":
    sys.exit(main())
