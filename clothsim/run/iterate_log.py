"""Log of the Newton iterates of one step, for the analysis of a solve.

`iterates_STEP.npz` is a NumPy archive (no pickle). A step is solved once or, after failures, several times:
  dts (s,)                  length of the step in each solve [s]
  solve (k,)                solve of each iterate, 0..s-1; its first iterate is the start
  positions (k, N, 3)       all rows of x: cloths, bodies, ghosts [m], relative to `world.origin`
  fraction (k,)             fraction of the Newton step that contact and line search allowed; 0 at a start, nan after a
                            nonlinear elimination (`solve.nonlinear_elimination`)
  speed (k,)                |dx|_inf / dt of that full step [m/s]; nan at a start and after an elimination
  residual (k,)             largest force where that step began [N]; nan also while Dirichlet vertices are displaced
  energy (k,)               E(x) of the step [J]
"""

from collections import deque
from io import BytesIO
from pathlib import Path

import numpy as np

from clothsim.base.file_writing import write_atomically
from clothsim.solve.newton.observer import Iterate, Observer, unobserved
from clothsim.solve.newton.potential import Potential

MOST_BYTES = 1 << 29
"""Bound on the logged positions, 512 MiB: beyond it the first iterates are dropped."""


def iterates_name(step: int) -> str:
    """Return the file name of a step."""
    return f"iterates_{step}.npz"


class IterateLog:
    """Log of the iterates of step number `step` (from 1); `watch` goes to an Integrator."""

    def __init__(self, step: int) -> None:
        self.step = step
        self._dts: list[float] = []
        self._logged: deque[tuple[int, Iterate, float]] = deque()

    def watch(self, step: int, dt: float, potential: Potential) -> Observer:
        """Return the observer of a solve: this log for its own step."""
        if step != self.step:
            return unobserved
        self._dts.append(dt)
        solve = len(self._dts) - 1

        def observe(iterate: Iterate) -> None:
            # not `potential.value`, whose timers count the run's own evaluations
            energy = sum(energy.value(iterate.x) for energy in potential.acting.values())
            self._logged.append((solve, iterate, float(energy)))
            if len(self._logged) * iterate.x.nbytes > MOST_BYTES:
                self._logged.popleft()

        return observe

    def write(self, directory: Path) -> None:
        """Write the file into `directory`; InputError where that fails."""
        content = BytesIO()
        np.savez(
            content,
            dts=np.array(self._dts),
            solve=np.array([solve for solve, _, _ in self._logged], np.int64),
            positions=np.array([iterate.x for _, iterate, _ in self._logged]),
            fraction=np.array([iterate.fraction for _, iterate, _ in self._logged]),
            speed=np.array([iterate.speed for _, iterate, _ in self._logged]),
            residual=np.array([iterate.residual for _, iterate, _ in self._logged]),
            energy=np.array([energy for _, _, energy in self._logged]),
        )
        write_atomically(directory / iterates_name(self.step), content.getvalue())
