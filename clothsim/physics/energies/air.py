"""Aerodynamic drag and lift: the effect `air`.

The force on a triangle of area A and normal n that moves with v through air of velocity w, v_rel = v - w, is

    F = -(rho / 2) A |v_rel| (C_n n n' + C_t (1 - n n')) v_rel,    C_n = drag, C_t = (1 - lift) drag

(normal and tangential parts as in Wejchert & Haumann 1991, "Animation aerodynamics", with the square of the speed).
Face on, that is rho/2 A drag v^2; at an angle b between plate and wind the component across the wind, the lift, is
rho/2 A drag lift v^2 sin b cos b. lift = 1 is a thin plate without skin friction, lift = 0 pure drag along the wind.

|v_rel|, A and n are lagged: taken at the start of the step and constant within it. Then the force is linear in v_rel
and has the potential v_rel.T v_rel h / 2 with a positive semi-definite tensor T: the step is implicit in the velocity,
its derivatives are exact and the cloth cannot overshoot the wind, whatever dt is. The lag is an error of first order in
dt, also with BDF2.
"""

import abc
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.inputs import called
from clothsim.base.triangles import area_vectors
from clothsim.keys.effect_tables import Gust, Vortex
from clothsim.keys.typed_effects import Air
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.key_values import Schedule, lost_function, over_cloth, schedule
from clothsim.physics.energies.protocols import Driven, Idling

# Wind fields: the velocity of the air over space and time.

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
class WindFunction(Wind):
    """A Python function of points (m, 3) [m] and time [s] that returns velocities (m, 3) or (3,) [m/s]."""

    name: str
    function: Callable[[Floats, float], Floats]

    def at(self, points: Floats, time: float) -> Floats:
        """The velocities that the function returns. InputError for another shape or non-finite numbers."""
        velocities = np.asarray(called(self.name, self.function, points.copy(), time), np.float64)
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
    """The wind of a scene's value: a vector, a `Gust`, a `Vortex`, or in Python a function (`WindFunction`).

    Raises
    ------
    InputError
        For a gust without a mean wind, a vortex without an axis, or a function that a scene file has lost.
    """
    if callable(value):
        return WindFunction(name, value)
    if isinstance(value, Gust):
        velocity = np.array(value.velocity, np.float64)
        if not velocity.any():
            raise InputError(f"{name}.velocity is zero: a gust needs a mean wind.", "Give a velocity [m/s].")
        return GustField(velocity, value.amplitude, value.period, float(np.radians(value.sway_degrees)))
    if isinstance(value, Vortex):
        centre, axis, velocity = (np.array(each, np.float64) for each in (value.centre, value.axis, value.velocity))
        if not axis.any():
            raise InputError(f"{name}.axis is zero.", "Give the direction of the vortex line.")
        return VortexField(centre, axis / np.linalg.norm(axis), value.circulation, value.core, velocity)
    if isinstance(value, Mapping):
        raise lost_function(name, value)
    return Uniform(np.array(value, np.float64))


