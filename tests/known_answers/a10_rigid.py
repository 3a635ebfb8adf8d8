"""A10, rigid bodies: spin, pendulum, precession, collision, rolling, weight; order of the time integrator."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from clothsim.scene.assembly.scene_world import build
from tests.known_answers.row import Outcome, Row
from tests.support.rigid_scenes import EFFECTS, WEIGHTLESS, Moment, moments_of, momentum, rigid_scene

G = 9.81
FLOOR = {"name": "floor", "mesh": "slab", "size": [8, 2, 0.1], "position": [0, 0, -0.05]}


def refined(measure: Callable[[float], float], dt: float, exact: float) -> tuple[float, float]:
    """The value at half of dt, and the order seen between dt and that."""
    coarse, fine = measure(dt), measure(dt / 2)
    return fine, float(np.log2(abs((coarse - exact) / (fine - exact))))


def _spin() -> Outcome:
    """Angle after .1 s of a ball that turns at 360 degrees/s."""

    def angle(dt: float) -> float:
        found, _ = moments_of(
            rigid_scene({"mesh": "sphere", "subdivisions": 1, "spin_degrees_per_second": [360, 0, 0]}, dt=dt)
        )
        return float(np.degrees(np.arctan2(found[-1].maps[0, 2, 1], found[-1].maps[0, 1, 1])))

    value, order = refined(angle, 0.005, 36.0)
    return Outcome(value, 36.0, 2e-3, order=order, orders=(1.8, 2.2))


def _pendulum() -> Outcome:
    """Period of a bar of .4 m on a hinge at its end, from 10 degrees."""
    from scipy.special import ellipk

    length, width, amplitude = 0.4, 0.05, np.radians(10.0)
    centre = 0.5 * length * np.array([np.sin(amplitude), 0.0, -np.cos(amplitude)])
    bar = {"mesh": "slab", "size": [width, width, length], "rotation_degrees": [0, -10, 0], "position": centre}
    bar |= {"joint": {"point": [0, 0, 0], "axis": [0, 2, 0]}}
    inertia = (length**2 + width**2) / 12 + length**2 / 4
    exact = float(4 * np.sqrt(inertia / (G * length / 2)) * ellipk(np.sin(amplitude / 2) ** 2))

    def period(dt: float) -> float:
        found, _ = moments_of(rigid_scene(bar, dt=dt, duration=2.6))
        times = np.array([each.time for each in found])
        angles = np.array([np.arctan2(each.maps[0, 0, 2], each.maps[0, 2, 2]) for each in found]) - amplitude
        before = np.flatnonzero(np.sign(angles[:-1]) != np.sign(angles[1:]))
        zeros = times[before] - angles[before] * (times[before + 1] - times[before]) / np.diff(angles)[before]
        return float(2 * np.diff(zeros).mean())

    value, order = refined(period, 0.01, exact)
    return Outcome(value, exact, 1e-3, order=order, orders=(1.8, 2.2))


def _precession() -> Outcome:
    """Rate m g d / (I w) of a horizontal top on a ball joint at 100 rad/s."""
    spin = 100.0
    top = {"mesh": "capsule", "radius": 0.08, "height": 0.25, "segments": 24, "position": [0.1, 0, 0]}
    top |= {"rotation_degrees": [0, 90, 0], "joint": {"point": [0, 0, 0]}}
    body = build(rigid_scene(top)).world.rigid[0]
    inverse = np.linalg.pinv(body.gradients)
    second = inverse @ np.diag(body.masses) @ inverse.T / body.mass
    exact = float(G * 0.1 / ((second[1, 1] + second[2, 2]) * spin))
    top |= {"spin_degrees_per_second": np.degrees([spin, 0, exact])}

    def rate(dt: float) -> float:
        found, _ = moments_of(rigid_scene(top, dt=dt, duration=0.1))
        angles = np.unwrap([np.arctan2(each.maps[0, 1, 0], each.maps[0, 0, 0]) for each in found])
        return float(np.polyfit([each.time for each in found], angles, 1)[0])

    value, order = refined(rate, 0.001, exact)
    return Outcome(value, exact, 5e-3, order=order, orders=(1.7, 2.5))


def _collision(angular: bool) -> Outcome:
    """Change of momentum when two balls collide, over that of the first [m v, or m v r]."""
    ball: dict[str, Any] = {"mesh": "sphere", "radius": 0.1, "subdivisions": 2}
    rigid = [
        ball | {"name": "first", "velocity": [1.0, 0, 0]},
        ball | {"name": "second", "position": [0.22, 0.03, 0.02]},
    ]
    effects = WEIGHTLESS | {"body_contact": {}}
    _, simulation = moments_of(rigid_scene(rigid, effects=effects, dt=0.002, duration=0.1, tolerance=1e-10))
    linear, turning, _ = momentum(simulation)
    mass = simulation._session.built.world.rigid[0].mass
    if angular:
        return Outcome(float(np.abs(turning).max() / (0.1 * mass)), 0.0, 5e-3, "m v r")
    return Outcome(float(np.abs(linear - [mass, 0, 0]).max() / mass), 0.0, 1e-8, "m v")


def rolling(slope: float, speed: float, duration: float, friction: float = 0.5) -> tuple[list[Moment], Any]:
    """A ball of 2,562 vertices on a slope [rad], that starts with a speed [m/s] and no spin."""
    down = {"acceleration": G * np.array([np.sin(slope), 0, -np.cos(slope)])}
    effects = EFFECTS | {"gravity": down, "body_contact": {"d_hat": 1e-3}, "friction": {"coefficient": friction}}
    ball = {"mesh": "sphere", "radius": 0.1, "subdivisions": 4, "position": [-1, 0, 0.1005], "velocity": [speed, 0, 0]}
    return moments_of(rigid_scene(ball, FLOOR, effects, dt=0.01, duration=duration))


def _rolling() -> Outcome:
    slope = float(np.radians(10.0))
    found, _ = rolling(slope, 0.0, 0.8)
    times, speeds = np.transpose([(each.time, each.velocity[0]) for each in found if each.time > 0.1])
    return Outcome(float(np.polyfit(times, speeds, 1)[0]), float(5 / 7 * G * np.sin(slope)), 0.02)


def _sliding() -> Outcome:
    found, _ = rolling(0.0, 1.0, 0.4, 0.2)
    return Outcome(float(np.mean([each.velocity[0] for each in found[20:25]])), 5 / 7, 0.02)


ROWS = (
    Row("A10a", "spinning ball, dt 0.0025 s: angle after 0.1 s [degrees]", _spin),
    Row("A10b", "bar on a hinge, released at 10 degrees, dt 0.005 s: period [s]", _pendulum),
    Row("A10c", "top on a ball joint, dt 0.0005 s: precession [rad/s]", _precession),
    Row("A10d", "two colliding balls: change of momentum", partial(_collision, angular=False)),
    Row("A10e", "two colliding balls, dt 0.002 s: change of angular momentum", partial(_collision, angular=True)),
    Row("A10f", "ball of 2,562 vertices rolling down 10 degrees: acceleration [m/s2]", _rolling),
    Row("A10g", "the same ball, sliding until it rolls: final speed / initial speed", _sliding),
)
