"""Cost of gradients: the backward pass, and the polishing of steps, against the forward run.

`python -m tests.benchmarks.gradient_cost [--cells 40,100] [--json FILE]`. A sheet of 1 m falls on a ball with contact,
self contact and friction for .4 s. CPU seconds of one thread and one process, which alone can be compared: the forward
run as it is without `differentiable`, the same run with polished steps, the backward pass, and the derivatives by some
numbers of the scene once it is done.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time
from typing import TypeVar

from clothsim.base.errors import ClothsimError
from clothsim.base.record import to_json
from clothsim.base.text import text_table
from clothsim.gradients.differentiable_session import differentiable_session, forward, with_stiffness
from clothsim.gradients.losses import Height
from clothsim.gradients.run import Trace, traced
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.time_loop import steps

PATHS = "cloth.youngs_modulus", "effects.friction.coefficient"
EFFECTS = ("inertia", "membrane", "bending", "gravity", "body_contact", "self_contact")

Result = TypeVar("Result")


@dataclass(frozen=True)
class Cost:
    """CPU seconds of a scene of `cells` x `cells`; iterations: Newton's of the forward run."""

    cells: int
    steps: int
    iterations: int
    forward: float
    polished: float
    backward: float
    by_number: dict[str, float]

    @property
    def row(self) -> tuple[str, ...]:
        """The row of the table."""
        step, iteration = self.backward / self.steps, self.forward / self.iterations
        numbers = "/".join(f"{100 * each / self.forward:.0f} %" for each in self.by_number.values())
        return (
            f"{self.cells} x {self.cells}",
            f"{self.forward:.2f} s",
            f"{self.iterations / self.steps:.1f}",
            f"{100 * self.backward / self.forward:.0f} %",
            f"{step / iteration:.1f}",
            f"{100 * (self.polished / self.forward - 1):.0f} %",
            numbers,
        )


HEADS = ("cells", "forward", "iterations a step", "backward", "in iterations a step", "polishing", "by E / friction")


def drape(cells: int, duration: float = 0.4) -> Scene:
    """The sheet on the ball; steps are shorter above 40 x 40, where the buckling sheet else ends beside a saddle."""
    cloth = {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [cells, cells], "fabric": "cotton"}
    cloth |= {"position": [0.0, 0.0, 0.305], "rotation_degrees": [2.0, 1.0, 11.0]}
    effects = {name: dict[str, float]() for name in EFFECTS} | {"friction": {"eps_v": 5e-3}}
    return Scene(
        cloth=cloth,
        body={"name": "ball", "mesh": "sphere", "radius": 0.3},
        effects=effects,
        solver={"dt": min(0.01, 0.4 / cells), "threads": 1, "tolerance": 1e-3},
        run={"duration": duration, "frames_per_second": 25},
    )


def cost(cells: int, duration: float = 0.4) -> Cost:
    """Measure one scene; a first differentiable run compiles, and tells the stiffness that is held."""
    scene = drape(cells, duration)
    warm = traced(scene)
    warm.gradient(Height())

    def session(polish: int) -> Session:
        return differentiable_session(with_stiffness(prepare(scene, build(scene)), warm.stiffness), polish)

    plain, finished = session(0), session(8)
    iterations, plain_seconds = _timed(lambda: _iterations(plain))
    taken, polished = _timed(lambda: tuple(forward(finished, _start(finished))))
    gradient, backward = _timed(lambda: Trace(finished, taken).gradient(Height()))
    by_number = {path: _timed(lambda path=path: gradient[path])[1] for path in PATHS}  # type: ignore[misc]
    return Cost(cells, len(taken), iterations, plain_seconds, polished, backward, by_number)


def _iterations(session: Session) -> int:
    run, state, total = session.scene.run_settings, _start(session), 0
    for report in steps(session.integrator, state, run.duration, run.frames_per_second, run.until):
        if report.failure is not None:
            raise ClothsimError(report.failure.sentence)
        total += report.result.iterations
    return total


def _start(session: Session) -> State:
    return first_state(session.built.world, session.integrator.dt)


def _timed(job: Callable[[], Result]) -> tuple[Result, float]:
    started = process_time()
    result = job()
    return result, process_time() - started


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Cost of gradients against the forward run.")
    parser.add_argument("--cells", default="40", help="40,100 (default 40)")
    parser.add_argument("--duration", type=float, default=0.4, help="seconds (default 0.4)")
    parser.add_argument("--json", type=Path, help="keep the numbers in a file")
    arguments = parser.parse_args(argv)
    costs = [cost(int(cells), arguments.duration) for cells in arguments.cells.split(",")]
    print(text_table(HEADS, [each.row for each in costs]))
    if arguments.json is not None:
        arguments.json.write_text(to_json([asdict(each) for each in costs]), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
