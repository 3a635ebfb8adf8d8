"""Contact scales: d_hat from the mesh, barrier stiffness from loads and masses."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.physics.energies.base import Step

RISE_TIME = 30.0
"""Shortest time in which a rise of the stiffness may add the kinetic and barrier energy to the cloth, over
`contact_time`.
"""


def default_d_hat(edge_lengths: Floats) -> float:
    """A tenth of the median edge [m], to two digits: a gap that the mesh's own facets do not resolve.

    Examples
    --------
    >>> default_d_hat(np.array([0.01, 0.0123, 0.02]))
    0.0012
    """
    length = 0.1 * float(np.median(edge_lengths))
    digits = 1 - int(np.floor(np.log10(length)))
    return round(length, digits)


def barrier_stiffness(
    pressure: float, area_density: float, speed: float, d_hat: float, dt: float, contact_time_scale: float
) -> float:
    """Barrier stiffness kappa [Pa] for a step, from the state at its start alone: the largest of three pressures.

    Parameters
    ----------
    pressure : float
        The pressure that contact must balance now [Pa], the largest force of the other energies on a vertex in contact
        over its area: kappa = pressure puts its gap at about half of d_hat (F/(kappa w) = 3.85 at .53, for w = A/4).
    area_density : float
        rho_A [kg/m2].
    speed : float
        Approach speed v of the fastest vertex [m/s]; rho_A v times 1 / T, or v / d_hat where that is more, stops it in
        T or within d_hat; but never more than 1 / dt, which stops it in one step.
    d_hat : float
        Range of the barrier [m].
    dt : float
        Time step [s].
    contact_time_scale : float
        Contact time scale T [s]; rho_A d_hat / T^2 moves the cloth through d_hat in that time: a softer barrier would
        let it sink before it responds.

    Returns
    -------
    float
        kappa [Pa].

    Examples
    --------
    A light cloth at rest, for which the contact time scale is decisive:

    >>> round(barrier_stiffness(0.15 * 9.81, 0.15, 0.0, 1e-3, 0.01, 0.01), 3)
    1.5
    """
    rate = min(1 / dt, max(1 / contact_time_scale, speed / d_hat))
    return max(pressure, area_density * speed * rate, area_density * d_hat / contact_time_scale**2)


def bounded_stiffness(
    wanted: float, before: float, barrier_energy: float, kinetic_energy: float, dt: float, contact_time: float
) -> float:
    """Return the stiffness kappa [Pa] of a step: that wanted, but for the energy that its rise would add.

    A rise from k to kappa adds (kappa - k) B to the pairs that are active. Unbounded, it feeds on itself: as a pair
    closes its force grows, the load in balance with it asks for a stiffer barrier yet, and a stiff card is thrown back
    faster than it came. A fall takes energy away, and is free.

    Parameters
    ----------
    wanted, before : float
        kappa by the loads, and that of the step before [Pa].
    barrier_energy : float
        B, the barrier energy at the start of the step for a stiffness of 1 Pa [m3].
    kinetic_energy : float
        K, of the cloth at the start [J].
    dt, contact_time : float
        Length h of the step and the contact time T of the scene [s].

    Returns
    -------
    float
        The lesser of `wanted` and the kappa with (kappa - k) B = (K + k B) h / (RISE_TIME T) [Pa].

    Examples
    --------
    Where nothing is in contact, and where a card of .1 mJ that stands on its barrier would be lifted:

    >>> bounded_stiffness(900.0, 6.0, 0.0, 1e-4, 1e-3, 0.01)
    900.0
    >>> round(bounded_stiffness(900.0, 6.0, 1e-6, 1e-4, 1e-3, 0.01), 3)
    6.353
    """
    if wanted <= before or not barrier_energy:
        return wanted
    return min(wanted, before + dt / (RISE_TIME * contact_time) * (kinetic_energy / barrier_energy + before))


def kinetic_energy_of_impact(velocities: Floats, masses: Floats) -> float:
    """Return the kinetic energy of the cloth [J] in the frame in which it is largest: at rest, or with a body's vertex.

    A body that moves as prescribed brings energy: in its own frame the cloth comes at it.

    Parameters
    ----------
    velocities : (N, 3) array
        Of all vertices, those of the cloth first [m/s].
    masses : (n,) array
        Of the vertices of the cloth [kg].

    Returns
    -------
    float
        The largest of sum m |v|^2 / 2 and, over the velocities w of the vertices of bodies, sum m |v - w|^2 / 2.

    Examples
    --------
    >>> import numpy as np
    >>> kinetic_energy_of_impact(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]), np.array([0.5]))
    1.0
    """
    n = len(masses)
    bodies, momentum = velocities[n:] if velocities[n:].any() else velocities[:0], masses @ velocities[:n]
    gains = masses.sum() * (bodies**2).sum(axis=1) - 2 * bodies @ momentum
    return 0.5 * (float(masses @ (velocities[:n] ** 2).sum(axis=1)) + max(float(gains.max(initial=0.0)), 0.0))


@dataclass(frozen=True)
class HeavyBody:
    """A rigid body as a load on contact.

    Parameters
    ----------
    rows : slice
        Rows of x of its coordinates.
    masses : (k,) array
        Of the coordinates [kg].
    area : float
        Area on which its load is spread [m2]: its mean shadow, a quarter of its surface (Cauchy).
    """

    rows: slice
    masses: Floats
    area: float

    def load(self, step: Step) -> float:
        """Return the force of all energies but contact on the body at the start of a step [N]."""
        return float(np.linalg.norm(step.gradient[self.rows].sum(axis=0)))

    def stiffness(self, step: Step, load: float, d_hat: float) -> float:
        """Return the barrier stiffness [Pa] that bears a `load` [N] on the body, and stops it at its speed."""
        speed = float(np.linalg.norm(step.velocities[self.rows], axis=1).max())
        density = float(self.masses.sum()) / self.area
        return barrier_stiffness(load / self.area, density, speed, d_hat, step.dt, step.contact_time_scale or step.dt)

    def kinetic_energy(self, step: Step) -> float:
        """Return its kinetic energy at the start of a step [J]."""
        return 0.5 * float(self.masses @ (step.velocities[self.rows] ** 2).sum(axis=1))
