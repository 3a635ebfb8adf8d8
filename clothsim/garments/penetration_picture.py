"""Picture of a garment on a body, front and back, with penetrations marked."""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from clothsim.base.arrays import Floats
from clothsim.garments.penetration_report import PenetrationReport
from clothsim.render import (
    INK,
    Camera,
    Surface,
    add_legend,
    label,
    picture_setup,
    pixels,
    rendered_without_legend,
    ring,
)

SIZE = (720, 1080)
SHALLOW = (255, 205, 40)
"""The colour of a vertex just inside; INK is the deepest's."""
OUTLINE = (30, 30, 34, 255)
"""Of triangles that intersect."""
STRIP = (238, 239, 241)
"""The colour behind the words."""
CLEAR = 2e-3
"""Height of a mark above its surface for the visibility test, relative to the body's size."""
TURNS = ((0.3, "from the front"), (np.pi + 0.3, "from behind"))
"""Positions of the camera: turned about the body from its front [rad]."""


def draw_penetrations(report: PenetrationReport, file: Path) -> str:
    """A PNG with a dot where each vertex inside should come out, and intersecting triangles outlined.

    Marks that the body hides are left out: those of the other side are in the other half. The deepest is ringed where
    it is seen. Returns one line that names the renderer.
    """
    garment, figure = report.garment, report.figure
    none = np.zeros((0, 2))
    surfaces = [
        Surface(garment.name, garment.positions, garment.triangles, "cloth", none),
        Surface(figure.name, figure.positions, figure.triangles, "body", none),
    ]
    halves, note = [], ""
    for turn, side in TURNS:
        setup = picture_setup(
            [surfaces],
            size=SIZE,
            colour="plain",
            up=figure.up,
            view=_towards(figure.up, turn),
            title=side,
            renderer="auto",
            smooth=False,  # what is marked are its triangles
        )
        bare = Image.fromarray(np.round(255 * np.clip(rendered_without_legend(setup, surfaces), 0, 1)).astype(np.uint8))
        _mark(bare, report, setup.camera)
        halves.append(add_legend(np.asarray(bare, float) / 255, None, side))
        note = setup.note
    _with_key(np.hstack(halves), report).save(file, format="PNG")
    return note


def _towards(up: Floats, turn: float) -> Floats:
    """The direction from the body to the camera: the front is +z where y is up, -y where z is."""
    front = np.array([0.0, 0.0, 1.0]) if up[1] else np.array([0.0, -1.0, 0.0])
    return np.cos(turn) * front + np.sin(turn) * np.cross(up, front) + 0.12 * up


def _mark(picture: Any, report: PenetrationReport, camera: Camera) -> None:
    pen = ImageDraw.Draw(picture, "RGBA")
    x, triangles = report.garment.positions, report.garment.triangles
    bad = np.unique(np.concatenate([report.body_pairs[:, 0], report.self_pairs.ravel()]))
    middles = x[triangles[bad]].mean(axis=1)
    at = report.body.closest(middles)
    outside = np.where(at.inside[:, None], at.points, middles)
    for triangle in bad[_seen(report, outside, at.normals, camera)]:
        outline = [tuple(point) for point in pixels(camera, x[triangles[triangle]], SIZE)]
        pen.line([*outline, outline[0]], fill=OUTLINE, width=1)
    inside = report.inside[::-1]
    points, normals = report.closest.points[inside], report.closest.normals[inside]
    depths = -report.closest.signed_distance[inside]
    seen = np.flatnonzero(_seen(report, points, normals, camera))
    spots = pixels(camera, points, SIZE)
    for k in seen:
        _dot(pen, spots[k], depths[k] / depths[-1])
    if len(seen) and seen[-1] == len(inside) - 1:
        ring(pen, spots[-1], SIZE)


def _seen(report: PenetrationReport, points: Floats, normals: Floats, camera: Camera) -> np.ndarray:
    """Mask of the points on the body (k, 3) that face the camera and are not hidden by it."""
    rays = camera.position - points
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    facing = (rays * normals).sum(axis=1) > 0
    distance, _ = report.body.exits(points + CLEAR * report.body.size * normals, rays)
    return np.logical_and(facing, ~np.isfinite(distance))


def _dot(pen: Any, centre: Floats, depth_fraction: float) -> None:
    radius = 0.0042 * min(SIZE)
    colour = tuple(round((1 - depth_fraction) * a + depth_fraction * b) for a, b in zip(SHALLOW, INK, strict=True))
    pen.ellipse([*(centre - radius), *(centre + radius)], fill=colour, outline=(255, 255, 255, 140))


def _with_key(halves: np.ndarray, report: PenetrationReport) -> Any:
    """The picture with a legend of the marks below it."""
    counts, em = report.counts, min(SIZE) / 48
    height, width = halves.shape[:2]
    picture = Image.new("RGB", (width, height + round(5 * em)), STRIP)
    picture.paste(Image.fromarray(halves), (0, 0))
    deepest = f", the deepest {1e3 * counts.depth:.3g} mm (pink, ringed)" if counts.penetrating_vertices else ""
    percent = 100 * counts.penetrating_vertices / len(report.garment.positions)
    first = f"dots: {counts.penetrating_vertices:,} vertices ({percent:.3g} %) inside {report.figure.name}{deepest}"
    second = (
        f"dark triangles: they intersect the body ({counts.body_pairs:,} pairs) "
        f"or the garment itself ({counts.self_pairs:,} pairs)"
    )
    pen = ImageDraw.Draw(picture)
    for line, text in enumerate((first, second)):
        label(pen, (1.6 * em, height + (0.9 + 1.8 * line) * em), text, 1.1 * em)
    return picture
