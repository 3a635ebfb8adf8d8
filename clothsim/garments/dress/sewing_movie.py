"""Movie of the sewing: the seams closing, then the drape, seen by one camera."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from clothsim import Run
from clothsim.engine import Fabric
from clothsim.garments.dress.dress import touching_seams
from clothsim.garments.dress.garment_surfaces import body_surface_look, garment_surface
from clothsim.garments.dress.pictures import view_of
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.render import Surface

if TYPE_CHECKING:
    from clothsim.garments.dress.dressed import Dress

VIEW = (0.55, 0.2, 1.0)
"""View direction along the body's left, up and front."""
SIZE = (540, 720)
RATE = 10.0
"""Frames a second: as fast as it was."""


def draw_sewing(done: "Dress", target: Path, progress: Callable[[int, int], None] = lambda done, total: None) -> str:
    """Write an .mp4 or .gif of the closing and the drape; returns the line that names the renderer.

    InputError for another ending; MissingPackageError for an .mp4 without the extra `movies`.
    """
    from clothsim.render import write_movie as movie

    return movie(
        target,
        frames_of(done),
        frames_per_second=RATE,
        size=SIZE,
        colour="plain",
        up=done.body.up,
        view=view_of(VIEW, done.body),
        progress=progress,
    )


def frames_of(done: "Dress") -> list[list[Surface]]:
    """Garment and body of each frame: as placed, of each round of closing, of the drape."""
    body = body_surface_look(done.body)
    in_pieces = done.placed.weld(touching_seams(done.placed))
    frames = [[garment_surface(done.placed, done.placed.positions, fabrics=done.fabrics), body]]
    for run in done.closing:
        frames += [[garment, body] for garment in _frames(in_pieces, run, done.fabrics)]
    if done.run is not None:
        frames += [[garment, body] for garment in _frames(done.state, done.run, done.fabrics)]
    return frames


def _frames(state: SewingState, run: Run, fabrics: Mapping[str, Fabric]) -> list[Surface]:
    return [garment_surface(state, run.positions(number), fabrics=fabrics) for number in range(len(run))]
