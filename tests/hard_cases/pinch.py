"""Cloth pinched between two closing bodies."""

from collections.abc import Callable

from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case
from tests.hard_cases.twist import ELASTIC

D_HAT, SPEED, START = 4e-3, 0.1, 0.02
"""d_hat [m]; how fast each jaw comes [m/s]; how far each is from the cloth at the start [m]."""


def closing(last: float) -> Callable[[bool], Scene]:
    """Two jaws close on a sheet from both sides until they are `last` [m] apart (below zero: through each other)."""

    def scene(small: bool) -> Scene:
        n, duration = (6 if small else 20), (2 * START - last) / (2 * SPEED)
        jaw = {"mesh": "slab", "size": [0.1, 0.1, 0.02], "cells": [2, 2, 1]}
        jaws = [
            jaw
            | {
                "name": name,
                "position": [0, 0, side * (START + 0.01)],
                "motion": {"velocity": [0, 0, -side * SPEED]},
            }
            for name, side in (("upper jaw", 1), ("lower jaw", -1))
        ]
        contact = {"d_hat": D_HAT}
        return Scene(
            cloth={"mesh": "rectangle", "size": [0.2, 0.2], "cells": (n, n)},
            body=jaws,
            effects=ELASTIC | {"body_contact": contact, "self_contact": contact, "friction": {}},
            solver={"dt": 0.01},
            run={"duration": duration, "frames_per_second": 100},
        )

    return scene


def between(run: Run) -> str:
    """The jaws end half of d_hat apart, and what is between them is above the lower and below the upper."""
    jaws = {name: points[:, 2] for name, points, _ in run.bodies(-1)}
    low, high = jaws["lower jaw"].max(), jaws["upper jaw"].min()
    if abs(high - low - D_HAT / 2) > 1e-9:
        return f"the jaws end {high - low:.3g} m apart"
    x = run.positions(-1)
    z = x[(abs(x[:, :2]) < 0.05).all(axis=1), 2]
    return "" if ((z > low) & (z < high)).all() else "cloth is not between the jaws"


SAYS = ("pinched", "upper jaw", "lower jaw", ") m")

CASES = (
    Case("B9a", "two bodies close on the cloth to a gap of 0.5 d_hat", closing(D_HAT / 2), between),
    Case("B9b", "two bodies close through the cloth: must fail", closing(-D_HAT), fails=SAYS),
)
