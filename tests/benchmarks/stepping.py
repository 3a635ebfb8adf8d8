"""Error against processor time of a step: the default stop, converged steps, and half the dt, scene by scene.

Run from the repository: python -m tests.benchmarks.stepping [SCENE ...] [--starts 5] [--seconds 0.4] [--out FILE].
`--all` is every scene below; `--docs` writes docs/notes/newton_stop.md from the scenes measured so far (`--record`).
SCENE is a file of scenes/ without its ending, a scene of tests/known_answers/error_scenes.py, or sheet40, sheet100,
sheet200: a sheet of 1 m that falls 5 cm on a ball. The reference has an eighth of the dt (a sixteenth of the sheets')
and a tolerance of 1e-3 m/s; its own doubt is its distance to a run with twice its dt. Errors are root mean squares
over the vertices at each frame. Of several starts, 1e-7 m apart, the medians are given: creases are chosen by less.
SCENE "untuned" is each of untuned_scenes.py: both stops at three dt, reference dt / 32, and the errors at equal cost.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Scene, load_scene
from clothsim.base.arrays import Floats
from clothsim.mesh.body import LaterMotion, RigidMotion
from clothsim.physics.energies.pins import PinsConstraint
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.stepping.mechanical_energy import mechanical_energy
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.time_loop import finished, next_step
from tests.benchmarks.bench.bench_cases import sphere
from tests.benchmarks.stored_tables import Record, markdown_table, read_record, when, write_between, write_record
from tests.benchmarks.untuned_scenes import STOPPED, UNTUNED_SCENES
from tests.known_answers.error_scenes import ERROR_SCENES

ROOT = Path(__file__).parents[2]
JITTER = 1e-7
SHORTEN: Mapping[str, float] = {
    "shirt": 0.4, "flag": 0.4, "twist": 0.4, "cape": 0.8, "cards": 0.4, "tube": 0.5, "spin": 0.6, "thrown": 0.5
}  # fmt: skip
"""Seconds of the scenes that last longer."""
SHEETS = ("sheet40", "sheet100")
SHIPPED = ("flag", "twist", "cape", "stack", "cards", "tube", "spin", "funnel", "needles", "thrown", "shirt")
SETTINGS: Mapping[str, tuple[float, Mapping[str, Any]]] = {
    "default": (1.0, {}),
    "default, dt / 2": (0.5, {}),
    "default, dt / 4": (0.25, {}),
    "converge": (1.0, {"converge": True}),
    "converge, dt / 2": (0.5, {"converge": True}),
}
"""What is compared: a factor of dt, and keys of the solver."""

EARLIER: Mapping[str, str] = {
    "flag": "3.3, 33.6; 4.6, 18.6", "twist": "0.68, 10.0; 1.2, 7.3", "cape": "0.90, 13.1; 1.4, 8.6",
    "stack": "19.7, 6.4; 21.3, 5.0", "tube": "1.1, 3.6; 1.6, 1.3", "cards": "1.6, 0.56; 3.8, 0.30",
    "spin": "1.5, 77; 1.9, 72", "funnel": "2.8, 23.8; 2.9, 21.4", "needles": "2.2, 7.5; 3.1, 15.2",
    "thrown": "2.7, 47.6; 3.1, 25.9",
}  # fmt: skip
"""CPU [s] and error [mm] of 2026-11-23, when each step was converged, with dt and dt / 2."""
DOCS = Path(__file__).parents[2] / "docs" / "notes" / "newton_stop.md"
HEADER = ("scene (simulated s)", *SETTINGS, "doubt [mm]", "2026-11-23: dt; dt / 2")

UNTUNED_STOPS: Mapping[str, Mapping[str, Any]] = {"default": {}, "converge": {"converge": True}}
COUNTS = ("iterations", "patch_iterations")


@dataclass(frozen=True)
class Measured:
    """A run: CPU [s] and energy [J] at each frame, positions (frames, n, 3) [m], counts, and the tries that failed."""

    cpu: Floats
    energies: Floats
    positions: Floats
    iterations: int
    patch_iterations: int
    steps: int
    failures: int


def scene_of(name: str, seconds: float = 0.0) -> Scene:
    """The scene of a name, one thread, at most `seconds` long where that is given."""
    if name.startswith("sheet"):
        scene = sphere(int(name[5:]), height=0.05, fall=0.0)
        solver = {key: value for key, value in scene.solver.items() if key != "tolerance"}
        scene = replace(scene, solver=solver, run={"duration": seconds or 0.4, "frames_per_second": 50})
    else:
        generated = {**ERROR_SCENES, **UNTUNED_SCENES}
        scene = generated[name] if name in generated else load_scene(ROOT / "scenes" / f"{name}.toml")
        longest = min(seconds or np.inf, SHORTEN.get(name, np.inf), scene.run_settings.duration)
        scene = replace(scene, run={**scene.run, "duration": longest, "until": "time"})
    return replace(scene, solver={**scene.solver, "threads": 1})


def _with_still_pins(integrator: Any, state: State) -> tuple[Any, State]:
    """The integrator with every pin where it is now; BDF2 starts anew, as after `Simulation.drive_pins`."""
    still = RigidMotion(np.zeros(3), np.zeros(3), np.zeros(3))

    def held(constraint: Any) -> Any:
        if not isinstance(constraint, PinsConstraint):
            return constraint
        groups = (
            replace(g, motion=LaterMotion(state.positions[g.vertices], still, state.time)) for g in constraint.groups
        )
        return replace(constraint, groups=tuple(groups))

    constraints = {name: held(each) for name, each in integrator.constraints.items()}
    return replace(integrator, constraints=constraints), replace(state, previous=None)


def measured(scene: Scene, factor: float, keys: Mapping[str, Any], start: int = 0, stop: float = np.inf) -> Measured:
    """Run `scene` with its dt times `factor` and with `keys` of the solver, from the start of a number.

    stop: time from which its pins stand still [s].
    """
    given = {**scene.solver, "dt": factor * scene.solver_settings.dt, **keys}
    if "tolerance" in given:
        given.pop("newton_error_fraction", None)
    scene = replace(scene, solver=given)
    built = build(scene)
    integrator, world = prepare(scene, built).integrator, built.world
    state, run = first_state(world, integrator.dt), scene.run_settings
    if start:
        moved = state.positions.copy()
        moved[: world.n_cloth] += JITTER * np.random.default_rng(start).standard_normal((world.n_cloth, 3))
        state = replace(state, positions=moved)
    rows: list[tuple[float, float, Floats]] = []
    counts, began, spent = np.zeros(4, int), process_time(), 0.0
    while not finished(state, run.duration, run.frames_per_second):
        report = next_step(integrator, state, run.duration, run.frames_per_second)
        result = report.result
        counts += [result.iterations, result.elimination_iterations, 1, len(report.failures)]
        state = report.state
        if report.failure is not None:
            break
        if report.frame_done:
            spent += process_time() - began
            energy = mechanical_energy(world, report.potential, state).total
            rows.append((spent, energy, state.positions[: world.n_unknowns].copy()))
            if state.time > stop - 1e-9:
                (integrator, state), stop = _with_still_pins(integrator, state), np.inf
            began = process_time()
    cpu, energies, positions = (np.array(column) for column in zip(*rows, strict=True))
    return Measured(cpu, energies, positions, *map(int, counts))


def distances(run: Measured, reference: Measured) -> Floats:
    """Root mean squares over the vertices at each frame that both have [mm]."""
    common = min(len(run.positions), len(reference.positions))
    difference = run.positions[:common] - reference.positions[:common]
    return np.asarray(1e3 * np.sqrt((difference**2).sum(axis=2).mean(axis=1)))


@dataclass(frozen=True)
class Comparison:
    """The reference of a scene, its doubt at each frame [mm], and (runs, errors at each frame [mm]) by setting."""

    name: str
    scene: Scene
    reference: Measured
    doubt: Floats
    settings: Mapping[str, tuple[Sequence[Measured], Sequence[Floats]]]

    def summary(self) -> dict[str, Any]:
        """Medians for the page: duration [s], doubt [mm], and [CPU s, mean error in mm] by setting."""
        medians = {
            label: [float(np.median([run.cpu[-1] for run in runs])), float(np.median(errors, axis=0).mean())]
            for label, (runs, errors) in self.settings.items()
        }
        day, seconds = date.today().isoformat(), self.scene.run_settings.duration
        return {"date": day, "seconds": seconds, "doubt": float(self.doubt.mean()), "settings": medians}


def compared(name: str, starts: int, seconds: float) -> Comparison:
    """Run a scene with every one of SETTINGS from each start, and its reference."""
    scene = scene_of(name, seconds)
    finest = 1 / 16 if name.startswith("sheet") else 1 / 8
    reference, twice = (measured(scene, factor, {"tolerance": 1e-3}) for factor in (finest, 2 * finest))
    settings = {}
    for label, (factor, keys) in SETTINGS.items():
        runs = [measured(scene, factor, keys, start) for start in range(starts)]
        settings[label] = runs, [distances(run, reference) for run in runs]
    return Comparison(name, scene, reference, distances(twice, reference), settings)


def table(comparison: Comparison) -> list[str]:
    """Rows of the table of one scene, Markdown."""
    frames = len(comparison.reference.positions)
    shown = sorted({round(fraction * frames) - 1 for fraction in (0.35, 0.5, 0.6, 0.75, 1.0)})
    rate = comparison.scene.run_settings.frames_per_second
    times = " / ".join(f"{(k + 1) / rate:.3g}" for k in shown)
    lines = [
        f"### {comparison.name}",
        f"| setting | CPU s | first half | Newton + patch | steps | RMS mm, mean | at {times} s | energy mJ at these |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]

    def line(label: str, runs: Sequence[Measured], errors: Sequence[Floats]) -> str:
        middle = np.median(errors, axis=0)
        run = sorted(runs, key=lambda each: each.cpu[-1])[len(runs) // 2]
        half = np.median([each.cpu[frames // 2 - 1] for each in runs])
        energies = np.median([each.energies for each in runs], axis=0)
        failed = f", {run.failures} tries failed" if run.failures else ""
        return (
            f"| {label} | {run.cpu[-1]:.2f} | {half:.2f} | {run.iterations} + {run.patch_iterations}{failed} "
            f"| {run.steps} | {middle.mean():.2f} | {' / '.join(f'{middle[k]:.2f}' for k in shown)} "
            f"| {' / '.join(f'{1e3 * energies[k]:.1f}' for k in shown)} |"
        )

    lines.append(line("reference (beside it: doubt)", [comparison.reference], [comparison.doubt]))
    return lines + [line(label, *each) for label, each in comparison.settings.items()]


def page_of(record: Record) -> str:
    """The table of the page: CPU s and mean error of the scenes in the record, in the order of `--all`. Markdown."""
    rows = []
    for name in (each for each in (*SHEETS, "sheet200", *SHIPPED, *ERROR_SCENES) if each in record):
        pairs = (record[name]["settings"][label] for label in SETTINGS)
        cells = (f"{cpu:.2g}, {error:.2g}" for cpu, error in pairs)
        title = f"{name} ({record[name]['seconds']:g})"
        rows.append([title, *cells, f"{record[name]['doubt']:.2g}", EARLIER.get(name, "")])
    ratios = [each["settings"]["default"][0] / each["settings"]["converge"][0] for each in record.values()]
    days = when(each["date"] for each in record.values())
    summary = f"The default takes {min(ratios):.2f} to {max(ratios):.2f} of the CPU time of converged steps."
    return f"Measured on {days}. {summary}\n\n{markdown_table(HEADER, rows)}"


def _curve(runs: Sequence[tuple[float, float]], cpu: float) -> float:
    """The error of (CPU s, error) at `cpu`, both by logarithms, on the lines between the points."""
    seconds, errors = np.log(np.array(sorted(runs))).T
    return float(np.exp(np.interp(np.log(cpu), seconds, errors)))


def ratios_at_equal_cost(one: Sequence[tuple[float, float]], other: Sequence[tuple[float, float]]) -> Floats:
    """Errors of the curve `one` over those of `other` at each point (CPU s, error) in the range that both have.

    Empty where they share none.
    """
    low, high = (pick([limit(runs)[0] for runs in (one, other)]) for pick, limit in ((max, min), (min, max)))
    inside = sorted({cpu for cpu, _ in (*one, *other) if low <= cpu <= high})
    return np.array([_curve(one, cpu) / _curve(other, cpu) for cpu in inside])


def untuned_table(name: str, starts: int, seconds: float = 0.0) -> list[str]:
    """Rows of one scene of UNTUNED_SCENES: both stops at three dt, and the errors at equal cost. Markdown."""
    scene, stop = scene_of(name, seconds), STOPPED.get(name, np.inf)
    fine: Mapping[str, Any] = {"tolerance": 1e-3}
    reference, twice = (measured(scene, factor, fine, stop=stop) for factor in (1 / 32, 1 / 16))
    doubt, half = distances(twice, reference), len(reference.positions) // 2
    lines = [
        f"### {name}: twice its dt moves the reference by {doubt[:half].mean():.2f} and {doubt.mean():.2f} mm",
        "| stop | dt s | CPU s | Newton + patch | steps | RMS mm, first half | all |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    points: dict[str, list[tuple[float, float, float]]] = {}
    for label, keys in UNTUNED_STOPS.items():
        for factor in (1.0, 0.5, 0.25):
            runs = [measured(scene, factor, keys, start, stop) for start in range(starts)]
            errors = np.median([distances(run, reference) for run in runs], axis=0)
            means = float(errors[:half].mean()), float(errors.mean())
            cpu = float(np.median([run.cpu[-1] for run in runs]))
            newton, patch = (int(np.median([getattr(run, key) for run in runs])) for key in COUNTS)
            points.setdefault(label, []).append((cpu, *means))
            failed = f", {runs[0].failures} tries failed" if runs[0].failures else ""
            lines.append(
                f"| {label} | {factor * scene.solver_settings.dt:g} | {cpu:.2f} | {newton} + {patch}{failed} "
                f"| {runs[0].steps} | {means[0]:.2f} | {means[1]:.2f} |"
            )
    for k, window in enumerate(("first half", "all"), start=1):
        one, other = ([(point[0], point[k]) for point in points[label]] for label in UNTUNED_STOPS)
        shown = ", ".join(f"{each:.2f}" for each in ratios_at_equal_cost(one, other)) or "no CPU time in common"
        lines.append(f"Error of the default over that of converge at equal CPU, {window}: {shown}")
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables, and write them where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: the small and the shipped scenes")
    parser.add_argument("--all", action="store_true", help="these, the sheets of 40 and 100 cells and the untuned")
    parser.add_argument("--starts", type=int, default=1, help="starts 1e-7 m apart, of which the median is taken")
    parser.add_argument("--seconds", type=float, default=0.0, help="bound on the simulated time [s]")
    parser.add_argument("--out", type=Path, help="file for the tables")
    parser.add_argument(
        "--record", type=Path, default=Path("results/stepping.json"), help="file for the page's figures"
    )
    parser.add_argument("--docs", action="store_true", help=f"write {DOCS.name} from the record")
    given = parser.parse_args(arguments)
    text: list[str] = []
    names = given.scenes or (*(SHEETS if given.all else ()), *SHIPPED, *ERROR_SCENES)
    if given.all:
        names = (*names, "untuned")
    for name in [each for one in names for each in (UNTUNED_SCENES if one == "untuned" else [one])]:
        if name in UNTUNED_SCENES:
            rows = untuned_table(name, max(1, given.starts), given.seconds)
        else:
            comparison = compared(name, max(1, given.starts), given.seconds)
            rows = table(comparison)
            given.record.parent.mkdir(parents=True, exist_ok=True)
            write_record(given.record, read_record(given.record) | {name: comparison.summary()})
        print("\n".join(rows), flush=True)
        text += [*rows, ""]
        if given.out is not None:
            given.out.write_text("\n".join(text))
    if given.docs:
        write_between(DOCS, "stepping", page_of(read_record(given.record)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
