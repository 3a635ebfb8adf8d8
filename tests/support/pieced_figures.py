"""Figures made of closed pieces that overlap: capsules, balls and boxes, as mechanical characters are."""

from itertools import pairwise

import numpy as np
import trimesh

LIMB, BALL = (12, 10), 1
"""Meridians and parallels of a capsule; subdivisions of a ball."""


def figure(seed=0, height=1.7, gap=0.0):
    """A standing figure [m], y up, front along z: positions (n, 3), triangles (m, 3) of about forty closed pieces.

    Lengths and widths vary by a tenth with the seed; gap: between the two halves of each limb at its joint [m].
    """
    random = np.random.default_rng(seed)
    wide, long = random.uniform(0.92, 1.1, 2)
    s, pieces = height / 1.7, []

    def limb(a, b, radius):
        a, b = s * np.array(a), s * np.array(b)
        pieces.append(trimesh.creation.capsule(np.linalg.norm(b - a), s * radius, count=LIMB))
        pieces[-1].apply_transform(trimesh.geometry.align_vectors([0, 0, 1], b - a))
        pieces[-1].apply_translation((a + b) / 2)

    def ball(at, radius):
        pieces.append(trimesh.creation.icosphere(BALL, s * radius))
        pieces[-1].apply_translation(s * np.array(at))

    def box(at, extents):
        pieces.append(trimesh.creation.box(s * np.array(extents)))
        pieces[-1].apply_translation(s * np.array(at))

    def jointed(ends, radii):
        """Limbs from joint to joint, shortened by the gap, with a ball in each joint."""
        for k, (a, b) in enumerate(pairwise(np.array(ends))):
            along = (b - a) / np.linalg.norm(b - a)
            apart = (radii[k] + gap / 2) * along if gap else 0 * along
            limb(a + apart, b - apart, radii[k])
            ball(b, 0.8 * radii[k])

    for side in (-1, 1):
        hip, knee, ankle = (side * 0.095 * wide, 0.87, 0), (side * 0.12, 0.48 * long, 0.01), (side * 0.14, 0.09, -0.01)
        jointed([hip, knee, ankle], [0.085 * wide, 0.055])
        box((side * 0.145, 0.04, 0.05), (0.09, 0.08, 0.24))
        shoulder, elbow, wrist = (side * 0.2 * wide, 1.37, 0), (side * 0.38, 1.17, 0), (side * 0.53, 0.98, 0.03)
        jointed([shoulder, elbow, wrist], [0.055 * wide, 0.042])
        ball(shoulder, 0.065 * wide)
        box((side * 0.57, 0.93, 0.04), (0.05, 0.14, 0.07))
    for y, radius in ((0.93, 0.125), (1.05, 0.115), (1.2, 0.125)):
        limb((-0.05 * wide, y, 0), (0.05 * wide, y, 0), radius * wide)
    limb((-0.13 * wide, 1.33, 0), (0.13 * wide, 1.33, 0), 0.085)
    box((0, 1.13, 0), (0.2 * wide, 0.4, 0.2))
    limb((0, 1.35, 0), (0, 1.52, 0.01), 0.055)
    ball((0, 1.59, 0.02), 0.105)
    whole = trimesh.util.concatenate(pieces)
    return np.asarray(whole.vertices, float), np.asarray(whole.faces, np.int64), len(pieces)
