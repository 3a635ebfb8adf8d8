"""Initial states near contact: exact alignment, vanishing gaps, bodies that jump through cloth."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from clothsim.physics.contact.barrier import Barrier
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case, all_of, scene_of, steps_descend

FALLING: dict[str, dict[str, Any]] = {"inertia": {}, "membrane": {}, "bending": {}, "gravity": {}}
SOLVER = {"dt": 0.01, "tolerance": 1e-5}
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
        solver=SOLVER
        | {"max_iterations": 400},  # the first step leaves a gap of 1e-10 m; halved ones would throw the sheet
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


def stays_on_top(run: Run) -> str:
    """No vertex over the slab is below its top."""
    x = run.positions(-1)
    over = (np.abs(x[:, :2]) < SIZE / 2).all(axis=1)
    lowest = float(x[over, 2].min(initial=np.inf))
    return f"a vertex is {-lowest:.2g} m below the slab's top" if lowest <= 0 else ""


def not_thrown(run: Run) -> str:
    """A barrier entered at its very bottom lets go within about its own range: the sheet stays near."""
    highest = max(float(run.positions(frame)[:, 2].max()) for frame in range(len(run.times)))
    return f"the sheet was thrown {highest:.2g} m up" if highest > 10 * D_HAT else ""


def starts(number: int, gap: float) -> Case:
    """The case of a sheet so far above a slab. Jitter goes sideways only: it is larger than the gap."""
    check = all_of(stays_on_top, not_thrown, steps_descend)
    return Case(
        f"B14{'abcdefgh'[number]}",
        f"sheet starts {gap:g} m above a slab",
        lambda small: above(small, gap),
        check,
        **SIDEWAYS,
    )


SIDEWAYS: dict[str, Any] = {"jitter_axes": (1.0, 1.0, 0.0)}
GAPS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
ALIGNED = all_of(derivatives_finite, steps_descend)
"""The total energy may rise: by .6 % in a step where coplanar sheets buckle, by .02 % in B10d, at any tolerance."""

CASES = (
    Case("B10a", "sheet over a slab with the same grid", lambda small: above(small, D_HAT / 2), ALIGNED),
    Case("B10b", "the same, shifted along x", lambda small: above(small, D_HAT / 2, [SIZE / 16, 0]), ALIGNED),
    Case(
        "B10c", "sheet over a ridge along its middle edge", lambda small: above(small, D_HAT / 2, slab_turn=45), ALIGNED
    ),
    Case(
        "B10d",
        "the same, shifted by half a cell",
        lambda small: above(small, D_HAT / 2, [SIZE / 2 / cells(small)[0], 0], slab_turn=45),
        ALIGNED,
    ),
    Case("B10e", "coplanar sheets collide edge to edge", lambda small: side_by_side(small, 0.0), ALIGNED),
    Case("B10f", "the same, shifted along the edge", lambda small: side_by_side(small, SIZE / 32), ALIGNED),
    *(starts(number, gap) for number, gap in enumerate(GAPS)),
    Case(
        "B14h",
        "sheet starts in contact with a slab: must be refused",
        lambda small: above(small, 0.0),
        refused=("cloth", "table"),
        **SIDEWAYS,
    ),
)
