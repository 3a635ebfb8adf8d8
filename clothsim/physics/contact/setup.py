"""Setup of the contact effects: scales, and the refusal of a start in contact."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.triangles import triangle_areas
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs, intersection_points
from clothsim.keys.typed_effects import ContactKeys
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
    _refuse_initial_contact(world, candidates, start, offset)
    heavy = _heavy_bodies(world) if surface.n_shared else ()
    return Barrier(candidates, d_hat, offset, world.vertex_areas, world.masses, kappa, adaptive, name, heavy)


def _heavy_bodies(world: World) -> tuple[HeavyBody, ...]:
    """The rigid bodies as loads on contact."""
    found = []
    for body, rows in zip(world.rigid, world.coordinate_slices, strict=True):
        shadow = 0.25 * float(triangle_areas(body.positions[body.triangles]).sum())
        found.append(HeavyBody(rows, body.masses, shadow))
    return tuple(found)


def _resolved_d_hat(name: str, world: World, surface: ContactSurface, d_hat: float | str) -> float:
    """d_hat [m]: "auto" from the mesh and the gaps of rigid bodies, else as given. InputError for one of cloth size."""
    default = default_d_hat(edge_lengths(world))
    if isinstance(d_hat, str):
        return min(default, _d_hat_below_rigid_gaps(world, surface, default))
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


def _d_hat_below_rigid_gaps(world: World, surface: ContactSurface, most: float) -> float:
    """The smallest gap of a rigid body and another body at the start, within a tenth of `most` and `most` [m].

    A block that lies half a millimetre above a floor is thrown up where the cloth's cells make d_hat a centimetre.
    """
    bodies = np.isin(world.names, [body.name for body in world.bodies])
    rigid = np.isin(world.names, [body.name for body in world.rigid])
    pairs = rigid[:, None] & bodies
    allowed = surface.allowed & (pairs | pairs.T)
    if not allowed.any():
        return most
    gap = Candidates(replace(surface, allowed=allowed), most, skin=0.0).minimum_gap(world.start())
    return float(np.clip(gap, 0.1 * most, most))


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


def _refuse_intersections(world: World, surface: ContactSurface, start: Floats) -> None:
    """InputError where surfaces that may touch intersect at the start: names the first pair of objects and a point."""
    for first, second in _checked_groups(surface):
        pairs = intersecting_pairs(start, first, None if surface.is_self_contact else second)
        labels = surface.labels[first[pairs[:, 0], 0]], surface.labels[second[pairs[:, 1], 0]]
        pairs = pairs[surface.allowed[labels]]
        if len(pairs):
            raise _intersecting(world, surface, start, first, second, pairs)


def _checked_groups(surface: ContactSurface) -> Iterator[tuple[Ints, Ints]]:
    """Groups of triangles to check: cloths against the second group, and each rigid body against the others."""
    first, second = surface.first.triangles, surface.second.triangles
    own = len(first) - surface.n_shared
    yield first[:own], second
    owners = surface.labels[first[own:, 0]]
    for label in np.unique(owners):
        yield first[own:][owners == label], second[surface.labels[second[:, 0]] != label]


def _intersecting(
    world: World, surface: ContactSurface, start: Floats, first: Ints, second: Ints, pairs: Ints
) -> InputError:
    a, b = first[pairs[0, 0]], second[pairs[0, 1]]
    one, other = world.names[surface.labels[a[0]]], world.names[surface.labels[b[0]]]
    at = ", ".join(f"{c:.4g}" for c in intersection_points(start, first, second, pairs[:1])[0] + world.origin)
    statement = f"{one} intersects itself" if one == other else f"{one} intersects {other}"
    return InputError(
        f"{statement} at the start, in {len(pairs):,} pairs of triangles; the first is at ({at}) m.",
        f"Move {'the cloth out' if a[0] < world.n_cloth else 'them apart'} (position, rotation_degrees), "
        "or exclude the pair (exclude).",
    )


def _refuse_initial_contact(world: World, candidates: Candidates, start: Floats, offset: float) -> None:
    """InputError where the gap at the start is round-off, or below the offset: names the pair."""
    gap = candidates.minimum_gap(start)
    if gap > CONTACT_ROUND_OFF * float(np.abs(start).max(initial=0.0)):
        return
    rows = candidates.closest_pair(start)
    one, other = (world.names[candidates.surface.labels[row]] for row in (rows[0], rows[-1]))
    at = ", ".join(f"{c:.4g}" for c in start[rows[0]] + world.origin)
    less = f", less than the offset of {offset:g} m" if offset else ", which is contact to round-off"
    raise InputError(
        f"{one} starts {gap + offset:.3g} m from {other} at ({at}) m{less}.",
        "Move it further away." if not offset else "Move it further away, or choose a smaller offset.",
    )
