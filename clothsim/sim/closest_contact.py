"""Where contact is closest, and whether two things close on a cloth there."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.energies.base import Energy
from clothsim.mesh.world import World

PINCH_RADIUS = 2.0
"""Median cloth edges within which another touch belongs to the same pinch."""


@runtime_checkable
class HasContactPairs(Protocol):
    """What a contact energy tells of its near pairs: a cache `active(x)` of them, and their closest points."""

    candidates: Any

    @property
    def stiffness(self) -> float:
        """That of its barrier [Pa]."""

    def normal_forces(self, x: Floats, stiffness: float) -> tuple[Ints, Floats, Floats, Floats]:
        """Rows (p, 4), weights (p, 4) and line (p, 3) [m] of closest points, force (p,) [N]."""


@dataclass(frozen=True)
class ContactPair:
    """Two simplices of x at their closest: `first` and `second` rows, the place (3,) between them and the gap [m].

    pinch: the label of a third object that closes on the same place from elsewhere, None where there is none.
    """

    first: Ints
    second: Ints
    position: Floats
    gap: float
    pinch: int | None


def closest_contact_pair(world: World, energies: Iterable[Energy], x: Floats) -> ContactPair | None:
    """The closest pair of all contact energies at x (N, 3) [m]; None where no pair is near."""
    found = [_touches(energy, x) for energy in energies if isinstance(energy, HasContactPairs)]
    rows, splits, places, distances = (np.concatenate(parts) for parts in zip(*found, strict=True)) if found else _NONE
    if not len(rows):
        return None
    best = int(distances.argmin())
    pair, split = rows[best], int(splits[best])
    objects = world.labels[rows[:, [0, 3]]]
    ends = x[world.edges]
    edge = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    active = np.linalg.norm(places - places[best], axis=1) <= PINCH_RADIUS * edge
    elsewhere = ~np.isin(objects, objects[best])
    closing = np.flatnonzero(active & elsewhere.any(axis=1))
    third = closing[distances[closing].argmin()] if len(closing) else None
    pinch = None if third is None else int(objects[third][elsewhere[third]][0])
    return ContactPair(pair[:split], pair[split:], places[best], float(distances[best]), pinch)


def _touches(energy: HasContactPairs, x: Floats) -> tuple[Ints, Ints, Floats, Floats]:
    """Its near pairs: rows (p, 4), how many of them are of the first simplex, place (p, 3) and distance (p,) [m]."""
    rows, weights, lines, _ = energy.normal_forces(x, energy.stiffness)
    splits = np.where(np.arange(len(rows)) < energy.candidates.active(x).n_points, 1, 2)
    on_first = np.where(np.arange(4) < splits[:, None], weights, 0.0)
    places = np.einsum("pk,pkc->pc", np.abs(on_first), x[rows]) - 0.5 * lines
    return rows, splits, places, np.linalg.norm(lines, axis=1)


_NONE = (np.zeros((0, 4), np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))
