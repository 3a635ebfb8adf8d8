"""Release of carried vertices where a pinch opens: untangled by displacement along the normals of the carrier."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from clothsim.mesh.world import World
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidate_subsets import Suspension
from clothsim.physics.contact.opposing import Faces, first_hits
from clothsim.solve.pinch.carried import Carried

OPEN = 1.5
"""Gap from which a pinch counts as open, over the gap below which it closes."""
EASE = 0.25
"""Largest displacement of a vertex along the normal in a step before its release, in units of the limit."""
LEAST_HEIGHT = 0.25
"""Height above the carrier below which no vertex is released, in units of d_hat: the barrier would throw it out."""
LEAST_GAP = 0.02
"""Gap below which no pair is taken up again, in units of d_hat."""


@dataclass(frozen=True)
class Opening:
    """What a release needs to know of a step.

    barriers: contacts of bodies and of cloth; faces: body triangles; gaps (k,): in front of the carried
    vertices [m]; limit: gap of a pinch [m].
    """

    world: World
    barriers: Mapping[str, Barrier]
    x: Floats
    faces: Faces
    gaps: Floats
    limit: float


def still_carried(carried: Carried, opening: Opening) -> Carried:
    """Return those that stay carried; where the pinch is open they are raised towards the middle of the gap."""
    body, limit, gaps = opening.barriers["body_contact"], opening.limit, opening.gaps
    is_open = gaps >= OPEN * limit
    heights = carried.offsets[:, 2]
    free = is_open & (heights >= body.offset + LEAST_HEIGHT * body.d_hat)
    for _ in range(len(carried) + 1):
        if not free.any():
            break
        blocked = np.isin(carried.vertices, _tangled(carried.only(~free), carried.vertices[free], opening))
        if not (blocked & free).any():
            break
        free &= ~blocked
    middle = 0.5 * np.minimum(gaps, 4.0 * limit)
    raised = np.where(is_open, np.clip(middle - heights, -EASE * limit, EASE * limit), 0.0)
    return carried.raised(raised).only(~free)


def _tangled(remaining: Carried, released: Ints, opening: Opening) -> Ints:
    """Rows of x whose release would leave something intersecting, or closer than contact allows."""
    x, world = opening.x, opening.world
    held = remaining.mask(len(x))
    whole = world.triangles[~held[world.triangles].any(axis=1)]
    touched = whole[np.isin(whole, released).any(axis=1)]
    rows = [touched[intersecting_pairs(x, touched, world.body_triangles)[:, 0]].ravel()]
    rows.append(_crossing_edges(held, released, opening))
    suspension = Suspension(held, np.zeros(0, np.int64))
    for name, barrier in opening.barriers.items():
        if name == "self_contact":
            both = intersecting_pairs(x, world.triangles)
            partly = np.asarray(held[world.triangles].any(axis=1))[both].all(axis=1)
            rows.append(world.triangles[both[~partly]].ravel())
        pairs, distances = barrier.candidates.search.pairs(x, x, barrier.offset + LEAST_GAP * barrier.d_hat)
        taken_up = ~suspension.mask(pairs.elements, pairs.n_points, name == "self_contact")
        rows.append(pairs.elements[taken_up & (distances <= barrier.offset + LEAST_GAP * barrier.d_hat)].ravel())
    return np.unique(np.concatenate(rows))


def _crossing_edges(held: np.ndarray, released: Ints, opening: Opening) -> Ints:
    """Ends of edges of released and free vertices that meet a body triangle."""
    x, edges = opening.x, opening.world.edges
    edges = edges[np.isin(edges, released).any(axis=1) & ~held[edges].any(axis=1)]
    ends = np.concatenate([edges, edges[:, ::-1]])
    lines = x[ends[:, 0]], x[ends[:, 1]] - x[ends[:, 0]]
    hits = first_hits(opening.faces, x, np.ascontiguousarray(ends[:, 0]), lines, (0.0, 1.0), entering=False)
    return np.unique(ends[np.isfinite(hits)])
