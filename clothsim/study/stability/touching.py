"""Starts at the edge of contact: things exactly aligned, gaps down to nothing, bodies that jump through cloth."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from clothsim.contact.barrier import Barrier
from clothsim.io.run import Run
from clothsim.scene.build import build
from clothsim.scene.scene import Scene
from clothsim.study.stability.case import Case, all_of, energy_falls, scene_of, steps_descend

FALLING: dict[str, dict[str, Any]] = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}}
SOLVER = {"dt": 0.01}
SIZE, THICK = 0.4, 0.05
D_HAT = 4e-3


def cells(small: bool) -> list[int]:
    """Cells of a sheet."""
    return [8, 8] if small else [32, 32]


def above(small: bool, gap: float, shift: Sequence[float] = (0, 0), slab_turn: float = 0.0) -> Scene:
    """A sheet `gap` above a slab (or above its ridge, where it is turned about y) whose top is at z = 0.

    Sheet and slab have the same grid: without a shift each edge lies over an edge, each vertex over a vertex.
    """
    low = -THICK / 2 if not slab_turn else -SIZE / np.sqrt(2)
    slab_size = [SIZE, SIZE, THICK] if not slab_turn else [SIZE, SIZE, SIZE]
    slab_cells = [*cells(small), 1] if not slab_turn else [1, 1, 1]
    return Scene(
        cloth={"mesh": "rectangle", "size": [SIZE, SIZE], "cells": cells(small), "position": [*shift, gap]},
        body={
            "name": "table",
            "mesh": "slab",
            "size": slab_size,
            "cells": slab_cells,
            "position": [0, 0, low],
            "rotation_degrees": [0, slab_turn, 0],
        },
        effects=FALLING | {"body_contact": {"d_hat": D_HAT}},
        solver=SOLVER,
        run={"duration": 0.2 if small else 0.5},
    )


def side_by_side(small: bool, shift: float) -> Scene:
    """Two sheets in one plane that fly at each other, edge to edge: everything is coplanar, edges are parallel."""
    half = [SIZE / 2 + 3 * D_HAT, SIZE / 2]
    sheet = {"mesh": "rectangle", "size": half, "cells": cells(small)}
    away = half[0] / 2 + D_HAT
    return Scene(
        cloth=[
            sheet | {"name": "left", "position": [-away, 0, 0], "velocity": [0.5, 0, 0]},
            sheet | {"name": "right", "position": [away, shift, 0], "velocity": [-0.5, 0, 0]},
        ],
        effects={"inertia": {}, "membrane": {}, "bending": {}, "self_contact": {"d_hat": D_HAT}},
        solver=SOLVER,
        run={"duration": 0.1 if small else 0.3},
    )


def derivatives_finite(run: Run) -> str:
    """The barrier, its force and its Hessian are finite in every frame, also where edges are exactly parallel."""
    built = build(scene_of(run))
    for frame in range(len(run.times)):
        x = built.world.start()
        x[: built.world.n_cloth] = run.positions(frame)
        for name, energy in built.energies.items():
            if isinstance(energy, Barrier):
                made = energy.value(x), energy.gradient(x), energy.hessian(x).blocks
                if not all(np.isfinite(part).all() for part in made):
                    return f"{name} is not finite in frame {frame}"
    return ""


ALIGNED = all_of(derivatives_finite, energy_falls)
BUCKLED = all_of(derivatives_finite, steps_descend)

CASES = (
    Case("B10a", "sheet over a slab of the same grid", lambda small: above(small, D_HAT / 2), ALIGNED),
    Case("B10b", "its edges over the slab's, shifted", lambda small: above(small, D_HAT / 2, [SIZE / 16, 0]), ALIGNED),
    Case("B10c", "its edge on a parallel ridge", lambda small: above(small, D_HAT / 2, slab_turn=45), ALIGNED),
    Case(
        "B10d",
        "points on a ridge",
        lambda small: above(small, D_HAT / 2, [SIZE / 2 / cells(small)[0], 0], slab_turn=45),
        ALIGNED,
    ),
    Case("B10e", "coplanar sheets, edge to edge", lambda small: side_by_side(small, 0.0), BUCKLED),
    Case("B10f", "coplanar sheets, point to edge", lambda small: side_by_side(small, SIZE / 32), BUCKLED),
)
