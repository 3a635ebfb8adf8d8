"""Gradient of the length of intersection contours.

Volino & Magnenat-Thalmann 2006, "Resolving surface collisions through intersection contour minimization", section 3.
It frees contours that end inside both surfaces, where no region tells inside from outside: two hems that interlock.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.untangling.contours import Contours
from clothsim.geometry.untangling.piercings import Piercings
from clothsim.mesh.topology import half_edges

FLAT = 0.1
"""Least |cosine| of edge and normal that is divided by."""
LEAST = 0.5
"""Least length of the sum of the gradients of a contour that gives its direction."""


def contour_gradients(x: Floats, triangles: Ints, pairs: Ints, found: Piercings) -> Floats:
    """Return the motion of each edge, relative to the triangle that it pierces, which shortens the contour fastest.

    Returns
    -------
    (k, 3) float64
        G = sum_i (R_i - 2 (E.R_i)/(E.N) N) over the triangles i beside the edge: E its unit vector, N the normal of the
        triangle that is pierced, R_i the direction of the contour into triangle i.
    """
    piercing, pair, role = found.of_pair.T
    edge = x[found.edges[:, 1]] - x[found.edges[:, 0]]
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    owner = triangles[pairs[pair, role]]
    corners = x[owner]
    N, E = found.normals[piercing], edge[piercing]
    R = np.cross(N, np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    opposite = owner.sum(axis=1) - found.edges[piercing].sum(axis=1)
    inward = x[opposite] - x[found.edges[piercing, 0]]
    inward -= np.einsum("ij,ij->i", inward, E)[:, None] * E
    R *= np.sign(np.einsum("ij,ij->i", R, inward))[:, None]
    size = np.linalg.norm(R, axis=1, keepdims=True)
    R /= np.where(size > 0, size, 1.0)
    cosine = np.einsum("ij,ij->i", E, N)
    cosine = np.where(cosine < 0, -1.0, 1.0) * np.maximum(np.abs(cosine), FLAT)
    G = np.zeros((len(found.edges), 3))
    np.add.at(G, piercing, R - (2 * np.einsum("ij,ij->i", E, R) / cosine)[:, None] * N)
    # where a piercing is on an edge of the other surface too, round-off may leave out one of its two segments
    complete = np.bincount(piercing, minlength=len(G)) == _triangles_at(found.edges, triangles)
    return G * complete[:, None]


def _triangles_at(edges: Ints, triangles: Ints) -> Ints:
    """Number of triangles at each edge (k, 2)."""
    n = int(triangles.max(initial=0)) + 1
    ends = np.sort(half_edges(triangles), axis=1)
    keys, count = np.unique(ends[:, 0] * n + ends[:, 1], return_counts=True)
    return count[np.searchsorted(keys, edges[:, 0] * n + edges[:, 1])]


def slides(G: Floats, graph: Contours) -> Floats:
    """Return directions (k, 3), |.| <= 1, in which each edge slides along its contour, the same for a whole contour.

    A contour that ends inside both surfaces runs from the border of one to that of the other: the gradients of both
    ends, of one surface relative to the other, are alike, and the surfaces slide apart along their sum. Where they
    cancel, or one curve is on both sides, each edge follows its own gradient.
    """
    lower = np.minimum(graph.edge_curve, graph.face_curve)
    sign = np.where(graph.edge_curve == lower, 1.0, -1.0)
    total = np.zeros((graph.n_contours, 3))
    np.add.at(total, graph.contour, sign[:, None] * G)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    whole = sign[:, None] * (total / np.where(size > 0, size, 1.0))[graph.contour]
    own = G / np.maximum(np.linalg.norm(G, axis=1, keepdims=True), 1.0)
    alone = (graph.edge_curve == graph.face_curve) | (size[graph.contour, 0] < LEAST)
    return np.where(alone[:, None], own, whole)
