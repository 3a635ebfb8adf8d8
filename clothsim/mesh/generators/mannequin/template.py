"""The mannequin's mesh: made once from its function of space, and the same for every figure and pose."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.mesh.generators.mannequin.flesh import body_field, body_lattice
from clothsim.mesh.generators.mannequin.relax import both_halves, relaxed
from clothsim.mesh.generators.mannequin.skinning_weights import skinning_weights
from clothsim.mesh.generators.mannequin.surface_nets import half_surface

CELL = 0.020
"""The width of the lattice of the body [m]; finer at the hands, the toes and the soles."""


@dataclass(frozen=True)
class Template:
    """positions (n, 3) [m], triangles (m, 3) facing outward, skinning weights (n, j), in the rest pose."""

    positions: Floats
    triangles: Ints
    weights: Floats


@lru_cache(maxsize=1)
def template() -> Template:
    """The template: the left half, then its mirror image, which share the vertices on x = 0."""
    x = _lattice_line(-0.5 * CELL, 0.68, (0.46, 0.70), 0.5)
    y = _lattice_line(-0.22, 0.17, (-0.22, -0.115), 0.65)
    low = _lattice_line(-0.02, 0.70, (-0.02, 0.08), 0.75)
    z = np.concatenate([low, _lattice_line(low[-1] + CELL, 1.76, (0.82, 0.92), 0.8)])
    half = half_surface(body_lattice((x, y, z)), (x, y, z))
    positions, triangles = both_halves(*relaxed(*half, body_field))
    weights = skinning_weights(positions)
    for array in (positions, triangles, weights):
        array.setflags(write=False)
    return Template(positions, triangles, weights)


def _lattice_line(first: float, last: float, fine: tuple[float, float], factor: float) -> Floats:
    """Places from `first` to beyond `last`, CELL apart, within `fine` only factor times that [m]."""
    places = [first]
    while places[-1] < last:
        places.append(places[-1] + CELL * (factor if fine[0] <= places[-1] < fine[1] else 1.0))
    return np.array(places)
