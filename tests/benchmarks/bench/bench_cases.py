"""Benchmark cases: short named scenes that start from a state in contact."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.scene.scene import Scene
from clothsim.study.points import with_preset

ROOT = Path(__file__).parents[3]
"""The repository: scenes/, and ../shared beside it where the real data is there."""

D_HAT, RADIUS, FRICTION = 1e-3, 0.3, 0.4
FALL = 1.0
"""Speed at which the cloth meets the ball [m/s]."""
FOLD = 0.01
"""Radius of the fold [m]: the layers start twice that apart."""
OFF_CENTRE = 0.0037
"""The fold is off the middle [m], so that no vertex of a layer lies exactly over one of the other."""
WRUNG = 1.0
"""The strip starts as its ends have turned it after this time [s]."""

CONTACT: Mapping[str, Any] = {
    "body_contact": {"d_hat": D_HAT},
    "self_contact": {"d_hat": D_HAT},
    "friction": {"coefficient": FRICTION},
}
CLOTH: Mapping[str, Any] = {"inertia": {}, "membrane": {}, "bending": {}}


@dataclass(frozen=True)
class Case:
    """One row: its kind, and what of it is measured.

    kind: "steps" of a scene, "fit" or "import"; lead: steps from the start to the state that is kept, with ten times
    the tolerance; settle: steps from there to the state that is measured from (they compile, too); start: how the cloth
    lies at first, "" as the scene says; once: one trial only, it takes long; needs: a file without which it is skipped.
    """

    name: str
    kind: str = "steps"
    scene: Scene | None = None
    lead: int = 3
    settle: int = 1
    steps: int = 1
    start: str = ""
    once: bool = False
    needs: Path | None = None
    keys: Mapping[str, Any] = field(default_factory=dict)


def sphere(cells: int, height: float = 1.5 * D_HAT, fall: float = FALL, **solver: float) -> Scene:
    """A metre of cotton, `cells` x `cells`, `height` above a ball of 0.3 m; it may touch itself, and friction holds."""
    return Scene(
        cloth={
            "mesh": "rectangle",
            "size": (1.0, 1.0),
            "cells": (cells, cells),
            "position": (0.0, 0.0, RADIUS + height),
            "velocity": (0.0, 0.0, -fall),
        },
        body={"name": "ball", "mesh": "sphere", "radius": RADIUS},
        effects={**CLOTH, "gravity": {}, **CONTACT},
        solver={"dt": 0.02, "tolerance": 1e-3, "threads": 1, **solver},
        run={"duration": 1.0},
    )


def falling(settings: Mapping[str, Any], **solver: Any) -> Scene:
    """The sheet of 100 x 100 cells released 5 cm above the ball, with `settings` of its effects by name."""
    scene = sphere(100, height=0.05, fall=0.0)
    own = {key: value for key, value in scene.solver.items() if key != "tolerance"}
    return replace(scene, effects={**scene.effects, **settings}, solver={**own, **solver})


def fold(cells: int) -> Scene:
    """A metre of cotton on a table, folded once: the upper layer falls onto the lower."""
    return Scene(
        cloth={"mesh": "rectangle", "size": (1.0, 1.0), "cells": (cells, cells), "position": (0, 0, 1.5 * D_HAT)},
        body={
            "name": "table",
            "mesh": "slab",
            "size": (1.4, 1.4, 0.05),
            "cells": (8, 8, 1),
            "position": (0, 0, -0.025),
        },
        effects={**CLOTH, "gravity": {}, **CONTACT},
        solver={"dt": 0.02, "tolerance": 1e-3, "threads": 1},
        run={"duration": 1.0},
    )


def from_file(name: str, **solver: float) -> Scene:
    """A scene of the folder scenes/, on one thread."""
    from clothsim.scene.toml_file import load_scene

    scene = load_scene(ROOT / "scenes" / name)
    sections = {each: getattr(scene, each) for each in ("cloth", "body", "effects", "contact", "run", "seed")}
    return Scene(**sections, solver={**scene.solver, "threads": 1, **solver}, directory=scene.directory)


def folded(rest: Floats) -> Floats:
    """The flat sheet `rest (n, 3)` bent round a half circle of radius FOLD near x = 0, its left half in place."""
    s = rest[:, 0] - OFF_CENTRE
    half = 0.5 * np.pi * FOLD
    angle = np.clip((s + half) / FOLD, 0.0, np.pi)
    straight = np.where(s < -half, s + half, np.where(s > half, half - s, 0.0))
    x = OFF_CENTRE - half + straight + FOLD * np.sin(angle)
    return np.column_stack([x, rest[:, 1], rest[:, 2] + FOLD * (1 - np.cos(angle))])


def wrung(rest: Floats) -> Floats:
    """The flat strip `rest (n, 3)` as a helicoid: cross-sections turned about x, the ends by what WRUNG seconds do."""
    angle = -np.radians(180.0 * WRUNG) * rest[:, 0] / np.abs(rest[:, 0]).max()
    y, z = rest[:, 1], rest[:, 2]
    return np.column_stack([rest[:, 0], y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)])


STARTS = {"folded": (folded, 0.0), "wrung": (wrung, WRUNG)}
"""Where the cloth starts, and the time then [s]."""

QUICK = ("import", "sphere 40", "twist", "fit")
"""The cases of --quick."""


ORACLE = ("sphere 40", "sphere 100", "fold 100")
"""The cases of --oracle."""


def benchmark() -> tuple[Case, ...]:
    """The set."""
    scenes = ROOT / "scenes"
    dress = ROOT.parent / "shared" / "data" / "dress_on_body"
    return (
        Case("import", "import", keys={"code": "from clothsim import simulate"}),
        Case("sphere 40", scene=sphere(40), steps=2),
        Case("sphere 100", scene=sphere(100)),
        Case("sphere 200", scene=sphere(200), once=True),
        Case("fold 100", scene=fold(100), start="folded", lead=2, steps=2),
        Case("twist", scene=from_file("twist.toml"), start="wrung", lead=6, steps=2),
        Case("fit", "fit", keys={"garment": str(scenes / "shirt.toml"), "to": str(scenes / "shirt_large.toml")}),
        Case("dress", scene=from_file("dress.toml"), lead=1, once=True, needs=dress),
    )


PEERS: Mapping[str, Any] = {"membrane": {"material": "neo_hookean"}, "bending": {"model": "hinge"}}
"""Effects as other simulators have them: an isotropic sheet, hinges."""
WINDOWS = {"free fall, 0 to 0.1 s": (0, 5), "first touch, 0.1 to 0.2 s": (5, 5), "crumpling, 0.2 to 0.4 s": (10, 10)}
"""Windows of `falling` at dt 0.02 s: steps before them, and their steps."""


def windows() -> tuple[Case, ...]:
    """Each window with the settings of other simulators, with the defaults at the same tolerance, and as they are."""
    settings: Mapping[str, Scene] = {
        "as peers": falling(PEERS, integrator="backward_euler", tolerance=1e-3),
        "defaults, tolerance 1e-3": falling({}, tolerance=1e-3),
        "defaults": falling({}),
    }
    return tuple(
        Case(f"{name}: {window}", scene=scene, lead=lead, settle=0, steps=steps)
        for name, scene in settings.items()
        for window, (lead, steps) in WINDOWS.items()
    )


def aims() -> tuple[Case, ...]:
    """Aims (docs/results/performance.md): 1 s from 10 mm above the ball at 40x40, 0.2 s of impact at 100x100."""
    above = {"height": 0.01, "fall": 0.0}
    draft, fine = (with_preset(sphere(cells, **above), "draft")[0] for cells in (40, 80))
    standard = with_preset(sphere(40, **above), "standard")[0]
    impact = with_preset(sphere(100), "standard")[0]
    return (
        Case("aim draft of 40x40", scene=draft, lead=0, settle=0, steps=25, once=True),
        Case("aim draft on 40x40 cells", scene=fine, lead=0, settle=0, steps=25, once=True),
        Case("aim standard 40x40", scene=standard, lead=0, settle=0, steps=100, once=True),
        Case("aim standard 100x100, impact", scene=impact, lead=3, settle=0, steps=20, once=True),
    )
