"""Regions of surfaces that intersection curves bound: flood fill, and which side of a curve is inside.

All cut edges are removed and the rest is filled once into patches; the two sides of one curve are then unions of
patches, joined over the edges that other curves cut. The smaller side, by area, is inside; one that was inside before
stays so. A curve whose cut edges do not separate their ends is open: it ends inside the surface.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.untangling.contours import Contours, EdgeTriangleIntersections, connected
from clothsim.mesh.topology import unique_edges

Flags = NDArray[np.bool_]
MOSTLY = 0.5
"""Fraction of the area of a side that was inside before, above which it is again."""


@dataclass(frozen=True)
class Mesh:
    """Surfaces that are filled.

    triangles (m, 3); edges (e, 2), sorted; areas (n,) of the vertices at rest [m2].
    """

    triangles: Ints
    edges: Ints
    areas: Floats


def make_mesh(triangles: Ints, areas: Floats, n_vertices: int) -> Mesh:
    """Return the surfaces of `triangles (m, 3)` with `areas (m,)` [m2]."""
    of_vertices = np.bincount(triangles.ravel(), np.repeat(areas / 3, 3), minlength=n_vertices).astype(np.float64)
    return Mesh(triangles, unique_edges(triangles), of_vertices)


@dataclass(frozen=True)
class Sides:
    """Inside ends of cut edges.

    Parameters
    ----------
    inner : (k,) int64
        Which end (0 or 1) of each intersection's edge is to move through its triangle; -1: none.
    is_open : (k,) bool
        Intersections of contours none of whose curves separates its surface.
    inside : (n,) bool
        Vertices of the regions that are to pass through the other surface.
    """

    inner: Ints
    is_open: Flags
    inside: Flags


@dataclass(frozen=True)
class Region:
    """Inside of one curve.

    intersections (k,) of the curve; inner (k,): inner end of each edge; vertices (n,) bool; area [m2]; is_disc; is_old:
    True where most of it was inside before.
    """

    intersections: Ints
    inner: Ints
    vertices: Flags
    area: float
    is_disc: bool
    is_old: bool


def sides(mesh: Mesh, found: EdgeTriangleIntersections, graph: Contours, inside_before: Flags) -> Sides:
    """Return the inside end of each intersection's edge: of one curve for each contour."""
    n = len(mesh.areas)
    rows = np.searchsorted(mesh.edges[:, 0] * n + mesh.edges[:, 1], found.edges[:, 0] * n + found.edges[:, 1])
    uncut = np.ones(len(mesh.edges), bool)
    uncut[rows] = False
    patch = connected(mesh.edges[uncut, 0], mesh.edges[uncut, 1], n)
    regions: dict[int, list[Region]] = {}
    for curve in np.unique(graph.edge_curve):
        own = np.flatnonzero(graph.edge_curve == curve)
        region = _region(mesh, found, patch, rows, own, inside_before)
        if region is not None:
            regions.setdefault(int(graph.contour_of_curve[curve]), []).append(region)
    inner, inside = np.full(len(rows), -1), np.zeros(n, bool)
    for candidates in regions.values():
        chosen = _chosen(candidates)
        inner[chosen.intersections] = chosen.inner
        inside |= chosen.vertices
    return Sides(inner, ~np.isin(graph.contour, list(regions)), inside)


def _region(
    mesh: Mesh, found: EdgeTriangleIntersections, patch: Ints, rows: Ints, own: Ints, before: Flags
) -> Region | None:
    """The smaller side of the curve with the intersections `own`, of edges `rows`; None for an open curve."""
    times = np.zeros(rows.max(initial=-1) + 1, np.int64)
    np.add.at(times, rows[own], 1)
    one, other = patch[found.edges[times[rows] % 2 == 0]].T  # an edge that the curve cuts an odd number of times parts
    side = connected(one, other, int(patch.max(initial=-1)) + 1)[patch]
    one, other = (side[found.edges[own, end]] for end in (0, 1))
    cut = one != other
    if not cut.any():
        return None
    area = np.bincount(side, mesh.areas)
    old = np.bincount(side, mesh.areas * before) / np.where(area > 0, area, 1.0)
    # least first: what was inside before, then the smaller, then by number, so that equal ones differ
    rank = np.empty(len(area), np.int64)
    rank[np.lexsort((area, old <= MOSTLY))] = np.arange(len(area))
    other_inside = rank[other] < rank[one]
    numbers = np.unique(np.where(other_inside, other, one)[cut])
    vertices = np.isin(side, numbers)
    whole = float(area[numbers].sum())
    is_old = float((area * old)[numbers].sum()) > MOSTLY * whole
    return Region(own, np.where(cut, other_inside, -1), vertices, whole, _is_disc(mesh, vertices), is_old)


def _chosen(candidates: list[Region]) -> Region:
    """The old of two regions, else the one that is no disc, else the smaller.

    An end of a tube can pass through the disc that it cuts out of a sheet, the disc cannot pass through the tube.
    """
    return min(candidates, key=lambda region: (not region.is_old, region.is_disc, region.area, region.intersections[0]))


def _is_disc(mesh: Mesh, inside: Flags) -> bool:
    """True where the part of the mesh on the flagged vertices has Euler characteristic 1."""
    edges = np.count_nonzero(inside[mesh.edges].all(axis=1))
    faces = np.count_nonzero(inside[mesh.triangles].all(axis=1))
    return bool(np.count_nonzero(inside) - edges + faces == 1)
