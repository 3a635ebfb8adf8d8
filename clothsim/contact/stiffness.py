"""The scales of contact, chosen from the scene: d_hat from the mesh, the barrier stiffness from loads and masses."""

import numpy as np

from clothsim.arrays import Floats


def default_d_hat(edge_lengths: Floats) -> float:
    """A tenth of the median edge [m], to two digits: a gap that the mesh's own facets do not resolve."""
    length = 0.1 * float(np.median(edge_lengths))
    digits = 1 - int(np.floor(np.log10(length)))
    return round(length, digits)


def barrier_stiffness(gradient: Floats, areas: Floats, masses: Floats, d_hat: float, dt: float) -> float:
    """kappa [Pa] for a step, from the state at its start alone.

    Contact must carry the other forces, at most |g_i| / A_i per area (g: gradient of all other energies, weight, stress
    and the inertia of the step). kappa = max |g_i| / A_i puts the gap of the most loaded vertex at about half of d_hat
    (F/(kappa w) = 3.85 at .53 for w = A/4). Never below the pressure that moves the cloth's mass through d_hat in one
    step, m d_hat / (A dt^2): softer, the barrier would let the cloth sink before it answers.
    """
    pressure = float((np.linalg.norm(gradient, axis=1) / areas).max(initial=0.0))
    inertial = float((masses / areas).mean()) * d_hat / dt**2
    return max(pressure, inertial)
