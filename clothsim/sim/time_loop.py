"""Time loop: the steps of a run from frame to frame."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clothsim.sim.state import State
from clothsim.sim.stepping import Integrator, StepReport, advance


def steps(integrator: Integrator, state: State, duration: float, frames_per_second: float) -> Iterator[StepReport]:
    """Generate the steps from `state` to `duration` [s]; each frame falls on the end of a step.

    Yields
    ------
    StepReport
        The last one may be of a step that failed.
    """
    frames = max(1, int(np.ceil(duration * frames_per_second - 1e-9)))
    while state.frame < frames:
        until = min((state.frame + 1) / frames_per_second, duration)
        report = advance(integrator, state, until)
        if report.converged and report.state.time == until:
            report = replace(report, frame_done=True, state=replace(report.state, frame=state.frame + 1))
        yield report
        if not report.converged:
            return
        state = report.state
