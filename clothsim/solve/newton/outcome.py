"""Outcomes and iterates of a Newton solve: its end with a message, and the observer of each iterate."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from clothsim.base.arrays import Floats


class Ending(Enum):
    """Ends of a Newton solve; the value is the message, with blanks for the numbers."""

    CONVERGED = "The step converged."
    ITERATION_LIMIT = (
        "Newton did not converge in {limit} iterations: the last step was {speed:.3g} m/s at {who}, at {at} "
        "(tolerance {tolerance:.3g} m/s)."
    )
    LINE_SEARCH = (
        "The line search found no lower energy along a descent direction "
        "(the step was {speed:.3g} m/s at {who}, at {at})."
    )
    UNBALANCED = (
        "Forces do not balance: {force:.3g} N are left at {who}, at {at}, {percent:.0f} % of the largest force, "
        "though Newton's steps are short."
    )
    NO_ROOM = "Contact at {who}, at {at}, leaves no admissible step (fraction {fraction:.1e})."
    BLOCKED = "The prescribed motion is blocked by contact: {who} stops at {at}."
    SUNK = "Contact at {who}, at {at}, is too soft for its load: the cloth sinks into its barrier."
    NOT_FINITE = "The gradient or the Hessian is not finite at {who}, at {at}."
    SINGULAR = "The Newton matrix is not positive definite, and shifting its diagonal did not help."


@dataclass(frozen=True)
class Outcome:
    """End of a solve, with its location and numbers.

    Parameters
    ----------
    ending : Ending
        How the solve ended.
    row : int or None
        Row of x where the end shows.
    position : (3,) float64 or None
        Position of that row [m].
    numbers : mapping
        Values for the blanks of the message.
    """

    ending: Ending
    row: int | None = None
    position: Floats | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """True where the solve converged."""
        return self.ending is Ending.CONVERGED

    @property
    def sentence(self) -> str:
        """Message with the vertex named by its row of x."""
        return self.describe(f"vertex {self.row}")

    def describe(self, who: str, position: Floats | None = None) -> str:
        """Return the message about `who`, at `position (3,)` [m] if given, else at that of the row."""
        where = self.position if position is None else position
        return self.ending.value.format(who=who, at="" if where is None else position_text(where), **self.numbers)


def outcome(ending: Ending, x: Floats | None = None, row: int | None = None, **numbers: float) -> Outcome:
    """Make an outcome located at a row of x (N, 3) [m]; numbers: values for the blanks of its message.

    >>> outcome(Ending.SINGULAR).sentence
    'The Newton matrix is not positive definite, and shifting its diagonal did not help.'
    """
    position = None if x is None or row is None else np.array(x[row])
    return Outcome(ending, row, position, numbers)


def position_text(position: Floats) -> str:
    """Format a position; components below round-off of the largest read as 0.

    >>> position_text(np.array([0.1, 0.2, 1e-12]))
    '(0.1, 0.2, 0) m'
    """
    least = 1e-9 * float(np.abs(position).max())
    return "(" + ", ".join(f"{c if abs(c) > least else 0.0:.4g}" for c in position) + ") m"


@dataclass(frozen=True)
class Iterate:
    """One Newton iterate: x (N, 3) [m] and the step that led to it.

    Parameters
    ----------
    x : (N, 3) float64
        Positions [m].
    fraction : float
        Fraction of the step that was taken: 0 at the start, nan after a nonlinear elimination.
    speed : float
        |dx|_inf / dt of the full step [m/s]; nan where there was none.
    residual : float
        Largest force where the step began [N]; nan where it is unknown.
    """

    x: Floats
    fraction: float = 0.0
    speed: float = np.nan
    residual: float = np.nan


Observer = Callable[[Iterate], None]
"""Callback with the start of a solve, then with each iterate."""


def unobserved(iterate: Iterate) -> None:
    """Observe nothing."""
