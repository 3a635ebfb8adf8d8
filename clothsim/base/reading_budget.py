"""Reading budgets: how much a file may promise, counted before it is built.

A few bytes can promise gigabytes: a number of frames, a compressed array, a curve that is flattened finely.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import prod
from typing import TypeVar

from clothsim.base.errors import InputError

MOST = {
    "numbers": 1 << 24,  # of a motion, frames x joints x 4: 11 minutes of 52 joints at 120 frames a second
    "bytes": 1 << 28,  # that the arrays of a motion unpack to
    "nodes": 10_000,  # of a character's file
    "values": 1 << 26,  # of all accessors of a character's file: overlapping ones and those without bytes too
    "weights": 1 << 26,  # vertices x joints of a character: 500 MB
    "points": 300_000,  # of the outlines of a drawing, after curves are flattened
    "points of a piece": 10_000,
    "panels": 1_000,  # of a sewing pattern; GarmentCode's largest have some 60
    "edges": 20_000,
    "stitches": 20_000,
    "points of a panel": 10_000,
}
"""Largest promise of a file, by what is counted."""

Item = TypeVar("Item")


@dataclass
class Budget:
    """Counts that one file declares, summed up.

    Attributes
    ----------
    name : str
        Name of the file, for the sentence.

    Examples
    --------
    >>> budget = Budget("walk.bvh")
    >>> budget.spend("numbers", 1000, 20, 4)
    >>> budget.spent["numbers"]
    80000
    """

    name: str
    spent: Counter[str] = field(default_factory=Counter)

    def spend(self, what: str, *shape: int) -> None:
        """Count the product of `shape`. InputError where all that was counted so is more than MOST[what]."""
        self.spent[what] += prod(shape)
        if self.spent[what] > MOST[what]:
            size = " x ".join(f"{each:,}" for each in shape)
            raise InputError(
                f"{self.name} declares more than the {MOST[what]:,} {what} that are read ({size} at once).",
                "Cut it into smaller files, or export it more coarsely.",
            )

    def counted(self, items: Iterable[Item], *kinds: str) -> Iterator[Item]:
        """The items, each counted as one of every kind of `kinds` before it is handed on."""
        for item in items:
            for what in kinds:
                self.spend(what, 1)
            yield item
