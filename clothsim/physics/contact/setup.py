"""Setup of the contact effects: scales, offsets of rods, and the refusal of a start in contact.

A rod comes into contact by its centre line: its vertices against triangles and its edges against edges, in the search,
the CCD and the barrier of all others. Its surface is where the offset says: 2 r between rods, r between rod and body.
The offset is one number of an effect, so that all that takes part must be rods of one radius.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.triangles import triangle_areas
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
from clothsim.keys.typed_effects import ContactKeys
from clothsim.mesh.rod import Rod
from clothsim.mesh.topology import unique_edges
from clothsim.mesh.world import World
from clothsim.physics.contact.barrier import Barrier
from clothsim.physics.contact.candidates import Candidates
from clothsim.physics.contact.stiffness import HeavyBody, default_d_hat
from clothsim.physics.contact.surface import ContactSurface

CONTACT_ROUND_OFF = 64 * float(np.finfo(float).eps)
"""Fraction of the largest coordinate below which a gap at the start is round-off."""

LEAST_D_HAT = 2.0**24 * float(np.finfo(float).eps)
"""Smallest d_hat as fraction of the largest coordinate. Impacts close a gap to a thousandth of d_hat, whose changes are
then known to four digits; at 1e-9 m on a cloth of .5 m Newton's method did not converge, or a body went through."""


def contact_energy(world: World, keys: ContactKeys, surface: ContactSurface) -> Barrier:
    """Barrier of a contact effect on the primitives that may touch.

    Raises
    ------
    InputError
        d_hat does not suit the mesh, or surfaces intersect or touch at the start.
    """
    name, offset = keys.name, keys.offset
    d_hat = _resolved_d_hat(name, world, surface, keys.d_hat)
    adaptive = isinstance(keys.stiffness, str)
    kappa = 1.0 if isinstance(keys.stiffness, str) else keys.stiffness
    start = world.start()
    _refuse_intersections(world, surface, start)
    candidates = Candidates(surface, d_hat + offset, skin=0.7 * d_hat, offset=offset)
    gap = candidates.minimum_gap(start)
    if not gap > CONTACT_ROUND_OFF * float(np.abs(start).max(initial=0.0)):
        pair = candidates.closest_pair(start)
        one, other = (world.names[surface.labels[row]] for row in (pair[0], pair[-1]))
        at = ", ".join(f"{c:.4g}" for c in start[pair[0]] + world.origin)
        less = f", less than the offset of {offset:g} m" if offset else ", which is contact to round-off"
        raise InputError(
            f"{one} starts {gap + offset:.3g} m from {other} at ({at}) m{less}.",
            "Move it further away." if not offset else "Move it further away, or choose a smaller offset.",
        )
    heavy = []  # the rigid bodies as loads on contact
    if surface.n_shared:
        for body, rows in zip(world.rigid, world.coordinate_slices, strict=True):
            shadow = 0.25 * float(triangle_areas(body.positions[body.triangles]).sum())
            heavy.append(HeavyBody(rows, body.masses, shadow))
    return Barrier(candidates, d_hat, offset, world.vertex_areas, world.masses, kappa, adaptive, name, tuple(heavy))


def _refuse_intersections(world: World, surface: ContactSurface, start: Floats) -> None:
    """InputError where surfaces that may touch intersect at the start: names the first pair of objects and a point.

    Cloths are checked against the second group, and each rigid body against the others.
    """
    first, second = surface.first.triangles, surface.second.triangles
    own = len(first) - surface.n_shared
    owners, others = surface.labels[first[own:, 0]], surface.labels[second[:, 0]]
    of_rigid = [(first[own:][owners == label], second[others != label]) for label in np.unique(owners)]
    for one, other in [(first[:own], second), *of_rigid]:
        pairs = intersecting_pairs(start, one, None if surface.is_self_contact else other)
        labels = surface.labels[one[pairs[:, 0], 0]], surface.labels[other[pairs[:, 1], 0]]
        pairs = pairs[surface.allowed[labels]]
        if not len(pairs):
            continue
        a, b = one[pairs[0, 0]], other[pairs[0, 1]]
        names = [world.names[surface.labels[rows[0]]] for rows in (a, b)]
        at = ", ".join(f"{c:.4g}" for c in intersection_points(start, one, other, pairs[:1])[0] + world.origin)
        statement = f"{names[0]} intersects {'itself' if names[0] == names[1] else names[1]}"
        raise InputError(
            f"{statement} at the start, in {len(pairs):,} pairs of triangles; the first is at ({at}) m.",
            f"Move {'the cloth out' if a[0] < world.n_cloth else 'them apart'} (position, rotation_degrees), "
            "or exclude the pair (exclude).",
        )


