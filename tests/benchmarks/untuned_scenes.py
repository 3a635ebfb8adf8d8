"""Six scenes that no constant of the stop was chosen on: other cells, speeds, bodies and constraints than those it was.

Each is small, of one thread, and has a longest step of 0.02 s: `tests.benchmarks.stepping` runs them at that ceiling,
at half and at a quarter of it. STOPPED names those whose pins stop, and when.
"""

from collections.abc import Mapping
from typing import Any

from clothsim import Scene

CONTACT: Mapping[str, Any] = {"body_contact": {}, "self_contact": {}, "friction": {"coefficient": 0.3}}
CLOTH: Mapping[str, Any] = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}}
STOPPED: Mapping[str, float] = {"fast_pin": 0.1}
"""Time [s], that of a frame, at which every pin of a scene stops."""


def _scene(
    size: tuple[float, float], cells: tuple[int, int], duration: float, effects: Mapping[str, Any] = CONTACT,
    **others: Any
) -> Scene:  # fmt: skip
    """A rectangle of cotton, or of others["fabric"], and `effects`; of `others`, body and rigid are sections."""
    sections = {name: others.pop(name) for name in ("body", "rigid") if name in others}
    return Scene(
        cloth={"name": "cloth", "mesh": "rectangle", "size": size, "cells": cells, "fabric": "cotton", **others},
        effects={**CLOTH, **effects},
        solver={"dt": 0.02, "threads": 1},
        run={"duration": duration, "frames_per_second": 50},
        **sections,
    )


def _cells() -> Scene:
    """A sheet of 25 x 37 cells that falls on a ball, off its centre."""
    ball = {"name": "ball", "mesh": "sphere", "radius": 0.15, "position": [0.02, -0.03, 0.0]}
    return _scene((0.5, 0.7), (25, 37), 0.3, body=ball, position=[0.0, 0.0, 0.17])


def _speed() -> Scene:
    """A sheet thrown at a capsule at 3 m/s."""
    capsule = {
        "name": "capsule", "mesh": "capsule", "radius": 0.06, "height": 0.4, "segments": 32,
        "rotation_degrees": [0, 90, 0],
    }  # fmt: skip
    thrown = {"rotation_degrees": [90, 0, 0], "position": [0.0, -0.1, 0.02], "velocity": [0.0, 3.0, 0.0]}
    return _scene((0.4, 0.3), (20, 15), 0.2, body=capsule, **thrown)


def _rigid_hit() -> Scene:
    """A rigid ball of 2 m/s thrown into a sheet that hangs from an edge."""
    ball = {
        "name": "ball", "mesh": "sphere", "radius": 0.05, "subdivisions": 2, "density": 100.0,
        "position": [0.03, -0.1, -0.05], "velocity": [0.0, 2.0, 0.5],
    }  # fmt: skip
    effects = {**CONTACT, "pins": {"select": "top"}}
    return _scene((0.4, 0.4), (16, 16), 0.3, effects, rigid=ball, rotation_degrees=[90, 0, 0])


def _seam() -> Scene:
    """A piece of denim on a rod, whose two edges a seam draws together below it in 0.1 s."""
    rod = {
        "name": "rod", "mesh": "capsule", "radius": 0.06, "height": 0.4, "segments": 32,
        "rotation_degrees": [0, 90, 0],
    }  # fmt: skip
    closing = {"from": {"side": "bottom"}, "to": {"side": "top"}, "start": 0.14, "end": 0.24}
    effects = {**CONTACT, "seams": {"seam": [closing]}}
    return _scene((0.2, 0.44), (10, 22), 0.36, effects, body=rod, fabric="denim", position=[0.0, 0.0, 0.064])


def _fast_pin() -> Scene:
    """A sheet that hangs from two corners; one of them moves at 3 m/s for 0.1 s and stops."""
    corner = [[-0.16, -0.01, 0.14], [-0.14, 0.01, 0.16]]
    moved = [[0.14, -0.01, 0.14], [0.16, 0.01, 0.16]]
    pins = [
        {"select": {"box": corner}},
        {"select": {"box": moved}, "motion": {"velocity": [-1.8, 2.4, 0.0]}},
    ]
    effects = {"self_contact": {}, "pins": {"group": pins}}
    return _scene((0.3, 0.3), (15, 15), 0.3, effects, rotation_degrees=[90, 0, 0])


def _drop45() -> Scene:
    """A sheet at 45 degrees that drops edge first onto a slab with friction."""
    slab = {"name": "slab", "mesh": "slab", "size": [0.8, 0.8, 0.02], "position": [0, 0, -0.01]}
    return _scene((0.25, 0.2), (20, 16), 0.3, body=slab, rotation_degrees=[0, 45, 0], position=[0.0, 0.0, 0.12])


UNTUNED_SCENES: Mapping[str, Scene] = {
    "cells": _cells(),
    "speed": _speed(),
    "rigid_hit": _rigid_hit(),
    "seam": _seam(),
    "fast_pin": _fast_pin(),
    "drop45": _drop45(),
}
"""Scenes by name."""
