"""Stiff closed cloth on a spike, in a wedge and over a cliff, in exact alignment, and a ball thrown at a wall.

Spike, wedge and cliff: Erleben 2018, "Methodology for assessing mesh-based contact point methods", ACM Trans. Graph.
37(3), as IPC (Li et al. 2020) runs them; its ball of golf too. Here the solids are hollow, of stiff board.
"""

from typing import Any

import numpy as np

from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, all_of, energy_falls, scene_of
from tests.hard_cases.twist import ELASTIC
from tests.hard_cases.where import frames, over_needles

BOARD = {"density": 0.7, "thickness": 1e-3, "youngs_modulus": 1e8, "poisson_ratio": 0.3, "bending_stiffness": 0.1}
CONTACT = {"body_contact": {"d_hat": 2e-3}, "self_contact": {"d_hat": 2e-3}}
FALLING: dict[str, dict[str, Any]] = ELASTIC | CONTACT | {"gravity": {}}
ABOVE = 0.01
"""Gap at the start [m]."""
SIDE = 0.1
"""Of a box [m]."""

BALL = {"density": 8.0, "thickness": 1e-3, "youngs_modulus": 1.5e8, "poisson_ratio": 0.3, "bending_stiffness": 10.0}
"""As heavy as a ball for golf, 46 g; .2 mJ of bending for its curvature."""
RADIUS, SPEED, UPWARDS = 0.0214, 67.0, 20.0
"""Of the ball [m], and its speed at the wall and along it [m/s]."""
TOLERANCE = 1e-5
"""Of Newton's method [m/s]."""


def spike(small: bool) -> Scene:
    """A hollow cone falls, tip down, on the tip of a fixed one: a point on a point."""
    segments = 12 if small else 48
    cone = {"mesh": "cone", "radius": 0.05, "height": 0.1, "segments": segments}
    return Scene(
        cloth=BOARD | cone | {"rotation_degrees": [180, 0, 0], "position": [0, 0, 0.05 + ABOVE]},
        body=cone | {"name": "spike", "position": [0, 0, -0.05]},
        effects=FALLING,
        solver={"dt": 0.005},
        run={"duration": 0.15 if small else 0.4, "frames_per_second": 100},
    )


def box(small: bool, **placed: Any) -> dict[str, Any]:
    """A hollow cube."""
    return BOARD | {"mesh": "slab", "size": [SIDE] * 3, "cells": [4, 4, 4] if small else [12, 12, 12]} | placed


def wedge(small: bool) -> Scene:
    """A cube falls with an edge along the bottom of a groove: an edge on two, then faces on faces."""
    across = np.sqrt(0.5)
    walls = [
        {"mesh": "slab", "size": [0.3, 0.4, 0.02], "name": name, "rotation_degrees": [0, -45 * side, 0]}
        | {"position": [side * across * (0.15 + 0.01), 0, across * (0.15 - 0.01)]}
        for name, side in (("right wall", 1), ("left wall", -1))
    ]
    return Scene(
        cloth=box(small, rotation_degrees=[0, 45, 0], position=[0, 0, SIDE * across + ABOVE]),
        body=walls,
        effects=FALLING | {"friction": {}},
        solver={"dt": 0.005},
        run={"duration": 0.15 if small else 0.5, "frames_per_second": 100},
    )


def in_groove(run: Run) -> str:
    """Each vertex is above the faces z = |x| of the groove."""
    deepest = min(float((x[:, 2] - np.abs(x[:, 0])).min()) for x in frames(run))
    return f"a vertex is {-deepest * np.sqrt(0.5):.2g} m inside a wall" if deepest <= 0 else ""


def cliff(small: bool) -> Scene:
    """A cube falls flat on a cliff whose edge runs under the middle of it, and tips over."""
    return Scene(
        cloth=box(small, position=[0.002, 0, SIDE / 2 + ABOVE]),
        body={"name": "cliff", "mesh": "slab", "size": [1, 1, 1], "position": [-0.5, 0, -0.5]},
        effects=FALLING | {"friction": {"coefficient": 0.5}},
        solver={"dt": 0.005},
        run={"duration": 0.2 if small else 0.8, "frames_per_second": 100},
    )


def outside_cliff(run: Run) -> str:
    """No vertex is in the quadrant x < 0, z < 0."""
    deepest = max(float(np.minimum(-x[:, 0], -x[:, 2]).max()) for x in frames(run))
    return f"a vertex is {deepest:.2g} m inside the cliff" if deepest >= 0 else ""


def never_thrown(run: Run) -> str:
    """What falls without a push is never thrown: its centre of mass does not rise above where it started."""
    masses = build(scene_of(run)).world.masses
    heights = [float(masses @ x[:, 2] / masses.sum()) for x in frames(run)]
    rise = max(heights) - heights[0]
    return f"its centre rises {rise:.2g} m above its start" if rise > 1e-9 else ""


def golf(small: bool) -> Scene:
    """A ball at 67 m/s into the wall x = 0, and 20 m/s along it, without friction: 27 mm a step in the small form."""
    return Scene(
        cloth=BALL
        | {"mesh": "sphere", "radius": RADIUS, "subdivisions": 2 if small else 3}
        | {"position": [-2 * RADIUS, 0, 0], "velocity": [SPEED, 0, UPWARDS]},
        body={"name": "wall", "mesh": "slab", "size": [0.02, 0.2, 0.4], "position": [0.01, 0.02, 0.05]},
        effects=ELASTIC | {"body_contact": {}, "self_contact": {}},
        solver={"dt": 4e-4 if small else 5e-5, "tolerance": TOLERANCE},
        run={"duration": 4e-3, "frames_per_second": 2500},
    )


def rebounds(run: Run) -> str:
    """It comes back, no faster than it came; the wall gives no momentum along itself, but for Newton's tolerance."""
    masses = build(scene_of(run)).world.masses
    centres = np.array([masses @ x / masses.sum() for x in frames(run)])
    velocity = (centres[-1] - centres[-3]) / (run.times[-1] - run.times[-3])
    furthest = max(float(x[:, 0].max()) for x in frames(run))
    along = float(np.abs(velocity[1:] - (0, UPWARDS)).max())
    faults = {
        f"a vertex is {furthest:.2g} m inside the wall": furthest >= 0,
        f"its mean velocity along the wall changed by {along:.2g} m/s": along > TOLERANCE,
        f"it leaves at {-velocity[0]:.3g} m/s": not 0 < -velocity[0] < SPEED,
    }
    return next((fault for fault, there in faults.items() if there), "")


CASES = (
    Case("B25a", "cone on a spike, tip on tip", spike, all_of(over_needles, never_thrown, energy_falls)),
    Case("B25b", "cube in a wedge, edge on edge", wedge, all_of(in_groove, never_thrown, energy_falls)),
    Case("B25c", "cube over a cliff's edge", cliff, all_of(outside_cliff, never_thrown, energy_falls)),
    Case("B25d", "ball hits a wall at 67 m/s", golf, all_of(rebounds, energy_falls)),
)
