"""Waistbands: upper borders that hold a garment, closed to the girth of the body below them.

A garment keeps its ease where it is graded, and one with ease at its upper border slides until the body is as wide:
nothing but that border holds a skirt, trousers or a strapless bodice. A pattern maker cuts a band a little shorter than
the girth that it lies on. A fit scales the border of the rest shape; a sewn garment has its triangles there shortened
along it, as by an elastic, so that the cloth below stays as cut.
"""

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.engine import border_edges, components, deformation_gradients
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import BodyMesh
from transfer.body_frame import girth, level_set, loops
from transfer.body_parts import BodyParts
from transfer.errors import TransferError

TIGHT = 0.95
"""Length of a band over the girth of the body below it."""
LEAST = 0.75
"""A border that would be shortened by more stands off on purpose, and is left as it is."""
TOP = 0.01
"""Height to which a piece reaches above its band, as a fraction of the body's: with more it has shoulders or straps."""
DEPTH = 0.04
"""Depth below the band in which the garment narrows to it, as a fraction of the body's height."""


class Banded(NamedTuple):
    """Rest shape (n, 3) [m] with its bands closed, and the length of each band over the one that it had."""

    rest: Floats
    factors: tuple[float, ...]


class WaistBorder(NamedTuple):
    """Directed border edges (b, 2), vertices (k,) of its piece, centre (3,) and girth [m] of the body at its height.

    The centre is in the frame of the body.
    """

    edges: Ints
    piece: Ints
    centre: Floats
    girth: float


def with_waistbands(positions: Floats, triangles: Ints, body: BodyMesh, parts: BodyParts) -> Banded:
    """Close the waistbands of a garment at `positions` (n, 3) [m] on a body and its parts."""
    local = parts.frame.local(positions)
    rest, factors = local.copy(), []
    for band in bands(local, triangles, body, parts):
        length = float(np.linalg.norm(np.diff(local[band.edges], axis=1), axis=2).sum())
        factor = TIGHT * band.girth / length
        if not LEAST <= factor < 1.0:
            continue
        scale = 1.0 + (factor - 1.0) * nearness(local, band, parts)
        for axis in (0, 2):
            rest[band.piece, axis] = band.centre[axis] + scale * (local[band.piece, axis] - band.centre[axis])
        factors.append(factor)
    return Banded(parts.frame.world(rest) if factors else positions, tuple(factors))


def loose_edge(positions: Floats, triangles: Ints, body: BodyMesh) -> str:
    """The sentence that an upper edge of a garment, (n, 3) [m], is too wide to be shortened; empty where none is."""
    try:
        parts = body.parts
    except TransferError:
        return ""
    local = parts.frame.local(positions)
    for band in bands(local, triangles, body, parts):
        length = float(np.linalg.norm(np.diff(local[band.edges], axis=1), axis=2).sum())
        if TIGHT * band.girth < LEAST * length:
            return (
                f"Its upper edge is {length:.2f} m long where {body.name} is {band.girth:.2f} m round, and an edge is "
                f"shortened by {100 * (1 - LEAST):.0f} % at most."
            )
    return ""


def bands(local: Floats, triangles: Ints, body: BodyMesh, parts: BodyParts) -> list[WaistBorder]:
    """Topmost borders about the trunk, between crotch and armpits, of a garment at `local` (n, 3) [m]."""
    found = []
    on_body = parts.frame.local(body.positions)
    pieces = components(triangles, len(local))
    for edges in border_loops(triangles):
        loop = np.unique(edges)
        piece = np.flatnonzero(pieces == pieces[loop[0]])
        height = float(local[loop, 1].mean())
        low, high = parts.landmarks["crotch"], parts.landmarks["armpit"]
        topmost = local[piece, 1].max() <= local[loop, 1].max() + TOP * parts.frame.height
        centre = parts.trunk.at(np.array([height]), parts.trunk.centres)[0]
        centre[1] = height
        if topmost and low < height < high and abs(turns_about(local[edges] - centre)) > 0.5:
            found.append(WaistBorder(edges, piece, centre, girth_at(on_body, body.triangles, centre)))
    return found


def nearness(local: Floats, band: WaistBorder, parts: BodyParts) -> Floats:
    """Smooth weight of each vertex of the piece of a band, 1 at the band and 0 from DEPTH on, (k,)."""
    nearest = cKDTree(local[np.unique(band.edges)]).query(local[band.piece])[0]
    distance = np.minimum(nearest / (DEPTH * parts.frame.height), 1.0)
    return np.asarray(1.0 - distance**2 * (3.0 - 2.0 * distance), np.float64)


def girth_at(local: Floats, triangles: Ints, centre: Floats) -> float:
    """Girth [m] of the piece nearest to `centre` (3,) of a level section of a body, vertices `local` (n, 3)."""
    sections = loops(level_set(local, triangles, local[:, 1], float(centre[1])), triangles)
    near = min(sections, key=lambda one: float(np.linalg.norm(one.centre - centre)))
    return girth(near)


def border_loops(triangles: Ints) -> list[Ints]:
    """Directed border edges (b, 2) of each connected piece of the border."""
    edges = border_edges(triangles)[0]
    if not len(edges):
        return []
    labels = components(np.column_stack([edges, edges[:, 1]]), int(triangles.max()) + 1)[edges[:, 0]]
    return [edges[labels == label] for label in np.unique(labels)]


