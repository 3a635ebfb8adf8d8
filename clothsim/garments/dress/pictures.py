"""Pictures of a dressed garment: panels as placed, the garment worn and its stretch, from the front and the back."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.garments.dress.facing import front_of
from clothsim.garments.dress.garment_surfaces import body_surface_look, garment_surface
from clothsim.garments.inputs import Figure
from clothsim.render import Surface

if TYPE_CHECKING:
    from clothsim.garments.dress.dressed import Dress

SIZE = (640, 960)
PLACED, WORN, STRETCH = "placed.png", "worn.png", "stretch.png"
VIEWS = (("front", (0.3, 0.12, 1.0)), ("back", (0.3, 0.12, -1.0)))
"""View directions along x, up, and the direction that the body faces."""
ABOVE = 0.25
"""Height of the body that is shown above and below the garment, as a fraction of the garment's."""


def draw_dress(done: "Dress") -> list[Path]:
    """Write placed.png, worn.png in plain colour with its seams, and stretch.png; returns their paths."""
    title = {"completed": "worn", "sewn": "sewn, not draped"}.get(done.status, done.status)
    placed = garment_surface(done.placed, done.placed.positions, fabrics=done.fabrics)
    worn = garment_surface(done.state, done.state.positions, fabrics=done.fabrics)
    stretched = garment_surface(done.state, done.state.positions, done.state.stretches())
    return [
        _pair(done.directory / PLACED, "as placed", placed, done.body),
        _pair(done.directory / WORN, title, worn, done.body),
        _pair(done.directory / STRETCH, f"{title}, stretch", stretched, done.body),
    ]


def _pair(file: Path, title: str, garment: Surface, body: Figure) -> Path:
    """Write a picture from the front and from the back side by side."""
    from PIL import Image

    from clothsim.render import picture_setup, rendered

    surfaces = [garment, body_surface_look(body)]
    panels = []
    for side, view in VIEWS:
        setup = picture_setup(
            [surfaces],
            size=SIZE,
            colour="stretch" if len(garment.principal_stretches) else "plain",
            up=body.up,
            view=view_of(view, body),
            title=f"{title}, {side}",
            renderer="auto",
            focus=_focus(garment.positions, body),
        )
        panels.append(rendered(setup, surfaces))
    Image.fromarray(np.hstack(panels)).save(file, format="PNG")
    return file


def view_of(view: tuple[float, float, float], body: Figure) -> Floats:
    """Direction (3,) from a body to the camera, given along its left, up and front."""
    left, up, front = view
    forward = front_of(body)
    return np.asarray(left * np.cross(body.up, forward) + up * body.up + front * forward, np.float64)


def _focus(positions: Floats, body: Figure) -> Floats:
    """Points that the picture shows: the garment, and the body beside it."""
    levels, own = body.positions @ body.up, positions @ body.up
    room = ABOVE * float(np.ptp(own))
    near = (levels > own.min() - room) & (levels < own.max() + room)
    return np.concatenate([positions, body.positions[near]])
