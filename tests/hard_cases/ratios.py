"""Extreme stiffness and density ratios: stiff on soft cloth, area densities from .001 to 100."""

from collections.abc import Callable

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.keys.fabric_table import FABRICS
from clothsim.physics.energies.base import Energy, Step
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import Built, build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, scene_of
from tests.hard_cases.twist import ELASTIC

BALANCE = 1e-6
"""Of the weight: the largest force that may be left over."""

SOFT = 5e4
"""Young's modulus of the softer cloth [Pa]."""

REST, LONG = {"dt": 0.1, "tolerance": 1e-6}, {"duration": 10.0, "frames_per_second": 10}
"""Long steps, which damp, solved tightly, until nothing moves."""
SLOWEST = LONG | {"duration": 20.0}
"""A heavy sheet has an overdamped motion that decays as exp(-t / 4 s): 1.2 mm/s at 10 s, .1 mm/s at 20 s."""


def stiff_on_soft(ratio: float, bends: bool = True) -> Callable[[bool], Scene]:
    """A sheet `ratio` times as stiff (in bending too, or not) lies on a soft one held at its border, until at rest.

    Two sheets that touch, for two halves of one cloth cannot have fabrics of their own yet.
    """

    def scene(small: bool) -> Scene:
        n = 6 if small else 16
        soft = {"name": "soft", "mesh": "rectangle", "size": [0.4, 0.4], "cells": (n, n), "youngs_modulus": SOFT}
        stiff = soft | {"name": "stiff", "size": [0.2, 0.2], "position": [0, 0, 0.004], "youngs_modulus": ratio * SOFT}
        return Scene(
            cloth=[
                soft,
                stiff | {"bending_stiffness": (ratio if bends else 1.0) * FABRICS["cotton"].bending_stiffness},
            ],
            effects=ELASTIC
            | {
                "gravity": {},
                "self_contact": {},
                "damping": {"rate": 5.0},
                "pins": {"select": border(n)},
            },
            solver=REST,
            run=LONG,
        )

    return scene


def border(n: int) -> list[int]:
    """The border vertices of a rectangle of n x n cells."""
    i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
    return np.flatnonzero((i % n == 0) | (j % n == 0)).tolist()


def hung(density: float) -> Callable[[bool], Scene]:
    """A sheet of `density` [kg/m2], held at its upper edge, swings down and hangs still."""

    def scene(small: bool) -> Scene:
        n = 6 if small else 20
        return Scene(
            cloth={
                "mesh": "rectangle",
                "size": [0.2, 0.2],
                "cells": (n, n),
                "rotation_degrees": [80, 0, 0],
                "density": density,
            },
            effects=ELASTIC | {"gravity": {}, "damping": {"rate": 5.0}, "pins": {"select": "top"}},
            solver=REST,
            run=SLOWEST,
        )

    return scene


def balanced(run: Run) -> str:
    """At the end the pins carry all the weight, and no force is left on a cloth as a whole or, alone, on a vertex.

    From the last positions and the scene: membrane, bending and gravity of each cloth are summed again. A vertex is
    measured where nothing touches it; what contact puts on the others shows in the sums.
    """
    built = build(scene_of(run))
    x = np.concatenate([run.positions(-1), built.world.start()[built.world.n_cloth :]])
    forces = -np.sum([energy.gradient(x) for energy in still_energies(built, x)], axis=0)[: built.world.n_cloth]
    weight = 9.81 * float(built.world.masses.sum())
    held = np.zeros(len(forces), bool)
    for constraint in built.constraints.values():
        held[constraint.at(0.0).vertices] = True
    left = float(np.linalg.norm(forces[held].sum(axis=0) - [0, 0, -weight])) / weight
    if left > BALANCE:
        return f"the pins carry the weight but for {left:.2g} of it"
    alone = ~held & ~touched(built, x)
    left = float(np.linalg.norm(forces[alone], axis=1).max(initial=0.0)) / weight
    return f"a vertex keeps a force of {left:.2g} of the weight" if left > BALANCE else ""


def still_energies(built: Built, x: Floats) -> list[Energy]:
    """The energies of a body at rest that need no contact, bound to x."""
    step = Step(0.0, 1.0, x, np.zeros_like(x), 1.0, np.zeros_like(x))
    names = ("membrane", "bending", "gravity")
    return [built.energies[name].begin(step) for name in names]


def touched(built: Built, x: Floats) -> np.ndarray:
    """Mask of the cloth vertices with a contact force, (n_cloth,)."""
    if "self_contact" not in built.energies:
        return np.zeros(built.world.n_cloth, bool)
    return np.asarray(built.energies["self_contact"].gradient(x)[: built.world.n_cloth].any(axis=1))


CASES = (
    Case("B8a", "stiff sheet on a soft one, stiffness ratio 1e6", stiff_on_soft(1e6), balanced),
    Case("B8b", "stiff sheet on a soft one, stiffness ratio 1e8", stiff_on_soft(1e8), balanced),
    Case("B8e", "the same, ratio 1e6 in the membrane only", stiff_on_soft(1e6, bends=False), balanced, slow=True),
    Case("B8c", "hanging sheet of 1e-3 kg/m2", hung(1e-3), balanced),
    Case("B8d", "hanging sheet of 100 kg/m2", hung(1e2), balanced),
)
