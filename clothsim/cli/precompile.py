"""The first run after an installation compiles for half a minute: a second process begins at the other end.

What a run needs is compiled in the order in which it comes, the search for intersections and contact first. This
process drapes a cloth of four cells without contact, derives the energy of two pairs that touch, and draws the cloth:
the energies, the Newton matrix, the derivatives of contact and the picture are then in the cache of compiled kernels
when the run comes to them. It ends by itself, and at once with a run that is stopped or killed: a pipe between them
closes. A run that comes to its end first lets it finish, for the next one.
"""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import TYPE_CHECKING

from clothsim.cli.compilation_notice import kernels_are_compiled
from clothsim.engine import available_cores

if TYPE_CHECKING:
    from clothsim.base.arrays import Floats
    from clothsim.engine import Pairs

_GO_ON = b"."

CORES = 2
"""Fewer cores gain nothing."""


def start() -> "subprocess.Popen[bytes] | None":
    """The process; None where the kernels are compiled, or where one core has to do it all."""
    if available_cores() < CORES or kernels_are_compiled():
        return None
    command = [sys.executable, "-P", "-m", "clothsim.cli.precompile"]  # -P: not one of the cwd
    here = os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")]))
    silent, environment = subprocess.DEVNULL, {**os.environ, "PYTHONPATH": here}
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=silent, stderr=silent, env=environment)


def let_finish(process: "subprocess.Popen[bytes]") -> None:
    """Let the process outlive this one."""
    if process.stdin is not None:
        with suppress(OSError):  # it has ended
            process.stdin.write(_GO_ON)
            process.stdin.flush()
    process.poll()


def end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, unless that one lets it finish."""
    Thread(target=_wait, daemon=True).start()


def _wait() -> None:
    if os.read(sys.stdin.fileno(), 1) != _GO_ON:
        os._exit(1)


def compile_remaining_kernels() -> None:
    """Step four cells, evaluate contact, then run them and draw: the run itself has compiled its check by then."""
    from clothsim import Scene, simulate
    from clothsim.engine import Certificate, build, draw_frame, first_state, next_step, prepare

    scene = Scene(
        cloth={"mesh": "rectangle", "size": (1.0, 1.0), "cells": (2, 2)},
        effects={
            "inertia": {},
            "membrane": {},
            "bending": {},
            "gravity": {},
            "damping": {},
            "pins": {"select": "left"},
        },
        solver={"dt": 0.1},
        run={"duration": 0.1, "frames_per_second": 10},
    )
    session = prepare(scene, build(scene))
    state = first_state(session.built.world, session.integrator.dt)
    report = next_step(session.integrator, state, 0.1, 10.0)
    Certificate().after(session.built.world, report, state)
    evaluate_contact()
    with TemporaryDirectory() as folder:
        draped = simulate(scene, folder)
        draw_frame(draped.trajectory, Path(folder) / "picture.png")


def evaluate_contact() -> None:
    """The energy of a point close to a triangle and of two edges, nearly parallel, and its derivatives in a matrix."""
    import numpy as np

    from clothsim.engine import Barrier, Candidates, Pairs, make_pattern

    class Known(Candidates):
        """Two given pairs at every x."""

        def __init__(self) -> None:
            """No surface, as nothing is searched."""

        def active(self, x: "Floats") -> "Pairs":
            elements = np.array([[3, 0, 1, 2], [0, 1, 3, 4]])
            return Pairs(elements, np.ones(2), np.array([0.0, 1.0]), np.arange(2), n_points=1)

    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0.5], [1.2, 0.5, 0.5]])
    nothing = np.zeros(0)
    barrier = Barrier(Known(), 1.0, 0.0, areas=nothing, masses=nothing, stiffness=1.0, adaptive=False)
    barrier.gradient(x)
    make_pattern(len(x), np.array([[0, 1, 2]]), []).assemble([barrier.hessian(x, project) for project in (True, False)])


if __name__ == "__main__":
    end_with_parent()
    compile_remaining_kernels()
