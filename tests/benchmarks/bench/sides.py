"""Contact work of a Newton iteration by the numba path and by ipctk, timed by part."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from time import process_time
from typing import Any, Protocol

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidates import SLACK
from clothsim.solve.linear.sparsity import SparsityPattern

PARTS = ("candidates", "energy and gradient", "projected Hessian", "CCD")

Seconds = dict[str, float]
"""{part: processor seconds}."""


class Side(Protocol):
    """One of the two."""

    def begin(self, x: Floats) -> None:
        """As a time step begins at x (N, 3) [m], where the one before has ended."""

    def take(self, x: Floats, dx: Floats, seconds: Seconds) -> float:
        """All parts for the place x and the step dx (N, 3) [m], added to `seconds`; the energy [J]."""


@dataclass(frozen=True)
class Ours:
    """The numba path: what it finds is kept from way to way, its Hessian blocks go into the Newton matrix."""

    barriers: Sequence[Barrier]
    pattern: SparsityPattern

    def begin(self, x: Floats) -> None:
        """The step before has found what is near x."""
        for barrier in self.barriers:
            barrier.candidates.clear()
            barrier.candidates.active(x)

    def take(self, x: Floats, dx: Floats, seconds: Seconds) -> float:
        """Pairs, sums, matrix, step; the contact's own receipt tells the CCD from the search for it."""
        clock = Clock(seconds)
        for barrier in self.barriers:
            barrier.candidates.active(x)
        clock.book("candidates")
        energy = sum(barrier.value(x) for barrier in self.barriers)
        for barrier in self.barriers:
            barrier.gradient(x)
        clock.book("energy and gradient")
        self.pattern.assemble([barrier.hessian(x) for barrier in self.barriers])
        clock.book("projected Hessian")
        before, limit = self._of_ccd(), 1.0
        for barrier in self.barriers:
            limit = barrier.step_limit(x, dx, limit)
        of_ccd = self._of_ccd() - before
        clock.book("candidates")
        seconds["candidates"] -= of_ccd
        seconds["CCD"] += of_ccd
        return energy

    def _of_ccd(self) -> float:
        return sum(barrier.candidates.seconds["CCD"] for barrier in self.barriers)


class Ipctk:
    """ipctk by the calls that are cheapest for it.

    One mesh for body and self contact, one search (LBVH) an iteration for the collisions and the CCD, additive CCD, one
    thread. To search with a margin and to keep what was found costs it as much. Its Hessian is a sparse matrix.
    """

    def __init__(self, barriers: Sequence[Barrier], n_cloth: int) -> None:
        self._ipctk = ipctk = loaded()
        surface, self._d_hat = barriers[0].candidates.surface, barriers[0].d_hat
        self._count = int(surface.rows.max()) + 1
        edges = np.concatenate([surface.first.edges, surface.second.edges])
        rest = surface.rest_positions[: self._count]
        self._mesh = ipctk.CollisionMesh(*(np.asfortranarray(each) for each in (rest, edges, surface.triangles)))
        self._mesh.can_collide = ipctk.make_static_obstacle_filter(n_cloth)
        self._potential = ipctk.BarrierPotential(self._d_hat, 1.0, True)
        self._ccd = ipctk.AdditiveCCD(conservative_rescaling=SLACK)

    def begin(self, x: Floats) -> None:
        """Nothing is kept."""

    def take(self, x: Floats, dx: Floats, seconds: Seconds) -> float:
        """One search for the whole way, then the collisions, sums, matrix and step from it."""
        ipctk, mesh, clock = self._ipctk, self._mesh, Clock(seconds)
        here, there = np.asfortranarray(x[: self._count]), np.asfortranarray((x + dx)[: self._count])
        candidates, collisions = ipctk.Candidates(), ipctk.NormalCollisions()
        candidates.build(mesh, here, there, 0.5 * self._d_hat, ipctk.LBVH())
        collisions.use_area_weighting = True
        collisions.build(candidates, mesh, here, self._d_hat)
        clock.book("candidates")
        energy = float(self._potential(collisions, mesh, here))
        self._potential.gradient(collisions, mesh, here)
        clock.book("energy and gradient")
        self._potential.hessian(collisions, mesh, here, ipctk.PSDProjectionMethod.CLAMP)
        clock.book("projected Hessian")
        candidates.compute_collision_free_stepsize(mesh, here, there, 0.0, self._ccd)
        clock.book("CCD")
        return energy


class Clock:
    """Adds the processor seconds since the last call to a part."""

    def __init__(self, seconds: Seconds) -> None:
        self._seconds, self._last = seconds, process_time()

    def book(self, part: str) -> None:
        """Book what has passed."""
        now = process_time()
        self._seconds[part] += now - self._last
        self._last = now


def loaded() -> Any:
    """ipctk, on one thread. InputError where it is not installed."""
    try:
        ipctk = import_module("ipctk")  # by name: of the package only contact imports it, and this measures it
    except ImportError as error:
        remedy = "Run: pip install 'clothsim[oracle]'"
        raise InputError("--oracle measures ipctk, which is not installed.", remedy) from error
    ipctk.set_num_threads(1)
    return ipctk
