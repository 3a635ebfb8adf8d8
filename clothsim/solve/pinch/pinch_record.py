"""Record of carried vertices over a run, and the intersections that the policy of a pinch exempts."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from clothsim.base.arrays import Ints
from clothsim.mesh.world import Surface, World
from clothsim.solve.pinch.carried import carried_in
from clothsim.solve.stepping.state import State

if TYPE_CHECKING:
    from clothsim.geometry.intersection.crossings import Crossing


@dataclass(frozen=True)
class PinchRecord:
    """Carried vertices so far.

    Parameters
    ----------
    vertices : tuple of int
        Rows of x of all that were ever carried.
    most, now : int
        The most in one step, and those of the last one.
    steps : int
        Steps with any.
    released : int
        Releases.
    first_time, last_time : float or None
        Ends of the first and of the last step with any [s].
    first_position : (3,) tuple of float or None
        Their mean position at the end of the first one, in the coordinates of the scene [m].
    exempt_states : int
        Checked states in which triangles of carried vertices intersect.
    exempt_pairs : int
        The most such pairs of triangles in one state.
    """

    vertices: tuple[int, ...] = ()
    most: int = 0
    now: int = 0
    steps: int = 0
    released: int = 0
    first_time: float | None = None
    last_time: float | None = None
    first_position: tuple[float, ...] | None = None
    exempt_states: int = 0
    exempt_pairs: int = 0

    def after(self, world: World, before: State, state: State, found: "Sequence[Crossing]") -> Self:
        """Return the record after one more step from `before` to `state`, whose intersections are `found`."""
        was, now = (carried_in(each.memory).vertices for each in (before, state))
        exempt = sum(len(each.pairs) for each in found if each.role == "carried")
        more = replace(
            self,
            vertices=tuple(int(row) for row in np.union1d(self.vertices, now)),
            most=max(self.most, len(now)),
            now=len(now),
            released=self.released + len(np.setdiff1d(was, now)),
            exempt_states=self.exempt_states + (exempt > 0),
            exempt_pairs=max(self.exempt_pairs, exempt),
        )
        if not len(now):
            return more
        more = replace(more, steps=self.steps + 1, last_time=state.time)
        if self.first_time is not None:
            return more
        mean = state.positions[now].mean(axis=0) + world.origin
        return replace(more, first_time=state.time, first_position=tuple(float(each) for each in mean))

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of the certificate."""
        counts = {name: value for name, value in asdict(self).items() if name != "vertices"}
        exempt = "pairs of triangles of carried vertices, with bodies and with one another, are exempt from contact"
        return {"policy": "carry", "vertices": len(self.vertices), **counts, "exempt": exempt}


def record_from(fields: Mapping[str, Any]) -> PinchRecord:
    """Return the record that a checkpoint kept."""
    plain: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}
    return PinchRecord(**plain)


def exempted(found: "Sequence[Crossing]", surfaces: Sequence[Surface], vertices: Ints) -> "tuple[Crossing, ...]":
    """Separate the intersections of carried vertices (k,), rows of x: their role is "carried".

    With a body, those of triangles with a carried vertex; among cloth, those of two such triangles.
    """
    by_name = {s.name: np.asarray(np.isin(s.triangles, vertices).any(axis=1)) for s in surfaces}
    separated = []
    for crossing in found:
        exempt = by_name[crossing.first][crossing.pairs[:, 0]]
        if crossing.role == "cloth":
            exempt = exempt & by_name[crossing.second][crossing.pairs[:, 1]]
        for role, chosen in ((crossing.role, ~exempt), ("carried", exempt)):
            if chosen.any():
                separated.append(replace(crossing, pairs=crossing.pairs[chosen], role=role))
    return tuple(separated)
