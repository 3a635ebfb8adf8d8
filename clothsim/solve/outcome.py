"""How a solve can end: every end has a name and a sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from clothsim.arrays import Floats


class Ending(Enum):
    """The named ends of a Newton solve; the value is the sentence, with blanks for the numbers."""

    CONVERGED = "The step converged."
    ITERATION_LIMIT = (
        "Newton did not reach {tolerance:.3g} m/s in {limit} iterations "
        "(it stood at {speed:.3g} m/s, {who} at {place})."
    )
    LINE_SEARCH = (
        "The line search found no lower energy along a descent direction "
        "(Newton stood at {speed:.3g} m/s, {who} at {place})."
    )
    NO_ROOM = "Contact leaves {who} at {place} no room to move (step fraction {fraction:.1e})."
    BLOCKED = "The scripted motion is blocked: {who} cannot go past {place}."
    NOT_FINITE = "A number in the step is not finite: {who} at {place}."
    SINGULAR = "The Newton matrix could not be made positive definite."

    @property
    def cause(self) -> str:
        """The end in a word or two: "iteration limit"."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True)
class Outcome:
    """An end: the row of x where it shows and its position (3,) [m], None where no place is known; the numbers."""

    ending: Ending
    row: int | None = None
    position: Floats | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """True for the one good end."""
        return self.ending is Ending.CONVERGED

    @property
    def sentence(self) -> str:
        """What happened and where, by the row of x; `told` says it by a name."""
        return self.told(f"vertex {self.row}")

    def told(self, who: str, position: Floats | None = None) -> str:
        """The sentence with `who` in the place of the vertex, and at `position (3,)` if not at the vertex's own."""
        where = self.position if position is None else position
        return self.ending.value.format(who=who, place="" if where is None else place_text(where), **self.numbers)


def outcome(ending: Ending, x: Floats | None = None, row: int | None = None, **numbers: float) -> Outcome:
    """The outcome that shows at a row of x (N, 3) [m]; numbers: the blanks of its sentence."""
    position = None if x is None or row is None else np.array(x[row])
    return Outcome(ending, row, position, numbers)


def place_text(position: Floats) -> str:
    """ "(0.1, 0.2, 0.3) m"; what is round-off beside the largest coordinate reads as 0."""
    least = 1e-9 * float(np.abs(position).max())
    return "(" + ", ".join(f"{c if abs(c) > least else 0.0:.4g}" for c in position) + ") m"
