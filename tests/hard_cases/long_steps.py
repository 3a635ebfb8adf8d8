"""Step sizes from .002 to 2 s on one scene."""

from collections.abc import Callable

from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, steps_descend
from tests.hard_cases.twist import ELASTIC

STEPS = (0.002, 0.01, 0.05, 0.2, 1.0, 2.0)


def draped(dt: float) -> Callable[[bool], Scene]:
    """A sheet falls on a ball and over it, in steps of dt [s]."""

    def scene(small: bool) -> Scene:
        n, subdivisions, least = (10, 2, 0.2) if small else (24, 3, 2.0)
        return Scene(
            cloth={"mesh": "rectangle", "size": [0.6, 0.6], "cells": (n, n), "position": [0, 0, 0.16]},
            body={"name": "ball", "mesh": "sphere", "radius": 0.15, "subdivisions": subdivisions},
            effects=ELASTIC | {"gravity": {}, "body_contact": {}, "self_contact": {}, "friction": {}},
            solver={"dt": dt},
            run={"duration": max(least, 2 * dt), "frames_per_second": min(100.0, 1 / dt)},
        )

    return scene


CASES = tuple(
    Case(f"B7{letter}", f"sheet draped on a ball, dt {dt:g} s", draped(dt), steps_descend)
    for letter, dt in zip("abcdef", STEPS, strict=True)
)
