"""Intersections over the steps of a run: counts, the first of each kind, and the verdict of the exact check."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing
    from clothsim.run.certificate.intersection_check import IntersectionCheck
    from clothsim.solve.stepping.state import State

KINDS = ("cloth_body", "cloth_cloth", "excluded")
"""Kinds of intersections: of cloth with a body, of cloth with cloth, of pairs that the scene excludes from contact."""

OPTIONAL = ("carried", "rigid")
"""Kinds of few scenes: of vertices that are carried through a pinch, which only its policy brings about, and of rigid
bodies with bodies."""

ALL_KINDS = (*KINDS, *OPTIONAL)

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
        Of vertices that are carried through a pinch, and of rigid bodies with bodies.
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

        Parameters
        ----------
        check : IntersectionCheck
            The check that found them.
        found : sequence of Crossing
            Its result, in the coordinates of the scene.
        state : State
            The checked state.
        is_frame : bool
            True where it is a recorded frame.
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
    pairs = f"{each['pairs']:,} pair{'' if each['pairs'] == 1 else 's'} of triangles"
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
