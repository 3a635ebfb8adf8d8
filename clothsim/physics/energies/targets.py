"""Soft targets of every vertex in each frame: the effect `targets`.

    E = r^2/2 sum m |x - c(t)|^2        [J]

r [1/s] is the rate at which a mass m is drawn; c is the position at the start displaced by what an array has for each
frame, linear in between. The cloth follows a recorded motion within forces of its own: a pin prescribes a path, a
target only draws.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, as_finite
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Targets
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import ElementHessian, diagonal_hessian
from clothsim.physics.energies.protocols import Anchored, Driven, Elementwise, NoPastSensitivity


@dataclass(frozen=True)
class TargetsEnergy(Elementwise, Anchored, Driven, Energy, NoPastSensitivity):
    """E = sum k/2 |x - c|^2.

    Parameters
    ----------
    rows : (n, 1) int array
        Rows of x.
    stiffnesses : (n,) array
        r^2 m [N/m].
    start : (n, 3) array
        Positions at the start [m].
    displacements : (f, n, 3) or (f, 1, 3) array
        From the start, in each frame [m].
    frames_per_second : float
        [1/s].
    time : float
        Time of the targets [s].
    """

    rows: np.ndarray
    stiffnesses: Floats
    start: Floats
    displacements: Floats
    frames_per_second: float
    time: float = 0.0

    per_element = ("rows", "stiffnesses", "start")

    @property
    def drives(self) -> bool:
        """True where the targets move."""
        return bool((self.displacements != self.displacements[0]).any())

    @property
    def anchored_rows(self) -> np.ndarray:
        """The drawn vertices, (n,)."""
        return self.rows[:, 0]

    def begin(self, step: Step) -> Self:
        """A copy with the targets of the end of the step."""
        return replace(self, time=step.time + step.dt)

    def targets(self) -> Floats:
        """c at the time of the step, (n, 3) [m]; after the last frame that of the last."""
        frame = min(max(self.time * self.frames_per_second, 0.0), len(self.displacements) - 1.0)
        before = min(int(frame), max(len(self.displacements) - 2, 0))
        part, after = frame - before, min(before + 1, len(self.displacements) - 1)
        shift = (1 - part) * self.displacements[before] + part * self.displacements[after]
        return self.start + (shift if len(shift) == 1 else shift[self.rows[:, 0]])

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        return float(0.5 * self.stiffnesses @ (self._lines(x) ** 2).sum(axis=1))

    def gradient(self, x: Floats) -> Floats:
        """r^2 m (x - c), (N, 3) [N]."""
        gradient = np.zeros_like(x)
        gradient[self.rows[:, 0]] = self.stiffnesses[:, None] * self._lines(x)
        return gradient

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """r^2 m I of each vertex [N/m]."""
        return diagonal_hessian(self.rows, self.stiffnesses)

    def _lines(self, x: Floats) -> Floats:
        return x[self.rows[:, 0]] - self.targets()


def targets(world: World, keys: Targets) -> Energy | Off:
    """Soft targets of all cloth vertices; off where the rate is 0 or there are no displacements.

    Raises
    ------
    InputError
        For displacements of another shape.
    """
    if keys.rate == 0 or not np.size(keys.displacements):
        return Off("rate is 0" if keys.rate == 0 else "there are no displacements")
    found = as_finite("effects.targets.displacements", keys.displacements).astype(np.float64)
    n = world.n_cloth
    if found.ndim != 3 or found.shape[1] not in (1, n) or found.shape[2] != 3:
        raise InputError(
            f"effects.targets.displacements has shape {found.shape}.",
            f"Give (frames, {n}, 3), or (frames, 1, 3) for a displacement of all vertices.",
        )
    rows, start = np.arange(n)[:, None], world.start()[:n]
    return TargetsEnergy(rows, keys.rate**2 * world.masses, start, found, keys.frames_per_second)


_MOVE = np.array([[[0.0, 0.1, 0.0]], [[0.2, 0.1, -0.3]]])
EXAMPLE = Example(keys={"displacements": _MOVE, "rate": 2.0}, zero={"rate": 0}, external=True)