def _resolved_d_hat(name: str, world: World, surface: ContactSurface, d_hat: float | str) -> float:
    """d_hat [m]: "auto" from the mesh and the gaps of rigid bodies, else as given. InputError for one of cloth size."""
    default = default_d_hat(edge_lengths(world))
    if isinstance(d_hat, str):
        # A block half a millimetre above a floor is thrown up where the cloth's cells make d_hat a centimetre: at most
        # the smallest gap of a rigid body and another body at the start, and at least a tenth of the default.
        bodies = np.isin(world.names, [body.name for body in world.bodies])
        pairs = np.isin(world.names, [body.name for body in world.rigid])[:, None] & bodies
        allowed = surface.allowed & (pairs | pairs.T)
        if not allowed.any():
            return default
        gap = Candidates(replace(surface, allowed=allowed), default, skin=0.0).minimum_gap(world.start())
        return min(default, float(np.clip(gap, 0.1 * default, default)))
    coordinate = float(np.abs(world.start()).max())
    if d_hat < LEAST_D_HAT * coordinate:
        raise InputError(
            f"effects.{name}.d_hat is {d_hat:g} m, below {LEAST_D_HAT * coordinate:.2g} m: at coordinates of "
            f"{coordinate:.3g} m double precision cannot resolve changes of such gaps.",
            f"d_hat is the gap below which contact forces act: {default:g} m suits the mesh.",
        )
    size = float(np.ptp(world.moved(), axis=0).max())
    if d_hat >= size:
        whole = "the whole cloth is" if world.cloths else "all rigid bodies together are"
        raise InputError(
            f"effects.{name}.d_hat is {d_hat:g} m, and {whole} {size:.3g} m long.",
            f"d_hat is the gap below which contact forces act: {default:g} m suits the mesh.",
        )
    return d_hat


def d_hat_below_rest_gaps(world: World, surface: ContactSurface) -> float:
    """A tenth of the median edge, or half of the smallest rest gap of parts of one cloth where that is less [m]."""
    default = default_d_hat(edge_lengths(world))
    within_one_cloth = replace(surface, allowed=surface.allowed & np.eye(len(surface.allowed), dtype=bool))
    gap = Candidates(within_one_cloth, default, skin=0.0).minimum_gap(surface.rest_positions)
    return default if gap > default else max(0.5 * gap, 0.1 * default)


def edge_lengths(world: World) -> Floats:
    """Lengths of the cloths' edges at the start, without cloth those of the rigid bodies, (e,) [m]."""
    edges = (
        world.edges
        if world.cloths
        else np.concatenate(
            [
                unique_edges(body.triangles) + rows.start
                for body, rows in zip(world.rigid, world.rigid_slices, strict=True)
            ]
        )
    )
    return np.asarray(np.linalg.norm(np.diff(world.start()[edges], axis=1)[:, 0], axis=1), np.float64)


Keys = TypeVar("Keys", bound=ContactKeys)
D_HAT = 0.1
"""Default of d_hat over the length of an edge."""


def with_offset_of_rods(world: World, keys: Keys, radii: int) -> Keys:
    """The keys of a contact with the offset of the rods of the world; unchanged where there is none.

    radii: number of radii between the centre lines, 2 of rods and 1 of a rod and a body.

    Raises
    ------
    InputError
        Where the scene has cloth or rigid bodies beside rods, rods of two radii, or edges that are shorter than the rod
        is thick: it names the rod.
    """
    if not world.rods:
        return keys
    first = world.rods[0][0]
    others = [cloth.name for cloth in world.cloths if not isinstance(cloth, Rod)]
    others += [body.name for body in world.rigid]
    if others:
        raise InputError(
            f"{keys.section}: rods ({first.name}) do not touch cloth or rigid bodies ({others[0]}) yet.",
            "Leave out the contact, or the rod; `stiffeners` are rods along edges of cloth.",
        )
    for rod, _ in world.rods:
        if rod.radius != first.radius:
            raise InputError(
                f"{keys.section}: {first.name} has a radius of {first.radius:g} m, {rod.name} of {rod.radius:g} m.",
                "Rods in contact need one radius.",
            )
        shortest = float(rod.lengths.min())
        thickness = 2 * rod.radius + (D_HAT * shortest if isinstance(keys.d_hat, str) else keys.d_hat)
        if shortest <= thickness:
            raise InputError(
                f"{rod.name} has an edge of {shortest:g} m, less than its thickness with d_hat of {thickness:g} m.",
                "Give it fewer points, or a smaller radius or d_hat.",
            )
    return keys.with_keys(offset=keys.offset + radii * first.radius)
