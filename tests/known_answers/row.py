"""Row of the table of known answers: quantity, computed value, exact value, tolerance."""

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

from clothsim.base.errors import ClothsimError

ANY_ORDER = (-float("inf"), float("inf"))


@dataclass(frozen=True)
class Outcome:
    """A value beside the exact one.

    bar: the largest deviation that passes: a fraction of the exact value where unit is "", else in that unit; printed:
    exact value as docs/results/validation.md prints it, with which the computed one must agree in every digit; order:
    observed, to lie in orders; coarser: deviations on coarser meshes,
    of which it is; hinges: the value with hinges in place of the default bending. A row that compares
    nothing with a known value (a spread, a largest error) has exact 0.
    """

    value: float
    exact: float
    bar: float
    unit: str = ""
    printed: str = ""
    order: float | None = None
    orders: tuple[float, float] = ANY_ORDER
    hinges: float | None = None
    coarser: tuple[float, ...] = ()

    @property
    def deviation(self) -> float:
        """Value less exact: as a fraction of the exact value, or in the unit."""
        return self._from_exact(self.value)

    @property
    def deviation_of_hinges(self) -> float | None:
        """That of the value with hinges."""
        return None if self.hinges is None else self._from_exact(self.hinges)

    def _from_exact(self, value: float) -> float:
        difference = value - self.exact
        return difference if self.unit else difference / self.exact

    @property
    def wrong(self) -> str:
        """Short description of the failure; empty where the row passes."""
        if self.printed and not agrees(self.exact, self.printed):
            return f"the reference is {self.exact:.10g}, not {self.printed}"
        if not abs(self.deviation) <= self.bar:
            return "off by more than the bar"
        if self.order is not None and not self.orders[0] <= self.order <= self.orders[1]:
            return "order"
        return ""


@dataclass(frozen=True)
class Row:
    """A row: its name ("A1a"), what it asks, how it is found, and, where it is known to miss its bar, why."""

    name: str
    what: str
    run: Callable[[], Outcome]
    why: str = ""


@dataclass(frozen=True)
class Seen:
    """Outcome of a row and its CPU seconds; outcome None where it failed with a message, `wrong`."""

    row: Row
    outcome: Outcome | None
    wrong: str
    seconds: float

    @property
    def passed(self) -> bool:
        """True where nothing is wrong."""
        return not self.wrong


def seen(row: Row) -> Seen:
    """Run a row; an error of the package is a row that does not pass, never a crash."""
    started = process_time()
    try:
        outcome = row.run()
    except ClothsimError as error:
        return Seen(row, None, str(error), process_time() - started)
    return Seen(row, outcome, outcome.wrong, process_time() - started)


def agrees(value: float, printed: str) -> bool:
    """True where `value` rounds to the printed number, to one unit of its last digit."""
    places = len(printed.split(".")[1]) if "." in printed else 0
    return abs(value - float(printed)) <= 1.01 * 10.0**-places
