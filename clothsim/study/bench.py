"""What a Newton iteration costs, and where: `python -m clothsim.study.bench [--quick] [--json FILE]`.

A square of cloth falls on a ball; a few steps bring it into contact, then the same steps are taken several times from
the same state. All times are medians. Nothing here judges: the numbers belong to the machine they were measured on.
"""

import argparse
import platform
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from clothsim.energies.membrane import NeoHookeanMembrane
from clothsim.errors import ClothsimError
from clothsim.io.record import to_json
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.generate import rectangle
from clothsim.mesh.world import make_world
from clothsim.scene.build import build
from clothsim.scene.fabrics import FABRICS
from clothsim.scene.scene import Scene
from clothsim.session import Session, prepare
from clothsim.sim.state import State, first_state
from clothsim.sim.stepping import advance
from clothsim.solve.memory import peak_memory
from clothsim.study.text_table import text_table

ELASTICITY = ("membrane", "bending")
FALL = 1.0
"""Speed at which the cloth meets the ball [m/s]: in six steps of 10 ms it wraps a cap of some tenth of its area."""


@dataclass(frozen=True)
class Row:
    """A measured number: what, how much, of which unit."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Bench:
    """The rows, and on what they were measured: when, on how many cores, with which versions."""

    rows: tuple[Row, ...]
    date: str
    cores: int
    versions: dict[str, str]

    def as_text(self) -> str:
        """The table for people to read."""
        software = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        rows = [
            [row.name, f"{row.value:,.4g}" if row.value < 1e4 else f"{row.value:,.0f}", row.unit] for row in self.rows
        ]
        return f"{self.date}, {self.cores} cores; {software}\n\n{text_table(('what', 'value', 'unit'), rows)}"


def bench(
    cells: Sequence[int] = (40, 100), steps: int = 1, lead: int = 6, repeats: int = 3, kernel: int = 100
) -> Bench:
    """Measure squares of `cells` x `cells`: `lead` steps into contact, then `repeats` times the same `steps`.

    kernel: cells along the sheet of the membrane kernel, 2 kernel^2 triangles.
    """
    from os import cpu_count

    rows = [*_import_time(repeats), *_membrane(kernel, repeats)]
    for n in sorted(cells):
        rows.extend(_drape(n, steps, lead, repeats))
    versions = {"python": platform.python_version()}
    versions.update({name: version(name) for name in ("clothsim", "numpy", "numba", "ipctk")})
    return Bench(tuple(rows), datetime.now().astimezone().isoformat(timespec="minutes"), cpu_count() or 1, versions)


def sphere_scene(cells: int) -> Scene:
    """A metre of cotton, `cells` x `cells`, that touches a ball of 0.3 m and falls at FALL."""
    height = 0.3 + 0.1 / cells  # a tenth of an edge: d_hat, where contact begins
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": (1.0, 1.0),
            "cells": (cells, cells),
            "position": (0.0, 0.0, height),
            "velocity": (0.0, 0.0, -FALL),
        },
        body={"name": "ball", "mesh": "sphere", "radius": 0.3},
        effects={name: {} for name in ("inertia", "membrane", "bending", "gravity", "body_contact")},
        run={"duration": 1.0},
    )


def _drape(cells: int, steps: int, lead: int, repeats: int) -> list[Row]:
    """Milliseconds per Newton iteration of the sheet on the ball, split into its parts."""
    scene = sphere_scene(cells)
    session = prepare(scene, build(scene))
    state, _ = _advanced(session, first_state(session.built.world, session.integrator.dt), lead)
    trials: list[dict[str, float]] = []
    counts: list[float] = []
    for _ in range(repeats):
        before = _booked(session)
        start = perf_counter()
        _, iterations = _advanced(session, state, steps)
        seconds = perf_counter() - start
        after = _booked(session)
        spent = {name: after[name] - before.get(name, 0.0) for name in after}
        split = {"all": seconds, **_parts(spent, seconds)}
        trials.append({name: 1e3 * part / iterations for name, part in split.items()})
        counts.append(iterations / steps)
    where = f"ball {cells}x{cells}"
    ms = {name: median(trial[name] for trial in trials) for name in trials[0]}
    pairs = session.integrator.potential.accounts()["body_contact"]["pairs"]
    return [
        *(Row(f"{where}: {name}", value, "ms / Newton iteration") for name, value in ms.items()),
        Row(f"{where}: Newton iterations", median(counts), "a step"),
        Row(f"{where}: contact pairs", pairs, "pairs"),
        Row(f"{where}: peak memory of the bench so far", peak_memory() / 1e6, "MB"),
    ]


def _advanced(session: Session, state: State, steps: int) -> tuple[State, int]:
    """The state after some steps, and their Newton iterations."""
    iterations = 0
    for _ in range(steps):
        report = advance(session.integrator, state, state.time + session.integrator.dt)
        if not report.converged:
            raise ClothsimError(f"The bench cannot step: {report.result.outcome.sentence}")
        state, iterations = report.state, iterations + report.result.iterations
    return state, iterations


def _booked(session: Session) -> dict[str, float]:
    """Seconds booked so far: effects (less their parts), the parts, the phases."""
    potential = session.integrator.potential
    booked = dict(potential.ledger.phases)
    for name, account in potential.accounts().items():
        booked[name] = account["seconds"] - sum(account["parts"].values())
        booked.update(account["parts"])
    return booked


def _parts(spent: Mapping[str, float], seconds: float) -> dict[str, float]:
    """The split that the table shows; its parts add up to `seconds`."""
    named = {
        "elasticity": sum(spent[name] for name in ELASTICITY),
        "barrier": spent["body_contact"],
        **{name: spent[name] for name in ("candidates", "CCD", "assembly", "linear solve")},
    }
    return {**named, "inertia, gravity, line search, control": seconds - sum(named.values())}


def _membrane(cells: int, repeats: int) -> list[Row]:
    """The membrane kernel on a deformed sheet."""
    positions, triangles = rectangle(cells=(cells, cells))
    world = make_world([make_cloth("sheet", positions, triangles, FABRICS["cotton"])])
    energy = NeoHookeanMembrane.of(world)
    x = world.start() + 0.05 / cells * np.random.default_rng(0).standard_normal((world.n_vertices, 3))
    jobs: dict[str, Callable[[], object]] = {
        "value": lambda: energy.value(x),
        "gradient": lambda: energy.gradient(x),
        "projected Hessian": lambda: energy.hessian(x),
    }
    where = f"membrane, {len(triangles):,} triangles"
    times = {name: 1e3 * _seconds(job, repeats) for name, job in jobs.items()}
    rows = [Row(f"{where}: {name}", time, "ms") for name, time in times.items()]
    return [*rows, Row(f"{where}: all three", sum(times.values()), "ms")]


def _seconds(job: Callable[[], object], repeats: int, calls: int = 5) -> float:
    """Median over `repeats` of the mean time of a call; one call before them compiles."""
    job()
    times = []
    for _ in range(repeats):
        start = perf_counter()
        for _ in range(calls):
            job()
        times.append((perf_counter() - start) / calls)
    return median(times)


def _import_time(repeats: int) -> list[Row]:
    """Seconds that a fresh Python takes to start, empty and with the package imported."""
    jobs = {
        "python": "pass",
        "python, import clothsim": "import clothsim",
        "python, from clothsim import simulate": "from clothsim import simulate",
    }
    rows = []
    for name, code in jobs.items():
        times = []
        for _ in range(repeats):
            start = perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            times.append(perf_counter() - start)
        rows.append(Row(f"start of {name}", median(times), "s"))
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(prog="python -m clothsim.study.bench", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="40x40 only")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there too")
    arguments = parser.parse_args(argv)
    result = bench(cells=(40,)) if arguments.quick else bench()
    print(result.as_text())
    if arguments.json:
        arguments.json.write_text(to_json(asdict(result), indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
