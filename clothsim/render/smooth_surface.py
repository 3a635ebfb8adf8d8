"""Smooth surface through the vertices of a mesh, for pictures: Phong tessellation.

Boubekeur and Alexa 2008, "Phong tessellation", equation (2): a point of an edge is projected onto the tangent planes of
both ends, and their mean, weighted by SHAPE, replaces it. The vertices stay where they are; a cloth on a ball does not
sink into it, as it would with an approximating scheme such as Loop's.
"""

from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.render.surface_look import Surface, vertex_normals, vertex_values

SHAPE = 0.5
"""Weight of the projections; 0 leaves the triangles flat. With a half the middles of edges lie on a ball whose surface
the vertices are on, to fourth order in the angle; the paper takes 3/4 and bulges more."""
LEVELS = 2
"""Bound on the halvings of an edge."""
MOST_TRIANGLES = 60_000
"""Triangles beyond which a surface is fine enough as it is."""
COS_SHARP = 0.5
"""Cosine of the angle between the normals of two ends, 60 degrees, beyond which the middle of their edge stays: in a
fold as tight as the mesh the smooth sheets would cross."""


def smoothed(surface: Surface) -> Surface:
    """A cloth with its edges halved up to LEVELS times; a body, a fine cloth or one with strokes as it is."""
    if surface.role != "cloth" or len(surface.strokes):
        return surface
    x, triangles = surface.positions, surface.triangles
    values, material = vertex_values(surface), surface.material
    for _ in range(LEVELS):
        if 4 * len(triangles) > MOST_TRIANGLES:
            break
        x, triangles, edges = _halved(x, triangles)
        values, material = _with_means(values, edges), _with_means(material, edges)
    parts = len(triangles) // max(len(surface.triangles), 1)
    whole = replace(surface, positions=x, triangles=triangles, principal_stretches=np.zeros((0, 2)))
    return replace(whole, values=values, material=material, fabrics=np.repeat(surface.fabrics, parts))


def _with_means(values: Floats, edges: Ints) -> Floats:
    """Numbers at the vertices, if there are any, and at the middles of the edges."""
    return np.concatenate([values, values[edges].mean(axis=1)]) if len(values) else values


def _halved(x: Floats, triangles: Ints) -> tuple[Floats, Ints, Ints]:
    """Vertices and triangles with each triangle in four, and the edges (k, 2) whose middles are the new vertices."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    a, b, c = triangles.T
    ab, bc, ca = (number.reshape(-1, 3) + len(x)).T
    quarters = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]], axis=0)
    middles = _middles(x, vertex_normals(x, triangles), edges)
    return np.concatenate([x, middles]), quarters.transpose(2, 0, 1).reshape(-1, 3), edges


def _middles(x: Floats, normals: Floats, edges: Ints) -> Floats:
    """Middles of edges on the smooth surface; of one along which it turns sharply its own."""
    ends, n = x[edges], normals[edges]
    middle = ends.mean(axis=1)
    off = np.einsum("ijk,ijk->ij", middle[:, None] - ends, n)
    bulge = -(off[..., None] * n).mean(axis=1)
    turned = np.einsum("ik,ik->i", n[:, 0], n[:, 1]) < COS_SHARP
    return middle + SHAPE * np.where(turned[:, None], 0.0, bulge)
