"""Run that keeps its steps, and goes backwards over them for the gradient of a loss."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from clothsim.base.arrays import Floats, as_points
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.process_memory import Stopwatch
from clothsim.gradients.backward_pass import backward_pass
from clothsim.gradients.differentiable_session import (
    RecordedStep,
    differentiable_session,
    forward,
    recorded,
    stiffness_of,
    with_stiffness,
)
from clothsim.gradients.exact_system import MOST_STEPS
from clothsim.gradients.gradient import Gradient
from clothsim.gradients.losses import Function, Loss, OfMotion, as_loss
from clothsim.run.certificate import Certificate
from clothsim.run.recorded_run import Announcement, Listener, StepListener, recorded_run
from clothsim.run.results import Run
from clothsim.run.resume import new_output
from clothsim.run.session import Session, prepare
from clothsim.scene import paths
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import StepReport


@dataclass(frozen=True, eq=False)
class Trace:
    """The steps of a run, over which gradients go backwards.

    Attributes
    ----------
    session : Session
        The scene as it was stepped, contact stiffnesses held.
    steps : tuple of RecordedStep
        All steps.
    """

    session: Session
    steps: tuple[RecordedStep, ...]

    @cached_property
    def stiffness(self) -> Mapping[str, float]:
        """The stiffness of each contact [Pa], held over the run, by effect."""
        return stiffness_of(self.session.built.energies)

    @property
    def held_scene(self) -> Scene:
        """The scene with the stiffness of each contact as it is held here.

        The gradient is that of this scene. One of another run with `stiffness = "auto"` is compared only with the
        stiffness of this one: its own would be another number, by a rule that the gradient leaves out.
        """
        return with_held(self.session.scene, self.stiffness)

    @cached_property
    def frame_states(self) -> tuple[int, ...]:
        """For each frame the number of steps done at it."""
        ends = [k + 1 for k, step in enumerate(self.steps) if step.end.frame > step.start.frame]
        return (0, *ends)

    def cloth_positions(self, frame: int = -1) -> Floats:
        """Return the vertices of all cloths in a frame, in double precision, (n, 3) [m]."""
        world = self.session.built.world
        return self._state(frame).positions[: world.n_cloth] + world.origin

    def cloth_velocities(self, frame: int = -1) -> Floats:
        """Return the velocities of all cloth vertices in a frame, (n, 3) [m/s]."""
        return self._state(frame).velocities[: self.session.built.world.n_cloth]

    def gradient(self, loss: Loss | Function | Sequence[Loss]) -> Gradient:
        """Return the gradient of a loss by everything that the run was given.

        Parameters
        ----------
        loss : Loss, function or sequence of Loss
            A loss of `clothsim.gradients.losses`; a function of the positions (n, 3) [m] of the last frame that returns
            the loss and its derivative (n, 3); or losses to sum.

        Raises
        ------
        NoMinimumError
            If a step did not end at a minimum of its energy.
        InputError
            For a loss that does not fit the cloth.
        """
        world = self.session.built.world
        total, by_positions, by_velocities = 0.0, dict[int, Floats](), dict[int, Floats]()
        for each in loss if isinstance(loss, Sequence) else [loss]:
            one = as_loss(each)
            x, number = self.cloth_positions(one.frame), self._state_of(one.frame)
            if isinstance(one, OfMotion):
                value, derivative, by_v = one.of_motion(x, self.cloth_velocities(one.frame))
                rows = by_velocities.setdefault(number, np.zeros((world.n_vertices, 3)))
                rows[: world.n_cloth] += by_v
            else:
                value, derivative = one.evaluate(x, world.triangles)
            rows = by_positions.setdefault(number, np.zeros((world.n_vertices, 3)))
            rows[: world.n_cloth] += derivative
            total += value
        return Gradient(self, total, backward_pass(self.session.integrator, self.steps, by_positions, by_velocities))

    def _state(self, frame: int) -> State:
        number = self._state_of(frame)
        return self.steps[number - 1].end if number else self.steps[0].start

    def _state_of(self, frame: int) -> int:
        states = self.frame_states
        if not -len(states) <= frame < len(states):
            raise InputError(f"The loss is for frame {frame}, and the run has {len(states)}.")
        return states[frame]


@dataclass(frozen=True, repr=False, eq=False)
class DifferentiableRun(Run):
    """A run with the trace of its steps.

    Attributes
    ----------
    trace : Trace
        Its steps in double precision.

    Examples
    --------
    The derivative of the mean height of a sheet that hangs from two corners, with respect to its stiffness and start:

    >>> import clothsim
    >>> from clothsim.gradients.losses import Height
    >>> scene = clothsim.Scene(
    ...     cloth={"mesh": "rectangle", "size": [0.3, 0.3], "cells": [3, 3], "youngs_modulus": 1e4},
    ...     effects=[clothsim.Inertia(), clothsim.Membrane(), clothsim.Gravity(), clothsim.Pins(select=[0, 3])],
    ...     run=clothsim.RunSettings(duration=0.08),
    ... )
    >>> gradient = clothsim.simulate(scene, differentiable=True).gradient(Height())
    >>> bool(gradient["cloth.youngs_modulus"] > 0), gradient["start"].shape, abs(gradient.newton_error) < 1e-9
    (True, (16, 3), True)
    """

    trace: Trace

    def cloth_positions(self, frame: int = -1) -> Floats:
        """Return `Trace.cloth_positions`."""
        return self.trace.cloth_positions(frame)

    def gradient(self, loss: Loss | Function | Sequence[Loss]) -> Gradient:
        """Return `Trace.gradient`."""
        return self.trace.gradient(loss)


def with_held(scene: Scene, stiffness: Mapping[str, float]) -> Scene:
    """Return the scene with the stiffness of contacts [Pa] by effect in place of the rule that chooses it."""
    for name, kappa in stiffness.items():
        scene = paths.replace(scene, f"effects.{name}.stiffness", kappa)
    return scene


def traced(
    scene: Scene,
    stiffness: Mapping[str, float] | None = None,
    polish: int = MOST_STEPS,
    start: Mapping[str, Floats] | None = None,
) -> Trace:
    """Simulate a scene without output.

    Parameters
    ----------
    scene : Scene
    stiffness : mapping, optional
        Contact stiffnesses to hold [Pa], by effect; None: those of a pilot run.
    polish : int
        As in `simulate_differentiably`.
    start : mapping, optional
        `start` and `velocity` of the cloth in place of those of the scene, (n, 3) [m], [m/s].
    """
    scene.refuse_without_cloth("a gradient")
    session = prepare(scene, build(scene, affordable=True))
    session = differentiable_session(with_stiffness(session, stiffness) if stiffness else session, polish)
    return Trace(session, tuple(forward(session, begun(session, start or {}))))


def begun(session: Session, given: Mapping[str, Floats]) -> State:
    """Return the first state of a session with `start` and `velocity` (n, 3) of its cloth, where they are given."""
    world, state = session.built.world, first_state(session.built.world, session.integrator.dt)
    parts = {"start": state.positions.copy(), "velocity": state.velocities.copy()}
    for name, value in given.items():
        rows = as_points(name, value)
        if len(rows) != world.n_cloth:
            raise InputError(f"{name} has {len(rows)} rows, the cloth {world.n_cloth} vertices.")
        parts[name][: world.n_cloth] = rows - world.origin if name == "start" else rows
    return replace(state, positions=parts["start"], velocities=parts["velocity"])


def simulate_differentiably(
    scene: Scene,
    output: str | Path | None = None,
    progress: Listener | None = None,
    announce: Announcement | None = None,
    on_step: StepListener | None = None,
    message: Callable[[str], None] | None = None,
    overwrite: bool = False,
    polish: int = MOST_STEPS,
) -> DifferentiableRun:
    """Simulate a scene to its end and keep its steps, for `DifferentiableRun.gradient`.

    Parameters
    ----------
    scene, output, progress, announce, on_step, message, overwrite
        As in `clothsim.simulate`.
    polish : int
        Newton steps with the exact Hessian after each solve, at most; 0: none.

    Raises
    ------
    InputError
        For what has no gradient, by its name.
    ClothsimError
        If the run fails.
    """
    started = Stopwatch()
    session = differentiable_session(prepare(scene, build(scene, affordable=True)), polish)
    for note in session.notes:
        if message is not None and "held at" in note:
            message(note)
    directory = Path(tempfile.mkdtemp(prefix="clothsim-") if output is None else output)
    state, steps = first_state(session.built.world, session.integrator.dt), list[RecordedStep]()

    def record(report: StepReport) -> None:
        steps.append(recorded(steps[-1].end if steps else state, report))

    with new_output(directory, overwrite):
        if announce is not None:
            announce(session)
        listeners = progress, on_step
        run = recorded_run(
            session, state, Certificate(), directory, started, listeners, None, resumed=False, on_report=record
        )
    if run.status != "completed":
        raise ClothsimError(f"The run failed, and has no gradient: {run.reason}")
    return DifferentiableRun(run.directory, run.trajectory, run.summary, Trace(session, tuple(steps)))
