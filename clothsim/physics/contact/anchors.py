"""Anchors of static friction: elastic slip of a contact since it last held, carried from step to step.

A contact that holds is a spring between two material points, which yields at mu F (elastic-perfectly plastic, with a
return mapping: Simo and Hughes 1998, "Computational inelasticity", box 1.4; Cundall and Strack 1979 for the tangential
springs of contacts). z is the tangential displacement of the points since they last fitted, at most e. A step adds the
relative displacement u of the closest points: beyond |z + u| = e the anchor is drawn along, with |z| = e.

z turns with the body of a contact, with the second surface where cloth touches cloth: on a turntable it would else be
left behind at the rate omega z. So does the gap d between the points: on a slab that tilts by an angle it moves one
over the other by |d| times that angle, which is no slip (`turning`). It is the body's rotation that counts, whichever
surface has the vertex: the tilt of a triangle of cloth is unknown before the step.

The anchor belongs to a material point (a vertex, or an edge) and to the object that it touches, not to a pair of
simplices: a vertex that passes from face to face keeps it. Where one point touches an object from several sides, the
side with the nearest normal inherits.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import unit

SAME_SIDE = 0.5
"""Smallest cosine of the normals before and after of a contact that keeps its anchor."""

COLUMNS = np.cumsum((4, 4, 3, 3, 3, 3, 3))
"""Ends of the columns of `Anchors.as_array`: elements to facings; then whether it slides."""

LEAST_TANGENT = 0.1
"""Tangential fraction of a direction below which it does not tell the rotation about the normal."""


NO_TRIANGLES = np.zeros((0, 3), np.int64)
"""Triangles at the vertices of a scene without bodies."""


@dataclass(frozen=True)
class Anchors:
    """Elastic slips of contacts at the start of a step.

    Parameters
    ----------
    elements, weights : (p, 4) array
        Rows of x and weights g of the closest points.
    normals, slips : (p, 3) array
        n, and z [m].
    origins : (p, 3) array
        sum g_i x_i at the start of the step [m].
    directions : (p, 3) array
        `directions_of` the contacts at the start of the step [m].
    facings : (p, 3) array
        `facings_of` the contacts at the start of the step [m2].
    slides : (p,) bool array
        True where the contact slid in the step before.
    turners : (p, 3) int array
        `turners_of` the contacts.
    """

    elements: Ints
    weights: Floats
    normals: Floats
    slips: Floats
    origins: Floats
    directions: Floats
    facings: Floats
    slides: np.ndarray
    turners: Ints

    def as_array(self) -> Floats:
        """All numbers but the turners, (p, 24)."""
        vectors = self.normals, self.slips, self.origins, self.directions, self.facings
        parts = self.elements, self.weights, *vectors, self.slides[:, None]
        return np.concatenate([np.asarray(part, np.float64) for part in parts], axis=1)

    def after(self, x: Floats, elastic_slip: float, ratios: Floats) -> Self:
        """Anchors after the step that ends at x (N, 3) [m]; ratios (p,): mu_kinetic / mu_static of the contacts.

        One that comes to rest holds with mu_static from then on: its slip shrinks so that its force stays.
        """
        moved = relative_positions(x, self.elements, self.weights) - self.origins - self.turning(x)
        turned = _rotated(self.slips, self.normals, self.directions, directions_of(x, self.elements, self.turners))
        slips = turned + tangential(moved, self.normals)
        fractions = np.linalg.norm(slips, axis=1) / elastic_slip
        slides = fractions >= 1.0
        rests = np.minimum(fractions, 1.0)
        rests = 1.0 - np.sqrt(1.0 - ratios * (2.0 - rests) * rests)
        target = np.where(slides, 1.0, np.where(self.slides, rests, fractions))
        scale = np.divide(target, fractions, out=np.ones_like(target), where=fractions > 0.0)
        return replace(self, slips=slips * scale[:, None], slides=slides)

    def turning(self, x: Floats) -> Floats:
        """Displacements of the gaps (p, 3) [m] as the surface that turns them moves until it is that of x (N, 3) [m].

        Where only an edge of it is known it turns the shortest way; a vertex does not turn.
        """
        e, m = unit(self.directions), unit(self.facings)
        e_end = unit(directions_of(x, self.elements, self.turners))
        m_end = unit(facings_of(x, self.elements, self.weights, self.turners))
        axes, along = np.cross(e, e_end), (e * e_end).sum(axis=1, keepdims=True)
        across = np.cross(axes, self.origins)
        shortest = across + np.cross(axes, across) / np.maximum(1.0 + along, 1.0)
        start, end = (np.stack([u, v, np.cross(u, v)], axis=2) for u, v in ((e, m), (e_end, m_end)))
        full = np.einsum("pij,pkj,pk->pi", end - start, start, self.origins)
        known = ((m * m_end).sum(axis=1) > SAME_SIDE) & (along[:, 0] > SAME_SIDE)
        return np.where(known[:, None], full, np.where(along > SAME_SIDE, shortest, 0.0))

    def inherited(self, elements: Ints, weights: Floats, normals: Floats, labels: Ints) -> tuple[Ints, Floats]:
        """For new contacts the index of the contact that each continues, -1 for none (q,), and their slips (q, 3) [m].

        The slip is turned into the new tangent plane. labels (N,): object of each row of x.
        """
        new_keys, keys = (_keys(*each, labels) for each in ((elements, weights), (self.elements, self.weights)))
        order = np.argsort(keys, kind="stable")
        first, last = (np.searchsorted(keys[order], new_keys, side) for side in ("left", "right"))
        new = np.repeat(np.arange(len(new_keys)), last - first)
        before = np.concatenate([[0], np.cumsum(last - first)])[:-1]
        old = order[np.arange(len(new)) - np.repeat(before - first, last - first)]
        cosines = (normals[new] * self.normals[old]).sum(axis=1)
        same = (elements[new] == self.elements[old]).all(axis=1)
        new, old, score = (each[cosines > SAME_SIDE] for each in (new, old, cosines + 2.0 * same))
        best = np.lexsort((old, -score, new))
        found, at = np.unique(new[best], return_index=True)
        parents = np.full(len(new_keys), -1)
        parents[found] = old[best][at]
        slips = np.zeros((len(new_keys), 3))
        slips[found] = _turned(self.slips[parents[found]], normals[found])
        return parents, slips


def anchors_from(numbers: object, triangles_at: Ints = NO_TRIANGLES) -> Anchors:
    """Anchors of `Anchors.as_array`, which a file may hold as lists; triangles_at as of `turners_of`."""
    rows = np.asarray(numbers, np.float64).reshape(-1, COLUMNS[-1] + 1)
    parts, weights, normals, slips, origins, directions, facings, slides = np.split(rows, COLUMNS, axis=1)
    vectors, elements = (normals, slips, origins, directions, facings), parts.astype(np.int64)
    return Anchors(elements, weights, *vectors, slides[:, 0] > 0.0, turners_of(elements, triangles_at))


def anchors_at(
    x: Floats,
    elements: Ints,
    weights: Floats,
    normals: Floats,
    slips: Floats,
    slides: np.ndarray,
    triangles_at: Ints = NO_TRIANGLES,
) -> Anchors:
    """Anchors of contacts in a step that starts at x (N, 3) [m]; triangles_at as of `turners_of`."""
    origins, turners = relative_positions(x, elements, weights), turners_of(elements, triangles_at)
    directions, facings = directions_of(x, elements, turners), facings_of(x, elements, weights, turners)
    return Anchors(elements, weights, normals, slips, origins, directions, facings, slides, turners)


def turners_of(elements: Ints, triangles_at: Ints) -> Ints:
    """Rows (p, 3) of a triangle of the body of each contact; -1 where cloth touches cloth.

    triangles_at (N, 3): rows of a triangle at each vertex of a body, -1 for all others; empty where there is no body.
    """
    if not len(triangles_at):
        return np.full((len(elements), 3), -1)
    last = triangles_at[elements[:, 3]]
    return np.where(last[:, :1] < 0, triangles_at[elements[:, 0]], last)


def relative_positions(x: Floats, elements: Ints, weights: Floats) -> Floats:
    """sum g_i x_i of each contact (p, 3) [m]."""
    return np.asarray(np.einsum("pk,pkc->pc", weights, x[elements]), np.float64)


def directions_of(x: Floats, elements: Ints, turners: Ints) -> Floats:
    """An edge of the body of each contact, else of its second surface, (p, 3) [m]; 0 where that is a vertex."""
    of_body = turners[:, 0] >= 0
    first = np.where(elements[:, 2] == elements[:, 3], elements[:, 1], elements[:, 2])
    second = np.where(elements[:, 2] == elements[:, 3], elements[:, 2], elements[:, 3])
    first, second = np.where(of_body, turners[:, 0], first), np.where(of_body, turners[:, 1], second)
    return np.asarray(x[second] - x[first], np.float64)


def facings_of(x: Floats, elements: Ints, weights: Floats, turners: Ints) -> Floats:
    """Normal of the body of a contact, else of its face or its two edges, (p, 3) [m2].

    0 where it has none or the edges are parallel.
    """
    a, b, c, d = (x[elements[:, k]] for k in range(4))
    of_edges = (weights[:, 0] > 0.0) & (weights[:, 0] < 1.0)
    first, second = np.where(of_edges[:, None], b - a, c - b), d - c
    of_body = turners[:, 0] >= 0
    corners = x[turners[of_body]]
    first[of_body], second[of_body] = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = np.cross(first, second)
    least = LEAST_TANGENT * np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    has_one = (of_body | of_edges | (weights[:, 1] < 0.0)) & (np.linalg.norm(normals, axis=1) > least)
    return np.where(has_one[:, None], normals, 0.0)


def rigid_displacements(x: Floats, displacements: Floats, labels: Ints) -> Floats:
    """The rigid displacements nearest to those of each object.

    Of each object u + r x d is fitted by least squares, with the offsets d from its mean position. Objects without
    extent across a line turn about none of it.

    Parameters
    ----------
    x, displacements : (n, 3) array
        Positions and small displacements [m].
    labels : (n,) int array
        Object of each row.

    Returns
    -------
    (n, 3) array [m]

    Examples
    --------
    >>> x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> turned = np.cross([0, 0, 0.1], x)
    >>> bool(np.allclose(rigid_displacements(x, turned, np.zeros(4, int)), turned))
    True
    """
    found = np.zeros_like(displacements)
    for label in np.unique(labels):
        rows = labels == label
        mean = displacements[rows].mean(axis=0)
        offsets = x[rows] - x[rows].mean(axis=0)
        squares = offsets.T @ offsets
        inertia = np.trace(squares) * np.eye(3) - squares
        momentum = np.cross(offsets, displacements[rows] - mean).sum(axis=0)
        rotation = np.linalg.lstsq(inertia, momentum, rcond=None)[0]
        found[rows] = mean + np.cross(rotation, offsets)
    return found


def _rotated(vectors: Floats, normals: Floats, before: Floats, after: Floats) -> Floats:
    """Tangential vectors (p, 3) turned about the normals as the directions turned from `before` to `after` (p, 3)."""
    start, end = tangential(before, normals), tangential(after, normals)
    known = (start**2).sum(axis=1) > LEAST_TANGENT**2 * (before**2).sum(axis=1)
    sine = np.where(known, (np.cross(start, end) * normals).sum(axis=1), 0.0)
    cosine = np.where(known, (start * end).sum(axis=1), 1.0)
    size = np.hypot(sine, cosine)
    sine, cosine = (np.divide(each, size, out=np.zeros_like(size), where=size > 0.0) for each in (sine, cosine))
    return np.asarray(cosine[:, None] * vectors + sine[:, None] * np.cross(normals, vectors), np.float64)


def tangential(vectors: Floats, normals: Floats) -> Floats:
    """Components of vectors (p, 3) perpendicular to unit normals."""
    return np.asarray(vectors - np.einsum("pc,pc->p", vectors, normals)[:, None] * normals, np.float64)


def _keys(elements: Ints, weights: Floats, labels: Ints) -> Ints:
    """One number for the material point of each contact and the object that it touches, (p,)."""
    first = np.where(weights[:, 1] == 1.0, elements[:, 1], elements[:, 0])
    on_edge = (weights[:, 0] != 1.0) & (weights[:, 1] != 1.0)
    second = np.where(on_edge, elements[:, 1], -1)
    count = int(labels.max(initial=0)) + 1
    return np.asarray((first * (len(labels) + 1) + second + 1) * count + labels[elements[:, 3]], np.int64)


def _turned(vectors: Floats, normals: Floats) -> Floats:
    """Tangential components of vectors (p, 3) for unit normals, with the lengths of the vectors."""
    turned = tangential(vectors, normals)
    before, after = (np.linalg.norm(each, axis=1, keepdims=True) for each in (vectors, turned))
    return np.asarray(turned * np.divide(before, after, out=np.ones_like(after), where=after > 0.0), np.float64)


NO_ANCHORS = anchors_from(())
