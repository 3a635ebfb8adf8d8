"""Panels cut as fans of half a turn or more, as the halves of a circle skirt, folded into half cones round the body.

Flat before and behind the body, such a panel has its sides level with its waist, or above it, and far out: the strings
between front and back run through arms, chest or hands, and no pose of the arms clears them. Round a cone there is less
room than the fan is wide; it stands in waves, which are as long as it is, so that the cloth begins almost unstrained.
"""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.closing import MOST
from clothsim.garments.dress.placement import CHEST, is_of_arm
from clothsim.garments.dress.sewing_state import crosses_body
from clothsim.garments.inputs import BodyMesh
from clothsim.patterns import PatternMesh
from transfer.signed_distance import BodySurface

ON_ARC = 0.01
"""Distance from a circle within which an edge lies on it, and by which the panel may reach inside it [m]."""
NEAR_ARC = 0.3
"""Distance of an edge from the circle of another within which one circle is laid through both, as a fraction of its
radius: the arcs of a graded waist have centres of their own."""
LEAST_TURN, MOST_TURN = np.radians(170.0), np.radians(355.0)
"""Angles of the inner edge between which a fan is folded [rad]; farther round, its sides overlap in the pattern."""
FACING = 0.9
"""Cosine of the angle between the normal of a panel before or behind the body and the body's front, at least."""
SLOPE = np.radians(30.0)
"""Angle of the cone from the vertical [rad]."""
WAVE = 0.4
"""Length of the hem that stands in one wave [m]."""
BELOW = 0.03
"""Distance of the upper edge below what it is sewn to [m]."""
STEEPEST = np.linspace(0.0, 12.0, 200)
"""Steepest slopes of a sine wave."""
LONGER = np.sqrt(1 + (STEEPEST[:, None] * np.cos(np.linspace(0, np.pi, 200))) ** 2).mean(axis=1)
"""Lengths of these waves over that of their base."""


@dataclass(frozen=True)
class Fan:
    """A panel round a centre in its plane.

    Attributes
    ----------
    radius, turn : float
        Of its inner edge [m], [rad].
    distance, angle : (k,) array
        Of each vertex from the centre [m], and from its middle [rad].
    inner : (i,) int array
        Vertices of the inner edge among those of the panel.
    """

    radius: float
    turn: float
    distance: Floats
    angle: Floats
    inner: Ints


def fan_of(mesh: PatternMesh, name: str) -> Fan | None:
    """A panel as a fan: edges that are sewn to other panels on one circle, all else outside of it; None for others."""
    first = mesh.vertices[name].start
    points = mesh.panel_coordinates[mesh.vertices[name]]
    sewn = [
        mesh.edges[side] - first
        for seam in mesh.seams
        for side, other in (seam.stitch.sides, seam.stitch.sides[::-1])
        if side.panel == name != other.panel
    ]
    return widest_fan(points, sewn)


def widest_fan(points: Floats, sewn: list[Ints]) -> Fan | None:
    """The panel, vertices (k, 2) [m], round a circle through one edge or several; the one that turns most."""
    found = []
    for rows in (each for each in sewn if len(each) > 2):
        centre, radius = _circle(points[rows])
        off = [np.abs(np.linalg.norm(points[each] - centre, axis=1) - radius).max() for each in sewn]
        also = (each for each, by in zip(sewn, off, strict=True) if by <= NEAR_ARC * radius)
        near = np.unique(np.concatenate([rows, *also]))
        found += [_fan_about(points, chosen, sewn) for chosen in (rows, near)]
    return max((fan for fan in found if fan is not None), key=lambda fan: fan.turn, default=None)


def _circle(line: Floats) -> tuple[Floats, float]:
    """Centre (2,) and radius of the circle through points (k, 2), by least squares [m]."""
    columns = np.column_stack([2 * line, np.ones(len(line))])
    x, y, power = np.linalg.lstsq(columns, (line**2).sum(axis=1), rcond=None)[0]
    return np.array([x, y]), float(np.sqrt(max(power + x * x + y * y, 0.0)))


def _fan_about(points: Floats, rows: Ints, sewn: list[Ints]) -> Fan | None:
    """The panel round the circle of some of its vertices, with the edges on it; None where that is no inner edge."""
    centre, radius = _circle(points[rows])
    away = points - centre
    distance = np.linalg.norm(away, axis=1)
    if distance.min() < radius - ON_ARC or np.ptp(distance[rows]) > ON_ARC:
        return None
    on_arc = [each for each in sewn if np.abs(distance[each] - radius).max() < ON_ARC]
    inner = np.unique(np.concatenate(on_arc))
    angle = np.arctan2(away[:, 1], away[:, 0])
    around = np.sort(angle[inner])
    gaps = np.diff(around, append=around[0] + 2 * np.pi)
    middle = float(around[gaps.argmax()] + gaps.max() / 2 + np.pi)  # opposite to the widest gap [rad]
    angle = (angle - middle + np.pi) % (2 * np.pi) - np.pi
    return Fan(radius, 2 * float(np.abs(angle[inner]).max()), distance, angle, inner)