@dataclass(frozen=True)
class AirEnergy(Energy, Driven, Idling):
    """E = sum d.T d / (2 h), d = y - y_n - h w, y the centroid of a triangle, so that d / h = v_rel.

    With BDF2 x^ and b h replace x_n and h (docs/theory.md#time-integration).

    Parameters
    ----------
    triangles : (m, 3) int array
        Rows of x.
    across, along : (m,) arrays
        rho C_n / 2 and rho C_t / 2 [kg/m3].
    wind, strength : Wind, Schedule
        Velocity field of the air and a factor over time.
    origin : (3,) array
        Origin of x in the scene's coordinates [m].
    tensors : (m, 3, 3) array
        T of the step [N s/m].
    drifted : (m, 3) array
        y_n + h w: the centroids displaced with the air [m].
    dt : float
        h [s].
    """

    triangles: Ints
    across: Floats
    along: Floats
    wind: Wind
    strength: Schedule
    origin: Floats
    tensors: Floats
    drifted: Floats
    dt: float

    incremental = True

    @property
    def drives(self) -> bool:
        """True where there is wind."""
        return not (self.wind.still or self.strength.is_zero)

    @property
    def idle(self) -> bool:
        """True where no triangle moves relative to the air."""
        return not self.tensors.any()

    def begin(self, step: Step) -> Self:
        """A copy with |v_rel|, areas and normals of the start of the step, and the wind of its end.

        A quasi-static ramp scales a wind of constant strength; a strength that varies over time is a ramp of its own.
        """
        past, corners = step.past, step.positions[self.triangles]
        now = step.time + step.dt
        factor = self.strength.at(now) * (step.load if self.strength.is_constant else 1.0)
        wind = factor * self.wind.at(corners.mean(axis=1) + self.origin, now)
        twice = area_vectors(corners)
        areas = np.linalg.norm(twice, axis=1) / 2
        normals = twice / np.maximum(2 * areas, np.finfo(float).tiny)[:, None]
        speeds = np.linalg.norm(step.velocities[self.triangles].mean(axis=1) - wind, axis=1)
        projector = normals[:, :, None] * normals[:, None, :]
        shape = self.along[:, None, None] * np.eye(3) + (self.across - self.along)[:, None, None] * projector
        drifted = past.positions[self.triangles].mean(axis=1) + past.dt * wind
        return replace(self, tensors=(areas * speeds)[:, None, None] * shape, drifted=drifted, dt=past.dt)

    def value(self, x: Floats) -> float:
        """Incremental dissipation [J]."""
        d = self._relative(x)
        return float(np.einsum("ti,tij,tj->", d, self.tensors, d)) / (2 * self.dt)

    def gradient(self, x: Floats) -> Floats:
        """T d / (3 h) on each corner, (N, 3) [N]."""
        forces = np.einsum("tij,tj->ti", self.tensors, self._relative(x)) / (3 * self.dt)
        corners = self.triangles.ravel()
        thirds = np.repeat(forces, 3, axis=0)
        return np.stack([np.bincount(corners, thirds[:, k], len(x)) for k in range(3)], axis=1)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """T / (9 h) for each pair of corners [N/m]: constant, positive semi-definite and exact."""
        return ElementHessian(self.triangles, np.tile(self.tensors / (9 * self.dt), (1, 3, 3)))

    def _relative(self, x: Floats) -> Floats:
        return x[self.triangles].mean(axis=1) - self.drifted


def air(world: World, keys: Air) -> Energy | Off:
    """Drag and lift of all triangles in still air or wind; off where the density or every drag is 0.

    Raises
    ------
    InputError
        For a value out of its range; names the key and the triangle.
    """
    rho = keys.density
    across = over_cloth("effects.air.drag", keys.drag, world, least=0.0)
    lifts = over_cloth("effects.air.lift", keys.lift, world, least=0.0)
    if (lifts > 1).any():
        raise InputError(f"effects.air.lift is {lifts.max():g} on triangle {lifts.argmax()}.", "Give it from 0 to 1.")
    field, pace = wind_of("effects.air.wind", keys.wind), schedule("effects.air.strength", keys.strength)
    if rho == 0:
        return Off("the density of the air is 0")
    selected = np.flatnonzero(across)
    if not len(selected):
        return Off("drag is 0")
    across, along = rho / 2 * across[selected], rho / 2 * (across * (1 - lifts))[selected]
    none = np.zeros((len(selected), 3))
    tensors = np.zeros((len(selected), 3, 3))
    return AirEnergy(world.triangles[selected], across, along, field, pace, world.origin, tensors, none, 1.0)


EXAMPLE = Example(
    keys={"wind": {"kind": "vortex", "circulation": 9.0, "core": 0.5, "velocity": (1.0, 2.0, 0.5)}, "lift": 0.7},
    in_scene={},
    zero={"drag": 0, "wind": [5, 0, 0]},
    external=True,
    # idle only at rest: without a load in still air, or in the first step of a fall
    idle=Idle(scene={"body": (), "effects": {"inertia": {}, "damping": {}}}),
)
