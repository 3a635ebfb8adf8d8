"""Recommendations of a study checked: `python -m tests.benchmarks.recommendations SCENE DIR [--finer dt=2,cells=2]`.

Every recommended setting of the study in DIR is run anew, and compared with one run that shares nothing with the
study's reference: BDF2, with every knob finer by some levels, and nothing extrapolated. That run has an error of its
own, taken as its distance to the same one level coarser; a predicted error below twice that is unresolved.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.safe_files.record import read_summary
from clothsim.base.text_table import text_table
from clothsim.scene.assembly.explicit_lengths import fixed
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.overrides import set_key
from clothsim.scene.scene import Scene
from clothsim.scene.toml_file import load_scene
from clothsim.study.evaluation import STUDY_NAME
from clothsim.study.knobs import KNOBS, usable
from clothsim.study.points import Bench, Point, point
from clothsim.study.reference_solution import Norm
from clothsim.study.resample import at_points_of, material_of, point_areas
from clothsim.study.worker import answer

FINER = "dt=2,cells=2,tolerance=2,d_hat=3,eps_v=1"
TWICE = 2.0


@dataclass(frozen=True)
class Promise:
    """Recommended settings for an error [mm], the error measured by the study, and the one of the repeated run [mm].

    doubt [mm]: the error of the run that it was compared with.
    """

    target: float
    label: str
    promised: float
    found: float
    doubt: float = 0.0

    @property
    def resolved(self) -> bool:
        """True where the comparison can tell a factor of two."""
        return self.promised >= TWICE * self.doubt

    @property
    def holds(self) -> bool:
        """True where the two errors are within a factor of two."""
        return self.promised / TWICE <= self.found <= self.promised * TWICE


def promises(scene: Scene, study: Mapping[str, Any], finer: Mapping[str, int]) -> list[Promise]:
    """Every recommended setting of study.json run anew. InputError where a run is no data point."""
    built = build(scene)
    base = fixed(scene, built)
    knobs, _ = usable(base, None)
    bench = Bench(scene, base, knobs)
    material = material_of([c.rest_positions for c in built.world.cloths], [c.triangles for c in built.world.cloths])
    areas = point_areas(material)
    norm = Norm(areas / areas.sum())
    best = {name: level for name, level in finer.items() if name in knobs}

    def ran(some: Scene) -> Floats:
        with TemporaryDirectory() as folder:
            target = Path(folder) / "run.npz"
            said = answer({"scene": some.to_text(), "seed": 0, "target": str(target)})
            if said["failed"]:
                raise InputError(f"A run to compare with is no data point: {said['failed']}")
            with np.load(target) as kept:
                count = sum(name.startswith("rest_") for name in kept.files)
                mesh = [kept[f"rest_{k}"] for k in range(count)], [kept[f"triangles_{k}"] for k in range(count)]
                return at_points_of(material, material_of(*mesh), kept["positions"])

    levels = [best, {name: level - 1 for name, level in best.items()}]
    exact, coarser = (ran(set_key(bench.scene(point(each)), "solver.integrator", "bdf2")) for each in levels)
    doubt = 1e3 * norm(exact - coarser)
    found = []
    for each in study["recommended"]:
        where = _point_of(bench, each)
        error = 1e3 * norm(ran(bench.scene(where)) - exact)
        found.append(Promise(each["error"], where.label(), each["measured_error"], error, doubt))
    return found


def _verdict(each: Promise) -> str:
    return ("yes" if each.holds else "NO") if each.resolved else "unresolved"


def _point_of(bench: Bench, advice: Mapping[str, Any]) -> Point:
    """The point with the label of a recommendation: "dt +1, cells -1", "draft", "bdf2", "base"."""
    parts = [part.rsplit(" ", 1) for part in advice["label"].split(", ")]
    if len(parts[0]) == 1:
        return Point() if advice["label"] == "base" else Point(variant=advice["label"])
    return point({name: int(level) for name, level in parts})


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; 0 where every resolved prediction holds."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.recommendations", description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("directory", type=Path)
    parser.add_argument("--finer", default=FINER, help=f"levels of the run to compare with (default {FINER})")
    arguments = parser.parse_args(argv)
    finer = {name: int(level) for name, level in (each.split("=") for each in arguments.finer.split(","))}
    try:
        if set(finer) - set(KNOBS):
            raise InputError(f"--finer names {sorted(set(finer) - set(KNOBS))[0]!r}.", f"Known: {', '.join(KNOBS)}.")
        rows = promises(load_scene(arguments.scene), read_summary(arguments.directory / STUDY_NAME), finer)
    except ClothsimError as error:
        print(error, file=sys.stderr)
        return 2
    cells = [
        [
            f"{each.target:g}",
            each.label,
            f"{each.promised:.3g}",
            f"{each.found:.3g}",
            f"{each.doubt:.2g}",
            _verdict(each),
        ]
        for each in rows
    ]
    print(text_table(("for at most [mm]", "settings", "promised [mm]", "found [mm]", "to +- [mm]", "holds"), cells))
    return 0 if all(each.holds for each in rows if each.resolved) else 1


if __name__ == "__main__":
    sys.exit(main())
