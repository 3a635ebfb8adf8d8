"""Cost ladder: cost that each effect adds to a step, on one mesh, from one state.

`python -m tests.benchmarks.ladder [--cells N] [--page FILE] [--picture FILE]`.
A sheet falls on a ball with every rung
on. From the state that it is in then, each rung takes the same steps, several times: the fastest counts, on one thread.
Each rung solves a different problem: the times compare costs, not results.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from time import perf_counter
from typing import Any

from clothsim.base.errors import ClothsimError
from clothsim.base.text import text_table
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import Built, build
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import advance
from tests.benchmarks.stored_tables import markdown_table, write_between

MARK = "ladder"
GROUND = ("inertia", "membrane")
ORDER = ("bending", "gravity", "body_contact", "friction", "self_contact", "air", "strain_limit")
"""The first rungs; every other effect of the table that can act on a sheet over a ball follows, in its order."""
LINE = [[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]
DART = [[-0.5, -0.45, 0.0], [-0.5, -0.2, 0.0]], [[-0.45, -0.5, 0.0], [-0.2, -0.5, 0.0]]
KEYS: Mapping[str, Mapping[str, Any]] = {
    "pins": {"select": "corners"},
    "fibres": {"warp": 20.0, "weft": 20.0},
    "pressure": {"value": 0.5},
    "springs": {"spring": [{"select": "corners", "stiffness": 1.0}]},
    "rest_angle": {"crease": [{"through": LINE, "angle_degrees": 20.0}]},
    "plastic_bending": {"yield_angle_degrees": 5.0},
    "seams": {"seam": [{"from": {"through": DART[0]}, "to": {"through": DART[1]}, "end": 5.0}]},
}
"""Keys of effects that have nothing to do without."""
SOLVE, ASSEMBLY, CONTROL = "linear solve", "assembly", "line search, control"
PHASES = (SOLVE, ASSEMBLY, CONTROL)


@dataclass(frozen=True)
class Rung:
    """An effect added to those before it: milliseconds and Newton iterations a step, the non-zeros of the matrix (its
    upper triangle); parts: the milliseconds of each of PHASES and of each effect that is on.
    """

    name: str
    milliseconds: float
    iterations: float
    nonzeros: int
    parts: Mapping[str, float]


@dataclass(frozen=True)
class Ladder:
    """The rungs from the ground up, the cells along the sheet, the day, and {effect that is no rung: why}."""

    rungs: tuple[Rung, ...]
    cells: int
    day: str
    left_out: Mapping[str, str]


def sheet_on_ball(cells: int, effects: Sequence[str]) -> Scene:
    """A metre of cotton just above a ball of .3 m."""
    place = (0.0, 0.0, 0.3 + 0.2 / cells)
    return Scene(
        cloth={"mesh": "rectangle", "size": (1.0, 1.0), "cells": (cells, cells), "position": place},
        body={"name": "ball", "mesh": "sphere", "radius": 0.3},
        effects={name: KEYS.get(name, {}) for name in effects},
        solver={"threads": 1},
        run={"duration": 1.0},
    )


def climb(cells: int = 40, steps: int = 3, lead: int = 25, repeats: int = 4) -> Ladder:
    """`lead` steps with every rung, then from there `steps` with the first, the first two, ...: `repeats` times.

    Rungs take turns, and the fastest try of each counts: what else the machine does is no cost of theirs.
    """
    names, left_out = _rungs(cells)
    sets = [names[:count] for count in range(len(GROUND), len(names) + 1)]
    sessions = [_session(cells, effects) for effects in sets]
    state = first_state(sessions[-1].built.world, sessions[-1].integrator.dt)
    for _ in range(lead):
        state = _step(sessions[-1], state)[0]
    for session in sessions:
        _taken(session, state, 1)  # loads, compiles, analyses
    tries = [[_taken(session, state, steps) for session in sessions] for _ in range(repeats)]
    rungs = []
    for effects, session, seen in zip(sets, sessions, zip(*tries, strict=True), strict=True):
        iterations, seconds = min(seen, key=lambda one: sum(one[1].values()))
        parts = {part: 1e3 * spent / steps for part, spent in seconds.items()}
        nonzeros = session.integrator.system.pattern.nonzeros
        name = " + ".join(GROUND) if effects == sets[0] else effects[-1]
        rungs.append(Rung(name, sum(parts.values()), iterations / steps, nonzeros, parts))
    return Ladder(tuple(rungs), cells, date.today().isoformat(), left_out)


def _rungs(cells: int) -> tuple[list[str], dict[str, str]]:
    """The effects in their order, and why others are no rungs."""
    names, left_out = list(GROUND), {}
    for name in (*ORDER, *(name for name in EFFECTS if name not in (*GROUND, *ORDER))):
        built = _built(cells, [*names, name])
        if name in built.energies:
            names.append(name)
        else:
            left_out[name] = built.off.get(name, "a constraint on vertices")
    return names, left_out


def _built(cells: int, effects: Sequence[str]) -> Built:
    return build(sheet_on_ball(cells, effects))


def _session(cells: int, effects: Sequence[str]) -> Session:
    scene = sheet_on_ball(cells, effects)
    return prepare(scene, build(scene))


def _step(session: Session, state: State) -> tuple[State, int]:
    dt = session.integrator.dt
    report = advance(session.integrator, replace(state, dt=dt), state.time + dt)
    if report.failure is not None:
        raise ClothsimError(f"The ladder cannot step: {report.failure.reason}")
    return report.state, report.result.iterations


def _taken(session: Session, state: State, steps: int) -> tuple[int, dict[str, float]]:
    """Newton iterations of some steps, and their seconds: of PHASES and of each effect, together all of them."""
    before, started, iterations = _booked(session), perf_counter(), 0
    for _ in range(steps):
        state, moved = _step(session, state)
        iterations += moved
    elapsed = perf_counter() - started
    spent = {name: seconds - before.get(name, 0.0) for name, seconds in _booked(session).items()}
    named = {name: spent[name] for name in (SOLVE, ASSEMBLY, *session.built.energies)}
    return iterations, {**named, CONTROL: elapsed - sum(named.values())}


def _booked(session: Session) -> dict[str, float]:
    timers = session.integrator.potential.timers
    return {**timers.phases, **{name: account.seconds for name, account in timers.effects.items()}}


HEADER = (
    "effects",
    "ms per step",
    "of which the added effect",
    "Newton iterations per step",
    "ms per iteration",
    "non-zeros of the matrix",
)


def cells_of(rung: Rung, first: bool) -> list[str]:
    """A line of the table."""
    own = sum(rung.parts[name] for name in GROUND) if first else rung.parts[rung.name]
    return [
        rung.name if first else f"+ {rung.name}",
        f"{rung.milliseconds:.1f}",
        f"{own:.1f}",
        f"{rung.iterations:.1f}",
        f"{rung.milliseconds / rung.iterations:.1f}",
        f"{rung.nonzeros:,}",
    ]


def lines(ladder: Ladder) -> list[list[str]]:
    """The table."""
    return [cells_of(rung, rung is ladder.rungs[0]) for rung in ladder.rungs]


def markdown(ladder: Ladder, picture: str = "") -> str:
    """Section of the README: the picture, where there is one, and the table."""
    left = ", ".join(f"{name} ({why})" for name, why in ladder.left_out.items())
    scene = f"a sheet of {ladder.cells}x{ladder.cells} cells on a ball, one thread"
    return "\n".join(
        [
            "<details><summary>Cost ladder: cost that each effect adds to a step</summary>",
            "",
            *([f"![Milliseconds a step, effect by effect]({picture})", ""] if picture else []),
            f"Measured on {ladder.day} with `python -m tests.benchmarks.ladder`: {scene}.",
            f"Every row starts from the same state.{f' Not in the table: {left}.' if left else ''}",
            "",
            markdown_table(HEADER, lines(ladder)),
            "",
            "</details>",
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Climb, print the table, and keep it where asked."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.ladder", description=__doc__.splitlines()[0])
    parser.add_argument("--cells", type=int, default=40, metavar="N", help="cells along the sheet (default 40)")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the table between FILE's marks")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw stacked bars (PNG)")
    arguments = parser.parse_args(argv)
    ladder = climb(arguments.cells)
    print(text_table(HEADER, lines(ladder)))
    if arguments.picture:
        from tests.benchmarks.ladder_picture import draw

        draw(ladder, arguments.picture)
    if arguments.page:
        shown = arguments.picture.as_posix() if arguments.picture else ""
        write_between(arguments.page, MARK, markdown(ladder, shown))
    return 0


if __name__ == "__main__":
    sys.exit(main())
