"""Penetration of a garment: vertices inside the body, and triangle pairs of the exact intersection check."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.engine import intersecting_pairs, intersection_points
from transfer.signed_distance import BodySurface


@dataclass(frozen=True)
class Counts:
    """Penetration counts of a garment on a body.

    Attributes
    ----------
    penetrating_vertices : int
        Garment vertices inside the body.
    depth : float
        Depth of the deepest [m].
    body_pairs, self_pairs : int
        Intersecting triangle pairs of garment and body, and of the garment with itself.
    position : ndarray (3,) or None
        Position of the worst [m]; None where `clean`.
    carried : int
        Vertices that the body carries where it overlaps itself; what they penetrate is not counted.
    """

    penetrating_vertices: int
    depth: float
    body_pairs: int
    self_pairs: int
    position: Floats | None
    carried: int = 0

    @property
    def on_body(self) -> bool:
        """True where garment and body are disjoint, the state that contact requires and preserves."""
        return not (self.penetrating_vertices or self.body_pairs)

    @property
    def clean(self) -> bool:
        """True without penetration and intersections."""
        return self.on_body and not self.self_pairs

    @property
    def rank(self) -> tuple[int, int]:
        """Number of penetrations of the body, then of intersections with itself: the smaller, the better."""
        return self.penetrating_vertices + self.body_pairs, self.self_pairs

    @property
    def where(self) -> str:
        """Position of the worst penetration as text."""
        return (
            "nowhere" if self.position is None else f"near ({', '.join(f'{value:.3g}' for value in self.position)}) m"
        )

    def __str__(self) -> str:
        inside = f"{self.penetrating_vertices:,} vertices inside"
        deep = f" (to {1e3 * self.depth:.3g} mm)" if self.penetrating_vertices else ""
        held = f"; {self.carried:,} vertices carried" if self.carried else ""
        return f"{inside}{deep}, {self.body_pairs:,} pairs with the body, {self.self_pairs:,} with itself{held}"


NO_ROWS: Ints = np.zeros(0, np.int64)


def counted(garment: Floats, triangles: Ints, body: BodySurface, carried: Ints = NO_ROWS) -> Counts:
    """Penetration counts of `garment (n, 3)` [m] with `triangles (m, 3)` on `body`; arguments of `penetrations`."""
    return penetrations(garment, triangles, body, carried)[0]


def penetrations(
    garment: Floats, triangles: Ints, body: BodySurface, carried: Ints = NO_ROWS
) -> tuple[Counts, Ints, Ints]:
    """The counts, and the pairs (p, 2) of intersecting triangles: of garment and body, of the garment with itself.

    carried (k,): vertices that the body carries where it overlaps itself. Left out are they, the pairs of their
    triangles with the body, and those of two of their triangles.
    """
    free = np.ones(len(garment), bool)
    free[carried] = False
    within = body.penetration(garment[free])
    x = np.concatenate([garment, body.positions])
    faces = body.triangles + len(garment)
    own, with_body = intersecting_pairs(x, triangles), intersecting_pairs(x, triangles, faces)
    whole = np.asarray(free[triangles].all(axis=1))
    own, with_body = own[whole[own].any(axis=1)], with_body[whole[with_body[:, 0]]]
    position = None
    if within.count:
        position = garment[free][within.worst]
    elif len(with_body):
        position = intersection_points(x, triangles, faces, with_body[:1])[0]
    elif len(own):
        position = intersection_points(x, triangles, triangles, own[:1])[0]
    return Counts(within.count, within.depth, len(with_body), len(own), position, len(carried)), with_body, own
