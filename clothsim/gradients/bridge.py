"""A run as a function of numbers of its scene, for packages that differentiate functions of arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError
from clothsim.gradients.differentiable_session import differentiable_session, stiffness_of
from clothsim.gradients.losses import Custom, Loss
from clothsim.gradients.parameters import with_value
from clothsim.gradients.run import Trace, traced
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene


@dataclass(frozen=True)
class Bridge:
    """The map from numbers of a scene to positions of its cloths.

    Parameters
    ----------
    scene : Scene
        The scene; its other numbers are held.
    names : tuple of str
        Paths of the numbers, as "cloth.youngs_modulus".
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

    @cached_property
    def held(self) -> Mapping[str, float]:
        """The stiffness of each contact [Pa] in all runs."""
        if self.stiffness is not None:
            return self.stiffness
        held = differentiable_session(prepare(self.scene, build(self.scene, affordable=True)), polish=0)
        return stiffness_of(held.built.energies)

    def trace(self, values: Sequence[Floats]) -> Trace:
        """Run the scene with other numbers; the last run is kept, as its derivative is asked for next."""
        arrays = [np.asarray(value, np.float64) for value in values]
        key = b"".join(array.tobytes() for array in arrays)
        if not self._last or self._last[0][0] != key:
            scene, held = self.scene, self.held
            for name, array in zip(self.names, arrays, strict=True):
                scene = with_value(scene, name, array)
            self._last[:] = [(key, traced(scene, held))]
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


def missing(package: str) -> ClothsimError:
    """Return the error where the package of a bridge is not installed."""
    return ClothsimError(f"{package} is not installed.", f"Run: pip install 'clothsim[{package}]'")


def _linear(row: Floats, frame: int) -> Loss:
    return Custom(lambda x: (float(np.vdot(row, x)), row), frame)
