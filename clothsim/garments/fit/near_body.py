"""Part of a body near a garment, which stands for the body while it moves; the exact check has the whole body."""

from collections.abc import Sequence

import numpy as np

from clothsim.base.arrays import Floats, Ints

MARGIN = 0.06
"""Distance from the garment up to which the body is kept, as a fraction of the body's largest extent."""


def near_body(garment: Floats, frames: Sequence[Floats], triangles: Ints) -> tuple[tuple[Floats, ...], Ints]:
    """Frames and triangles of the part of a body that is near a garment in any frame; all of it where none is.

    Parameters
    ----------
    garment : (n, 3) ndarray
        Positions of the garment [m].
    frames : sequence of (k, 3) ndarray
        Positions of the body [m].
    triangles : (m, 3) ndarray
        Its triangles; one with a vertex near the garment is kept whole.
    """
    from scipy.spatial import cKDTree  # a tenth of the start of the program, for fits that grow or morph

    margin = MARGIN * max(float(np.ptp(frame, axis=0).max()) for frame in frames)
    tree = cKDTree(garment)
    near = np.zeros(len(frames[0]), bool)
    for frame in frames:
        near |= np.isfinite(tree.query(frame, distance_upper_bound=margin)[0])
    kept = triangles[near[triangles].any(axis=1)]
    if not len(kept):
        return tuple(frames), triangles
    used, renumbered = np.unique(kept, return_inverse=True)
    return tuple(frame[used] for frame in frames), renumbered.reshape(-1, 3).astype(np.int64)
