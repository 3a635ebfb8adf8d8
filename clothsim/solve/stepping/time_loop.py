"""Time loop: the steps of a run from frame to frame."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clothsim.solve.stepping.rest import with_rest
from clothsim.solve.stepping.state import State
from clothsim.solve.stepping.stepping import Integrator, StepReport, advance


def steps(
    integrator: Integrator, state: State, duration: float, frames_per_second: float, until: str = "time"
) -> Iterator[StepReport]:
    """Generate the steps from `state` to `duration` [s]; each frame falls on the end of a step.

    Parameters
    ----------
    integrator : Integrator
        Takes the steps.
    state : State
        Start.
    duration : float
        End [s].
    frames_per_second : float
        Frame rate [1/s].
    until : {"time", "rest"}
        "rest": the first frame at rest is the last one, if it comes before the end.

    Yields
    ------
    StepReport
        The last one may be of a step that failed.
    """
    while not finished(state, duration, frames_per_second, until):
        report = next_step(integrator, state, duration, frames_per_second)
        yield report
        if not report.converged:
            return
        state = report.state


def next_step(integrator: Integrator, state: State, duration: float, frames_per_second: float) -> StepReport:
    """One step from `state` towards the next frame; after `duration` [s] frames follow at the same rate."""
    until = (state.frame + 1) / frames_per_second
    if state.frame < frame_count(duration, frames_per_second):
        until = min(until, duration)
    if integrator.carries_pinched:
        from clothsim.solve.pinch.pinch import advance_carrying  # no other run imports it

        report, integrator = advance_carrying(integrator, state, until)
    else:
        report = advance(integrator, state, until)
    if report.converged and report.state.time == until:
        report = replace(report, frame_done=True, state=replace(report.state, frame=state.frame + 1))
    return with_rest(integrator, state, report, duration)


def finished(state: State, duration: float, frames_per_second: float, until: str = "time") -> bool:
    """True where `state` is the end of a run; parameters as of `steps`."""
    return state.frame >= frame_count(duration, frames_per_second) or (until == "rest" and state.at_rest)


def frame_count(duration: float, frames_per_second: float) -> int:
    """Number of frames after the start in a run of `duration` [s]."""
    return max(1, int(np.ceil(duration * frames_per_second - 1e-9)))
