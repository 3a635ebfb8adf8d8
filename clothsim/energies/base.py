"""What an Energy is, what a step tells it, and how its Hessian comes out."""

import abc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self, cast

import numpy as np
from scipy import sparse

from clothsim.arrays import Floats, Ints
from clothsim.energies.lanes import unpack
from clothsim.jit import LANES

CONTACT_TIME_SCALE = 0.01
"""In which contact answers at the latest [s], the dt that scenes have. With a shorter dt its stiffness no longer grows:
the energy of a gap below d_hat would go with 1 / dt^2, and finer steps would shoot off what starts there."""


@dataclass(frozen=True)
class Past:
    """The past as a step weighs it: it ends with the velocities v = (x - positions) / dt (FORMULAS 2).

    Backward Euler: x_n, v_n (N, 3) and h [s]; BDF2: x^, v^ and b h. Inertia, damping and friction know no other time.
    """

    positions: Floats
    velocities: Floats
    dt: float


@dataclass(frozen=True)
class Step:
    """What an Energy may know when it is bound to a step of the integrator.

    time: start of the step [s]; dt: its length [s]; positions, velocities: (N, 3) at its start [m], [m/s], in the
    world's order (cloth, bodies, ghosts); load: the share of the loads that acts, 1 except in a quasi-static ramp;
    gradient: (N, 3) sum of the gradients of the other energies at the start [N], and bound: the energies that are bound
    to this step by now, by name: both are given to those that `begin_last`; memory: what each energy
    `carry_over` of the step before; weighed: the past of a formula other than backward Euler's; contact_time_scale
    of the barrier stiffness [s], where that is not dt.
    """

    time: float
    dt: float
    positions: Floats
    velocities: Floats
    load: float
    gradient: Floats
    bound: "Mapping[str, Energy]" = field(default_factory=dict)
    memory: Mapping[str, float | Floats] = field(default_factory=dict)
    weighed: Past | None = None
    contact_time_scale: float | None = None

    @property
    def past(self) -> Past:
        """The past that velocities are taken from."""
        return self.weighed or Past(self.positions, self.velocities, self.dt)


@dataclass(frozen=True)
class ElementHessian:
    """Second derivatives as dense blocks: `blocks (m, 3k, 3k)` [N/m] over the vertices `elements (m, k)`.

    Rows of vertices that are not unknowns (bodies, ghosts) may be there; the assembler drops them.
    """

    elements: Ints
    blocks: Floats

    @property
    def nnz(self) -> int:
        """Numbers in the blocks."""
        return self.blocks.size

    def times(self, vectors: Floats) -> Floats:
        """Each block times the numbers of its vertices, (m, 3 k)."""
        return np.einsum("mij,mj->mi", self.blocks, vectors)

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The (3 n, 3 n) matrix, assembled the slow and obvious way (tests, diagnostics)."""
        dofs = (3 * self.elements[:, :, None] + np.arange(3)).reshape(len(self.elements), 3 * self.elements.shape[1])
        rows = np.repeat(dofs, dofs.shape[1], axis=1).ravel()
        columns = np.tile(dofs, (1, dofs.shape[1])).ravel()
        shape = (3 * n_vertices, 3 * n_vertices)
        return sparse.coo_array((self.blocks.ravel(), (rows, columns)), shape=shape).tocsr()


@dataclass(frozen=True)
class LowRankHessian:
    """Projected second derivatives as sums of squares: contact's have a fifth of the numbers of their blocks.

    Over the vertices of element e, of `elements (m, k)`, none twice in one, it is the sum of v v' over count[e] rows v
    of `sides (s, 3 k)` [(N/m)^1/2] from first[e] on; first, count: (m,).
    """

    elements: Ints
    first: Ints
    count: Ints
    factors: Floats

    @property
    def nnz(self) -> int:
        """Numbers in the blocks."""
        return len(self.elements) * self.factors.shape[1] ** 2

    @property
    def blocks(self) -> Floats:
        """The same as dense blocks (m, 3 k, 3 k) [N/m]: slow, for diagnostics and tests."""
        blocks = np.zeros((len(self.elements), *2 * self.factors.shape[1:]))
        for has, factors in self._one_each():
            blocks[has] += factors[:, :, None] * factors[:, None, :]
        return blocks

    def times(self, vectors: Floats) -> Floats:
        """Each block times the numbers of its vertices, (m, 3 k)."""
        products = np.zeros_like(vectors)
        for has, factors in self._one_each():
            products[has] += np.einsum("mi,mi->m", factors, vectors[has])[:, None] * factors
        return products

    def _one_each(self) -> Iterator[tuple[Ints, Floats]]:
        """The elements that have a first side, and these sides; those that have a second, and so on."""
        for k in range(int(self.count.max(initial=0))):
            has = np.flatnonzero(self.count > k)
            yield has, self.factors[self.first[has] + k]

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The (3 n, 3 n) matrix, the slow and obvious way."""
        return ElementHessian(self.elements, self.blocks).to_sparse(n_vertices)


