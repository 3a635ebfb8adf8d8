"""Predicted garment of a moving scene, frame by frame: certified as it is, repaired, or simulated.

A model predicts the garment in each frame, and the exact test checks it. Where it intersects, or a piece is inside a
body, the frame is repaired: the prediction a moment earlier is untangled, and one step of backward Euler leads from
there to the frame. The inertia of that step is the soft target: with the velocity of the prediction its minimum
without other forces is the prediction itself, and contact keeps the step free of intersections. Where that fails in
`newton` iterations, the frame is simulated from the last one that was accepted, or else from the start of the scene.

Each frame that is yielded is free of intersections by the exact test. Nothing is said of what is between two frames:
frames that were predicted do not follow from one another.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from time import process_time

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.geometry.untangling.untangle import untangle
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.checked_garment import Prediction
from clothsim.scene.assembly.moving_garment import MotionModel, MovingGarment
from clothsim.scene.assembly.scene_world import build
from clothsim.solve.stepping.integrators import BACKWARD_EULER
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import Integrator, advance

CERTIFIED, REPAIRED, SIMULATED = "certified", "repaired", "simulated"
NEWTON = 30
"""Newton iterations that a repair may take."""
ROUNDS = 60
"""Rounds of untangling that a repair may take."""
EARLIER = 0.01
"""Time before a frame at which its repair begins [s]."""


@dataclass(frozen=True, eq=False)
class CheckedFrame:
    """A frame of a predicted motion.

    Attributes
    ----------
    time : float
        [s].
    verdict : {"certified", "repaired", "simulated"}
    cloth : (k, 3) ndarray
        Positions of all cloths [m], free of intersections.
    bodies : tuple of (b, 3) ndarray
        [m].
    predicted : Prediction
        What the model predicted, and the verdict of the exact test on that.
    seconds : dict of str to float
        Processor time of "prediction", "test", "repair" and "simulation" [s].
    newton_iterations : int
        Of the repair and the simulation.
    """

    time: float
    verdict: str
    cloth: Floats
    bodies: tuple[Floats, ...]
    predicted: Prediction
    seconds: dict[str, float] = field(default_factory=dict)
    newton_iterations: int = 0


def checked_motion(
    garment: MovingGarment, model: MotionModel, duration: float | None = None, newton: int = NEWTON
) -> Iterator[CheckedFrame]:
    """The frames of a scene's motion as a model predicts them, each with its verdict.

    Parameters
    ----------
    garment : MovingGarment
        Of the scene.
    model : MotionModel
    duration : float, optional
        Time of the last frame [s]; None: that of the scene.
    newton : int
        Newton iterations that a repair may take; 0: nothing is repaired.

    Raises
    ------
    InputError
        For a model of another garment or body, or where the scene itself cannot be simulated to a frame.
    """
    scene = replace(garment.scene, seed={})
    end = scene.run_settings.duration if duration is None else duration
    times = np.arange(round(end * model.rate) + 1) / model.rate
    began = process_time()
    canonical = garment.canonical(model, times)
    shared = (process_time() - began) / len(times)
    motion = _Motion(garment, model, times, canonical, prepare(scene, build(scene)), newton)
    for k in range(len(times)):
        frame = motion.checked(k)
        seconds = frame.seconds | {"prediction": frame.seconds["prediction"] + shared}
        yield replace(frame, seconds=seconds)


@dataclass(eq=False)
class _Motion:
    """Frames so far: positions of the last two, and the state after the last where that was simulated."""

    garment: MovingGarment
    model: MotionModel
    times: Floats
    canonical: Floats
    session: Session
    newton: int
    before: list[Floats] = field(default_factory=list)
    state: State | None = None

    def checked(self, k: int) -> CheckedFrame:
        """Frame k, after frame k - 1."""
        clock, time = process_time(), float(self.times[k])
        points = self.garment.posed(self.canonical[k], time, self.model.reference)
        bodies, predicted_at = self.garment.bodies(time), process_time()
        found = self.garment.surfaces.check(points, bodies)
        seconds = {"prediction": predicted_at - clock, "test": process_time() - predicted_at}
        verdict, cloth, iterations = CERTIFIED, points if found.clean else None, 0
        state = None
        if cloth is None and self.newton:
            clock = process_time()
            verdict, (cloth, iterations) = REPAIRED, self._repaired(k, bodies)
            seconds["repair"] = process_time() - clock
        if cloth is None:
            clock = process_time()
            state, more = self._simulated(k)
            verdict, iterations = SIMULATED, iterations + more
            cloth = state.positions[: len(points)] + self.session.built.world.origin
            seconds["simulation"] = process_time() - clock
        self.state, self.before = state, [*self.before[-1:], cloth]
        return CheckedFrame(time, verdict, cloth, bodies, found, seconds, iterations)

    def _repaired(self, k: int, bodies: tuple[Floats, ...]) -> tuple[Floats | None, int]:
        """Positions of frame k by a step from the untangled prediction before it, None where that fails; iterations."""
        if k == 0:
            return None, 0
        world, time = self.session.built.world, float(self.times[k])
        share = min(1.0, EARLIER * self.model.rate)
        earlier = time - share / self.model.rate
        canonical = (1 - share) * self.canonical[k] + share * self.canonical[k - 1]
        start = self.garment.posed(canonical, earlier, self.model.reference) - world.origin
        n, at = world.n_cloth, self._rows(start, earlier)
        edges = np.concatenate([np.zeros((len(world.triangles), 2, 1)), world.rest_shapes], axis=2).transpose(0, 2, 1)
        body = (at[n:], world.body_triangles - n) if len(world.body_triangles) else None
        free = untangle(start, world.triangles, material=edges, body=body, rounds=ROUNDS)
        if not free.free:
            return None, 0
        points = self.garment.posed(self.canonical[k], time, self.model.reference) - world.origin
        at[:n] = free.positions
        velocities = np.zeros_like(at)
        velocities[:n] = (points - start) / (time - earlier)
        integrator = self.session.integrator
        brief = replace(
            integrator,
            formula=BACKWARD_EULER,
            settings=replace(integrator.settings, max_iterations=self.newton),
            control=None,
        )
        state = State(earlier, time - earlier, 0, 0, at, velocities)
        report = advance(brief, state, time, retries=False)
        iterations = report.result.iterations
        if report.failure is not None:
            return None, iterations
        made = report.state.positions[:n] + world.origin
        return (made if self.garment.surfaces.check(made, bodies).clean else None), iterations

    def _simulated(self, k: int) -> tuple[State, int]:
        """The state at frame k by steps from the last frame, or else from the start of the scene; iterations."""
        integrator, time = self.session.integrator, float(self.times[k])
        world, first = self.session.built.world, first_state(self.session.built.world, integrator.dt)
        starts = [first]
        if self.state is not None:
            starts = [self.state, first]
        elif self.before:
            at = self._rows(self.before[-1] - world.origin, float(self.times[k - 1]))
            velocities = np.zeros_like(at)
            if len(self.before) > 1:
                velocities[: world.n_cloth] = (self.before[-1] - self.before[-2]) * self.model.rate
            starts = [State(float(self.times[k - 1]), integrator.dt, 0, 0, at, velocities), first]
        iterations, why = 0, ""
        for start in starts:
            state, more, why = _stepped(integrator, start, time)
            iterations += more
            if not why:
                cloth = state.positions[: world.n_cloth] + world.origin
                if self.garment.checked(cloth, time).clean:
                    return state, iterations
                why = "It intersects."
        raise InputError(f"The scene cannot be simulated to {time:.3g} s: {why}", "See `clothsim run`.")

    def _rows(self, cloth: Floats, time: float) -> Floats:
        """All rows of x with the cloths (k, 3) and the bodies at a time."""
        world = self.session.built.world
        return np.concatenate([cloth, *(body.at(time) for body in world.bodies), world.ghosts])


def _stepped(integrator: Integrator, state: State, until: float) -> tuple[State, int, str]:
    """The state at a time, the iterations to it, and why it was not reached; empty where it was."""
    iterations = 0
    while state.time < until - 1e-9:
        report = advance(integrator, state, until)
        iterations += report.result.iterations
        if report.failure is not None:
            return state, iterations, report.failure.reason
        state = report.state
    return state, iterations, ""
