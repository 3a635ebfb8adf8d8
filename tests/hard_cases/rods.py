"""Rods: a cord whose knot is pulled together, and two linked rings that are thrown apart.

What is tied shows in the determinant of the centre lines (`knots`), which shares nothing with contact: 7 of the
knot, 2 of two linked rings, as long as no rod has passed through another one.
"""

from pathlib import Path

import numpy as np

import clothsim
from clothsim.base.linalg import unit
from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case
from tests.hard_cases.knots import FAR, determinant

KNOT = Path(__file__).parents[2] / "scenes" / "knot.toml"
PULL = 2.0
"""Speed of each end of the cord [m/s]."""
APART = 8.0
"""Speed of each ring [m/s]."""


def pulled(small: bool) -> Scene:
    """The cord of the scene `knot`, its ends pulled at eight times the speed, without damping in the full form."""
    scene = clothsim.load_scene(KNOT)
    group = [{"select": side, "motion": {"velocity": [v, 0.0, 0.0]}} for side, v in (("left", -PULL), ("right", PULL))]
    effects = {**scene.effects, "pins": {"group": group}, "damping": {"rate": 20.0 if small else 2.0}}
    return Scene(rod=scene.rod, effects=effects, solver={"dt": 0.01 if small else 0.005}, run={"duration": 0.16})


def thrown(small: bool) -> Scene:
    """Two linked rings that fly apart: each is caught by the other one and bounces in it."""
    n = 24 if small else 60
    angles = 2 * np.pi * np.arange(n) / n
    circle = 0.1 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    section = {"loop": True, "radius": 0.003, "density": 1200.0, "youngs_modulus": 1e7}
    rods = [
        {"name": "left", "points": circle.tolist(), "velocity": [-APART, 0.0, 0.0], **section},
        {
            "name": "right",
            "points": (circle[:, [0, 2, 1]] + [0.1, 0, 0]).tolist(),
            "velocity": [APART, 0, 0],
            **section,
        },
    ]
    effects = {"inertia": {}, "self_contact": {}}
    return Scene(rod=rods, effects=effects, solver={"dt": 0.002}, run={"duration": 0.06, "frames_per_second": 100.0})


def _lines(run: Run, frame: int) -> list[np.ndarray]:
    x = run.positions(frame)
    return [x[surface.rows] for surface in run.trajectory.surfaces if surface.role == "cloth"]


def still_knotted(run: Run) -> str:
    """The same knot in each frame, and drawn together."""
    for frame in range(len(run.times)):
        (line,) = _lines(run, frame)
        last, first = (end + FAR * unit(end - before) for end, before in ((line[-1], line[-2]), (line[0], line[1])))
        far = np.stack([last, [0.0, -3 * FAR, 0.0], first])
        if (found := determinant([np.concatenate([line, far])])) != 7:
            return f"the knot has the determinant {found} in frame {frame}"
    before, after = (abs(line[0, 0] - line[-1, 0]) for line in (_lines(run, 0)[0], _lines(run, -1)[0]))
    return "" if after > before + 0.2 else "it was not pulled"


def still_linked(run: Run) -> str:
    """Two linked rings in each frame, that were taut once."""
    distances = []
    for frame in range(len(run.times)):
        lines = _lines(run, frame)
        distances.append(abs(lines[0].mean(axis=0)[0] - lines[1].mean(axis=0)[0]))
        if (found := determinant(lines)) != 2:
            return f"the rings have the determinant {found} in frame {frame}"
    return "" if max(distances) > 0.15 else "the rings never met"


CASES = (
    Case("B30a", "knot in a cord, each end pulled at 2 m/s", pulled, still_knotted, jitters=False),
    Case("B30b", "two linked rings of cord, each thrown outwards at 8 m/s", thrown, still_linked, jitters=False),
)
