"""Picture of a fit: the garment before, after transfer, and fitted."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from clothsim.base.arrays import Floats
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.stages import Garment
from clothsim.render import Surface, picture_setup, rendered

if TYPE_CHECKING:
    from clothsim.garments.fit.fit import Fit

SIZE = (640, 960)
FRONT = (0.35, 0.15, 1.0)
"""View direction: to the right of a person that faces the camera, slightly above; along x, up, and the third axis."""


def draw_fit(done: "Fit", file: Path) -> str:
    """Write a PNG of the garment on its body, transferred, and fitted; returns the renderer's note.

    All panels have one camera, moved with the body, so that bodies and garments are drawn in one size.
    """
    panels = _panels(done)
    title, _, target, _ = panels[-1]
    right, up, front = FRONT
    surfaces = [_surfaces(done.garment, points, figure, each) for _, points, figure, each in panels]
    setup = picture_setup(
        [surfaces[-1]],
        size=SIZE,
        colour="stretch",
        up=target.up,
        view=(right, up, front) if target.up[1] else (right, -front, up),
        title=title,
        renderer="auto",
        smooth=done.status in ("completed", "distorted"),  # in others triangles may cross, and are drawn as they are
        focus=np.concatenate([points + _displacement_to(figure, target) for _, points, figure, _ in panels]
                             + [figure.positions + _displacement_to(figure, target) for _, _, figure, _ in panels]),
    )  # fmt: skip
    pictures = []
    for (name, _, figure, _), drawn in zip(panels[:-1], surfaces[:-1], strict=True):
        camera = replace(setup.camera, position=setup.camera.position - _displacement_to(figure, target))
        pictures.append(rendered(replace(setup, camera=camera, scale=None, title=name, smooth=False), drawn))
    Image.fromarray(np.hstack([*pictures, rendered(setup, surfaces[-1])])).save(file, format="PNG")
    return setup.note


def _displacement_to(figure: BodyMesh, target: BodyMesh) -> Floats:
    """Displacement from one body's middle to the other's, (3,) [m]; 0 where their upward axes differ."""
    if not np.allclose(figure.up, target.up):
        return np.zeros(3)
    own, other = (np.array([each.positions.min(axis=0), each.positions.max(axis=0)]) for each in (figure, target))
    return np.asarray(other.mean(axis=0) - own.mean(axis=0), np.float64)


def _panels(done: "Fit") -> list[tuple[str, Floats, BodyMesh, Floats]]:
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


def _surfaces(garment: Garment, positions: Floats, figure: BodyMesh, stretches: Floats) -> list[Surface]:
    body = Surface(figure.name, figure.positions, figure.triangles, "body", np.zeros((0, 2)))
    return [Surface(garment.name, positions, garment.triangles, "cloth", stretches), body]
