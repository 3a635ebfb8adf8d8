"""Swatch card: the Cusick drape of each named fabric, side by side.

A disc of cloth of 30 cm is held between two discs of 18 cm, as in the drape tester, and hangs over their edge
(docs/results/validation.md, A7). The meshes are coarse: for comparison by eye, not for measurement.

Membrane and bending are those of a scene that names no model. The model is elastic: the hysteresis of a real cloth, by
which its drape depends on how it was laid, is not in it, so that a coefficient here is not one of a drape tester.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from clothsim.base.arrays import Floats
from clothsim.keys.fabric_table import FABRICS
from clothsim.mesh.generators.shapes import disk, tube
from clothsim.mesh.topology import border_edges
from clothsim.render.picture import picture_setup, rendered
from clothsim.render.surface_look import Surface
from clothsim.run.simulate import simulate
from clothsim.scene.scene import Scene

RADIUS, HELD = 0.15, 0.09
"""Radii of the cloth and of the discs that hold it [m]."""
RINGS = 15
SIZE = (360, 290)
COLUMNS = 5
VIEW = (0.4, -1.0, 0.75)
LIMIT, DT = 6.0, 0.04
REST_SPEED = 3e-3
"""Longest time [s], steps [s], and the speed [m/s] below which a swatch hangs still."""


def cusick_scene(fabric: str, rings: int | None = None) -> Scene:
    """The drape of a fabric from flat, damped until it hangs still."""
    rings = RINGS if rings is None else rings
    positions, _ = disk(RADIUS, rings)
    held = np.flatnonzero(np.linalg.norm(positions, axis=1) < HELD + 1e-9)
    return Scene(
        cloth={"name": fabric, "mesh": "disk", "radius": RADIUS, "cells": rings, "fabric": fabric},
        effects={
            "pins": {"select": [int(row) for row in held], "clamp": True},
            "inertia": {},
            "membrane": {},
            "bending": {},
            "gravity": {},
            "damping": {"rate": 8.0},
        },
        solver={"dt": DT},
        run={"duration": LIMIT, "until": "rest", "rest_speed": REST_SPEED, "frames_per_second": 5},
    )


def drape_coefficient(positions: Floats, triangles: np.ndarray) -> float:
    """The fraction of the free ring that the cloth's shadow covers, from its outline seen from above.

    (A - pi r^2)/(pi R^2 - pi r^2) (BS 5058), A within the border's polygon.
    """
    edges, _ = border_edges(triangles)
    start, end = positions[edges[:, 0]], positions[edges[:, 1]]
    shadow = 0.5 * abs(float(np.sum(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0])))
    return (shadow - np.pi * HELD**2) / (np.pi * (RADIUS**2 - HELD**2))


def draw_swatches(fabrics: Sequence[str], file: Path, report: Callable[[str], None] = print) -> str:
    """Drape each of `fabrics` and write them to one PNG; `report` gets a line for each. Returns the renderer's line."""
    panels, note = [], ""
    for name in fabrics:
        run = simulate(cusick_scene(name))
        cloth = run.trajectory.surfaces[0]
        percent = 100 * drape_coefficient(run.positions(-1), cloth.own_triangles)
        still = "at rest" if run.summary["certificate"]["at_rest"] else "NOT at rest"
        report(f"{name}: {run.status}, {still}, elastic drape coefficient {percent:.0f} %")
        fabric = FABRICS[name]
        title = f"{name.replace('_', ' ')}\n{1e3 * fabric.density:.0f} g/m2, drapes to {percent:.0f} %"
        positions, triangles = tube(0.98 * HELD, HELD, (48, 2))
        below = np.array([0.0, 0.0, -0.5 * HELD - 2e-3])
        surfaces = [
            Surface(cloth.name, run.positions(-1), cloth.own_triangles, "cloth", np.zeros((0, 2))),
            Surface("pedestal", positions + below, triangles, "body", np.zeros((0, 2))),
        ]
        angle = np.linspace(0, 2 * np.pi, 24)
        rim = 0.95 * RADIUS * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(24)])
        focus = np.concatenate([rim, 0.75 * rim - [0.0, 0.0, 0.3 * RADIUS]])
        look: dict[str, Any] = {"size": SIZE, "colour": "plain", "up": "z", "view": VIEW, "renderer": "auto"}
        setup = picture_setup([surfaces], title=title, samples=3, focus=focus, **look)
        panels.append(rendered(setup, surfaces))
        note = setup.note
    columns = min(COLUMNS, len(panels))
    empty = np.broadcast_to(panels[0][:, :1], panels[0].shape)
    panels += [empty] * (-len(panels) % columns)
    rows = [np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)]
    Image.fromarray(np.vstack(rows)).save(file, format="PNG")
    return note
