"""Kabsch rotations of vertex neighbourhoods.

The neighbourhood of a vertex is its one-ring (`mesh.topology.vertex_rings`) AND the vertex itself: the corner vertex of
a lone triangle has only two neighbours, always on a line; with the vertex they are the triangle, which fixes the
rotation.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_points
from clothsim.base.errors import InputError
from clothsim.base.linalg import kabsch


@dataclass(frozen=True)
class VertexFrames:
    """Rotations of vertex neighbourhoods, and the vertices that do not determine one.

    A neighbourhood on a line, in the reference or deformed, leaves the rotation about that line open: its rotation is
    one of the optimal ones. A vertex without neighbours is listed as collinear and has the identity.

    Attributes
    ----------
    rotations : (n, 3, 3) array
        The rotation of each vertex.
    collinear : (k,) int array
        Vertices, ascending, whose neighbourhoods do not determine their rotation.
    """

    rotations: Floats
    collinear: Ints


def vertex_frames(reference: Floats, deformed: Floats, starts: Ints, neighbours: Ints) -> VertexFrames:
    """Kabsch rotation of each vertex neighbourhood: the best fit from the reference to the deformed positions.

    Minimises sum |R (p_j - p_mean) - (q_j - q_mean)|^2 over the vertex and its one-ring, all of weight 1 (Kabsch 1976).
    Flat neighbourhoods are fine. Exact to round-off for rigid motions, also for 180 degrees and sheets turned over.

    Parameters
    ----------
    reference : (n, 3) array
        Reference positions p [m].
    deformed : (n, 3) array
        Deformed positions q [m].
    starts : (n + 1,) int array
    neighbours : (h,) int array
        One-rings from `mesh.topology.vertex_rings`: that of vertex i is `neighbours[starts[i]:starts[i + 1]]`.

    Returns
    -------
    VertexFrames
        Rotations (n, 3, 3) and the vertices without a unique one.

    Raises
    ------
    InputError
        The arrays have wrong shapes, non-finite entries or rows out of range.

    Examples
    --------
    A triangle turned by 90 degrees about z:

    >>> import numpy as np
    >>> from clothsim.mesh.topology import vertex_rings
    >>> rest = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> turned = np.array([[0.0, 0, 0], [0, 1, 0], [-1, 0, 0]])
    >>> frames = vertex_frames(rest, turned, *vertex_rings(np.array([[0, 1, 2]]), 3))
    >>> np.allclose(frames.rotations, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    True
    """
    p, q = as_points("reference", reference), as_points("deformed", deformed)
    if p.shape != q.shape:
        raise InputError(f"reference has {len(p)} vertices, deformed {len(q)}.")
    if len(starts) != len(p) + 1 or starts[0] != 0 or starts[-1] != len(neighbours) or (np.diff(starts) < 0).any():
        raise InputError(
            f"starts must ascend from 0 to {len(neighbours)} in {len(p) + 1} entries.",
            "Use mesh.topology.vertex_rings.",
        )
    bad = np.flatnonzero((neighbours < 0) | (neighbours >= len(p)))
    if bad.size:
        raise InputError(f"neighbours[{bad[0]}] = {neighbours[bad[0]]} is not a vertex in 0..{len(p) - 1}.")
    rotations = np.empty((len(p), 3, 3))
    determined = np.empty(len(p), bool)
    sizes = np.diff(starts)
    for size in np.unique(sizes):
        vertices = np.flatnonzero(sizes == size)
        rings = np.column_stack([vertices, neighbours[starts[vertices, None] + np.arange(size)]])
        rotations[vertices], determined[vertices] = kabsch(p[rings], q[rings])
    return VertexFrames(rotations, np.flatnonzero(~determined))
