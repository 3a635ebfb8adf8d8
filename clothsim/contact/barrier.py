"""The barrier energy of contact: zero beyond d_hat, infinite at contact."""

from dataclasses import dataclass, replace
from typing import Self

import ipctk
import numpy as np
from scipy import sparse

from clothsim.arrays import Floats
from clothsim.contact.candidates import Candidates
from clothsim.contact.stiffness import barrier_stiffness
from clothsim.energies.base import Energy, Step


@dataclass(frozen=True)
class Barrier(Energy):
    """E = kappa sum w b(d) over the pairs closer than d_hat (Li et al. 2020, IPC; area weights: Li et al. 2023).

    b(d) = -(d^2 - d_hat^2)^2 ln(d^2 / d_hat^2) / d_hat^3 [m], w the area of the pair [m2], kappa [Pa].
    areas (n_cloth,) [m2] and masses (n_cloth,) [kg] of the cloth vertices give kappa its scale in `begin`, where
    `adaptive`; otherwise it stays as given.
    """

    candidates: Candidates
    d_hat: float
    areas: Floats
    masses: Floats
    stiffness: float
    adaptive: bool

    begins_last = True
    exact_in_newton = False

    def begin(self, step: Step) -> Self:
        """Bound to the step: fresh candidates, and a stiffness that holds the loads at about half of d_hat."""
        self.candidates.forget()
        if not self.adaptive:
            return self
        n = len(self.areas)
        touching = self.gradient(step.positions)[:n].any(axis=1)
        loads = np.linalg.norm(step.gradient[:n], axis=1) / self.areas
        speeds = np.linalg.norm(step.velocities[:n], axis=1)
        stiffness = barrier_stiffness(
            float(loads[touching].max(initial=0.0)),
            float(self.masses.sum() / self.areas.sum()),
            float(speeds.max(initial=0.0)),
            self.d_hat,
            step.dt,
        )
        return replace(self, stiffness=stiffness)

    def value(self, x: Floats) -> float:
        """Barrier energy [J]; +inf where a pair touches."""
        collisions = self.candidates.collisions(x)
        if not len(collisions):
            return 0.0
        value = float(self._potential(collisions, self.candidates.surface.mesh, self.candidates.surface.rows(x)))
        return value if np.isfinite(value) else np.inf

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]: also on the rows of bodies, where it is the reaction's negative."""
        out = np.zeros_like(x)
        collisions = self.candidates.collisions(x)
        if len(collisions):
            surface = self.candidates.surface
            flat = self._potential.gradient(collisions, surface.mesh, surface.rows(x))
            out[: surface.n_surface] = flat.reshape(-1, 3)
        return out

    def hessian(self, x: Floats, project: bool = True) -> sparse.csr_array:
        """d2E/dx2 over all rows [N/m]; projected pair by pair, or exact."""
        surface = self.candidates.surface
        collisions = self.candidates.collisions(x)
        size = x.size
        if not len(collisions):
            return sparse.csr_array((size, size))
        method = ipctk.PSDProjectionMethod.CLAMP if project else ipctk.PSDProjectionMethod.NONE
        columns = self._potential.hessian(collisions, surface.mesh, surface.rows(x), method)
        # the matrix is symmetric: its compressed columns are its compressed rows
        pointers = np.concatenate([columns.indptr, np.full(size - columns.shape[0], columns.nnz, columns.indptr.dtype)])
        return sparse.csr_array((columns.data, columns.indices, pointers), shape=(size, size))

    def step_limit(self, x: Floats, dx: Floats) -> float:
        """The fraction of dx that is free of collision."""
        return self.candidates.step_limit(x, dx)

    def minimum_gap(self, x: Floats) -> float:
        """The smallest distance between a cloth and a body [m] where it is below d_hat, else inf."""
        return self.candidates.minimum_gap(x)

    def choices(self) -> tuple[str, ...]:
        """d_hat, and how the stiffness is set."""
        stiffness = "set anew at each step" if self.adaptive else f"{self.stiffness:g} Pa"
        return (f"d_hat = {self.d_hat:g} m, stiffness {stiffness}",)

    def counts(self) -> dict[str, float]:
        """Pairs closer than d_hat at the last position, CCD calls, and the seconds of both searches."""
        searches = self.candidates
        return {"pairs": searches.pairs, "ccd_calls": searches.ccd_calls, **searches.seconds}

    @property
    def _potential(self) -> ipctk.BarrierPotential:
        return ipctk.BarrierPotential(self.d_hat, self.stiffness, True)
