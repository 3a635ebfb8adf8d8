"""Welding of the closed part of seams: pairs whose gap is small become one vertex where the exact check allows it."""

from collections.abc import Callable

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.penetration import counted
from transfer.signed_distance import BodySurface


def welded_where_closed(state: SewingState, limit: float, surface: BodySurface) -> SewingState:
    """State in which every pair with a gap of at most `limit` [m] is welded, unless its weld would intersect.

    All pairs are tried at one time; pairs that would intersect are halved, seam after seam, down to single ones.
    """
    groups = [pairs for k in state.open_seams if len(pairs := _closed_pairs(state, k, limit))]
    if not groups:
        return state
    clean = lambda tried: counted(tried.positions, tried.triangles, surface).clean  # noqa: E731
    whole = state.join(np.concatenate(groups))
    if clean(whole):
        return whole
    for pairs in groups:
        state = _halved(state, pairs, clean)
    return state


def _halved(state: SewingState, pairs: Ints, clean: Callable[[SewingState], bool]) -> SewingState:
    """State with as many of these neighbouring pairs welded as halving finds."""
    tried = state.join(pairs)
    if clean(tried):
        return tried
    if len(pairs) == 1:
        return state
    middle = len(pairs) // 2
    return _halved(_halved(state, pairs[:middle], clean), pairs[middle:], clean)


def _closed_pairs(state: SewingState, seam: int, limit: float) -> Ints:
    """Pairs of vertices of the panels in a seam that are closed and not welded yet, (k, 2)."""
    pairs = state.mesh.seams[seam].pairs
    ends = state.number[pairs]
    gaps = np.linalg.norm(state.positions[ends[:, 0]] - state.positions[ends[:, 1]], axis=1)
    return np.asarray(pairs[(ends[:, 0] != ends[:, 1]) & (gaps <= limit)])
