"""Wind fields: the velocity of the air over space and time."""

import abc
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.keys.effect_tables import Gust, Vortex
from clothsim.physics.energies.varying_values import lost_function

UP = np.array([0.0, 0.0, 1.0])


class Wind(abc.ABC):
    """A velocity field of the air."""

    @abc.abstractmethod
    def at(self, points: Floats, time: float) -> Floats:
        """The velocity of the air at `points (m, 3)` [m] in the scene's coordinates and at `time` [s], (m, 3) [m/s]."""

    @property
    def still(self) -> bool:
        """True where the air never moves."""
        return False


@dataclass(frozen=True)
class Uniform(Wind):
    """A uniform, constant velocity (3,) [m/s]."""

    velocity: Floats

    def at(self, points: Floats, time: float) -> Floats:
        """The velocity."""
        return np.broadcast_to(self.velocity, points.shape)

    @property
    def still(self) -> bool:
        """True where the velocity is zero."""
        return not self.velocity.any()


@dataclass(frozen=True)
class GustField(Wind):
    """A mean velocity V with fluctuations of strength and direction that are convected by V (Taylor 1938).

    w = |V| (1 + amplitude g(u)) (cos a V/|V| + sin a side), a = sway g(u + 5), u = (t - x.V/|V|^2) / period, with a
    horizontal unit vector `side` and g the sum of three sines of incommensurable periods, between -1 and 1.

    Parameters
    ----------
    velocity : (3,) array
        V [m/s].
    amplitude : float
        Relative fluctuation of the strength.
    period : float
        [s].
    sway : float
        Largest angle from V [rad].
    """

    velocity: Floats
    amplitude: float
    period: float
    sway: float

    def at(self, points: Floats, time: float) -> Floats:
        """The velocity of the gust at the points, (m, 3) [m/s]."""
        speed = float(np.linalg.norm(self.velocity))
        along = self.velocity / speed
        side = np.cross(UP, along)
        length = float(np.linalg.norm(side))
        side = side / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
        u = (time - points @ along / speed) / self.period
        strength, angle = speed * (1 + self.amplitude * swing(u)), self.sway * swing(u + 5)
        return strength[:, None] * (np.cos(angle)[:, None] * along + np.sin(angle)[:, None] * side)


@dataclass(frozen=True)
class VortexField(Wind):
    """A line vortex, v = circulation r / (2 pi (r^2 + core^2)) at the distance r from the line (Scully 1975).

    Parameters
    ----------
    centre, axis : (3,) arrays
        A point of the line at time 0 [m] and its unit vector.
    circulation : float
        [m2/s].
    core : float
        Distance at which v is largest [m].
    velocity : (3,) array
        Uniform wind that is added and convects the line [m/s].
    """

    centre: Floats
    axis: Floats
    circulation: float
    core: float
    velocity: Floats

    def at(self, points: Floats, time: float) -> Floats:
        """The velocity of the vortex at the points, (m, 3) [m/s]."""
        arms = points - (self.centre + self.velocity * time)
        arms = arms - (arms @ self.axis)[:, None] * self.axis
        rate = self.circulation / (2 * np.pi * ((arms**2).sum(axis=1) + self.core**2))
        return self.velocity + rate[:, None] * np.cross(self.axis, arms)


@dataclass(frozen=True)
class Field(Wind):
    """A Python function of points (m, 3) [m] and time [s] that returns velocities (m, 3) or (3,) [m/s]."""

    name: str
    function: Callable[[Floats, float], Floats]

    def at(self, points: Floats, time: float) -> Floats:
        """The velocities that the function returns. InputError for another shape or non-finite numbers."""
        velocities = np.asarray(self.function(points.copy(), time), np.float64)
        if velocities.shape not in (points.shape, (3,)):
            raise InputError(f"{self.name} returned an array of shape {velocities.shape}, not {points.shape}.")
        if not np.isfinite(velocities).all():
            raise InputError(f"{self.name} returned a non-finite number at {time:g} s.")
        return np.broadcast_to(velocities, points.shape)


def swing(u: Floats) -> Floats:
    """The aperiodic fluctuation g(u), between -1 and 1."""
    turns = (0.5, 1.0, 0.0), (0.3, 2**0.5, 1.0), (0.2, 5**0.5, 2.0)
    return sum((weight * np.sin(2 * np.pi * pace * u + phase) for weight, pace, phase in turns), np.zeros_like(u))


def wind_of(name: str, value: Any) -> Wind:
    """The wind of a scene's value: a vector, a `Gust`, a `Vortex`, or in Python a function (`Field`).

    Raises
    ------
    InputError
        For a gust without a mean wind, a vortex without an axis, or a function that a scene file has lost.
    """
    if callable(value):
        return Field(name, value)
    if isinstance(value, Gust):
        return _gust(name, value)
    if isinstance(value, Vortex):
        return _vortex(name, value)
    if isinstance(value, Mapping):
        raise lost_function(name, value)
    return Uniform(np.array(value, np.float64))


def _gust(name: str, keys: Gust) -> GustField:
    velocity = np.array(keys.velocity, np.float64)
    if not velocity.any():
        raise InputError(f"{name}.velocity is zero: a gust needs a mean wind.", "Give a velocity [m/s].")
    return GustField(velocity, keys.amplitude, keys.period, float(np.radians(keys.sway_degrees)))


def _vortex(name: str, keys: Vortex) -> VortexField:
    centre, axis, velocity = (np.array(each, np.float64) for each in (keys.centre, keys.axis, keys.velocity))
    if not axis.any():
        raise InputError(f"{name}.axis is zero.", "Give the direction of the vortex line.")
    return VortexField(centre, axis / np.linalg.norm(axis), keys.circulation, keys.core, velocity)
