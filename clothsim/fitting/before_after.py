"""Picture of a fit: the garment before, after transfer, and fitted."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clothsim.arrays import Floats
from clothsim.fitting.inputs import Figure
from clothsim.fitting.stage import Garment
from clothsim.render.surface_look import Surface

if TYPE_CHECKING:
    from clothsim.fitting.fit import Fit

SIZE = (640, 960)
FRONT = (0.35, 0.15, 1.0)
"""View direction: to the right of a person that faces the camera, slightly above; along x, up, and the third axis."""


def draw_fit(done: "Fit", file: Path) -> str:
    """Write a PNG of the garment on its body, transferred, and fitted; returns the renderer's note."""
    from PIL import Image

    from clothsim.render.picture import picture_setup, rendered

    panels, note = [], ""
    for title, positions, figure, stretches in _panels(done):
        surfaces = _surfaces(done.garment, positions, figure, stretches)
        setup = picture_setup(
            [surfaces],
            size=SIZE,
            colour="stretch",
            up=figure.up,
            view=_view(figure),
            title=title,
            renderer="auto",
            smooth=False,  # before it, triangles cross
            focus=np.concatenate([figure.positions, positions]),
        )
        panels.append(rendered(setup, surfaces))
        note = setup.note
    Image.fromarray(np.hstack(panels)).save(file, format="PNG")
    return note


def _panels(done: "Fit") -> list[tuple[str, Floats, Figure, Floats]]:
    plain = np.zeros((0, 2))
    first = done.stages[0]
    panels = [(f"before, on {done.source.name}", first.positions, done.source, plain)]
    seed = next((stage for stage in done.stages if stage.name == ("size" if done.size.factors else "transfer")), None)
    if seed is not None:
        panels.append((f"transferred to {done.target.name}", seed.positions, done.target, plain))
    ending = {
        "completed": "fitted and draped",
        "distorted": "draped, distorted",
        "refined": "refined, not simulated",
        "failed": f"failed; the best: {done.answer.name}",
    }
    panels.append((ending[done.status], done.positions, done.target, done.cost.stretches))
    return panels


def _surfaces(garment: Garment, positions: Floats, figure: Figure, stretches: Floats) -> list[Surface]:
    body = Surface(figure.name, figure.positions, figure.triangles, "body", np.zeros((0, 2)))
    return [Surface(garment.name, positions, garment.triangles, "cloth", stretches), body]


def _view(figure: Figure) -> tuple[float, float, float]:
    right, up, front = FRONT
    return (right, up, front) if figure.up[1] else (right, -front, up)
