"""Nonlinear elimination: the unconverged vertices minimised as a patch of their own, all others fixed.

Late in a solve of crumpling cloth a hundredth of the vertices still moves: separate creases that grow. Every iteration
over the whole cloth pays for all other vertices too, and one crease that overshoots shortens the step of all (Lanzkron,
Rose & Wilkes 1996).
"""

from dataclasses import replace

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.jit import kernel
from clothsim.physics.energies.hessians import ByElement
from clothsim.solve.linear.sparsity import Explicit, SparsityPattern

RINGS = 3
"""Rings of neighbours that a patch adds around the unconverged vertices."""
MIN_VERTICES = 4000
"""Vertices of a cloth from which on patches pay: ten of the repository's scenes, all smaller, took 1.04 to 1.43 times
as long with them; a sheet of 5,041 vertices took .9, one of 10,201 .8.
"""
MAX_FRACTION = 0.5
"""Largest fraction of the vertices in a patch: a larger one would cost what the whole cloth does."""
NONE = np.zeros(0, np.int64)


class Patch:
    """Subset of the vertices: rows (k,) of x that move, ascending; moving (N,): the same as booleans.

    Renumbered element lists are cached: the same list comes back as the same object.
    """

    def __init__(self, rows: Ints, count: int) -> None:
        self.rows = rows
        self.moving = np.zeros(count, bool)
        self.moving[rows] = True
        self._numbers = np.full(count, len(rows))  # fixed vertices get a row that the assembler drops
        self._numbers[rows] = np.arange(len(rows))
        self._known: dict[int, tuple[Ints, Ints]] = {}

    def renumbered(self, elements: Ints) -> Ints:
        """Return rows of x (m, j) as rows of the patch's matrix."""
        found = self._known.get(id(elements))
        if found is None:
            found = self._known[id(elements)] = (
                elements,
                self._numbers[elements],
            )  # a list in the cache keeps its id
        return found[1]

    def hessian(self, hessian: Explicit) -> Explicit:
        """Return a Hessian over x as one over the patch's rows."""
        if isinstance(hessian, ByElement):
            return replace(hessian, elements=self.renumbered(hessian.elements))
        entries = (3 * self.rows[:, None] + np.arange(3)).ravel()
        return sparse.csr_array(hessian.tocsr()[entries][:, entries])


def unconverged(moved: Floats, least: float, pattern: SparsityPattern, fixed: np.ndarray) -> Ints:
    """Select the rows (k,) that moved further than `least`, with RINGS rings of neighbours.

    Parameters
    ----------
    moved : (n,) float64
        Displacement of each vertex in the last step [m].
    least : float
        Threshold [m].
    pattern : SparsityPattern
        Adjacency.
    fixed : (n,) bool
        Dirichlet vertices.

    Returns
    -------
    (k,) int64
        Empty where the patch would be too large, or the cloth is small.
    """
    chosen = (moved > least) & ~fixed
    if len(moved) < MIN_VERTICES or not 0 < chosen.sum() <= MAX_FRACTION * len(moved):
        return NONE
    for _ in range(RINGS):
        grown = chosen.copy()
        _grow(grown, chosen, pattern.starts, pattern.columns)
        chosen = grown
    found = np.flatnonzero(chosen & ~fixed)
    return found if len(found) <= MAX_FRACTION * len(moved) else NONE


@kernel
def _grow(grown, chosen, starts, columns):
    """Add the neighbours of the `chosen` (n,) to `grown (n,)`."""
    for i in range(len(chosen)):
        for k in range(starts[i], starts[i + 1]):
            grown[i] |= chosen[columns[k]]
            grown[columns[k]] |= chosen[i]
