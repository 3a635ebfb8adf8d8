"""Intersections of a run: exact check of its states, history and warnings. It shares no code with contact."""

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import IntersectionWarning
from clothsim.geometry.intersection.proved_separations import ProvedSeparations
from clothsim.mesh.world import SurfaceRows, world_surfaces
from clothsim.solve.stepping.failure import Failure, crossing_failure
from clothsim.solve.stepping.state import State

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing
    from clothsim.run.session import Session

_EFFECT_OF_ROLE = {"body": "body_contact", "cloth": "self_contact", "rigid": "body_contact"}
"""Effect that keeps cloth from intersecting a body or cloth, and rigid bodies from bodies."""

_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class IntersectionCheck:
    """Surfaces to check, and the pairs that a scene keeps free of intersections.

    All pairs of cloths, of cloth and body, and of rigid bodies and bodies are checked, whatever effects are on.

    Parameters
    ----------
    surfaces : tuple of SurfaceRows
        Cloths and bodies of the scene.
    on : frozenset of str
        Contact effects that are on.
    excluded : frozenset of frozenset of str
        Pairs of names that the scene excludes from contact.
    proofs : ProvedSeparations, optional
        Separations proved at the last state; None: each state is searched in full.
    """

    surfaces: tuple[SurfaceRows, ...]
    on: frozenset[str]
    excluded: frozenset[frozenset[str]]
    proofs: "ProvedSeparations | None" = None

    @property
    def cloths(self) -> bool:
        """True where the scene has a cloth that is not a rod."""
        return any(surface.role == "cloth" and not len(surface.edges) for surface in self.surfaces)

    @property
    def rods(self) -> bool:
        """True where the scene has a rod."""
        return any(len(surface.edges) for surface in self.surfaces)

    @property
    def bodies(self) -> bool:
        """True where the scene has a body."""
        return any(surface.role == "body" for surface in self.surfaces)

    @property
    def rigid(self) -> bool:
        """True where the scene has a rigid body that forces move."""
        return any(surface.rigid for surface in self.surfaces)

    def crossings(self, x: Floats, origin: Floats = _ORIGIN) -> "tuple[Crossing, ...]":
        """Find all intersections in x (N, 3) [m], which is relative to `origin` (3,)."""
        from clothsim.geometry.intersection.crossings import (
            crossings,  # kernels: a process that runs nothing does not load them
        )

        found = crossings(x, self.surfaces, proofs=self.proofs)
        return tuple(replace(crossing, position=crossing.position + origin) for crossing in found)

    def crossings_of(self, state: "State", origin: Floats) -> "tuple[Crossing, ...]":
        """Find all intersections in a state; those of vertices flypapered through a pinch have the role "carried"."""
        found = self.crossings(state.positions, origin)
        if not found or "contact.pinch" not in state.memory:
            return found
        from clothsim.solve.pinch.flypaper import (
            exempted,
            flypapered_in,  # runs without the policy do not import it
        )

        return exempted(found, self.surfaces, flypapered_in(state.memory).vertices)

    def kind(self, crossing: "Crossing") -> str:
        """Return the kind of a crossing.

        "cloth_body", "cloth_cloth", "rigid" of a rigid body, "excluded" by the scene, "carried" in a pinch.
        """
        if frozenset((crossing.first, crossing.second)) in self.excluded:
            return "excluded"
        if crossing.role in ("carried", "rigid"):
            return crossing.role
        return f"cloth_{crossing.role}"

    def violations(self, found: "Sequence[Crossing]") -> "list[Crossing]":
        """Return the crossings that an effect of the scene should have prevented."""
        return [each for each in found if _EFFECT_OF_ROLE.get(each.role) in self.on and self.kind(each) != "excluded"]

    @property
    def _passing(self) -> str:
        """The contacts without which a rod may pass through a line between two steps, and leave no trace in either."""
        needed = ["self_contact"] + ["body_contact"] * self.bodies
        off = [name for name in needed if name not in self.on]
        return f", not between steps: without {' and '.join(off)}" if off else ""

    def coverage(self, complete: bool = True) -> dict[str, str]:
        """Return a description of the checked pairs, for the certificate; complete: of all states."""
        checked = "checked at every step" if complete else "checked at every step since the run was resumed"
        kinds = {"cloth_body": checked if self.bodies else "no body", "cloth_cloth": checked}
        if not self.cloths:
            kinds = dict.fromkeys(kinds, NO_CLOTH)
        kinds |= {"rods": f"centre lines {checked}{self._passing}"} if self.rods else {}
        return kinds | ({"rigid": checked} if self.rigid else {})


