"""Upper edges that hold a garment: taken in to the girth of the body, as an elastic waistband is.

Nothing but its upper edge holds a skirt, trousers or a strapless bodice. One with ease there slides until the body is
as wide. The edge that would slide is shortened at rest: its triangles along it, so that the cloth below stays as cut.
"""

from collections import Counter
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.engine import border_edges, deformation_gradients
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import BodyMesh
from clothsim.garments.waistband import TIGHT, Band, bands, girth_at, nearness
from transfer.body_parts import BodyParts
from transfer.errors import TransferError

LEAST = 0.6
"""An edge that would have to be shortened by more is left as it is, and a note says so."""
SLID = 0.02
"""Way down of an upper edge in the drape, as a fraction of the body's height, beyond which a note says so."""


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
        if factor < LEAST:
            notes.append(f"{measured}: too wide to be taken in")
            continue
        material = taken_in(state, material, band, factor, nearness(local, band, parts))
        notes.append(f"{measured}: taken in to {100 * factor * length:.1f} cm")
    return replace(state, mesh=replace(state.mesh, material_coordinates=material)), tuple(notes)


def taken_in(state: SewingState, material: Floats, band: Band, factor: float, near: Floats) -> Floats:
    """Material coordinates (m, 3, 2) [m] of triangles shortened by `factor` along a band, the less the farther from it.

    near: weight of each vertex of the piece of the band, (k,). A triangle is shortened along the direction of its own
    plane that lies along the band at present.
    """
    weight = np.zeros(len(state.positions))
    weight[band.piece] = near
    share = weight[state.triangles].max(axis=1)
    rows = np.flatnonzero(share > 0)
    corners, faces = material[rows], state.triangles[rows]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    F = np.asarray(deformation_gradients(state.positions, faces, np.linalg.inv(edges)))
    along = np.einsum("tij,tj->ti", np.linalg.pinv(F), _along(state, band, faces))
    along /= np.linalg.norm(along, axis=1)[:, None]
    shorter = (factor - 1.0) * share[rows]
    offsets = corners - corners[:, :1]
    taken = material.copy()
    taken[rows] = corners + (shorter[:, None] * np.einsum("tci,ti->tc", offsets, along))[..., None] * along[:, None]
    return taken


def _along(state: SewingState, band: Band, faces: Ints) -> Floats:
    """Unit direction (t, 3) of the edge of a band that is nearest to each triangle."""
    ends = state.positions[band.edges]
    nearest = cKDTree(ends.mean(axis=1)).query(state.positions[faces].mean(axis=1))[1]
    direction = ends[nearest, 1] - ends[nearest, 0]
    return np.asarray(direction / np.linalg.norm(direction, axis=1)[:, None], np.float64)


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
