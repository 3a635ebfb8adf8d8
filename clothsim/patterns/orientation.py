"""Orientation of panels: which of them are turned so that the sewn surface has one front."""

from collections import deque
from collections.abc import Mapping

from clothsim.base.errors import InputError
from clothsim.patterns.pattern import Pattern


def turned_panels(pattern: Pattern) -> Mapping[str, bool]:
    """Panels whose front is turned over against the direction of their loop.

    A stitch whose start meets the end of its partner joins equal fronts, one of right on wrong opposite fronts. In each
    piece of the garment the larger part of the panels keeps its front.

    Raises
    ------
    InputError
        Stitches that ask for both: the sewn surface would have one side (a Moebius band).
    """
    beside: dict[str, list[tuple[str, bool, int]]] = {name: [] for name in pattern.panels}
    for number, stitch in enumerate(pattern.stitches):
        a, b = (side.panel for side in stitch.sides)
        beside[a].append((b, stitch.right_wrong, number))
        beside[b].append((a, stitch.right_wrong, number))
    turned: dict[str, bool] = {}
    for first in pattern.panels:
        if first in turned:
            continue
        piece = _piece(first, beside)
        opposite = sum(piece.values()) > len(piece) / 2
        turned |= {name: value != opposite for name, value in piece.items()}
    return turned


def _piece(first: str, beside: Mapping[str, list[tuple[str, bool, int]]]) -> dict[str, bool]:
    """Panels sewn to `first`, True where their front is opposite to its own."""
    piece, waiting = {first: False}, deque([first])
    while waiting:
        name = waiting.popleft()
        for other, opposite, number in beside[name]:
            if other not in piece:
                piece[other] = piece[name] != opposite
                waiting.append(other)
            elif piece[other] != (piece[name] != opposite):
                raise InputError(
                    f"Stitch {number} of {name} and {other} gives the garment one side only (a Moebius band).",
                    "Turn that stitch: right_wrong joins opposite fronts.",
                )
    return piece