AT_ONCE = 1024
"""Elements that are computed before they are added: hinges fill 0.7 MB, which stays in the second cache."""


@dataclass(frozen=True)
class LanesHessian:
    """Second derivatives that are computed where they are added, a few groups of LANES elements at a time.

    All at once they would go through the memory twice, which takes longer than to compute them. fill(lanes, first)
    writes those of elements (m, k) from `first` on, as many as there is room for, to `lanes` (g, numbers of the blocks
    of corners a <= b in this order, each row by row, times LANES). A group's last places may be for no element.
    The x of which they are may not be changed in place before they are added.
    """

    elements: Ints
    fill: Callable[[Floats, int], None]

    @property
    def nnz(self) -> int:
        """Numbers in the blocks."""
        return len(self.elements) * (3 * self.elements.shape[1]) ** 2

    @property
    def blocks(self) -> Floats:
        """The same as dense blocks (m, 3 k, 3 k) [N/m]."""
        blocks = room_for(self.elements)
        for first, lanes in self.chunks():
            unpack(blocks[first : first + AT_ONCE], lanes)
        return blocks

    def chunks(self, asked: np.ndarray | None = None) -> Iterator[tuple[int, Floats]]:
        """The first element of each chunk and the lanes of the chunk, which the next overwrites.

        asked (m,): booleans; a chunk in which none is asked for is left out.
        """
        count, corners = self.elements.shape
        room = np.empty((-(-min(AT_ONCE, count) // LANES), 9 * corners * (corners + 1) // 2 * LANES))
        for first in range(0, count, AT_ONCE):
            if asked is None or asked[first : first + AT_ONCE].any():
                lanes = room[: -(-(count - first) // LANES)]
                self.fill(lanes, first)
                yield first, lanes

    def times(self, vectors: Floats) -> Floats:
        """Each block times the numbers of its vertices, (m, 3 k), looked at where some are not 0: few are pinned."""
        products = np.zeros_like(vectors)
        for first, lanes in self.chunks(np.asarray(vectors.any(axis=1))):
            here = slice(first, first + AT_ONCE)
            blocks = room_for(self.elements[here])
            unpack(blocks, lanes)
            products[here] = np.einsum("mij,mj->mi", blocks, vectors[here])
        return products

    def to_sparse(self, n_vertices: int) -> sparse.csr_array:
        """The (3 n, 3 n) matrix, the slow and obvious way."""
        return ElementHessian(self.elements, self.blocks).to_sparse(n_vertices)


ByElement = ElementHessian | LowRankHessian | LanesHessian
"""What an energy hands over element by element."""


def room_for(elements: Ints) -> Floats:
    """Blocks of the `elements (m, k)`, (m, 3 k, 3 k), to be filled.

    By numpy, which asks the system for large pages. A kernel that makes its own waits for small ones beyond 32 MB, at
    each Hessian anew and longer than it computes.
    """
    size = 3 * elements.shape[1]
    return np.empty((len(elements), size, size))


class Energy(abc.ABC):
    """A term of E(x): frozen data with `value`, `gradient` and `hessian`. All positions are (N, 3) [m]."""

    begins_last: ClassVar[bool] = False
    """True where `begin` needs `step.gradient`, the sum of the other energies' gradients."""

    incremental: ClassVar[bool] = False
    """True where the value belongs to the step (inertia, dissipation) and is no energy of the state."""

    exact_in_newton: ClassVar[bool] = True
    """False where the projected Hessian serves Newton for both: the exact one would cost more than it saves."""

    per_element: ClassVar[tuple[str, ...]] = ()
    """Its arrays with a row for each element, first the rows of x of each; empty where it is no sum over elements."""

    @property
    def drives(self) -> bool:
        """True where it may do work on the cloth from outside, as wind does: a rise of the energy is then no error."""
        return False

    @property
    def idle(self) -> bool:
        """True where, bound to this step, it is 0 with all its derivatives at every x: the step leaves it out."""
        return False

    @property
    def anchored_rows(self) -> Ints:
        """Rows of x that it ties to places of the world: what is held so has an equilibrium under a load."""
        return np.zeros(0, np.int64)

    @property
    def activation_distance(self) -> float:
        """The distance below which it pushes things apart [m], 0 where it does not."""
        return 0.0

    @property
    def lag_iterations(self) -> int:
        """How often a step is solved; before each pass but the first the energy is bound `relag`."""
        return 1

    @abc.abstractmethod
    def value(self, x: Floats) -> float:
        """E(x) [J]; +inf where x is not admissible, never NaN."""

    @abc.abstractmethod
    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]; rows of vertices that it does not touch are zero."""

    @abc.abstractmethod
    def hessian(self, x: Floats, project: bool = True) -> "ByElement | sparse.csr_array":
        """d2E/dx2 [N/m]; `project`: positive semi-definite for the Newton direction, else exact."""

    def begin(self, step: Step) -> Self:
        """A copy bound to the step (lagged quantities, targets); the energy itself where nothing is lagged."""
        return self

    def relag(self, x: Floats) -> Self:
        """A copy for another pass of the same step, its lagged quantities taken at x."""
        return self

    def restricted_to(self, moving: np.ndarray, x: Floats) -> Self:
        """A copy for solves from x in which the `moving` vertices ((N,) booleans) move and all others stand.

        It may leave out what none of them touches, a constant.
        By `per_element`; without it the energy itself, which is as right and costs more.
        """
        if not self.per_element:
            return self
        kept = np.flatnonzero(moving[getattr(self, self.per_element[0])].any(axis=1))
        return replace(cast(Any, self), **{name: getattr(self, name)[kept] for name in self.per_element})

    def step_limit(self, x: Floats, dx: Floats, most: float = 1.0) -> float:
        """The largest admissible fraction of dx, in [0, most]; 0 where it cannot be told."""
        return most

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance that it keeps [m], inf where it keeps none."""
        return float("inf")

    def gap_change(self, x: Floats, dx: Floats) -> float:
        """The largest share by which the step changes a distance that it keeps, 0 where it keeps none."""
        return 0.0

    def tightest(self, x: Floats) -> str:
        """What of it is nearly at a limit at x, for a failure to say; empty where nothing is, and for contact."""
        return ""

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """Rows (m, k) that its Hessian is expected to couple on the way x -> x + dx beyond the mesh's own stencils.

        A guess: it may lack some. (0, 1) for all but contact.
        """
        return np.zeros((0, 1), np.int64)

    @property
    def carry_over(self) -> float | Floats:
        """What the binding of the next step needs of this one, a number (contact: its stiffness [Pa]) or an array
        (plastic bending: its angles), else nan.
        """
        return float("nan")

    def defaults_used(self) -> tuple[str, ...]:
        """What it chose where the scene was silent, for the user to read."""
        return ()

    def found(self, x: Floats) -> tuple[str, ...]:
        """What there is to say of it at the end of a run, where the cloth is at x."""
        return ()

    def counts(self) -> dict[str, float]:
        """Work that only it can count, by the names of the ledger (pairs, ccd_calls) and of its phases (seconds)."""
        return {}


@dataclass(frozen=True)
class Prescribed:
    """Vertices whose positions are given: `vertices (k,)` and where they are, `positions (k, 3)` [m]."""

    vertices: Ints
    positions: Floats


class Constraint(abc.ABC):
    """An effect without energy: it prescribes positions, exactly."""

    @property
    @abc.abstractmethod
    def still(self) -> bool:
        """True where the prescribed positions never change."""

    @abc.abstractmethod
    def at(self, time: float) -> Prescribed:
        """The prescribed vertices and their positions at `time` [s]."""

    def holder(self, row: int) -> str:
        """The name of what holds a row of x ("pins.group[1]"), empty where nothing of it does."""
        return ""


@dataclass(frozen=True)
class Off:
    """What an effect's builder returns when the scene names it but it can do nothing: the reason, for `explain`."""

    reason: str
