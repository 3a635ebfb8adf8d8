"""How a solve can end: every end has a name and a sentence."""

from dataclasses import dataclass
from enum import Enum


class Ending(Enum):
    """The named ends of a Newton solve; the value is the sentence, with blanks for the numbers."""

    CONVERGED = "The step converged."
    ITERATION_LIMIT = "Newton did not reach {tolerance:.3g} m/s in {limit} iterations (it stood at {speed:.3g} m/s)."
    LINE_SEARCH = "The line search found no lower energy along a descent direction (Newton stood at {speed:.3g} m/s)."
    NO_ROOM = "Contact leaves vertex {vertex} at {place} no room to move (step fraction {fraction:.1e})."
    BLOCKED = "The scripted motion is blocked: vertex {vertex} at {place} is {left:.3g} m from its place."
    NOT_FINITE = "A number in the step is not finite: vertex {vertex} at {place}."
    SINGULAR = "The Newton matrix could not be made positive definite."


@dataclass(frozen=True)
class Outcome:
    """An end and the sentence that says where."""

    ending: Ending
    sentence: str

    @property
    def converged(self) -> bool:
        """True for the one good end."""
        return self.ending is Ending.CONVERGED


def outcome(ending: Ending, **numbers: object) -> Outcome:
    """The outcome with the blanks of its sentence filled."""
    return Outcome(ending, ending.value.format(**numbers))
