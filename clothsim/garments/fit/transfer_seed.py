"""Deformation transfer of a garment to another body as the start of a fit."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.garments.fit.markers import NO_MARKERS, marked_vertices
from clothsim.garments.fit.stage import Garment
from clothsim.garments.inputs import Figure
from transfer.body_parts import BodyParts
from transfer.correspond import correspond
from transfer.errors import TransferError


@dataclass(frozen=True)
class Transferred:
    """Garment positions (n, 3) [m], source body in the target's shape (k, 3) [m], registration in one line."""

    positions: Floats
    body: Floats
    description: str


def transferred(garment: Garment, source: Figure, target: Figure, markers: Floats = NO_MARKERS) -> Transferred:
    """The garment on the target, each triangle deformed as the body below it. TransferError as `transfer` has them.

    markers (k, 6): corresponding points of both (see `markers`); none: derived where the bodies differ in mesh.
    """
    from transfer.garment import transfer_garment

    body, description = target.positions, "the bodies share their mesh"
    if not np.array_equal(source.triangles, target.triangles):
        given = marked_vertices(markers, source, target) if len(markers) else None
        bodies = source.positions, source.triangles, target.positions, target.triangles
        registration = correspond(*bodies, given, parts=None if len(markers) else _parts(source, target))
        how = f"with {len(registration.markers)} {'derived' if registration.derived else 'given'} markers"
        how = how if len(registration.markers) else "part by part"
        body, description = registration.positions, f"{source.name} registered to {target.name} {how}"
    elif len(markers):
        description += ", so the markers are not needed"
    placed = transfer_garment(garment.positions, garment.triangles, source.positions, body, source.triangles)
    return Transferred(placed, body, description)


def _parts(*figures: Figure) -> tuple[BodyParts, BodyParts] | None:
    """Parts of both bodies; None where one is no standing body."""
    try:
        source, target = (figure.parts for figure in figures)
    except TransferError:
        return None
    return source, target