def intersection_check_of(
    surfaces: Sequence[SurfaceRows],
    effects: Mapping[str, Any],
    on: Collection[str],
    proofs: "ProvedSeparations | None" = None,
) -> IntersectionCheck:
    """Make the check of a scene.

    effects: the scene's; `exclude` of a contact lists pairs of names; on: effects that are on; proofs: for the states
    of a run, one after another.
    """
    pairs = [pair for name in _EFFECT_OF_ROLE.values() if name in effects for pair in effects[name].exclude]
    acting = frozenset(_EFFECT_OF_ROLE.values()) & set(on)
    return IntersectionCheck(tuple(surfaces), acting, frozenset(map(frozenset, pairs)), proofs)


NO_CLOTH = "no cloth"
"""Coverage of the kinds with cloth in a scene of rigid bodies alone."""

KINDS = ("cloth_body", "cloth_cloth", "excluded")
"""Kinds of intersections: of cloth with a body, of cloth with cloth, of pairs that the scene excludes from contact."""

OPTIONAL = ("carried", "rigid")
"""Kinds of few scenes: of vertices that are flypapered in a pinch, which only its policy brings about, and of rigid
bodies with bodies."""

ALL_KINDS = (*KINDS, *OPTIONAL)

SURFACES_OF_KIND = {
    "cloth_body": "cloth and body",
    "cloth_cloth": "cloth and cloth",
    "excluded": "excluded pairs",
    "carried": "carried vertices",
    "rigid": "rigid bodies and bodies",
}
"""What intersects, in words."""

_EFFECT = {"cloth_body": "body_contact", "cloth_cloth": "self_contact", "rigid": "body_contact"}


@dataclass(frozen=True)
class Occurrences:
    """Occurrences of one kind of intersection in the checked states of a run.

    Parameters
    ----------
    pairs, most_pairs : int
        Pairs of triangles that intersect in the first such state, and the most in one state.
    states : int
        Number of such states: ends of steps, and the start.
    first_step, first_time : int, float or None
        The first such state: its step (0: the start) and time [s].
    first_frame : int or None
        The first recorded frame that intersects; None where there is none.
    surfaces, triangles : str
        The surfaces of the first such state that intersect, and one pair of their triangles.
    """

    pairs: int = 0
    most_pairs: int = 0
    states: int = 0
    first_step: int | None = None
    first_time: float | None = None
    first_frame: int | None = None
    surfaces: str = ""
    triangles: str = ""

    def after(self, found: "Sequence[Crossing]", state: "State", is_frame: bool) -> Self:
        """Return the occurrences after one more state, in which `found` intersect."""
        if not found:
            return self
        pairs = sum(len(crossing.pairs) for crossing in found)
        first_frame = state.frame if is_frame and self.first_frame is None else self.first_frame
        seen = replace(self, states=self.states + 1, most_pairs=max(self.most_pairs, pairs), first_frame=first_frame)
        if self.states:
            return seen
        others = f" ({len(found) - 1} other pairs of surfaces too)" if len(found) > 1 else ""
        first = replace(seen, pairs=pairs, first_step=state.step, first_time=state.time)
        return replace(first, surfaces=found[0].summary + others, triangles=found[0].sentence)


