"""How the neighbourhood of each vertex has turned: Kabsch rotations and affine fits of vertex rings.

Here a ring is the one-ring of `mesh.topology.vertex_rings` AND its centre: the corner vertex of one triangle has only
two neighbours, always on a line; with the centre they are the triangle, which fixes the rotation.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints, as_points
from clothsim.errors import InputError
from clothsim.linalg import fit_gradient, kabsch


@dataclass(frozen=True)
class RingFrames:
    """rotations: (n, 3, 3) per vertex; collinear: (k,) sorted vertices whose rings do not determine one.

    A ring on a line, in the reference or deformed, leaves the turn about that line open: its rotation is one of the
    best. A vertex without neighbours is among them, with the identity.
    """

    rotations: Floats
    collinear: Ints


def ring_frames(reference: Floats, deformed: Floats, starts: Ints, neighbours: Ints) -> RingFrames:
    """The rotation that best carries each vertex ring of `reference (n, 3)` to `deformed (n, 3)` (Kabsch, centred).

    Ring of vertex i: i and `neighbours[starts[i]:starts[i + 1]]`, all of weight 1. Flat rings are fine. Exact to
    round-off for rigid motions, also of 180 degrees and of sheets turned over.
    """
    p, q = _checked(reference, deformed, starts, neighbours)
    rotations = np.empty((len(p), 3, 3))
    determined = np.empty(len(p), bool)
    for vertices, rings in _rings_by_size(starts, neighbours):
        rotations[vertices], determined[vertices] = kabsch(p[rings], q[rings])
    return RingFrames(rotations, np.flatnonzero(~determined))


def ring_gradients(reference: Floats, deformed: Floats, starts: Ints, neighbours: Ints) -> tuple[Floats, Ints]:
    """The least-squares 3D deformation gradient of each vertex ring, (n, 3, 3), and the rank of its rest shape, (n,).

    Rank 3: F. Rank 2 (flat at rest): F in the plane, its normal maps to 0 (pseudo-inverse). Rank 1: F along the line;
    rank 0: zero. Rings as in `ring_frames`.
    """
    p, q = _checked(reference, deformed, starts, neighbours)
    gradients = np.empty((len(p), 3, 3))
    ranks = np.empty(len(p), np.int64)
    for vertices, rings in _rings_by_size(starts, neighbours):
        gradients[vertices], ranks[vertices] = fit_gradient(p[rings], q[rings])
    return gradients, ranks


def _rings_by_size(starts: Ints, neighbours: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Vertices (g,) with equally many neighbours, and their rings with the centre first, (g, k + 1)."""
    sizes = np.diff(starts)
    for size in np.unique(sizes):
        vertices = np.flatnonzero(sizes == size)
        yield vertices, np.column_stack([vertices, neighbours[starts[vertices, None] + np.arange(size)]])


def _checked(reference: Floats, deformed: Floats, starts: Ints, neighbours: Ints) -> tuple[Floats, Floats]:
    p, q = as_points("reference", reference), as_points("deformed", deformed)
    if p.shape != q.shape:
        raise InputError(f"reference has {len(p)} vertices, deformed {len(q)}.")
    if len(starts) != len(p) + 1 or starts[0] != 0 or starts[-1] != len(neighbours) or (np.diff(starts) < 0).any():
        raise InputError(
            f"starts must rise from 0 to {len(neighbours)} in {len(p) + 1} entries.", "Use mesh.topology.vertex_rings."
        )
    bad = np.flatnonzero((neighbours < 0) | (neighbours >= len(p)))
    if bad.size:
        raise InputError(f"neighbours[{bad[0]}] = {neighbours[bad[0]]} names a vertex outside 0..{len(p) - 1}.")
    return p, q
