"""The stages of a fit: what made the garment's shape, how long it took, and what is wrong with the shape."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from clothsim.arrays import Floats, Ints
from clothsim.fitting.penetration import Counts, counted
from transfer.signed_distance import BodySurface


@dataclass(frozen=True)
class Garment:
    """positions (n, 3) [m] as it lies on the body that it was made for; triangles (m, 3); notes: what was chosen.

    sewn: its panels were welded, so that three may meet in a seam.
    """

    name: str
    positions: Floats
    triangles: Ints
    notes: tuple[str, ...] = ()
    sewn: bool = False


@dataclass(frozen=True)
class Stage:
    """name; seconds it took; positions (n, 3) [m] after it; counts: of these on the body; said: what it did."""

    name: str
    seconds: float
    positions: Floats
    counts: Counts
    said: str = ""

    def as_dict(self) -> dict[str, Any]:
        """As the summary keeps it."""
        return {
            "name": self.name,
            "seconds": self.seconds,
            "penetrating_vertices": self.counts.penetrating_vertices,
            "depth": self.counts.depth,
            "intersecting_pairs": self.counts.body_pairs,
            "self_pairs": self.counts.self_pairs,
            "said": self.said,
        }


Heard = Callable[[Stage], None]
"""Called as each stage ends."""


def staged(
    name: str,
    triangles: Ints,
    body: BodySurface,
    make: Callable[[], tuple[Floats, str]],
    heard: Heard,
    started: float | None = None,
) -> Stage:
    """The stage that `make` makes: its positions and what it did; counted on `body`, heard by the caller's listener.

    started: where the stage began before this call, its `perf_counter`.
    """
    started = perf_counter() if started is None else started
    positions, said = make()
    seconds = perf_counter() - started
    stage = Stage(name, seconds, positions, counted(positions, triangles, body), said)
    heard(stage)
    return stage
