"""Approach of placed panels: each group moves rigidly toward the body until it is a short way in front of it.

Panels are placed far from the body so that none intersects it. Seams at the ends of a panel that is far away draw
its ends inward while its middle lags behind: the panel bows, its shoulders sink below those of the body, and the
garment slips down.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.separating import outward_of_groups, rigid_groups
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.inputs import Figure
from clothsim.garments.penetration import counted
from transfer.signed_distance import BodySurface

CLEARANCE = 0.02
"""Distance that is left in front of a group of panels [m]."""
LEAST = 0.005
"""Least displacement that is worth it [m]."""


def approached(state: SewingState, body: Figure, surface: BodySurface) -> tuple[SewingState, str]:
    """State whose groups of panels moved rigidly toward the body; and a description.

    A group of panels that touch moves against its outward normal, those nearest to the body first, until
    `CLEARANCE` is left to the body or to another group. One with nothing before it stays.
    """
    group = rigid_groups(state)
    outward = outward_of_groups(state, body)
    ahead = [_way_ahead(state, group == k, -outward[k], body) for k in range(len(outward))]
    moved_by = np.zeros(len(outward))
    order = np.argsort(ahead)
    for k in [*order, *order]:  # once more, since a group may have stood before another
        way = _way_ahead(state, group == k, -outward[k], body) - CLEARANCE
        if not LEAST < way < np.inf:
            continue
        moved = state.at(state.positions - (way * (group == k))[:, None] * outward[k])
        if counted(moved.positions, moved.triangles, surface).clean:
            state, moved_by[k] = moved, moved_by[k] + way
    return state, f"moved toward the body by at most {1e3 * moved_by.max(initial=0.0):.3g} mm"


def _way_ahead(state: SewingState, chosen: Ints, direction: Floats, body: Figure) -> float:
    """Way [m] that the chosen vertices can move along a direction before they meet the body or the rest; or inf.

    Measured at vertices of both sides: rays of the moving ones forward, rays of what they may meet backward.
    """
    inside = chosen[state.triangles[:, 0]]
    own, others = state.triangles[inside], state.triangles[~inside]
    obstacle = np.concatenate([body.positions, state.positions])
    faces = np.concatenate([body.triangles, others + len(body.positions)])
    ahead = first_hits(state.positions[chosen], direction, obstacle, faces)
    behind = first_hits(obstacle[np.unique(faces)], -direction, state.positions, own)
    return float(min(ahead.min(initial=np.inf), behind.min(initial=np.inf)))


def first_hits(points: Floats, directions: Floats, positions: Floats, triangles: Ints) -> Floats:
    """Distance to the first triangle that each ray meets, (k,) [m]; inf for none. Unit directions: (3,) or (k, 3)."""
    import igl

    tree = igl.AABB()
    tree.init(positions, np.ascontiguousarray(triangles))
    rays = np.ascontiguousarray(np.broadcast_to(directions, points.shape))
    hit, distance, _ = tree.intersect_ray_first(positions, np.ascontiguousarray(triangles), points, rays)
    met = np.logical_and(hit.ravel() >= 0, np.isfinite(distance.ravel()))
    return np.where(met, distance.ravel(), np.inf)
