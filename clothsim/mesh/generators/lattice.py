"""Lattices of quads and their triangulations, shared by all structured generators."""

import numpy as np

from clothsim.base.arrays import Floats, Ints


def lattice_points(nx: int, ny: int) -> Floats:
    """Return the corners of nx by ny unit cells, ((nx + 1)(ny + 1), 2); the second coordinate runs fastest."""
    x, y = np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()])


def lattice_quads(nx: int, ny: int, closed: bool = False) -> Ints:
    """Return the cells as quads (nx ny, 4), counter-clockwise from the lower left; `closed`: column nx is column 0."""
    column = np.arange(nx)[:, None]
    right = (column + 1) % nx if closed else column + 1
    row = np.arange(ny)
    corners = [column * (ny + 1) + row, right * (ny + 1) + row, right * (ny + 1) + row + 1, column * (ny + 1) + row + 1]
    return np.stack(corners, axis=2).reshape(-1, 4).astype(np.int64)


def checkerboard(nx: int, ny: int) -> Ints:
    """Return 0 or 1 for each cell in the order of `lattice_quads`, alternating along both directions, (nx ny,)."""
    return ((np.arange(nx)[:, None] + np.arange(ny)) % 2).ravel().astype(np.int64)


def cut_quads(quads: Ints, other_diagonal: Ints) -> Ints:
    """Cut each quad a b c d into two triangles, (2 k, 3): a b c and a c d, or with `other_diagonal` b c d and b d a."""
    turned = np.where(other_diagonal[:, None] == 1, np.roll(quads, -1, axis=1), quads)
    return turned[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
