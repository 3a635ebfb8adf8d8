"""Mean stress and energy density of a membrane on pairs of triangles."""

from dataclasses import replace
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy


@runtime_checkable
class PairMembrane(Protocol):
    """A membrane that is a sum over pairs of triangles; a single triangle has its last corner twice.

    elements (p, 4): shared edge and both opposite corners; rates (p, 3, 4, 2): gradients of the shape functions of the
    pair and of both triangles, in the frame of the first; per_element: names of all arrays with one row an element.
    """

    elements: Ints
    rates: Floats
    per_element: tuple[str, ...]


def pair_stress(membrane: PairMembrane, world: World, x: Floats) -> Floats:
    """First Piola-Kirchhoff stress [N/m] in the frame of each triangle, (m, 3, 2), the mean over its pair.

    The mean of P over an element is sum of f_v X_v' / A, f_v = dE/dx_v of the element alone and X_v its rest positions,
    of any energy (mean stress theorem); here with the pair unfolded about its common edge.
    """
    separate, y, first, second = _separate_pairs(membrane, world, x)
    forces = separate.gradient(y).reshape(-1, 4, 3)
    single = second < 0
    X = np.zeros((len(first), 4, 2))
    X[:, 1:] = _edges(membrane.rates, single)
    areas = world.rest_areas[first] + np.where(single, 0.0, world.rest_areas[second])
    P = np.einsum("pvk,pvi->pki", forces, X) / areas[:, None, None]
    values = np.zeros((len(world.triangles), 3, 2))
    values[first] = P
    pairs = np.flatnonzero(~single)
    values[second[pairs]] = P[pairs] @ _turns(world, membrane.elements[pairs], first[pairs], second[pairs])
    return values


def pair_energy_density(membrane: PairMembrane, world: World, x: Floats) -> Floats:
    """Energy of each pair over its reference area [J/m2], for each triangle, (m,)."""
    separate, y, first, second = _separate_pairs(membrane, world, x)
    arrays = {name: getattr(separate, name) for name in membrane.per_element}
    parts = ({name: array[k : k + 1] for name, array in arrays.items()} for k in range(len(first)))
    energies = np.array([replace(cast("Any", separate), **part).value(y) for part in parts])
    pairs = np.flatnonzero(second >= 0)
    areas = world.rest_areas[first].copy()
    areas[pairs] += world.rest_areas[second[pairs]]
    values = np.zeros(len(world.triangles))
    values[first] = energies / areas
    values[second[pairs]] = values[first[pairs]]
    return values


def _separate_pairs(membrane: PairMembrane, world: World, x: Floats) -> tuple[Energy, Floats, Ints, Ints]:
    """The membrane on pairs that share no vertex, their corners (4 p, 3), and the numbers of their triangles.

    The number of the second triangle is -1 where there is none.
    """
    elements = membrane.elements
    of_world = {tuple(row): k for k, row in enumerate(np.sort(world.triangles, axis=1).tolist())}
    first, second = (
        np.array([of_world.get(tuple(row), -1) for row in np.sort(elements[:, corners], axis=1).tolist()], np.int64)
        for corners in ([0, 1, 2], [0, 1, 3])
    )
    second[elements[:, 2] == elements[:, 3]] = -1
    separate = replace(cast("Any", membrane), elements=np.arange(elements.size).reshape(-1, 4))
    return separate, np.ascontiguousarray(x[elements.ravel()]), first, second


def _edges(rates: Floats, single: np.ndarray) -> Floats:
    """Rest positions of the last three vertices relative to the first, (p, 3, 2) [m], from their gradients."""
    edges = np.zeros((len(rates), 3, 2))
    edges[:, :2] = np.linalg.inv(rates[:, 1, 1:3]).transpose(0, 2, 1)
    edges[~single, 2] = np.linalg.inv(rates[~single][:, 2, [1, 3]])[:, :, 1]
    return edges


def _turns(world: World, elements: Ints, first: Ints, second: Ints) -> Floats:
    """Rotations (p, 2, 2) from the frame of the second triangle to that of the first."""
    from clothsim.physics.energies.triangle_pairs import turns

    return turns(world, elements, np.stack([first, second], axis=1))
