"""Curves of a drawing: lines, arcs, splines and polylines of ezdxf as parts of outlines."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.patterns.dxf.outline import Part, parts_of_bezier, straight_parts
from clothsim.patterns.curves import Arc, Straight

FLAT = 1e-5
"""Distance of chords from the spline that they stand for [m]."""
CURVES = frozenset({"LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"})


def exploded(entity: Any) -> Iterator[Any]:
    """Lines and arcs of a polyline; another entity as it is."""
    if entity.dxftype() not in ("POLYLINE", "LWPOLYLINE"):
        yield entity
        return
    for part in entity.virtual_entities():
        part.dxf.layer = entity.dxf.layer
        yield part


def in_plane(point: Any) -> Floats:
    """x and y of a point of the drawing."""
    return np.array([point[0], point[1]], np.float64)


def parts_of(entity: Any, metres: float) -> tuple[Part, ...]:
    """Curves of an entity of an outline [m]; none of a text or a point."""
    kind = entity.dxftype()
    if kind == "LINE":
        return (Part(metres * in_plane(entity.dxf.start), metres * in_plane(entity.dxf.end), Straight()),)
    if kind in ("ARC", "CIRCLE"):
        return _arcs(entity, metres)
    if kind == "ELLIPSE":
        return straight_parts(metres * np.array([in_plane(point) for point in entity.flattening(FLAT / metres)]))
    if kind != "SPLINE":
        return ()
    spline = entity.construction_tool()
    points = metres * np.array([in_plane(point) for point in spline.control_points])
    if not spline.is_rational and spline.is_clamped and spline.degree in (2, 3) and len(points) == spline.degree + 1:
        return parts_of_bezier(points)
    return straight_parts(metres * np.array([in_plane(point) for point in spline.flattening(FLAT / metres)]))


def _arcs(entity: Any, metres: float) -> tuple[Part, ...]:
    """Both halves of an arc or a circle, so that neither closes on itself."""
    if entity.dxftype() == "CIRCLE":
        first, sweep = 0.0, 360.0
    else:
        first = entity.dxf.start_angle
        sweep = (entity.dxf.end_angle - first) % 360.0 or 360.0
    angles = [first, first + sweep] if sweep < 270.0 else [first, first + sweep / 2, first + sweep]
    ends = [metres * in_plane(point) for point in entity.vertices(angles)]
    large, right = len(angles) == 2 and sweep > 180.0, entity.dxf.extrusion[2] > 0
    radius = metres * float(entity.dxf.radius)
    return tuple(Part(a, b, Arc(radius, large, right)) for a, b in zip(ends, ends[1:], strict=False))
