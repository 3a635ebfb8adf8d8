"""Kernels of a run that its beginning does not need, compiled by the second process (`run.precompile`)."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.pair_list import Pairs
from clothsim.run.certificate import Certificate
from clothsim.run.pictures import draw_frame
from clothsim.run.precompile import end_with_parent
from clothsim.run.session import prepare
from clothsim.run.simulate import simulate
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.linear.sparsity import make_pattern
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.time_loop import next_step


def compile_remaining_kernels() -> None:
    """Step four cells, evaluate contact, then run them and draw: the run itself has compiled its check by then."""
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
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0.5], [1.2, 0.5, 0.5]])
    nothing = np.zeros(0)
    barrier = Barrier(_GivenPairs(), 1.0, 0.0, areas=nothing, masses=nothing, stiffness=1.0, adaptive=False)
    barrier.gradient(x)
    make_pattern(len(x), np.array([[0, 1, 2]]), []).assemble([barrier.hessian(x, project) for project in (True, False)])


class _GivenPairs(Candidates):
    """Two given pairs at every x."""

    def __init__(self) -> None:
        """No surface, as nothing is searched."""

    def read(self, x: Floats) -> Floats:
        """All rows."""
        return x

    def active(self, x: Floats) -> Pairs:
        elements = np.array([[3, 0, 1, 2], [0, 1, 3, 4]])
        return Pairs(elements, np.ones(2), np.array([0.0, 1.0]), np.arange(2), n_points=1)


if __name__ == "__main__":
    end_with_parent()
    compile_remaining_kernels()
