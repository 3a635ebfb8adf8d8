"""Soft targets over time, frames to which the cloth is drawn under contact: the effect `guide`.

E = k/2 sum m |x - y(t)|^2, y the frames, between them cubic in time with central differences for slopes (Catmull and
Rom 1974), so that a free fall is met exactly. Without other forces a vertex swings about its
target with the frequency sqrt(k) / (2 pi), and under an acceleration a it stays a/k aside: at k = 1e4 / s2 its own
weight moves it by 1 mm. Contact, which no energy outweighs, keeps what the frames do not: cloth apart from cloth.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Guide
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example
from clothsim.physics.energies.hessians import (
    ElementHessian,
    diagonal_hessian,
    every_vertex,
    weighted_difference,
    weighted_square,
)
from clothsim.physics.energies.protocols import Anchored, Driven, Elementwise, PastSensitivity, SeesPast


@dataclass(frozen=True)
class GuideEnergy(Elementwise, Energy, Anchored, Driven, SeesPast):
    """E = sum k m |x - y|^2 / 2.

    Parameters
    ----------
    rows : (n, 1) int array
        Rows of x.
    stiffnesses : (n,) array
        k m [N/m].
    target : (n, 3) array
        y at the end of the step [m].
    frames : (f, n, 3) array
        y at the times 0, 1/rate, 2/rate, ...; the last one holds [m].
    rate : float
        [1/s].
    """

    rows: Ints
    stiffnesses: Floats
    target: Floats
    frames: Floats
    rate: float

    per_element = ("rows", "stiffnesses", "target")

    @property
    def drives(self) -> bool:
        """True where the frames differ."""
        return len(self.frames) > 1

    @property
    def anchored_rows(self) -> Ints:
        """All vertices, (n,)."""
        return self.rows[:, 0]

    def begin(self, step: Step) -> Self:
        """A copy with the targets of the end of the step."""
        return replace(self, target=between(self.frames, (step.time + step.dt) * self.rate)[self.rows[:, 0]])

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        return weighted_square(self.rows, self.stiffnesses, x, self.target) / 2

    def gradient(self, x: Floats) -> Floats:
        """k m (x - y), (N, 3) [N]."""
        return weighted_difference(self.rows, self.stiffnesses, x, self.target)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """k m on the diagonal [N/m]."""
        return self._hessian

    def past_sensitivity(self, step: Step, x: Floats, adjoint: Floats) -> PastSensitivity:
        """Zero: the targets are functions of time."""
        return PastSensitivity()

    @cached_property
    def _hessian(self) -> ElementHessian:
        return diagonal_hessian(self.rows, self.stiffnesses)


def between(frames: Floats, at: float) -> Floats:
    """Positions (n, 3) at a time counted in frames (f, n, 3), which are held beyond their ends.

    Examples
    --------
    >>> import numpy as np
    >>> squares = np.arange(5.0)[:, None, None] ** 2
    >>> [float(between(squares, at)[0, 0]) for at in (-1.0, 0.5, 1.5, 3.75, 9.0)]
    [0.0, 0.25, 2.25, 14.0625, 16.0]
    """
    last = len(frames) - 1
    at = min(max(at, 0.0), float(last))
    k = min(int(at), max(last - 1, 0))
    t, first, second = at - k, frames[k], frames[min(k + 1, last)]
    if last < 2:
        return np.asarray(first + t * (second - first), np.float64)
    before = frames[k - 1] if k > 0 else 3 * first - 3 * second + frames[2]
    after = frames[k + 2] if k + 2 <= last else 3 * second - 3 * first + before
    slopes = (second - before) / 2, (after - first) / 2
    cubic = (1 + 2 * t) * (1 - t) ** 2 * first + t * (1 - t) ** 2 * slopes[0]
    return np.asarray(cubic + t * t * (3 - 2 * t) * second - t * t * (1 - t) * slopes[1], np.float64)


def guide(world: World, keys: Guide) -> Energy | Off:
    """The pull of the frames on all cloths; off where there are none, or the strength is 0.

    Raises
    ------
    InputError
        The frames are no array (f, n, 3) of finite numbers, n the vertices of all cloths.
    """
    if keys.strength == 0 or not len(keys.frames):
        return Off("there is no frame" if keys.strength else "strength is 0")
    try:
        frames = np.asarray(keys.frames, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"effects.guide.frames must be numbers: {error}.") from error
    n = world.n_cloth
    if frames.ndim != 3 or frames.shape[1:] != (n, 3) or not len(frames):
        remedy = f"Give (frames, {n}, 3): positions of the {n} vertices of the cloths in each frame."
        raise InputError(f"effects.guide.frames has the shape {frames.shape}.", remedy)
    if not np.isfinite(frames).all():
        at = np.argwhere(~np.isfinite(frames))[0]
        raise InputError(f"effects.guide.frames[{at[0]}, {at[1]}] is not finite.", "Give each vertex a position.")
    frames = frames - world.origin
    return GuideEnergy(every_vertex(n), keys.strength * world.masses[:n], frames[0], frames, keys.frames_per_second)


_FRAMES = np.random.default_rng(7).uniform(-0.5, 0.5, (3, 25, 3)).round(3)
EXAMPLE = Example(
    keys={"frames": _FRAMES[:, :12].tolist(), "strength": 3.0},
    in_scene={"frames": _FRAMES.tolist(), "strength": 3.0},
    zero={"frames": _FRAMES.tolist(), "strength": 0},
    external=True,
)
