"""Hard case: scene for each seed, checks of its run, and result."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.record import RECORD_NAME, read_record
from clothsim.files.meshes.readers.obj import obj_text
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.run.intersections import intersection_warnings
from clothsim.run.results import Run
from clothsim.run.simulate import simulate
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene, scene_from_text
from clothsim.solve.stepping.integrators import BACKWARD_EULER
from clothsim.solve.stepping.mechanical_energy import ALLOWED

JITTER = 1e-3
"""Standard deviation of the vertices' displacement at the start, in median edges; seed 0 is the exact start."""

ENERGY_NOISE = 1e-9
"""Rise of an energy in a step, as a fraction of the largest energy, that is round-off."""

MOST_NEWTON = 400
"""Newton iterations that a step may take, those of parts of the cloth too."""

Check = Callable[[Run], str]
"""What is wrong with a run, in a sentence; empty where it is right."""


def right(run: Run) -> str:
    """Nothing more is asked for than of every run."""
    return ""


def all_of(*checks: Check) -> Check:
    """The first fault that one of the checks finds."""
    return lambda run: next(filter(None, (check(run) for check in checks)), "")


def steps_descend(run: Run) -> str:
    """Without prescribed motion (validation.md A4): |v1 - v0|^2_M/2 + Psi1 <= |v0|^2_M/2 + Psi0 to round-off."""
    rise = run.summary["certificate"]["step_energy_rise"]
    return "" if rise <= ENERGY_NOISE else f"a step ends {rise:.2g} of the energy above where it began"


def energy_falls(run: Run) -> str:
    """The total energy does not rise either: asked for where nothing buckles, for there Psi is as good as convex.

    BDF2 may add what its truncation error does, a small fraction of the kinetic energy.
    """
    drift = run.summary["certificate"]["energy_drift"]
    first_order = scene_of(run).solver_settings.integrator == BACKWARD_EULER
    bound = ENERGY_NOISE if first_order else ALLOWED
    return steps_descend(run) or ("" if drift <= bound else f"a step adds {drift:.2g} of the energy")


def scene_of(run: Run) -> Scene:
    """The scene of a run, for checks that simulate it again."""
    return scene_from_text(read_checkpoint(run.directory / CHECKPOINT_NAME).scene_text)


def none(small: bool) -> Mapping[str, str]:
    """No files."""
    return {}


@dataclass(frozen=True)
class Case:
    """A row of the table.

    scene: makes it for the full table, or small for the tests; check: what must hold of its run beside what must hold
    of all; fails: where the case is infeasible, words that its one sentence must hold (then nothing else is asked);
    refused: words of the InputError where it must not even start; jitters: whether seeds move the start, and
    jitter_axes how much along x, y and z; crosses: True where the cloth may intersect itself; files: {name: text} of
    files that the scene names, written for each run; slow: True where the small form takes seconds: it is run by the
    command alone, not by the tests.
    """

    name: str
    title: str
    scene: Callable[[bool], Scene]
    check: Check = right
    fails: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    jitters: bool = True
    jitter_axes: Sequence[float] = (1.0, 1.0, 1.0)
    crosses: bool = False
    files: Callable[[bool], Mapping[str, str]] = none
    slow: bool = False


@dataclass(frozen=True)
class Result:
    """A run of a case: smallest gap [m] below d_hat, Newton iterations, CPU seconds; wrong: empty where it passed."""

    case: str
    seed: int
    wrong: str
    gap: float = np.inf
    newton_iterations: int = 0
    seconds: float = 0.0

    @property
    def passed(self) -> bool:
        """True where nothing was wrong."""
        return not self.wrong


def run_case(case: Case, seed: int = 0, small: bool = True) -> Result:
    """Run a case from a start jittered by `seed`; every exception but bad input is a wrong result, never a crash."""
    started = process_time()
    with tempfile.TemporaryDirectory() as folder:
        try:
            scene = case.scene(small)
            for name, text in case.files(small).items():
                (Path(folder) / name).write_text(text, encoding="utf-8")
                scene = replace(scene, directory=Path(folder))
            if case.jitters:
                scene = jittered(scene, seed, Path(folder), case.jitter_axes)
            run = simulate(scene, Path(folder) / "run")
        except InputError as error:
            return Result(case.name, seed, _refused(case, error), seconds=process_time() - started)
        except (ClothsimError, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            return Result(case.name, seed, f"{type(error).__name__}: {error}", seconds=process_time() - started)
        gap = run.summary["certificate"]["minimum_gap"]
        wrong = _wrong(case, run, Path(folder) / "run")
        newton = run.summary["newton_iterations"] + run.summary["regional_iterations"]
    return Result(case.name, seed, wrong, np.inf if gap is None else gap, newton, process_time() - started)


def jittered(scene: Scene, seed: int, folder: Path, axes: Sequence[float] = (1.0, 1.0, 1.0)) -> Scene:
    """The scene with its free vertices moved at random at the start (its rest shape is not); seed 0: as it is."""
    if seed == 0:
        return scene
    built = build(scene)
    world = built.world
    edges = np.diff(world.start()[world.edges], axis=1)[:, 0]
    size = JITTER * float(np.median(np.linalg.norm(edges, axis=1)))
    moved = world.start()[: world.n_cloth] + world.origin
    away = size * np.asarray(axes) * np.random.default_rng(seed).standard_normal(moved.shape)
    for constraint in built.constraints.values():
        held = constraint.at(0.0).vertices
        away[held[held < world.n_cloth]] = 0.0
    moved += away
    file = folder / "start.obj"
    file.write_text(obj_text(moved, world.triangles), encoding="utf-8")
    return replace(scene, seed={"from": "file", "file": str(file)})


def _refused(case: Case, error: InputError) -> str:
    missing = [word for word in case.refused if word not in str(error)]
    if not case.refused:
        return f"refused: {error}"
    return f"the refusal does not say {missing[0]!r}: {error}" if missing else ""


def _wrong(case: Case, run: Run, directory: Path) -> str:
    """The first thing that is wrong with a run."""
    if case.refused:
        return "it was not refused"
    if case.fails:
        return _wrong_failure(case, run)
    certificate = run.summary["certificate"]
    crossed = not (case.crosses or run.intersection_free)
    faults = {
        run.summary["reason"]: run.status != "completed",
        " ".join(intersection_warnings(run.intersections)) or "not all was checked": crossed,
        "a position is not finite": not np.isfinite(run.positions(-1)).all(),
        "a triangle has lost its area": bool(scene_of(run).cloths) and not (certificate["stretch_min"] or 0.0) > 0.0,
    }
    wrong = next((fault for fault, there in faults.items() if there), "")
    return wrong or _bounded(read_record(directory / RECORD_NAME)) or case.check(run)


def _wrong_failure(case: Case, run: Run) -> str:
    if run.status == "completed":
        return "it completed, though the case is infeasible"
    missing = [word for word in case.fails if word not in run.summary["reason"]]
    if missing:
        return f"the sentence does not say {missing[0]!r}: {run.summary['reason']}"
    return "" if run.intersection_free else "a step intersects"


def _bounded(record: list[dict[str, Any]]) -> str:
    most = max((entry["newton_iterations"] + entry["regional_iterations"] for entry in record), default=0)
    return f"a step took {most} Newton iterations" if most > MOST_NEWTON else ""
