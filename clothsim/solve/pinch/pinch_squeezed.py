"""Squeezed vertices of a failed step: cloth with active contacts that push it from opposite sides."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.energies.base import Energy

TIGHT = 0.2
"""Gap below which a contact counts as squeezed, in units of d_hat."""
OPPOSITE = -0.3
"""Cosine of two directions of contact below which they oppose one another."""
RADIUS = 2.0
"""Distance within which they belong to one pinch, in median cloth edges."""


def squeezed(world: World, energies: Mapping[str, Energy], x: Floats, carried: np.ndarray) -> Ints:
    """Rows of x of cloth vertices at contacts that oppose one another, and their neighbours.

    One of the two is with a body, or with cloth that a body carries.

    Parameters
    ----------
    world : World
        Meshes.
    energies : mapping
        Energies bound to the step.
    x : (N, 3) array
        Where the step ended [m].
    carried : (N,) bool array
        Carried rows of x.
    """
    rows, places, directions, bodies = [], [], [], []
    for name in ("body_contact", "self_contact"):
        energy = energies.get(name)
        if isinstance(energy, Barrier):
            for each, place, direction, partners in _contacts(energy, x, world.n_cloth):
                rows.append(each)
                places.append(place)
                directions.append(direction)
                bodies.append((name == "body_contact") | (carried[partners] & (partners >= 0)).any(axis=1))
    if not sum(len(each) for each in rows):
        return np.zeros(0, np.int64)
    of_pair, at, along, with_body = (np.concatenate(each) for each in (rows, places, directions, bodies))
    ends = x[world.edges]
    edge = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    i, j = cKDTree(at).query_pairs(RADIUS * edge, output_type="ndarray").T
    opposed = (np.einsum("kd,kd->k", along[i], along[j]) < OPPOSITE) & (with_body[i] | with_body[j])
    found = np.unique(of_pair[np.concatenate([i[opposed], j[opposed]])])
    found = found[(found >= 0) & (found < world.n_cloth)]
    return np.unique(world.edges[np.isin(world.edges, found).any(axis=1)])


def _contacts(barrier: Barrier, x: Floats, n_cloth: int) -> list[tuple[Ints, Floats, Floats, Ints]]:
    """Cloth rows (p, 4) of tight contacts, their places and directions (p, 3), and rows (p, 4) of their partners.

    -1 in the place of rows of the other side.
    """
    elements, weights, lines, _ = barrier.normal_forces(x, barrier.stiffness)
    gaps = np.linalg.norm(lines, axis=1)
    tight = gaps - barrier.offset < TIGHT * barrier.d_hat
    elements, weights, lines = elements[tight], weights[tight], lines[tight] / gaps[tight, None]
    contacts = []
    for sign in (1.0, -1.0):
        on_side = (sign * weights > 0.0) & (elements < n_cloth)
        some = on_side.any(axis=1)
        place = np.einsum("pk,pkd->pd", np.where(on_side, np.abs(weights), 0.0), x[elements])
        partners = np.where(sign * weights < 0.0, elements, -1)
        contacts.append((np.where(on_side, elements, -1)[some], place[some], sign * lines[some], partners[some]))
    return contacts