@dataclass(frozen=True)
class IntersectionHistory:
    """Intersections of all checked states so far.

    Parameters
    ----------
    cloth_body, cloth_cloth, excluded : Occurrences
        By kind.
    frames : tuple of int
        Recorded frames that intersect.
    complete : bool
        False where earlier states were not checked: those of a run that an older version began.
    carried, rigid : Occurrences
        Of vertices that are flypapered through a pinch, and of rigid bodies with bodies.
    """

    cloth_body: Occurrences = field(default_factory=Occurrences)
    cloth_cloth: Occurrences = field(default_factory=Occurrences)
    excluded: Occurrences = field(default_factory=Occurrences)
    frames: tuple[int, ...] = ()
    complete: bool = True
    carried: Occurrences = field(default_factory=Occurrences)
    rigid: Occurrences = field(default_factory=Occurrences)

    def after(self, check: "IntersectionCheck", found: "Sequence[Crossing]", state: "State", is_frame: bool) -> Self:
        """Return the history after one more checked state.

        check: the check that found them; found: its result, in the coordinates of the scene; is_frame: True where it is
        a recorded frame.
        """
        if not found:
            return self
        by_kind = {
            kind: getattr(self, kind).after([each for each in found if check.kind(each) == kind], state, is_frame)
            for kind in ALL_KINDS
        }
        return replace(self, **by_kind, frames=(*self.frames, state.frame) if is_frame else self.frames)

    @property
    def intersection_free(self) -> bool | None:
        """True where all pairs were checked in all states and none intersects; None where not all were checked."""
        if self.frames or any(getattr(self, kind).states for kind in ALL_KINDS):
            return False
        return True if self.complete else None

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the certificate, {kind: counts and first occurrence}."""
        kinds = (*KINDS, *(kind for kind in OPTIONAL if getattr(self, kind).states))
        return {kind: asdict(getattr(self, kind)) for kind in kinds}

    def as_json(self) -> dict[str, Any]:
        """Return every field, for the checkpoint."""
        return asdict(self)


def history_from(fields: Mapping[str, Any]) -> IntersectionHistory:
    """Return the history that `as_json` wrote."""
    kinds = {kind: Occurrences(**fields[kind]) for kind in ALL_KINDS if kind in fields}
    return IntersectionHistory(**kinds, frames=tuple(fields["frames"]), complete=fields["complete"])


def intersection_warnings(intersections: Mapping[str, Mapping[str, Any]], on: Collection[str] = ()) -> list[str]:
    """Sentences on the intersections of a run: surfaces, time, triangles and remedy.

    Parameters
    ----------
    intersections : mapping
        {kind: counts and first occurrence} as of `IntersectionHistory.as_dict` and the certificate.
    on : collection of str
        Contact effects that are on: what they should have prevented is a failure, not a warning.

    Examples
    --------
    >>> first = {"pairs": 3, "states": 9, "first_step": 12, "first_time": 0.24, "first_frame": 6}
    >>> names = {"surfaces": "cloth intersects itself", "triangles": "triangles 4 and 8 of cloth intersect near ... m"}
    >>> print(*intersection_warnings({"cloth_cloth": {**first, **names}}))  # doctest: +NORMALIZE_WHITESPACE
    cloth intersects itself, 3 pairs of triangles at 0.24 s, step 12 (9 checked states in all, the first recorded
    frame is 6): triangles 4 and 8 of cloth intersect near ... m. Add [effects.self_contact] to the scene.
    """
    return [
        _sentence(kind, each) for kind, each in intersections.items() if each["states"] and _EFFECT.get(kind) not in on
    ]


def occurrence_text(each: Mapping[str, Any]) -> str:
    """Return the counts and the first occurrence of one kind: "none", or pairs, time, step, states and frame."""
    if not each["states"]:
        return "none"
    pairs = f"{each['pairs']:,} pair{'' if each['pairs'] == 1 else 's'}"
    pairs += "" if each["triangles"].startswith("edge") else " of triangles"
    frame = "no recorded frame" if each["first_frame"] is None else f"the first recorded frame is {each['first_frame']}"
    states = f"{each['states']:,} checked state{'' if each['states'] == 1 else 's'} in all"
    return f"{pairs} at {each['first_time']:.4g} s, step {each['first_step']} ({states}, {frame})"


def _sentence(kind: str, each: Mapping[str, Any]) -> str:
    at_start = each["first_step"] == 0
    return f"{each['surfaces']}, {occurrence_text(each)}: {each['triangles']}. {_remedy(kind, at_start)}"


def _remedy(kind: str, at_start: bool) -> str:
    if kind == "excluded":
        return "The scene excludes the pair from contact."
    if kind == "carried":
        return "Their vertices are carried through a pinch (contact.pinch)."
    add = f"add [effects.{_EFFECT[kind]}] to the scene."
    if not at_start:
        return add.capitalize()
    apart = "weld borders that touch, or set seed.untangle" if kind == "cloth_cloth" else "or set seed.untangle"
    return f"Move them apart at the start, {apart}; then {add}"


def checked_step(
    session: "Session",
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

    intersections: as in the certificate; on: effects that are on; stacklevel: as of `warnings.warn`: the line of the
    user's code.
    """
    unwanted = {kind: intersections[kind] for kind in intersections if kind not in ("excluded", "carried")}
    for sentence in intersection_warnings(unwanted, on):
        warnings.warn(sentence, IntersectionWarning, stacklevel=stacklevel)
