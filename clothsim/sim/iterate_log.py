"""The Newton iterates of one step, kept and written: to see how a solve went, or where it got stuck.

`iterates_STEP.npz` is a NumPy archive (no pickle). A step is solved once or, after failures, several times:
  dts (s,)                  length of the step in each solve [s]
  solve (k,)                the solve that each iterate belongs to, 0..s-1; its first iterate is where it started
  positions (k, N, 3)       all rows of x: cloths, bodies, ghosts [m], from the world's `origin` (see `mesh.origin`)
  fraction (k,)             share of the Newton step that led there which contact and line search allowed; 0 at a start,
                            nan where a few vertices were brought to rest by themselves (`solve.region`)
  speed (k,)                |dx|_inf / dt of that whole step [m/s]; nan at a start and there
  residual (k,)             largest force where that step began [N]; nan also where bodies or pins are carried
  energy (k,)               E(x) of the step [J]
"""

from collections import deque
from io import BytesIO
from pathlib import Path

import numpy as np

from clothsim.io.atomic import write_atomically
from clothsim.solve.observer import Iterate, Observer, unobserved
from clothsim.solve.potential import Potential

MOST_BYTES = 1 << 29
"""Of positions that are kept, 512 MiB: beyond it the first iterates are let go."""


def iterates_name(step: int) -> str:
    """The name of the file of a step."""
    return f"iterates_{step}.npz"


class IterateLog:
    """Gathers the iterates of step number `step` (from 1). `watch` is an Integrator's."""

    def __init__(self, step: int) -> None:
        self.step = step
        self._dts: list[float] = []
        self._kept: deque[tuple[int, Iterate, float]] = deque()

    def watch(self, step: int, dt: float, potential: Potential) -> Observer:
        """Who observes a solve of a step: this log where it is its step."""
        if step != self.step:
            return unobserved
        self._dts.append(dt)
        solve = len(self._dts) - 1

        def observe(iterate: Iterate) -> None:
            # Not by `potential.value`: the receipt counts the run's own evaluations.
            energy = sum(energy.value(iterate.x) for energy in potential.acting.values())
            self._kept.append((solve, iterate, float(energy)))
            if len(self._kept) * iterate.x.nbytes > MOST_BYTES:
                self._kept.popleft()

        return observe

    def write(self, directory: Path) -> None:
        """Write the file into `directory`. InputError where that cannot be done."""
        content = BytesIO()
        np.savez(
            content,
            dts=np.array(self._dts),
            solve=np.array([solve for solve, _, _ in self._kept], np.int64),
            positions=np.array([iterate.x for _, iterate, _ in self._kept]),
            fraction=np.array([iterate.fraction for _, iterate, _ in self._kept]),
            speed=np.array([iterate.speed for _, iterate, _ in self._kept]),
            residual=np.array([iterate.residual for _, iterate, _ in self._kept]),
            energy=np.array([energy for _, _, energy in self._kept]),
        )
        write_atomically(directory / iterates_name(self.step), content.getvalue())
