"""Exact check of the steps of a simulation: its history, failures, and Python warnings."""

import warnings
from collections.abc import Collection, Mapping
from typing import Any

from clothsim.base.errors import IntersectionWarning
from clothsim.geometry.intersection.proved_separations import ProvedSeparations
from clothsim.mesh.world import world_surfaces
from clothsim.run.certificate.intersection_check import intersection_check_of
from clothsim.run.certificate.intersection_history import IntersectionHistory, intersection_warnings
from clothsim.run.session import Session
from clothsim.solve.stepping.failure import Failure, crossing_failure
from clothsim.solve.stepping.state import State


def checked_step(
    session: Session,
    history: IntersectionHistory,
    state: State,
    is_frame: bool,
    proofs: ProvedSeparations,
    dt: float = 0.0,
) -> tuple[IntersectionHistory, Failure | None]:
    """Check the state at the end of a step of `dt` [s]; the first intersection of a kind is a Python warning.

    proofs: those of any other state of the same surfaces; they become those of this one.

    Returns
    -------
    IntersectionHistory
        With this state, where it is accepted.
    Failure or None
        A failure where contact should have prevented the intersection.
    """
    built = session.built
    check = intersection_check_of(world_surfaces(built.world), session.scene.effects, built.energies, proofs)
    found = check.crossings_of(state, built.world.origin)
    broken = check.violations(found)
    if broken:
        return history, crossing_failure(broken[0], state, dt)
    after = history.after(check, found, state, is_frame)
    if after is not history:
        known, now = history.as_dict(), after.as_dict()
        new = {kind: now[kind] for kind in known if not known[kind]["states"]}
        warn_of(new, stacklevel=4)
    return after, None


def warn_of(intersections: Mapping[str, Mapping[str, Any]], on: Collection[str] = (), stacklevel: int = 3) -> None:
    """Give a Python warning for each kind of intersection that occurred, but for pairs that the scene lets cross.

    Parameters
    ----------
    intersections : mapping
        As in the certificate.
    on : collection of str
        Effects that are on.
    stacklevel : int
        As of `warnings.warn`: the line of the user's code.
    """
    unwanted = {kind: intersections[kind] for kind in intersections if kind not in ("excluded", "carried")}
    for sentence in intersection_warnings(unwanted, on):
        warnings.warn(sentence, IntersectionWarning, stacklevel=stacklevel)
