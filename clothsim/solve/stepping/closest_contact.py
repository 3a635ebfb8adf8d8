"""Closest contact pair, and detection of a pinch: two objects that close on a cloth from both sides."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy

PINCH_RADIUS = 2.0
"""Distance, in median cloth edges, within which another contact pair belongs to the same pinch."""


@runtime_checkable
class HasContactPairs(Protocol):
    """Contact energy with the pairs of distinct closest features and their closest points."""

    def distinct(self, x: Floats) -> Any:
        """Return the pairs, of which the first `n_points` are of a point and a triangle."""

    @property
    def stiffness(self) -> float:
        """Barrier stiffness [Pa]."""

    def normal_forces(self, x: Floats, stiffness: float) -> tuple[Ints, Floats, Floats, Floats]:
        """Return rows (p, 4), weights (p, 4), connecting lines (p, 3) [m] and forces (p,) [N] of the closest points."""


@dataclass(frozen=True)
class ContactPair:
    """Two simplices of x at their closest.

    Parameters
    ----------
    first, second : (1..3,) int64
        Rows of x of both simplices.
    place : (3,) float64
        Point between them [m].
    gap : float
        Distance [m].
    pinch : int or None
        Label of a third object that closes on the same point from elsewhere.
    """

    first: Ints
    second: Ints
    position: Floats
    gap: float
    pinch: int | None


def closest_contact_pair(world: World, energies: Iterable[Energy], x: Floats) -> ContactPair | None:
    """Return the closest pair of all contact energies at x (N, 3) [m]; None where no pair is active."""
    found = [_contact_pairs(energy, x) for energy in energies if isinstance(energy, HasContactPairs)]
    rows, splits, midpoints, distances = (
        (np.concatenate(parts) for parts in zip(*found, strict=True)) if found else _NONE
    )
    if not len(rows):
        return None
    best = int(distances.argmin())
    pair, split = rows[best], int(splits[best])
    objects = world.labels[rows[:, [0, 3]]]
    ends = x[world.edges]
    edge = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
    active = np.linalg.norm(midpoints - midpoints[best], axis=1) <= PINCH_RADIUS * edge
    elsewhere = ~np.isin(objects, objects[best])
    closing = np.flatnonzero(active & elsewhere.any(axis=1))
    third = closing[distances[closing].argmin()] if len(closing) else None
    pinch = None if third is None else int(objects[third][elsewhere[third]][0])
    return ContactPair(pair[:split], pair[split:], midpoints[best], float(distances[best]), pinch)


def _contact_pairs(energy: HasContactPairs, x: Floats) -> tuple[Ints, Ints, Floats, Floats]:
    """Active pairs: rows (p, 4), size of the first simplex (p,), midpoint (p, 3) and distance (p,) [m]."""
    rows, weights, lines, _ = energy.normal_forces(x, energy.stiffness)
    splits = np.where(np.arange(len(rows)) < energy.distinct(x).n_points, 1, 2)
    on_first = np.where(np.arange(4) < splits[:, None], weights, 0.0)
    midpoints = np.einsum("pk,pkc->pc", np.abs(on_first), x[rows]) - 0.5 * lines
    return rows, splits, midpoints, np.linalg.norm(lines, axis=1)


_NONE = (np.zeros((0, 4), np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))
