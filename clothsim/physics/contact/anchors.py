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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel, part
from clothsim.base.vectors import cross, dot, dots, length, lengths, minus, row, unit

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
        slips, _ = self._trial(x)
        fractions = lengths(slips) / elastic_slip
        scale, _ = self._drawn(fractions, ratios)
        return replace(self, slips=slips * scale[:, None], slides=fractions >= 1.0)

    def _trial(self, x: Floats) -> tuple[Floats, Floats]:
        """Slips (p, 3) before they yield, and the displacements (p, 3) of the closest points less `turning` [m]."""
        moved = relative_positions(x, self.elements, self.weights) - self.origins - self.turning(x)
        turned = _rotated(self.slips, self.normals, self.directions, directions_of(x, self.elements, self.turners), 1.0)
        return turned + tangential(moved, self.normals), moved

    def _drawn(self, fractions: Floats, ratios: Floats) -> tuple[Floats, Floats]:
        """Factors (p,) of slips that are `fractions` of the largest, and their derivatives by the fractions."""
        slides, rests = fractions >= 1.0, np.minimum(fractions, 1.0)
        root = np.sqrt(1.0 - ratios * (2.0 - rests) * rests)
        target = np.where(slides, 1.0, np.where(self.slides, 1.0 - root, fractions))
        scale = np.divide(target, fractions, out=np.ones_like(target), where=fractions > 0.0)
        resting = np.divide(ratios * (1.0 - rests), root, out=np.zeros_like(root), where=root > 0.0)
        slope = np.where(slides, 0.0, np.where(self.slides, resting, 1.0))
        return scale, np.divide(slope - scale, fractions, out=np.zeros_like(target), where=fractions > 0.0)

    def after_adjoint(self, x: Floats, elastic_slip: float, ratios: Floats, by: Floats) -> tuple[Floats, Floats]:
        """Derivative of by . (slips of `after`) by x (N, 3), and by the numbers of `as_array` (p, 24)."""
        trial, moved = self._trial(x)
        fractions = lengths(trial) / elastic_slip
        scale, slope = self._drawn(fractions, ratios)
        along = np.divide(dots(trial, by), fractions, out=np.zeros_like(scale), where=fractions > 0.0)
        by = scale[:, None] * by + (slope * along)[:, None] * trial / elastic_slip**2
        by_moved, by_normals = tangential_adjoint(moved, self.normals, by)
        end = directions_of(x, self.elements, self.turners)
        by_slips = _rotated(by, self.normals, self.directions, end, -1.0)
        turned = adjoint_by_rows(
            lambda n, e, e_end: _rotated(self.slips, n, e, e_end, 1.0), (self.normals, self.directions, end), by
        )
        by_x, by_origins, by_directions, by_facings = self.turning_adjoint(x, -by_moved)
        _add_directions(by_x, self.elements, self.turners, turned[2])
        by_weights = _add_relative(by_x, x, self.elements, self.weights, by_moved)
        none = np.zeros((len(by), 1))
        vectors = by_normals + turned[0], by_slips, by_origins - by_moved, by_directions + turned[1], by_facings
        return by_x, np.concatenate([np.zeros((len(by), 4)), by_weights, *vectors, none], axis=1)

    def turning(self, x: Floats) -> Floats:
        """Displacements of the gaps (p, 3) [m] as the surface that turns them moves until it is that of x (N, 3) [m].

        Where only an edge of it is known it turns the shortest way; a vertex does not turn.
        """
        return _turning(self.origins, self.directions, self.facings, *self._frames(x))

    def turning_adjoint(self, x: Floats, by: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Derivative of by . turning(x) by x (N, 3), origins, directions and facings (p, 3)."""
        parts = adjoint_by_rows(_turning, (self.origins, self.directions, self.facings, *self._frames(x)), by)
        by_x = np.zeros_like(x)
        _add_directions(by_x, self.elements, self.turners, parts[3])
        _add_facings(by_x, x, self.elements, self.weights, self.turners, parts[4])
        return by_x, parts[0], parts[1], parts[2]

    def start_adjoint(self, x: Floats, origins: Floats, directions: Floats, facings: Floats) -> tuple[Floats, Floats]:
        """Derivative by x (N, 3), and by the weights (p, 4), of what `anchors_at` takes from x, by its adjoints."""
        by_x = np.zeros_like(x)
        _add_directions(by_x, self.elements, self.turners, directions)
        _add_facings(by_x, x, self.elements, self.weights, self.turners, facings)
        return by_x, _add_relative(by_x, x, self.elements, self.weights, origins)

    def _frames(self, x: Floats) -> tuple[Floats, Floats]:
        """Directions and facings at x."""
        return directions_of(x, self.elements, self.turners), facings_of(x, self.elements, self.weights, self.turners)

    def inherited(self, elements: Ints, weights: Floats, normals: Floats, labels: Ints) -> tuple[Ints, Floats]:
        """For new contacts the index of the contact that each continues, -1 for none (q,), and their slips (q, 3) [m].

        The slip is turned into the new tangent plane. labels (N,): object of each row of x.
        """
        new_keys, keys = (_keys(*each, labels) for each in ((elements, weights), (self.elements, self.weights)))
        order = np.argsort(keys, kind="stable")
        parents = _parents(new_keys, keys, order, elements, self.elements, normals, self.normals)
        found = np.flatnonzero(parents >= 0)
        slips = np.zeros((len(new_keys), 3))
        slips[found] = turned = tangential(self.slips[parents[found]], normals[found])
        before, after = lengths(self.slips[parents[found]])[:, None], lengths(turned)[:, None]
        slips[found] *= np.divide(before, after, out=np.ones_like(after), where=after > 0.0)  # with its length
        return parents, slips


def anchors_from(numbers: object, triangles_at: Ints = NO_TRIANGLES) -> Anchors:
    """Anchors of `Anchors.as_array`, which a file may hold as lists; triangles_at as of `turners_of`."""
    rows = np.asarray(numbers, np.float64).reshape(-1, COLUMNS[-1] + 1)
    parts, weights, normals, slips, origins, directions, facings, slides = (
        np.ascontiguousarray(part) for part in np.split(rows, COLUMNS, axis=1)
    )
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


@kernel
def relative_positions(x: Floats, elements: Ints, weights: Floats) -> Floats:
    """Return sum g_i x_i of each contact (p, 3) [m]."""
    found = np.zeros((len(elements), 3))
    for p in range(len(elements)):
        for k in range(4):
            a, b, c = row(x, elements[p, k])
            found[p, 0] += weights[p, k] * a
            found[p, 1] += weights[p, k] * b
            found[p, 2] += weights[p, k] * c
    return found


@kernel
def directions_of(x: Floats, elements: Ints, turners: Ints) -> Floats:
    """Return an edge of the body of each contact, else of its second surface, (p, 3) [m]; 0 where that is a vertex."""
    found = np.empty((len(elements), 3))
    for p in range(len(elements)):
        first, second = _edge(elements, turners, p)
        found[p, 0], found[p, 1], found[p, 2] = minus(row(x, second), row(x, first))
    return found


@part
def _edge(elements: Ints, turners: Ints, p: int) -> tuple[int, int]:
    """Rows of the ends of the edge of contact p; whole arrays are passed, as a view of a row takes longer than this."""
    if turners[p, 0] >= 0:
        return turners[p, 0], turners[p, 1]
    b, c, d = elements[p, 1], elements[p, 2], elements[p, 3]
    return (b, c) if c == d else (c, d)


@kernel
def facings_of(x: Floats, elements: Ints, weights: Floats, turners: Ints) -> Floats:
    """Return the normal of the body of a contact, else of its face or its two edges, (p, 3) [m2].

    0 where it has none or the edges are parallel.
    """
    found = np.zeros((len(elements), 3))
    for p in range(len(elements)):
        a, b, c, d, has_one = _sides(elements, weights, turners, p)
        first, second = minus(row(x, b), row(x, a)), minus(row(x, d), row(x, c))
        normal = cross(first, second)
        if has_one and length(normal) > LEAST_TANGENT * length(first) * length(second):
            found[p, 0], found[p, 1], found[p, 2] = normal
    return found


@part
def _sides(elements: Ints, weights: Floats, turners: Ints, p: int) -> tuple[int, int, int, int, bool]:
    """Rows of the ends of the two sides that span the facing of contact p, and whether it has one."""
    if turners[p, 0] >= 0:
        return turners[p, 0], turners[p, 1], turners[p, 0], turners[p, 2], True
    a, b, c, d = elements[p, 0], elements[p, 1], elements[p, 2], elements[p, 3]
    if 0.0 < weights[p, 0] < 1.0:
        return a, b, c, d, True
    return b, c, c, d, weights[p, 1] < 0.0


@kernel
def _ends(elements: Ints, weights: Floats, turners: Ints) -> Ints:
    """Rows of the two ends of `directions_of`, then of the four of the sides of `facings_of`, (6, p)."""
    ends = np.empty((6, len(elements)), np.int64)
    for p in range(len(elements)):
        ends[0, p], ends[1, p] = _edge(elements, turners, p)
        ends[2, p], ends[3, p], ends[4, p], ends[5, p], _ = _sides(elements, weights, turners, p)
    return ends


@kernel
def _parents(
    new_keys: Ints, keys: Ints, order: Ints, elements: Ints, old_elements: Ints, normals: Floats, old_normals: Floats
) -> Ints:
    """Return the contact with the key of each new one whose normal is nearest, of the same elements first; -1 for none.

    order: of `keys`, ascending.
    """
    parents = np.full(len(new_keys), -1)
    for new in range(len(new_keys)):
        low, high = 0, len(order)
        while low < high:
            middle = (low + high) // 2
            low, high = (middle + 1, high) if keys[order[middle]] < new_keys[new] else (low, middle)
        best = -np.inf
        while low < len(order) and keys[order[low]] == new_keys[new]:
            old = order[low]
            cosine = dot(row(normals, new), row(old_normals, old))
            same = True
            for k in range(4):
                same &= elements[new, k] == old_elements[old, k]
            score = cosine + 2.0 * same
            if cosine > SAME_SIDE and score > best:
                parents[new], best = old, score
            low += 1
    return parents


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
        found[rows] = _rigid(x[rows], displacements[rows])[0]
    return found


def rigid_adjoint(x: Floats, displacements: Floats, labels: Ints, by: Floats) -> tuple[Floats, Floats]:
    """Derivative of by . rigid_displacements by x and by the displacements, (n, 3) each: a projection is symmetric."""
    by_x, by_displacements = np.zeros_like(x), np.zeros_like(x)
    for label in np.unique(labels):
        rows = labels == label
        (found, turn), (own, by_turn) = _rigid(x[rows], displacements[rows]), _rigid(x[rows], by[rows])
        by_displacements[rows] = own
        by_x[rows] = np.cross(by[rows] - own, turn) + np.cross(displacements[rows] - found, by_turn)
    return by_x, by_displacements


def _rigid(x: Floats, displacements: Floats) -> tuple[Floats, Floats]:
    """The rigid displacements of one object, and their rotation (3,)."""
    mean = displacements.mean(axis=0)
    offsets = x - x.mean(axis=0)
    squares = offsets.T @ offsets
    inertia = np.trace(squares) * np.eye(3) - squares
    momentum = np.cross(offsets, displacements - mean).sum(axis=0)
    rotation = np.linalg.lstsq(inertia, momentum, rcond=None)[0]
    return mean + np.cross(rotation, offsets), rotation


@kernel
def _turning(
    origins: Floats, directions: Floats, facings: Floats, directions_end: Floats, facings_end: Floats
) -> Floats:
    found = np.zeros((len(origins), 3))
    for p in range(len(origins)):
        origin = row(origins, p)
        e, m = unit(row(directions, p)), unit(row(facings, p))
        e_end, m_end = unit(row(directions_end, p)), unit(row(facings_end, p))
        along = dot(e, e_end)
        if not along > SAME_SIDE:
            continue
        if dot(m, m_end) > SAME_SIDE:
            start, end = (e, m, cross(e, m)), (e_end, m_end, cross(e_end, m_end))
            for i in range(3):
                for k in range(3):
                    for j in range(3):
                        found[p, i] += (end[j][i] - start[j][i]) * start[j][k] * origin[k]
        else:  # the shortest way
            axis = cross(e, e_end)
            across = cross(axis, origin)
            further = cross(axis, across)
            for i in range(3):
                found[p, i] = across[i] + further[i] / max(1.0 + along, 1.0)
    return found


@kernel
def _rotated(vectors: Floats, normals: Floats, before: Floats, after: Floats, sign: float) -> Floats:
    """Tangential vectors (p, 3) turned about the normals as the directions turned from `before` to `after` (p, 3).

    With the sign -1 they are turned back.
    """
    found = np.empty((len(vectors), 3))
    for p in range(len(vectors)):
        vector, normal, direction = row(vectors, p), row(normals, p), row(before, p)
        start, end = _across(direction, normal), _across(row(after, p), normal)
        sine, cosine = 0.0, 1.0
        if dot(start, start) > LEAST_TANGENT**2 * dot(direction, direction):
            sine, cosine = dot(cross(start, end), normal), dot(start, end)
        size = np.hypot(sine, cosine)
        sine, cosine = (sine / size, cosine / size) if size > 0.0 else (0.0, 0.0)
        turned = cross(normal, vector)
        for k in range(3):
            found[p, k] = cosine * vector[k] + sign * sine * turned[k]
    return found


@part
def _across(vector, normal):
    along = vector[0] * normal[0] + vector[2] * normal[2] + vector[1] * normal[1]  # added as np.einsum does
    return vector[0] - along * normal[0], vector[1] - along * normal[1], vector[2] - along * normal[2]


@kernel
def tangential(vectors: Floats, normals: Floats) -> Floats:
    """Return the components of vectors (p, 3) perpendicular to unit normals."""
    found = np.empty((len(vectors), 3))
    for p in range(len(vectors)):
        found[p, 0], found[p, 1], found[p, 2] = _across(row(vectors, p), row(normals, p))
    return found


@kernel
def _keys(elements: Ints, weights: Floats, labels: Ints) -> Ints:
    """One number for the material point of each contact and the object that it touches, (p,)."""
    keys, count = np.empty(len(elements), np.int64), 1
    for label in labels:
        count = max(count, label + 1)
    for p in range(len(elements)):
        first = elements[p, 1] if weights[p, 1] == 1.0 else elements[p, 0]
        second = elements[p, 1] if weights[p, 0] != 1.0 and weights[p, 1] != 1.0 else -1
        keys[p] = (first * (len(labels) + 1) + second + 1) * count + labels[elements[p, 3]]
    return keys


# Adjoints, for the gradient of a run: derivatives of by . result, by each argument.


ROW_STEP = 1e-4
"""Displacement of a row's entry in a difference of fourth order, as a fraction of the row's length."""


def adjoint_by_rows(function: Callable[..., Floats], arrays: Sequence[Floats], by: Floats) -> list[Floats]:
    """Derivatives of by . function(*arrays) by arrays (p, 3), of a function of rows: by central differences.

    For rotations of unit vectors, which are smooth on the scale of the row. A row of zeros (no such vector) has none.
    """
    found = []
    for number, array in enumerate(arrays):
        sizes = ROW_STEP * np.linalg.norm(array, axis=1)
        part = np.zeros_like(array)
        for k in range(array.shape[1]):
            for offset, weight in ((2.0, -1.0 / 12.0), (1.0, 2.0 / 3.0), (-1.0, -2.0 / 3.0), (-2.0, 1.0 / 12.0)):
                moved = array.copy()
                moved[:, k] += offset * sizes
                part[:, k] += weight * dots(by, function(*arrays[:number], moved, *arrays[number + 1 :]))
        found.append(np.divide(part, sizes[:, None], out=np.zeros_like(part), where=sizes[:, None] > 0.0))
    return found


def tangential_adjoint(vectors: Floats, normals: Floats, by: Floats) -> tuple[Floats, Floats]:
    """Adjoints of `tangential` by the vectors and by the normals."""
    along, across = dots(vectors, normals)[:, None], dots(by, normals)[:, None]
    return tangential(by, normals), -(along * by + across * vectors)


def turned_adjoint(vectors: Floats, normals: Floats, by: Floats) -> tuple[Floats, Floats]:
    """Adjoints, by both, of vectors that are turned into new tangent planes with their lengths."""
    turned = tangential(vectors, normals)
    before, after = lengths(vectors)[:, None], lengths(turned)[:, None]
    scale, along = np.divide(before, after, out=np.ones_like(after), where=after > 0.0), dots(turned, by)[:, None]
    by_length = np.divide(along, before * after, out=np.zeros_like(after), where=before * after > 0.0)
    by_turned = scale * by - scale * np.divide(along, after**2, out=np.zeros_like(after), where=after > 0.0) * turned
    by_vectors, by_normals = tangential_adjoint(vectors, normals, by_turned)
    return by_vectors + by_length * vectors, by_normals


def _add_relative(out: Floats, x: Floats, elements: Ints, weights: Floats, by: Floats) -> Floats:
    """Add the adjoint of `relative_positions` by x to `out`; return that by the weights (p, 4)."""
    np.add.at(out, elements, weights[:, :, None] * by[:, None, :])
    return np.asarray(np.einsum("pc,pkc->pk", by, x[elements]), np.float64)


def _add_directions(out: Floats, elements: Ints, turners: Ints, by: Floats) -> None:
    first, second = _ends(elements, np.zeros((len(elements), 4)), turners)[:2]
    np.add.at(out, second, by)
    np.subtract.at(out, first, by)


def _add_facings(out: Floats, x: Floats, elements: Ints, weights: Floats, turners: Ints, by: Floats) -> None:
    rows = _ends(elements, weights, turners)[2:]
    first, second = x[rows[1]] - x[rows[0]], x[rows[3]] - x[rows[2]]
    by = np.where(np.any(facings_of(x, elements, weights, turners), axis=1, keepdims=True), by, 0.0)
    for ends, added in ((rows[:2], np.cross(second, by)), (rows[2:], np.cross(by, first))):
        np.add.at(out, ends[1], added)
        np.subtract.at(out, ends[0], added)


NO_ANCHORS = anchors_from(())
