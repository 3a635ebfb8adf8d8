"""The scales of contact, chosen from the scene: d_hat from the mesh, the barrier stiffness from loads and masses."""

import numpy as np

from clothsim.arrays import Floats


def default_d_hat(edge_lengths: Floats) -> float:
    """A tenth of the median edge [m], to two digits: a gap that the mesh's own facets do not resolve."""
    length = 0.1 * float(np.median(edge_lengths))
    digits = 1 - int(np.floor(np.log10(length)))
    return round(length, digits)


def barrier_stiffness(pressure: float, area_density: float, speed: float, d_hat: float, dt: float) -> float:
    """kappa [Pa] for a step, from the state at its start alone; the largest of three pressures.

    pressure [Pa]: what contact must carry now, the most that the other forces put on the area of a touching vertex:
    kappa = pressure puts its gap at about half of d_hat (F/(kappa w) = 3.85 at .53, for w = A/4). rho_A v / dt: what
    stops the fastest vertex in one step, for those that are yet to touch. rho_A d_hat / dt^2: what moves the cloth
    through d_hat in one step; softer, the barrier would let it sink before it answers.
    """
    return max(pressure, area_density * speed / dt, area_density * d_hat / dt**2)
