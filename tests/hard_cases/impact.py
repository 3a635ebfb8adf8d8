"""Impact with large displacements in a step."""

from collections.abc import Callable
from typing import Any

from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, Check, all_of, energy_falls
from tests.hard_cases.edges import wall
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import over_edges, over_plane

PLATE: dict[str, Any] = {"name": "plate", "mesh": "rectangle", "size": [6.0, 6.0], "cells": [1, 1]}
KNIFE = wall("knife", 0.0, 3.0, 6.0)


def thrown(speed: float, body: dict[str, Any]) -> Callable[[bool], Scene]:
    """A sheet of cotton, tilted a little, thrown straight down at what stands fixed under it."""

    def scene(small: bool) -> Scene:
        n = 8 if small else 24
        return Scene(
            cloth={
                "mesh": "rectangle",
                "size": [0.6, 0.6],
                "cells": (n, n),
                "rotation_degrees": [5, 3, 0],
                "position": [0.02, 0, 0.5],
                "velocity": [0, 0, -speed],
            },
            body=body,
            effects=ELASTIC | {"body_contact": {}, "self_contact": {}},
            solver={"dt": 0.01},
            run={"duration": 0.06 if small else 0.2, "frames_per_second": 100},
        )

    return scene


def cases() -> tuple[Case, ...]:
    """Both bodies, both speeds."""
    bodies: list[tuple[str, dict[str, Any], Check]] = [
        ("a plate", PLATE, over_plane(0.0)),
        ("an edge", KNIFE, over_edges((0.0,), 0.0, -6.0)),
    ]
    pairs = [(speed, *body) for body in bodies for speed in (30.0, 100.0)]
    return tuple(
        Case(f"B6{letter}", f"impact on {name} at {speed:g} m/s", thrown(speed, body), all_of(check, energy_falls))
        for letter, (speed, name, body, check) in zip("abcd", pairs, strict=True)
    )


CASES = cases()
