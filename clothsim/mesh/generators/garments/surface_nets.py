"""Surface nets (Gibson 1998): the half x >= 0 of a mirror-symmetric level set f = 0 as triangles, in whole arrays.

One vertex for each lattice cell that the surface crosses, at the mean of the crossings of its edges; one quad for each
lattice edge that it crosses, between the four cells around that edge. The first column of cells lies across x = 0: by
symmetry its vertices are on the plane, and no quad is its own mirror image.
"""

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.generators.lattice import cut_quads

_CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 1)])
_EDGES = ((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7))


def _is_split(code: int) -> bool:
    """True where the inside corners (the bits of `code`) or the outside ones are not connected by edges of the cell."""
    for wanted in (1, 0):
        left = [c for c in range(8) if (code >> c & 1) == wanted]
        visited, todo = set(left[:1]), left[:1]
        while todo:
            here = todo.pop()
            step = [c for edge in _EDGES if here in edge for c in edge if c in left and c not in visited]
            visited.update(step)
            todo.extend(step)
        if len(visited) < len(left):
            return True
    return False


_SPLIT = np.array([_is_split(code) for code in range(256)])


def half_surface(f: Floats, nodes: tuple[Floats, Floats, Floats]) -> tuple[Floats, Ints]:
    """Mesh the surface inside the lattice.

    Parameters
    ----------
    f : (nx, ny, nz) float64
        Level-set function at the nodes.
    nodes : tuple
        Ascending x, y and z of the lattice [m]; x[0] = -x[1], and the surface must not reach the other sides.

    Returns
    -------
    positions : (n, 3) float64
        Vertices with x >= 0 [m].
    triangles : (m, 3) int64
        Facing towards growing f; a manifold, see `_plain`.
    """
    f = _plain(f)
    number, positions = _cell_vertices(f, nodes)
    quads = np.concatenate([_quads(f < 0, number, axis) for axis in range(3)])
    first, second = (np.linalg.norm(positions[quads[:, k]] - positions[quads[:, k + 2]], axis=1) for k in (0, 1))
    return positions, cut_quads(quads, (second < first * (1 - 1e-6)).astype(np.int64))


def _plain(f: Floats) -> Floats:
    """f without cells whose inside or outside corners are connected only across a diagonal: there sheets would touch.

    Where the surface has a thin ridge between the nodes such a cell loses its shallowest inside corner.
    """
    f = f.copy()
    f[0] = f[1]  # exactly symmetric, whatever the rounding
    for _ in range(64):
        corner = _corners(f)
        code = ((corner < 0) << np.arange(8)).sum(axis=3)
        bad = np.argwhere(_SPLIT[code])
        if not len(bad):
            break
        values = corner[tuple(bad.T)]
        shallow = np.where(values < 0, values, -np.inf).argmax(axis=1)
        f[tuple((bad + _CORNERS[shallow]).T)] = 1e-9
        f[:2] = f[:2].max(axis=0)
    return f


def _corners(f: Floats) -> Floats:
    """Values at the 8 corners of each cell, (nx, ny, nz, 8)."""
    return np.stack([f[tuple(slice(c, f.shape[k] - 1 + c) for k, c in enumerate(cs))] for cs in _CORNERS], axis=3)


def _cell_vertices(f: Floats, nodes: tuple[Floats, Floats, Floats]) -> tuple[Ints, Floats]:
    """Number of the vertex of each cell, -1 for none, and the vertices."""
    corner = _corners(f)
    inside = corner < 0
    crossed = inside.any(axis=3) & ~inside.all(axis=3)
    number = np.full(crossed.shape, -1, np.int64)
    number[crossed] = np.arange(crossed.sum())
    values = corner[crossed]
    total, count = np.zeros((len(values), 3)), np.zeros(len(values))
    for a, b in _EDGES:
        cut = (values[:, a] < 0) != (values[:, b] < 0)
        fraction = values[cut, a] / (values[cut, a] - values[cut, b])
        total[cut] += _CORNERS[a] + fraction[:, None] * (_CORNERS[b] - _CORNERS[a])
        count[cut] += 1
    cell, fraction = np.argwhere(crossed), total / count[:, None]
    low = np.column_stack([nodes[k][cell[:, k]] for k in range(3)])
    high = np.column_stack([nodes[k][cell[:, k] + 1] for k in range(3)])
    positions = low + fraction * (high - low)
    positions[cell[:, 0] == 0, 0] = 0.0
    return number, positions


def _quads(inside: np.ndarray, number: Ints, axis: int) -> Ints:
    """Quads (q, 4) of the crossed lattice edges along `axis`, facing outward."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    ends = np.moveaxis(inside, axis, 0)
    crossed = np.moveaxis(ends[:-1] != ends[1:], 0, axis)
    node = np.argwhere(crossed)
    node = node[(node[:, one] > 0) & (node[:, two] > 0)]  # left out: the mirror images at the first node of x
    if axis == 0:
        node = node[node[:, 0] > 0]
    around = []
    for shift_one, shift_two in ((1, 1), (0, 1), (0, 0), (1, 0)):
        cell = node.copy()
        cell[:, one] -= shift_one
        cell[:, two] -= shift_two
        around.append(number[tuple(cell.T)])
    quads = np.column_stack(around)
    outward = inside[tuple(node.T)]
    return np.where(outward[:, None], quads, quads[:, ::-1])
