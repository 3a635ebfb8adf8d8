"""Cloth drawn through a narrow opening."""

import numpy as np

from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import frames, ways_out

NECK, MOUTH, DEPTH, LENGTH = 0.05, 0.22, 0.14, 0.06
"""Radius of the neck and of the mouth, height of the mouth, length of the neck below it [m]: it ends at z = 0."""
AROUND = (24, 48)
"""Corners of the wall, in the small form and in the full one."""
INSIDE = NECK * float(np.cos(np.pi / AROUND[0]))
"""Radius of a circle that no wall cuts: it touches the coarser one [m]."""


def pulled_through(small: bool) -> Scene:
    """A disk of cotton is pulled through a funnel by its middle, with friction .4."""
    rings, speed = (5, 1.0) if small else (14, 0.5)
    top = DEPTH + LENGTH
    way = top + 0.28
    cells = (AROUND[0], 6) if small else (AROUND[1], 12)
    mouth = {"mesh": "tube", "radius": NECK, "top_radius": MOUTH, "height": DEPTH, "cells": cells}
    neck = {"mesh": "tube", "radius": NECK, "height": LENGTH, "cells": (cells[0], 2)}
    return Scene(
        cloth={"mesh": "disk", "radius": 0.2, "cells": rings, "position": [0, 0, top]},
        body=[
            mouth | {"name": "mouth", "position": [0, 0, LENGTH + DEPTH / 2]},
            neck | {"name": "neck", "position": [0, 0, LENGTH / 2]},
        ],
        effects=ELASTIC
        | {
            "gravity": {},
            "body_contact": {},
            "self_contact": {},
            "friction": {"coefficient": 0.4},
            "pins": {"select": list(range(7)), "motion": {"velocity": [0, 0, -speed]}},
        },
        solver={"dt": 0.01},
        run={"duration": way / speed, "frames_per_second": 50},
    )


def through(run: Run) -> str:
    """No edge of the cloth goes through the wall of the neck, and all cloth is below it when the run ends.

    Cloth beside the neck is no fault: what has left it springs open, and a corner may fold up over the neck's end. An
    edge is through the wall where it goes out of both circles between which the wall's polygon lies, INSIDE and NECK,
    at a height of the neck; one that passes close under the end may do so at the outer circle alone. What else cuts the
    wall is the exact test's to find, which checks each frame too.
    """
    for time, x in zip(run.times, frames(run), strict=True):
        ways = np.stack([ways_out(x, run.triangles, radius) for radius in (INSIDE, NECK)])
        if ((ways > 0) & (ways < LENGTH)).all(axis=0).any():
            return f"at {time:.3g} s the cloth goes through the wall of the neck"
    left = float(run.positions(-1)[:, 2].max())
    return f"cloth is left {left:.2g} m above the neck's end" if left > 0 else ""


CASES = (Case("B4", "cloth pulled through a funnel, mu 0.4", pulled_through, through),)
