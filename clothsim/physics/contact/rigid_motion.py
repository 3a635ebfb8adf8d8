"""Rigid part of displacements: translation and rotation of each object as a whole."""

import numpy as np

from clothsim.base.arrays import Floats, Ints


def rigid_displacements(x: Floats, displacements: Floats, labels: Ints) -> Floats:
    """The rigid displacements nearest to those of each object.

    Of each object u + r x d is fitted by least squares, with the offsets d from its mean position. Objects without
    extent across a line turn about none of it.

    Parameters
    ----------
    x, displacements : (n, 3) array
        Positions and small displacements [m].
    labels : (n,) int array
        Object of each row.

    Returns
    -------
    (n, 3) array [m]

    Examples
    --------
    >>> x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    >>> turned = np.cross([0, 0, 0.1], x)
    >>> bool(np.allclose(rigid_displacements(x, turned, np.zeros(4, int)), turned))
    True
    """
    found = np.zeros_like(displacements)
    for label in np.unique(labels):
        rows = labels == label
        mean = displacements[rows].mean(axis=0)
        offsets = x[rows] - x[rows].mean(axis=0)
        squares = offsets.T @ offsets
        inertia = np.trace(squares) * np.eye(3) - squares
        momentum = np.cross(offsets, displacements[rows] - mean).sum(axis=0)
        rotation = np.linalg.lstsq(inertia, momentum, rcond=None)[0]
        found[rows] = mean + np.cross(rotation, offsets)
    return found
