"""Hands of the mannequin in pictures of the style studio: smooth blades, as of a shop's dummy, without thumbs.

Only what is drawn changes: a run has the hands of the template, which are blunt.
"""

from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.generators.mannequin.generator import ARM, JOINT_POSITIONS, joint, mirrored, template

LENGTH = 1.22
"""Length of a drawn hand relative to the template's, whose fingers are missing."""
NARROW = -0.04
"""Where the forearm is narrowest, from the wrist on [m]: there a drawn hand begins."""
ALONG, WIDE, THICK = (
    np.array([0.0, 0.22, 0.48, 0.66, 0.82, 0.94, 1.0]),
    np.array([0.027, 0.029, 0.037, 0.034, 0.025, 0.014, 0.0]),
    np.array([0.024, 0.021, 0.018, 0.015, 0.011, 0.008, 0.0]),
)
"""Fractions of the way from there to the tip, and half the width and the thickness of a drawn hand [m]."""
BLEND = 0.02
"""Way over which the arm becomes the hand [m]."""
RIGID = 0.999
"""Weight of the wrist from which on a vertex moves with it alone."""


CLEARANCE = 0.03
"""Distance to a cloth within which a hand stays as it is, and from twice of which on it is a blade [m]."""


def with_dummy_hands(positions: Floats, triangles: Ints, cloths: Floats) -> Floats:
    """Vertices (n, 3) of a body with the hands of a dummy, away from the vertices (k, 3) of cloths [m].

    What has not the template's triangles (m, 3) stays as it is.
    """
    made = template()
    if not np.array_equal(triangles, made.triangles):
        return positions
    x, near, reach = positions.copy(), cKDTree(cloths), 2.0 * CLEARANCE
    for side in ("left", "right"):
        rows, moves = _moves(side)
        rigid = rows[made.weights[rows, joint(f"{side}_wrist")] > RIGID]
        apart = near.query(positions[rows], distance_upper_bound=reach, workers=1)[0]
        free = np.clip(np.minimum(apart, reach) / CLEARANCE - 1.0, 0.0, 1.0)
        rest, drawn = made.positions[rigid], positions[rigid]  # the linear part of the affine map that fits them
        turn = np.linalg.lstsq(rest - rest.mean(axis=0), drawn - drawn.mean(axis=0), rcond=None)[0]
        x[rows] += free[:, None] * (moves @ turn)
    return x


@lru_cache(maxsize=2)
def _moves(side: str) -> tuple[Ints, Floats]:
    """Vertices (k,) that the wrist of a side moves, and how the drawn hand's differ in the rest pose (k, 3) [m]."""
    made = template()
    rows = np.flatnonzero(made.weights[:, joint(f"{side}_wrist")] > 0.0)
    along = ARM if side == "left" else mirrored(ARM)
    wide = np.array([0.0, 1.0, 0.0])
    thick = np.cross(along, wide)
    off = made.positions[rows] - JOINT_POSITIONS[joint(f"{side}_wrist")]
    a, b, c = off @ along, off @ wide, off @ thick
    t = np.clip((a - NARROW) / (a.max() - NARROW), 0.0, 1.0)
    width, height = (np.sqrt(np.maximum(PchipInterpolator(ALONG, each**2)(t), 0.0)) for each in (WIDE, THICK))
    turn = np.arctan2(c / THICK[0], b / WIDE[0])
    goal = np.stack([a + (LENGTH - 1.0) * t * np.maximum(a, 0.0), width * np.cos(turn), height * np.sin(turn)])
    s = np.clip((a - NARROW) / BLEND + 0.5, 0.0, 1.0)
    return rows, ((goal - [a, b, c]) * s * s * (3.0 - 2.0 * s)).T @ np.stack([along, wide, thick])
