"""Drapes from learned seeds against transferred ones: `python -m tests.benchmarks.learned_seeds FARM --drapes 10`.

A model is learned from the first drapes of a farm; each of the last ones is draped again from four starts, under the
same settings:

* transfer: the garment as it is made for the base body, deformed as that body is (the start of `clothsim fit`);
* transferred drape: the same of the drape at rest on the base body;
* nearest drape: the same of the training drape with the nearest parameters, from its own body;
* model: the prediction.

All are untangled first. The label is the drape of the farm, from the scene's own start; the distance between the ends
of two runs of one drape is what a model of the labels can reach at best.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.text import text_table
from clothsim.files.meshes.readers.obj import write_obj
from clothsim.mesh.world import World
from clothsim.scene.assembly.drape_model import DrapeModel, predicted
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene
from clothsim.study.farm.drape import drape
from clothsim.study.farm.plan import DrapeJob, Farm, open_farm
from clothsim.study.farm.publication import processor
from clothsim.study.farm.reading import CLOTH
from clothsim.study.farm.status import manifest
from clothsim.study.farm.verification import verify
from clothsim.study.learned_drapes import Learned, learn
from transfer.garment import transfer_garment


@dataclass(frozen=True)
class Row:
    """A drape from one start.

    Attributes
    ----------
    drape, start, cause : str
        Id, name of the start, and why it is not usable ("": certified and at rest).
    newton_iterations : int
    cpu_seconds : float
        Of untangling and simulation.
    seed_error, end_error : float
        Root mean square distance of a vertex of the start and of the end to the label [m]; nan without an end.
    """

    drape: str
    start: str
    cause: str
    newton_iterations: int
    cpu_seconds: float
    seed_error: float
    end_error: float


def compare(farm: Farm, held_out: float, drapes: int, show: Callable[[Row], None]) -> tuple[Learned, list[Row]]:
    """Learn a farm; rows of some of its held-out drapes from every start."""
    verify(farm, fraction=0)  # which `learn` asks for
    learned = learn(farm, held_out)
    usable = [row for row in manifest(farm) if row["usable"]]
    known = {row["id"]: row["parameters"] for row in usable[: learned.training]}
    held = [row["id"] for row in usable[learned.training :]]
    chosen = [held[round(k)] for k in np.linspace(0, len(held) - 1, min(drapes, len(held)))]
    rows = []
    with tempfile.TemporaryDirectory(prefix="clothsim-seeds-") as folder:
        base = world_of(farm.scene)
        starts = {"transfer": _cloth(base), "transferred drape": _at_rest(farm.scene, Path(folder))}
        jobs = {job.id: job for job in farm.jobs}
        for name in chosen:
            near = jobs[_nearest(known, jobs[name].values, learned.model)]
            for row in _rows(farm, jobs[name], near, base, starts, learned.model, Path(folder)):
                show(row)
                rows.append(row)
    return learned, rows


def _nearest(known: Mapping[str, Mapping[str, Any]], values: Mapping[str, Any], model: DrapeModel) -> str:
    """The training drape whose parameters, over their deviations, are nearest."""

    def distance(name: str) -> float:
        apart = [known[name][key] - values[key] for key in model.inputs.tolist()]
        return float(np.linalg.norm(np.array(apart) / model.scale))

    return min(known, key=distance)


def _rows(
    farm: Farm,
    job: DrapeJob,
    near: DrapeJob,
    base: World,
    starts: Mapping[str, Floats],
    model: DrapeModel,
    folder: Path,
) -> list[Row]:
    """The drape as the farm has it, and from each start."""
    scene, label, other = farm.scene_of(job), _drape(farm, job), world_of(farm.scene_of(near))
    world, summary = world_of(scene), _summary(farm, job)
    triangles, bodies = base.cloths[0].triangles, base.bodies[0].triangles
    seeds = {
        name: transfer_garment(shape, triangles, _body(base), _body(world), bodies) for name, shape in starts.items()
    }
    seeds["nearest drape"] = transfer_garment(_drape(farm, near), triangles, _body(other), _body(world), bodies)
    seeds["model"] = predicted(model, scene)
    own = Row(job.id, "own", summary["cause"], summary["newton_iterations"], summary["cpu_seconds"], np.nan, 0.0)
    rows = [replace(own, seed_error=_rms(_cloth(world), label))]
    for name, positions in seeds.items():
        file = write_obj(folder / "seed.obj", positions, triangles)
        made = drape(replace(scene, seed={"from": "file", "file": str(file), "untangle": True}), folder)
        end = np.nan if made.positions is None else _rms(made.positions, label)
        row = replace(own, start=name, cause=made.summary["cause"], cpu_seconds=made.summary["cpu_seconds"])
        iterations = made.summary.get("newton_iterations", 0)
        rows.append(replace(row, newton_iterations=iterations, seed_error=_rms(positions, label), end_error=end))
    return rows


def _drape(farm: Farm, job: DrapeJob) -> Floats:
    return np.load(farm.directory / "drapes" / job.id / CLOTH).astype(np.float64)


def _summary(farm: Farm, job: DrapeJob) -> dict[str, Any]:
    return dict(json.loads((farm.directory / "drapes" / job.id / "summary.json").read_text(encoding="utf-8")))


def _at_rest(scene: Scene, folder: Path) -> Floats:
    made = drape(scene, folder)
    if made.positions is None:
        raise SystemExit(f"The base scene has no drape: {made.summary['reason']}")
    return np.asarray(made.positions, np.float64)


def _cloth(world: World) -> Floats:
    return world.cloths[0].positions + world.origin


def _body(world: World) -> Floats:
    return world.bodies[0].positions + world.origin


def _rms(one: Floats, other: Floats) -> float:
    return float(np.sqrt(np.mean(((one - other) ** 2).sum(axis=1))))


def ratios(rows: Sequence[Row], start: str, against: str) -> dict[str, float]:
    """Newton iterations and processor time of the usable drapes from one start over those from another: of their sums,
    and the median and the range of the ratio of the iterations of single drapes."""
    found = {(row.drape, row.start): row for row in rows if not row.cause}
    mine = [row for row in found.values() if row.start == start and (row.drape, against) in found]
    pairs = [(row, found[row.drape, against]) for row in mine]
    each = [one.newton_iterations / other.newton_iterations for one, other in pairs]
    ones, others = zip(*pairs, strict=True)
    return {
        "drapes": len(pairs),
        "newton": sum(row.newton_iterations for row in ones) / sum(row.newton_iterations for row in others),
        "newton_median": median(each),
        "newton_least": min(each),
        "newton_most": max(each),
        "cpu": sum(row.cpu_seconds for row in ones) / sum(row.cpu_seconds for row in others),
    }


def report(learned: Learned, rows: Sequence[Row]) -> dict[str, Any]:
    """Errors of the model, the distances of the ends, and the ratios."""
    starts = list(dict.fromkeys(row.start for row in rows))
    usable = {start: [row for row in rows if row.start == start and not row.cause] for start in starts}
    return {
        "processor": processor(),
        **{key: getattr(learned, key) for key in ("training", "held_out", "error", "mean_error", "nearest_error")},
        "usable": {start: len(usable[start]) for start in starts},
        "causes": [(row.drape, row.start, row.cause) for row in rows if row.cause],
        "seed_error": {start: _root_mean(row.seed_error for row in rows if row.start == start) for start in starts},
        "end_error": {start: _root_mean(row.end_error for row in usable[start]) for start in starts},
        "ratios": {
            f"{start} / {against}": ratios(rows, start, against)
            for start in starts
            for against in starts
            if start == "model" != against
        },
    }


def _root_mean(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(list(values)))))


def as_text(rows: Sequence[Row]) -> str:
    """A table of the drapes."""
    header = ("drape", "start", "Newton", "CPU s", "seed mm", "end mm", "cause")
    cells = [
        [
            row.drape,
            row.start,
            str(row.newton_iterations),
            f"{row.cpu_seconds:.2f}",
            f"{1e3 * row.seed_error:.1f}",
            f"{1e3 * row.end_error:.1f}",
            row.cause,
        ]
        for row in rows
    ]
    return text_table(header, cells)


def main(arguments: Sequence[str] | None = None) -> int:
    """Learn, drape and print the table and the report as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("farm", type=Path)
    parser.add_argument("--held-out", type=float, default=0.25)
    parser.add_argument("--drapes", type=int, default=10, help="held-out drapes that are made again")
    parser.add_argument("-o", "--output", type=Path, help="the report and all rows as JSON")
    given = parser.parse_args(arguments)
    learned, rows = compare(
        open_farm(given.farm),
        given.held_out,
        given.drapes,
        lambda row: print(row.drape, row.start, row.cause, flush=True),
    )
    made = report(learned, rows)
    print(as_text(rows))
    print(json.dumps(made, indent=1))
    if given.output is not None:
        given.output.write_text(json.dumps({**made, "rows": [asdict(row) for row in rows]}, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
