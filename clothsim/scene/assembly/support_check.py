"""Existence of a quasi-static equilibrium: a load on a cloth without any support has none."""

from collections.abc import Iterable, Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.constraint import Constraint
from clothsim.physics.energies.protocols import Anchored
from clothsim.physics.energies.step import Step

ROUND_OFF = 1e-9
"""Fraction of the forces on a piece below which their sum counts as zero: internal forces cancel to the last digits."""


def refuse_unsupported(world: World, energies: Mapping[str, Energy], constraints: Iterable[Constraint]) -> None:
    """Refuse a piece of cloth under a load without pin, spring, contact with a body, inertia or damping.

    Parameters
    ----------
    world : World
        Cloths and bodies at the start.
    energies : dict of str to Energy
        The effects that are on.
    constraints : iterable of Constraint
        The prescribed positions.

    Raises
    ------
    InputError
        With the name of the piece and its load.

    Notes
    -----
    The internal forces of a piece cancel, so that the sum of its forces is the load. With self_contact all pieces count
    as one, as one may lie on another.
    """
    # Friction resists only where there is contact, whose forces are known last.
    resisted = any(_resists(world, energy) for energy in energies.values() if not energy.begins_last)
    if resisted or "body_contact" in energies:
        return
    pieces = np.zeros(world.n_cloth, np.int64) if "self_contact" in energies else _pieces(world)
    held = np.zeros(world.n_vertices, bool)
    for constraint in constraints:
        held[constraint.at(0.0).vertices] = True
    for energy in energies.values():
        if isinstance(energy, Anchored):
            held[energy.anchored_rows] = True
    forces = _forces(world, energies)
    for piece in np.setdiff1d(pieces, pieces[held[: world.n_cloth]]):
        of_piece = np.flatnonzero(pieces == piece)
        load = float(np.linalg.norm(forces[of_piece].sum(axis=0)))
        if load > ROUND_OFF * np.linalg.norm(forces[of_piece], axis=1).sum():
            label = int(world.labels[of_piece[0]])
            own = of_piece[0] - world.cloth_slices[label].start
            part = f"the piece of {world.names[label]} with vertex {own}" if own else world.names[label]
            raise InputError(
                f"Nothing supports {part} against its load of {load:.3g} N: no pin of its own, no body_contact, no "
                "inertia.",
                "Pin some of its vertices, put a body under it (with effects.body_contact), or add effects.inertia.",
            )


def _resists(world: World, energy: Energy) -> bool:
    """True for an incremental energy with a force against a translation: damping of the strain rate has none."""
    if not energy.incremental:
        return False
    start = world.start()
    none = np.zeros_like(start)
    bound = energy.begin(Step(0.0, 1.0, start, none, 1.0, none))
    change = bound.gradient(start + 1.0) - bound.gradient(start)
    return bool(np.abs(change.sum(axis=0)).max() > ROUND_OFF * np.abs(change).sum())


def _pieces(world: World) -> Ints:
    """The number of the connected piece of each cloth vertex, (n_cloth,)."""
    ones = np.ones(len(world.edges))
    graph = coo_array((ones, tuple(world.edges.T)), shape=(world.n_cloth, world.n_cloth))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _forces(world: World, energies: Mapping[str, Energy]) -> Floats:
    """Minus the gradient of the energies at the start under full load, (n_cloth, 3) [N]; without those of contact."""
    start = world.start()
    none = np.zeros_like(start)
    step = Step(0.0, 1.0, start, none, 1.0, none)
    forces = none.copy()
    for energy in energies.values():
        if not energy.begins_last:
            forces -= energy.begin(step).gradient(start)
    return forces[: world.n_cloth]
