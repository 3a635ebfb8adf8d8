"""Picture from several sides with marked points and triangles, and a key of the marks below it."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from clothsim.base.arrays import Floats
from clothsim.render.closeup import INK, pixels, ring
from clothsim.render.legend import add_legend, label
from clothsim.render.picture import picture_setup, rendered_without_legend
from clothsim.render.surface_look import Surface

LIGHT = (255, 205, 40)
"""Colour of a dot of fraction 0; INK is that of 1."""
OUTLINE = (30, 30, 34, 255)
"""Of marked triangles."""
STRIP = (238, 239, 241)
"""The colour behind the key."""


def draw_marks(
    path: str | Path,
    surfaces: Sequence[Surface],
    views: Sequence[tuple[Floats, str]],
    *,
    outlined: Floats,
    dots: Floats,
    fractions: Floats,
    visible: Callable[[Floats], tuple[np.ndarray, np.ndarray]],
    key: Sequence[str],
    size: tuple[int, int],
    up: Floats,
) -> str:
    """Write a PNG of surfaces with triangles outlined and dots, one view beside the other; returns the renderer's note.

    Parameters
    ----------
    path : str or Path
        The picture.
    surfaces : sequence of Surface
        Cloth and bodies.
    views : sequence of ((3,) ndarray, str)
        Direction from the surfaces to the camera, and title.
    outlined : (m, 3, 3) ndarray
        Corners of the marked triangles [m].
    dots : (n, 3) ndarray
        Marked points [m], drawn in this order; the last one gets a ring where it is seen.
    fractions : (n,) ndarray
        Their colours, from 0, light, to 1.
    visible : callable
        Masks (m,) of the triangles and (n,) of the points that are seen from a camera at (3,) [m].
    key : sequence of str
        Lines below the picture.
    size : (int, int)
        Width and height of each view in pixels.
    up : (3,) ndarray
        Vertical axis.
    """
    parts, note = [], ""
    for view, title in views:
        setup = picture_setup(
            [surfaces],
            size=size,
            colour="plain",
            up=up,
            view=view,
            title=title,
            renderer="auto",
            smooth=False,  # what is marked are its triangles
        )
        bare = Image.fromarray(np.round(255 * np.clip(rendered_without_legend(setup, surfaces), 0, 1)).astype(np.uint8))
        pen = ImageDraw.Draw(bare, "RGBA")
        triangles_seen, dots_seen = visible(setup.camera.position)
        for corners in outlined[triangles_seen]:
            outline = [tuple(point) for point in pixels(setup.camera, corners, size)]
            pen.line([*outline, outline[0]], fill=OUTLINE, width=1)
        spots, radius = pixels(setup.camera, dots, size), 0.0042 * min(size)
        for k in np.flatnonzero(dots_seen):
            colour = tuple(round((1 - fractions[k]) * a + fractions[k] * b) for a, b in zip(LIGHT, INK, strict=True))
            pen.ellipse([*(spots[k] - radius), *(spots[k] + radius)], fill=colour, outline=(255, 255, 255, 140))
        if len(dots_seen) and dots_seen[-1]:
            ring(pen, spots[-1], size)
        parts.append(add_legend(np.asarray(bare, float) / 255, None, title))
        note = setup.note
    whole, em = np.hstack(parts), min(size) / 48
    height, width = whole.shape[:2]
    picture = Image.new("RGB", (width, height + round((1.4 + 1.8 * len(key)) * em)), STRIP)
    picture.paste(Image.fromarray(whole), (0, 0))
    pen = ImageDraw.Draw(picture)
    for line, text in enumerate(key):
        label(pen, (1.6 * em, height + (0.9 + 1.8 * line) * em), text, 1.1 * em)
    picture.save(path, format="PNG")
    return note
