"""Pictures with marks: a close-up of a point, such as the position of a failure, and views with marked triangles."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw

from clothsim.base.arrays import Floats, Ints
from clothsim.render.camera import Viewpoint, three_quarter_view
from clothsim.render.picture import PictureSetup, picture_setup, rendered_without_legend
from clothsim.render.styles import add_legend, label, margins
from clothsim.render.surface_look import Surface

INK = (196, 0, 120)
"""No colour of cloth, body or stretch."""

EDGES, SMALLEST, LARGEST = 5.0, 0.10, 0.25
"""Radius of the view in median cloth edges, and its bounds relative to the cloth's size."""

OUTLINED = 60
"""Number of outlined cloth triangles, the nearest to the point."""

ELEVATIONS, AZIMUTHS = (24, 8, 50, 75, -20), range(0, 360, 30)
"""Candidate view directions [degrees]."""


def draw_closeup(
    path: str | Path,
    surfaces: Sequence[Surface],
    point: Floats,
    *,
    title: str = "",
    up: ArrayLike | str = "z",
    size: tuple[int, int] = (1280, 960),
    renderer: str = "auto",
) -> str:
    """Write a PNG of `surfaces` round `point (3,)` [m] with a ring there; returns one line that names the renderer.

    The view is one from which nothing hides the point. Where there is none, the bodies in front of it are cut away, and
    the title names them. Other arguments as in `picture.draw`.
    """
    view_radius = _view_radius([surface for surface in surfaces if surface.role == "cloth"])
    focus = point + view_radius * np.concatenate([np.eye(3), -np.eye(3)])
    settings = {"size": size, "colour": "stretch", "up": up, "renderer": renderer, "focus": focus}
    settings["smooth"] = False  # the triangles that failed
    upright = picture_setup([surfaces], view="auto", title=title, **settings).up  # type: ignore[arg-type]
    near = np.concatenate(
        [_corners_near(surface, point, view_radius) for surface in surfaces if surface.role == "cloth"]
    )
    skin = 0.05 * view_radius
    # the direction from the point towards the camera along which the fewest triangles hide it: of equals the usual
    # one; hits nearer than `skin` do not count, for the point lies on a triangle
    usual = three_quarter_view(near, upright)
    vertical = upright / np.linalg.norm(upright)
    level = usual - (usual @ vertical) * vertical
    level /= np.linalg.norm(level)
    side = np.cross(vertical, level)
    turns = [(np.radians(e), np.radians(a)) for e in ELEVATIONS for a in AZIMUTHS]
    others = [np.cos(e) * (np.cos(a) * level + np.sin(a) * side) + np.sin(e) * vertical for e, a in turns]
    views = np.array([usual, *others])
    counts = [sum(len(_find_occluders(surface, point, way, skin)) for surface in surfaces) for way in views]
    view = views[int(np.argmin(counts))]
    setup = picture_setup([surfaces], view=view, title=title, **settings)  # type: ignore[arg-type]
    # of each body that hides the point only what is behind it is seen
    towards = (setup.camera.position - point) / np.linalg.norm(setup.camera.position - point)
    seen, cut = [], []
    for surface in surfaces:
        if surface.role == "body" and len(_find_occluders(surface, point, towards, skin)):
            corners = surface.positions[surface.triangles]
            parts = [part for triangle in corners for part in _behind(triangle, (triangle - point) @ towards)]
            cut.append(surface.name)
            if parts:
                points = np.concatenate(parts)
                seen.append(replace(surface, positions=points, triangles=np.arange(len(points)).reshape(-1, 3)))
        else:
            seen.append(surface)
    caption = f"{title} ({' and '.join(cut)} cut open)" if cut else title
    nearest = near[np.argsort(np.linalg.norm(near.mean(axis=1) - point, axis=1))[:OUTLINED]]
    picture, pen = _outlined(setup, seen, nearest, (40, 40, 46, 70))
    draw_ring(pen, pixels(setup.camera, point[None], setup.size)[0], setup.size)
    room = margins(setup.size, setup.scale is not None, caption)
    # half transparent below the title and the bar: in a close-up dark surfaces may lie there
    (width, height), white = setup.size, (255, 255, 255, 170)
    bottom = room.top * height / 2 if setup.title else 0
    pen.rectangle([0, 0, width, bottom], fill=white)
    if setup.scale is not None:
        pen.rectangle([width * (1 - room.right / 2), bottom + 1, width, height], fill=white)
    legend = add_legend(np.asarray(picture, float) / 255, setup.scale, caption)
    Image.fromarray(legend).save(path, format="PNG")
    return setup.note


