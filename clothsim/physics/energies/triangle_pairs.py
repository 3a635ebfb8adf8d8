"""Pairs of neighbouring triangles at rest: their choice, frames and hourglass modes."""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.topology import interior_edges
from clothsim.mesh.world import World

SHARP = 1.0
"""Rest angle [rad] from which two neighbours do not form a pair."""


def pairs(world: World) -> tuple[Ints, Ints]:
    """Disjoint pairs of neighbours of one fabric: (p, 4) shared edge and the corners beside it; (p, 2) the triangles.

    Greedy, by how near the angles opposite to the shared edge are to right angles. No pair is bent by more than SHARP
    at rest: across a sharp crease the diagonals do not determine the strain.
    """
    corners, both = interior_edges(world.triangles)
    mu, lam = world.per_triangle("shear_modulus"), world.per_triangle("lame_modulus")
    alike = (mu[both[:, 0]] == mu[both[:, 1]]) & (lam[both[:, 0]] == lam[both[:, 1]])
    flat, rest = _rest(world)
    a, b, c, d = (rest[corners[:, k]] for k in range(4))
    one, other = np.cross(b - a, c - a), np.cross(d - a, b - a)
    size = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    alike &= flat[corners[:, 0]] | ((one * other).sum(axis=1) > np.cos(SHARP) * size)
    skew = np.zeros(len(corners))  # the cosines of the angles opposite to the shared edge
    for k in range(2):
        a, b, c = np.moveaxis(_positions(world, corners[:, [0, 1, 2 + k]], both[:, k]), 1, 0)
        u, v = a - c, b - c
        skew += np.abs((u * v).sum(axis=1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1))
    taken, chosen = np.zeros(len(world.triangles), bool), []
    for pair in np.argsort(np.round(skew, 9), kind="stable"):
        if alike[pair] and not taken[both[pair]].any():
            taken[both[pair]] = True
            chosen.append(pair)
    selected = np.array(chosen, np.int64)
    return corners[selected], both[selected]


def _rest(world: World) -> tuple[np.ndarray, Floats]:
    """For each cloth vertex whether its cloth is flat at rest (n,), and its rest position (n, 3) [m]."""
    flat = np.concatenate([np.full(len(cloth.positions), cloth.flat) for cloth in world.cloths])
    return flat, np.concatenate([cloth.rest_positions for cloth in world.cloths])


def _positions(world: World, corners: Ints, triangles: Ints) -> Floats:
    """Rest positions of the vertices `corners` (p, k) in the frames of `triangles` (p,), (p, k, 2) [m]."""
    where = (world.triangles[triangles][:, None, :] == corners[:, :, None]).argmax(axis=2)
    material = np.concatenate([cloth.material_coordinates for cloth in world.cloths])
    return np.asarray(np.take_along_axis(material[triangles], where[:, :, None], axis=1), np.float64)


def shape_gradients(world: World, corners: Ints, triangles: Ints) -> Floats:
    """Shape-function gradients of four vertices in a triangle's frame, 0 for a vertex of the other, (p, 4, 2) [1/m]."""
    inverses = world.rest_shape_inverses[triangles]
    own = np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1)
    there = world.triangles[triangles][:, None, :] == corners[:, :, None]
    return np.asarray(there.astype(np.float64) @ own, np.float64)


def turns(world: World, corners: Ints, both: Ints) -> Floats:
    """Rotations (p, 2, 2) from the frame of the second triangle to that of the first, matching the shared edge."""
    edges = [np.diff(_positions(world, corners[:, :2], both[:, k]), axis=1)[:, 0] for k in range(2)]
    z = [edge[:, 0] + 1j * edge[:, 1] for edge in edges]
    turn = z[0] / z[1]
    turn = turn / np.abs(turn)
    return np.stack([np.stack([turn.real, -turn.imag], 1), np.stack([turn.imag, turn.real], 1)], 1)


def unbending(world: World, corners: Ints, rates: Floats) -> Floats:
    """U^-1 (p, 2, 2), U the stretch of the pairs' mean F in the rest shape, 1 where that is flat."""
    flat, rest = _rest(world)
    F = np.einsum("pvk,pvi->pki", rest[corners], rates)
    C = np.where(flat[corners[:, 0], None, None], np.eye(2), np.einsum("pki,pkj->pij", F, F))
    values, vectors = np.linalg.eigh(C)
    return np.asarray(np.einsum("pij,pj,pkj->pik", vectors, values**-0.5, vectors), np.float64)


def hourglass_modes(world: World, elements: Ints, both: Ints, rates: Floats) -> tuple[Floats, Floats]:
    """Coefficients c (p, 4) [1/m] and edge normals m (p, 2), F1 - F2 = (sum of c_v x_v) m'; 0 for a single triangle."""
    edges = np.diff(_positions(world, elements[: len(both), :2], both[:, 0]), axis=1)[:, 0]
    coefficients, normals = np.zeros((len(elements), 4)), np.zeros((len(elements), 2))
    normals[: len(both)] = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    coefficients[: len(both)] = np.einsum(
        "pvi,pi->pv", rates[: len(both), 1] - rates[: len(both), 2], normals[: len(both)]
    )
    return coefficients, normals


def without_affine_part(world: World, elements: Ints, rates: Floats, coefficients: Floats) -> Floats:
    """The modes c - g . p0 (p, 4) [1/m] that are normal to the rest shapes' tangent planes, p0 = F'q at rest."""
    flat, rest = _rest(world)
    F = np.einsum("pvk,pvi->pki", rest[elements], rates)
    pulled = np.einsum("pki,pvk,pv->pi", F, rest[elements], coefficients)
    tangential = np.where(flat[elements[:, 0], None], 0.0, pulled)
    return np.asarray(coefficients - np.einsum("pvi,pi->pv", rates, tangential), np.float64)