def turns_about(edges: Floats) -> float:
    """Turns of directed edges (b, 2, 3) about the second axis through the origin."""
    angles = np.arctan2(edges[:, :, 2], edges[:, :, 0])
    return float(((np.diff(angles, axis=1) + np.pi) % (2.0 * np.pi) - np.pi).sum() / (2.0 * np.pi))


LEAST_HELD = 0.6
"""An edge that would have to be shortened by more is left as it is, and a note says so."""
SLID = 0.02
"""Descent of an upper edge in the drape, as a fraction of the body's height, beyond which a note says so."""


def parts_for_edges(body: BodyMesh) -> BodyParts:
    """Trunk of a body. InputError where it has none that could hold a garment."""
    try:
        return body.parts
    except TransferError as error:
        raise InputError(f"{body.name} has no trunk that could hold an edge: {error}", "Leave hold out.") from error


def edges_held(state: SewingState, body: BodyMesh) -> tuple[SewingState, tuple[str, ...]]:
    """State whose upper edges are taken in to `TIGHT` of the body's girth at their height, and a note for each.

    Edges that are shorter already, and garments with shoulders or straps, stay as they are. The positions stay; what
    changes are the `material_coordinates` of the mesh.
    """
    parts = parts_for_edges(body)
    local = parts.frame.local(state.positions)
    material = state.mesh.material_coordinates
    notes = []
    for band in bands(local, state.triangles, body, parts):
        length = rest_length(state, band.edges)
        factor = TIGHT * band.girth / length
        name = f"the upper edge of {', '.join(panels_at(state, band.edges))}"
        measured = f"{name} measures {100 * length:.1f} cm on a body of {100 * band.girth:.1f} cm"
        if factor >= 1.0:
            continue
        if factor < LEAST_HELD:
            notes.append(f"{measured}: too wide to be taken in")
            continue
        material = taken_in(state, material, band, factor, nearness(local, band, parts))
        notes.append(f"{measured}: taken in to {100 * factor * length:.1f} cm")
    return replace(state, mesh=replace(state.mesh, material_coordinates=material)), tuple(notes)


def taken_in(state: SewingState, material: Floats, band: WaistBorder, factor: float, near: Floats) -> Floats:
    """Material coordinates (m, 3, 2) [m] of triangles shortened by `factor` along a band, the less the farther from it.

    near: weight of each vertex of the piece of the band, (k,). A triangle is shortened along the direction of its own
    plane that lies along the band at present.
    """
    weight = np.zeros(len(state.positions))
    weight[band.piece] = near
    fraction = weight[state.triangles].max(axis=1)
    rows = np.flatnonzero(fraction > 0)
    corners, faces = material[rows], state.triangles[rows]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    F = np.asarray(deformation_gradients(state.positions, faces, np.linalg.inv(edges)))
    ends = state.positions[band.edges]
    nearest = cKDTree(ends.mean(axis=1)).query(state.positions[faces].mean(axis=1))[1]
    edge = ends[nearest, 1] - ends[nearest, 0]
    edge = edge / np.linalg.norm(edge, axis=1)[:, None]
    along = np.einsum("tij,tj->ti", np.linalg.pinv(F), edge)
    along /= np.linalg.norm(along, axis=1)[:, None]
    shorter = (factor - 1.0) * fraction[rows]
    offsets = corners - corners[:, :1]
    taken = material.copy()
    taken[rows] = corners + (shorter[:, None] * np.einsum("tci,ti->tc", offsets, along))[..., None] * along[:, None]
    return taken


def rest_length(state: SewingState, edges: Ints) -> float:
    """Length at rest of border edges (b, 2) of a garment [m]."""
    border, half = border_edges(state.triangles)
    corners = state.mesh.material_coordinates
    face, corner = half // 3, half % 3
    lengths = np.linalg.norm(corners[face, (corner + 1) % 3] - corners[face, corner], axis=1)
    n = len(state.positions)
    return float(lengths[np.isin(border @ [n, 1], edges @ [n, 1])].sum())


def panels_at(state: SewingState, edges: Ints) -> list[str]:
    """Panels with triangles at border edges (b, 2), those with most first."""
    on_edge = np.isin(state.triangles, edges).sum(axis=1) > 1
    count = Counter({name: int(on_edge[rows].sum()) for name, rows in state.mesh.faces.items()})
    return [name for name, number in count.most_common() if number]


def slid(before: SewingState, after: SewingState, body: BodyMesh) -> tuple[str, ...]:
    """How far each upper edge moved down in the drape, with its girth and the body's before and after."""
    try:
        parts = body.parts
    except TransferError:
        return ()
    on_body, notes = parts.frame.local(body.positions), []
    local = [parts.frame.local(each.positions) for each in (before, after)]
    for band in bands(local[0], before.triangles, body, parts):
        loop = np.unique(band.edges)
        down = float((local[0][loop, 1] - local[1][loop, 1]).mean())
        centre = band.centre - [0.0, down, 0.0]
        if down < SLID * parts.frame.height:
            continue
        girths = f"{100 * band.girth:.1f} cm where it was sewn"
        if parts.landmarks["crotch"] < centre[1]:
            girths += f" and {100 * girth_at(on_body, body.triangles, centre):.1f} cm where it lies"
        length = 100 * rest_length(before, band.edges)
        panels = ", ".join(panels_at(before, band.edges))
        what = f"the upper edge of {panels} slid down by {1e3 * down:.0f} mm"
        notes.append(f"{what}: it measures {length:.1f} cm, the body {girths}")
    return tuple(notes)