def folded_fans(mesh: PatternMesh, body: BodyMesh, surface: BodySurface) -> tuple[PatternMesh, tuple[str, ...]]:
    """Mesh whose wide fans lie in waves on half cones round the body; and a note for each.

    Only where strings between them run through the body, and folded no more of them do, and not most, so that the free
    ones draw the others round: others, as a flounce that is narrower than the hips, are sewn from where they are. What
    is sewn to something above the chest is a collar.
    """
    fans: dict[str, Fan] = {}
    highest = body.floor + CHEST * body.height
    for name, panel in mesh.pattern.panels.items():
        points = mesh.positions[mesh.vertices[name]]
        normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
        fan = None if is_of_arm(panel) or abs(normal @ body.front) < FACING else fan_of(mesh, name)
        if fan is not None and LEAST_TURN < fan.turn < MOST_TURN and _level(mesh, name, fan, body) < highest:
            fans[name] = fan
    folded, notes = mesh.positions.copy(), []
    for name, fan in fans.items():
        rows = mesh.vertices[name]
        folded[rows] = _on_cone(fan, mesh.positions[rows], _level(mesh, name, fan, body), body)
    crossing = dict.fromkeys(fans, np.zeros(3, np.int64))
    for seam in mesh.seams:
        if (pair := {side.panel for side in seam.stitch.sides}) <= fans.keys():
            both = [crosses_body(positions[seam.pairs], surface).sum() for positions in (mesh.positions, folded)]
            crossing |= {name: crossing[name] + [*both, len(seam.pairs)] for name in pair}
    positions = mesh.positions.copy()
    for name, (before, after, number) in crossing.items():
        if before and after <= min(before, MOST * number):
            positions[mesh.vertices[name]] = folded[mesh.vertices[name]]
            turn = f"a fan of {np.degrees(fans[name].turn):.0f} degrees, placed in waves round the body"
            notes.append(f"{name}, {turn}: {before} springs of its sides ran through the body, {after} do now")
    return replace(mesh, positions=positions), tuple(notes)


def _level(mesh: PatternMesh, name: str, fan: Fan, body: BodyMesh) -> float:
    """Height of the upper edge of a fan [m]: below the panels that its inner edge is sewn to."""
    inner = fan.inner + mesh.vertices[name].start
    heights = [
        float((mesh.positions[pairs[:, 1 - k]] @ body.up).min())
        for pairs in (seam.pairs for seam in mesh.seams)
        for k in (0, 1)
        if np.isin(pairs[:, k], inner).all()
    ]
    return min(heights) - BELOW


def _on_cone(fan: Fan, placed: Floats, level: float, body: BodyMesh) -> Floats:
    """Vertices of a fan in waves on a half cone, (k, 3) [m], before or behind the body as they were placed.

    The upper edge is a half circle of its own length. Below it, waves across the cone take up what the fan is longer
    than the cone is round.
    """
    facing = body.front * np.sign((placed - body.middle).mean(axis=0) @ body.front)
    right = np.cross(body.up, body.front)
    side = np.sign(np.sum(fan.angle * ((placed - placed.mean(axis=0)) @ right)))
    fraction = 2 * fan.angle / fan.turn
    along = np.pi / 2 * side * fraction
    down = fan.distance - fan.radius
    radius = fan.radius * fan.turn / np.pi + down * np.sin(SLOPE)
    count = max(round(float(fan.distance.max()) * fan.turn / WAVE), 1)
    steepest = np.interp(fan.distance * fan.turn / (np.pi * radius), LONGER, STEEPEST)
    height = steepest * radius / (2 * count) * np.sin(np.pi * count * fraction)
    out = np.sin(along)[:, None] * right + np.cos(along)[:, None] * facing
    reach = radius + height * np.cos(SLOPE)
    upright = level - down * np.cos(SLOPE) + height * np.sin(SLOPE)
    axis = (placed.mean(axis=0) @ facing) * facing + (body.middle @ right) * right
    return np.asarray(axis + reach[:, None] * out + upright[:, None] * body.up, np.float64)
