"""Runs and rollouts as functions of arrays, for packages that differentiate such functions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.gradients.differentiable_session import differentiable_session, stiffness_of
from clothsim.gradients.losses import Custom, Loss
from clothsim.gradients.parameters import value_at, with_value
from clothsim.gradients.run import Trace, traced
from clothsim.mesh.world import World
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene

if TYPE_CHECKING:
    from clothsim.gradients.layer import Layer, LayerState, Rollout

STARTS = ("start", "velocity")
"""Values of a bridge that are not numbers of the scene: positions and velocities of the cloth at the start, (n, 3)."""


class Differentiable(Protocol):
    """A function of arrays to arrays, with its derivative."""

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of what it returns."""

    def outputs(self, values: Sequence[Floats]) -> tuple[Floats, ...]:
        """Return the function."""

    def back(self, values: Sequence[Floats], cotangents: Sequence[Floats]) -> list[Floats]:
        """Return the derivatives of sum cotangents . outputs by each of the values."""


@dataclass(frozen=True)
class Bridge:
    """The map from numbers of a scene to positions of its cloths.

    Parameters
    ----------
    scene : Scene
        The scene; its other numbers are held.
    names : tuple of str
        Paths of the numbers, as "cloth.youngs_modulus"; and STARTS.
    frames : tuple of int
        Frames whose positions are returned.
    stiffness : mapping, optional
        Contact stiffnesses to hold in all runs [Pa], by effect; None: those of a run of the scene with its own
        numbers, whatever the numbers that it is called with.
    """

    scene: Scene
    names: tuple[str, ...]
    frames: tuple[int, ...] = (-1,)
    stiffness: Mapping[str, float] | None = None
    _last: list[tuple[bytes, Trace]] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """InputError for a name that is not a number: packages that call a bridge hide what is raised within it."""
        for name in self.names:
            if name not in STARTS:
                value_at(self.scene, self._world, name)

    @cached_property
    def _world(self) -> World:
        return build(self.scene, affordable=True).world

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Of the positions."""
        return ((len(self.frames), self._world.n_cloth, 3),)

    def outputs(self, values: Sequence[Floats]) -> tuple[Floats, ...]:
        """Return `positions`."""
        return (self.positions(values),)

    def back(self, values: Sequence[Floats], cotangents: Sequence[Floats]) -> list[Floats]:
        """Return `pulled_back`."""
        return self.pulled_back(values, cotangents[0])

    @cached_property
    def held(self) -> Mapping[str, float]:
        """The stiffness of each contact [Pa] in all runs."""
        if self.stiffness is not None:
            return self.stiffness
        return held_stiffness(self.scene)

    def trace(self, values: Sequence[Floats]) -> Trace:
        """Run the scene with other numbers; the last run is stored, because its derivative is requested next."""
        arrays = [np.asarray(value, np.float64) for value in values]
        key = b"".join(array.tobytes() for array in arrays)
        if not self._last or self._last[0][0] != key:
            scene, given = self.scene, dict(zip(self.names, arrays, strict=True))
            starts = {name: given.pop(name) for name in STARTS if name in given}
            for name, array in given.items():
                scene = with_value(scene, name, array)
            self._last[:] = [(key, traced(scene, self.held, start=starts))]
        return self._last[0][1]

    def positions(self, values: Sequence[Floats]) -> Floats:
        """Return the positions of all cloths in the frames, (f, n, 3) [m]."""
        trace = self.trace(values)
        return np.stack([trace.cloth_positions(frame) for frame in self.frames])

    def pulled_back(self, values: Sequence[Floats], cotangents: Floats) -> list[Floats]:
        """Return the derivatives of sum cotangents . positions by the numbers; cotangents (f, n, 3)."""
        rows = np.asarray(cotangents, np.float64)
        losses = [_linear(row, frame) for row, frame in zip(rows, self.frames, strict=True)]
        gradient = self.trace(values).gradient(losses)
        return [np.asarray(gradient[name], np.float64) for name in self.names]


@dataclass(frozen=True)
class RolloutBridge:
    """The map from positions, velocities and parameters to the positions and velocities after each of k steps.

    Parameters
    ----------
    layer : Layer
        The layer.
    names : tuple of str
        Parameters, as of `Layer.rollout`.
    k : int
        Number of steps.
    by_step : tuple of str
        Those of the parameters that have values for each step, along their first axis.
    """

    layer: "Layer"
    names: tuple[str, ...]
    k: int
    by_step: tuple[str, ...] = ()
    _last: list[tuple[bytes, "Rollout"]] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Of positions and velocities, (k, n, 3)."""
        shape = (self.k, self.layer.start.n, 3)
        return shape, shape

    def rollout(self, values: Sequence[Floats]) -> "Rollout":
        """Take the steps; the last rollout is stored, because its derivative is requested next."""
        arrays = [np.asarray(value, np.float64) for value in values]
        key = b"".join(array.tobytes() for array in arrays)
        if not self._last or self._last[0][0] != key:
            state: LayerState = self.layer.state(arrays[0], arrays[1])
            given = dict(zip(self.names, arrays[2:], strict=True))
            each = [
                {name: value[step] if name in self.by_step else value for name, value in given.items()}
                for step in range(self.k)
            ]
            rollout = self.layer.rollout(state, each if self.by_step else given, self.k)
            self._last[:] = [(key, rollout)]
        return self._last[0][1]

    def outputs(self, values: Sequence[Floats]) -> tuple[Floats, ...]:
        """Return positions and velocities; values: x, v and the parameters."""
        rollout = self.rollout(values)
        return rollout.x[1:], rollout.v[1:]

    def back(self, values: Sequence[Floats], cotangents: Sequence[Floats]) -> list[Floats]:
        """Return the derivatives of sum cotangents . outputs by x, v and the parameters."""
        n, none = self.layer.start.n, np.zeros((1, self.layer.start.n, 3))
        by_x, by_v = (np.concatenate([none, np.asarray(each, np.float64)]) for each in cotangents)
        by_start, by = self.rollout(values).vjp(by_x, by_v)
        found = [by_start.positions[:n], by_start.velocities[:n]]
        for name in self.names:
            parts = [np.asarray(step[name]) for step in by] if self.by_step else [np.asarray(by[name])]
            found.append(np.stack(parts) if name in self.by_step else np.sum(parts, axis=0))
        return found


def held_stiffness(scene: Scene) -> dict[str, float]:
    """Return the stiffness of each contact [Pa] that a run of the scene holds for its gradient, by effect."""
    session = differentiable_session(prepare(scene, build(scene, affordable=True)), polish=0)
    return stiffness_of(session.built.energies)


def missing(package: str) -> ClothsimError:
    """Return the error where the package of a bridge is not installed."""
    return ClothsimError(f"{package} is not installed.", f"Run: pip install 'clothsim[{package}]'")


def _linear(row: Floats, frame: int) -> Loss:
    return Custom(lambda x: (float(np.vdot(row, x)), row), frame)