def _outlined(
    setup: PictureSetup, surfaces: Sequence[Surface], triangles: Floats, colour: tuple[int, int, int, int]
) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """The picture without a legend, with triangles (m, 3, 3) [m] outlined, and a pen on it."""
    picture = Image.fromarray(np.round(255 * np.clip(rendered_without_legend(setup, surfaces), 0, 1)).astype(np.uint8))
    pen = ImageDraw.Draw(picture, "RGBA")
    for corners in triangles:
        outline = [tuple(point) for point in pixels(setup.camera, corners, setup.size)]
        pen.line([*outline, outline[0]], fill=colour, width=1)
    return picture, pen


def _view_radius(cloths: Sequence[Surface]) -> float:
    """Radius of the view around the point [m]."""
    corners = np.concatenate([cloth.positions[cloth.triangles] for cloth in cloths])
    edge = float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
    size = float(np.linalg.norm(np.ptp(np.concatenate([cloth.positions for cloth in cloths]), axis=0)))
    return min(max(EDGES * edge, SMALLEST * size), LARGEST * size)


def _corners_near(surface: Surface, point: Floats, radius: float) -> Floats:
    """The corners (k, 3, 3) of the triangles whose centroids are within `radius` [m]; of the nearest where none is."""
    corners = surface.positions[surface.triangles]
    distances = np.linalg.norm(corners.mean(axis=1) - point, axis=1)
    return corners[distances <= max(radius, float(distances.min()))]


def _find_occluders(surface: Surface, point: Floats, towards: Floats, skin: float) -> Ints:
    """The triangles that the ray from the point meets beyond `skin` [m] (Moeller & Trumbore 1997)."""
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    p = np.cross(towards, c - a)
    determinant = ((b - a) * p).sum(axis=1)
    q = np.cross(point - a, b - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((point - a) * p).sum(axis=1) / determinant
        v = q @ towards / determinant
        t = ((c - a) * q).sum(axis=1) / determinant
        return np.flatnonzero((u >= 0) & (v >= 0) & (u + v <= 1) & (t > skin))


def _behind(corners: Floats, heights: Floats) -> list[Floats]:
    """Part of a triangle (3, 3) where its heights (3,) above a plane are negative: 0 to 2 triangles."""
    polygon = []
    for k in range(3):
        here, there = heights[k], heights[(k + 1) % 3]
        if here <= 0:
            polygon.append(corners[k])
        if here * there < 0:
            polygon.append(corners[k] + here / (here - there) * (corners[(k + 1) % 3] - corners[k]))
    return [np.array([polygon[0], polygon[k], polygon[k + 1]]) for k in range(1, len(polygon) - 1)]


def pixels(camera: Viewpoint, points: Floats, size: tuple[int, int]) -> Floats:
    """Pixel coordinates of points (n, 3), from its upper left corner, (n, 2)."""
    x, y = camera.project(points).T
    return np.column_stack([(x + 1) / 2 * size[0], (1 - y) / 2 * size[1]])


def draw_ring(pen: Any, centre: Floats, size: tuple[int, int]) -> None:
    """A ring with a dot, light and dark so that it shows on anything."""
    radius, line = 0.035 * min(size), max(2, min(size) // 240)
    for colour, grown in (((255, 255, 255), line), (INK, 0)):
        box = [*(centre - radius - grown / 2), *(centre + radius + grown / 2)]
        pen.ellipse(box, outline=colour, width=line + grown)
    dot = 0.004 * min(size)
    pen.ellipse([*(centre - dot), *(centre + dot)], fill=INK, outline=(255, 255, 255))


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
        triangles_seen, dots_seen = visible(setup.camera.position)
        bare, pen = _outlined(setup, surfaces, outlined[triangles_seen], OUTLINE)
        spots, radius = pixels(setup.camera, dots, size), 0.0042 * min(size)
        for k in np.flatnonzero(dots_seen):
            colour = tuple(round((1 - fractions[k]) * a + fractions[k] * b) for a, b in zip(LIGHT, INK, strict=True))
            pen.ellipse([*(spots[k] - radius), *(spots[k] + radius)], fill=colour, outline=(255, 255, 255, 140))
        if len(dots_seen) and dots_seen[-1]:
            draw_ring(pen, spots[-1], size)
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
