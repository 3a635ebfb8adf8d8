"""Welding: pairs whose gap is small become one vertex where the exact check allows it, the rest after untangling."""

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.engine import intersecting_pairs, untangle
from clothsim.garments.dress.sewing_state import SewingState, worst_gap
from clothsim.garments.penetration import count_penetrations
from transfer.signed_distance import BodySurface

FARTHEST = 1.0
"""Largest gap that a weld may close, as a fraction of the mean edge: it moves a vertex by half an edge at most."""


def welded_where_closed(state: SewingState, limit: float, surface: BodySurface) -> SewingState:
    """State in which every pair with a gap of at most `limit` [m] is welded, unless its weld would intersect.

    No gap above FARTHEST of the mean edge is welded, whatever the limit. All pairs are tried at one time; pairs that
    would intersect are halved, seam after seam, down to single ones.
    """
    groups = [pairs for k in state.open_seams if len(pairs := _find_closed_pairs(state, k, limit))]
    if not groups:
        return state
    whole = state.join(np.concatenate(groups))
    if _is_clean(whole, surface):
        return whole
    for pairs in groups:
        state = _weld_by_halving(state, pairs, surface)
    return state


def _is_clean(state: SewingState, surface: BodySurface) -> bool:
    """True without an intersection by the exact check; with itself first, a tenth of the check against a body."""
    own = intersecting_pairs(state.positions, state.triangles)
    return not len(own) and count_penetrations(state.positions, state.triangles, surface).clean


def _weld_by_halving(state: SewingState, pairs: Ints, surface: BodySurface) -> SewingState:
    """State with as many of these neighbouring pairs welded as halving finds."""
    tried = state.join(pairs)
    if _is_clean(tried, surface):
        return tried
    if len(pairs) == 1:
        return state
    middle = len(pairs) // 2
    return _weld_by_halving(_weld_by_halving(state, pairs[:middle], surface), pairs[middle:], surface)


def _find_closed_pairs(state: SewingState, seam: int, limit: float) -> Ints:
    """Pairs of vertices of the panels in a seam that are closed and not welded yet, (k, 2)."""
    pairs = state.mesh.seams[seam].pairs
    ends = state.number[pairs]
    gaps = np.linalg.norm(state.positions[ends[:, 0]] - state.positions[ends[:, 1]], axis=1)
    return np.asarray(pairs[(ends[:, 0] != ends[:, 1]) & (gaps <= min(limit, FARTHEST * mean_edge(state)))])


def mean_edge(state: SewingState) -> float:
    """Mean length of the sides of all triangles at rest [m]."""
    corners = state.mesh.material_coordinates
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


ROUNDS = 100
"""Bound on the rounds of untangling: what comes free does so in some tens."""


def welded_and_untangled(state: SewingState, surface: BodySurface) -> SewingState:
    """State in which seams whose weld would intersect are welded too, where the cloth can be untangled after it.

    Between the sides of such a seam other cloth lies, folded between two godets or at a corner of several panels: it is
    moved out by the motion that shrinks the contours of intersection (`untangle`). First all of them, then each alone.
    What opens another seam beyond what may be welded is not taken.
    """
    farthest = FARTHEST * mean_edge(state)
    near = [k for k in state.open_seams if state.gaps(state.mesh.seams[k]).max(initial=0.0) <= farthest]
    seams = [state.mesh.seams[k].pairs for k in near]
    for pairs in (np.concatenate(seams), *seams) if seams else ():
        if np.ptp(state.number[pairs], axis=1).any():
            joined = state.join(pairs)
            freed = untangle(
                joined.positions,
                joined.triangles,
                material=state.mesh.material_coordinates,
                body=(surface.positions, surface.triangles),
                rounds=ROUNDS,
            )
            tried = joined.moved_to(freed.positions)
            stay_closed = worst_gap(tried)[0] <= max(farthest, worst_gap(state)[0])
            state = tried if stay_closed and _is_clean(tried, surface) else state
    return state
