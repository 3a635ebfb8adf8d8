"""Pictures of a dressed garment: the panels as placed, and worn, from the front and from the back."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clothsim.arrays import Floats
from clothsim.dressing.sewing_state import SewingState
from clothsim.fitting.inputs import Figure
from clothsim.render.surface_look import Surface

if TYPE_CHECKING:
    from clothsim.dressing.dress import Dress

SIZE = (640, 960)
PLACED, WORN = "placed.png", "worn.png"
VIEWS = (("front", (0.3, 0.12, 1.0)), ("back", (0.3, 0.12, -1.0)))
"""View directions along x, up, and the direction that the body faces."""
ABOVE = 0.25
"""Height of the body that is shown above and below the garment, as a fraction of the garment's."""


def draw_dress(done: "Dress") -> list[Path]:
    """Write placed.png and worn.png; returns their paths."""
    plain = np.zeros((0, 2))
    title = {"completed": "worn", "sewn": "sewn, not draped"}.get(done.status, done.status)
    return [
        _pair(done.directory / PLACED, "as placed", done.placed, plain, done.body),
        _pair(done.directory / WORN, title, done.state, done.state.stretches(), done.body),
    ]


def _pair(file: Path, title: str, state: SewingState, stretches: Floats, body: Figure) -> Path:
    """Write a picture from the front and from the back side by side."""
    from PIL import Image

    from clothsim.render.picture import picture_setup, rendered

    surfaces = [
        Surface("garment", state.positions, state.triangles, "cloth", stretches),
        Surface(body.name, body.positions, body.triangles, "body", np.zeros((0, 2))),
    ]
    panels = []
    for side, view in VIEWS:
        setup = picture_setup(
            [surfaces],
            size=SIZE,
            colour="stretch" if len(stretches) else "plain",
            up=body.up,
            view=_view(view, body),
            title=f"{title}, {side}",
            renderer="auto",
            focus=_focus(state.positions, body),
        )
        panels.append(rendered(setup, surfaces))
    Image.fromarray(np.hstack(panels)).save(file, format="PNG")
    return file


def _view(view: Sequence[float], body: Figure) -> tuple[float, float, float]:
    right, up, front = view
    return (right, up, front) if body.up[1] else (right, -front, up)


def _focus(positions: Floats, body: Figure) -> Floats:
    """Points that the picture shows: the garment, and the body beside it."""
    levels, own = body.positions @ body.up, positions @ body.up
    room = ABOVE * float(np.ptp(own))
    near = (levels > own.min() - room) & (levels < own.max() + room)
    return np.concatenate([positions, body.positions[near]])
