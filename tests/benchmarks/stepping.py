"""Error against processor time of a step: the default stop, converged steps, and half the dt, scene by scene.

Run from the repository: python -m tests.benchmarks.stepping [SCENE ...] [--starts 5] [--seconds 0.4] [--out FILE].
SCENE is a file of scenes/ without its ending, a scene of tests/known_answers/error_scenes.py, or sheet40, sheet100,
sheet200: a sheet of 1 m that falls 5 cm on a ball. The reference has an eighth of the dt (a sixteenth of the sheets')
and a tolerance of 1e-3 m/s; its own doubt is its distance to a run with twice its dt. Errors are root mean squares
over the vertices at each frame. Of several starts, 1e-7 m apart, the medians are given: creases are chosen by less.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Scene, load_scene
from clothsim.base.arrays import Floats
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.stepping.mechanical_energy import mechanical_energy
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import finished, next_step
from tests.benchmarks.bench.bench_cases import sphere
from tests.known_answers.error_scenes import ERROR_SCENES

ROOT = Path(__file__).parents[2]
JITTER = 1e-7
SHORTEN: Mapping[str, float] = {
    "shirt": 0.4, "flag": 0.4, "twist": 0.4, "cape": 0.8, "cards": 0.4, "tube": 0.5, "spin": 0.6, "thrown": 0.5
}  # fmt: skip
"""Seconds of the scenes that last longer."""
SHIPPED = ("flag", "twist", "cape", "cards", "tube", "spin", "funnel", "needles", "thrown", "shirt")
SETTINGS: Mapping[str, tuple[float, Mapping[str, Any]]] = {
    "default": (1.0, {}),
    "default, dt / 2": (0.5, {}),
    "default, dt / 4": (0.25, {}),
    "converge": (1.0, {"converge": True}),
    "converge, dt / 2": (0.5, {"converge": True}),
}
"""What is compared: a factor of dt, and keys of the solver."""


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
        scene = ERROR_SCENES[name] if name in ERROR_SCENES else load_scene(ROOT / "scenes" / f"{name}.toml")
        longest = min(seconds or np.inf, SHORTEN.get(name, np.inf), scene.run_settings.duration)
        scene = replace(scene, run={**scene.run, "duration": longest, "until": "time"})
    return replace(scene, solver={**scene.solver, "threads": 1})


def measured(scene: Scene, factor: float, keys: Mapping[str, Any], start: int = 0) -> Measured:
    """Run `scene` with its dt times `factor` and with `keys` of the solver, from the start of a number."""
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
            began = process_time()
    cpu, energies, positions = (np.array(column) for column in zip(*rows, strict=True))
    return Measured(cpu, energies, positions, *map(int, counts))


def distances(run: Measured, reference: Measured) -> Floats:
    """Root mean squares over the vertices at each frame that both have [mm]."""
    common = min(len(run.positions), len(reference.positions))
    difference = run.positions[:common] - reference.positions[:common]
    return np.asarray(1e3 * np.sqrt((difference**2).sum(axis=2).mean(axis=1)))


def table(name: str, starts: int, seconds: float) -> list[str]:
    """Rows of the table of one scene, Markdown."""
    scene = scene_of(name, seconds)
    finest = 1 / 16 if name.startswith("sheet") else 1 / 8
    reference, twice = (measured(scene, factor, {"tolerance": 1e-3}) for factor in (finest, 2 * finest))
    doubt, frames = distances(twice, reference), len(reference.positions)
    shown = sorted({round(fraction * frames) - 1 for fraction in (0.35, 0.5, 0.6, 0.75, 1.0)})
    rate = scene.run_settings.frames_per_second
    times = " / ".join(f"{(k + 1) / rate:.3g}" for k in shown)
    lines = [
        f"### {name}",
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

    lines.append(line("reference (beside it: doubt)", [reference], [doubt]))
    for label, (factor, keys) in SETTINGS.items():
        runs = [measured(scene, factor, keys, start) for start in range(starts)]
        lines.append(line(label, runs, [distances(run, reference) for run in runs]))
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables, and write them where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: the small and the shipped scenes")
    parser.add_argument("--starts", type=int, default=1, help="starts 1e-7 m apart, of which the median is taken")
    parser.add_argument("--seconds", type=float, default=0.0, help="bound on the simulated time [s]")
    parser.add_argument("--out", type=Path, help="file for the tables")
    given = parser.parse_args(arguments)
    text: list[str] = []
    for name in given.scenes or (*ERROR_SCENES, *SHIPPED):
        rows = table(name, max(1, given.starts), given.seconds)
        print("\n".join(rows), flush=True)
        text += [*rows, ""]
        if given.out is not None:
            given.out.write_text("\n".join(text))
    return 0


if __name__ == "__main__":
    sys.exit(main())
