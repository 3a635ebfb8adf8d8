"""Bodies that lie or stand on their head: gravity of the drape is along y or z, so they are refused."""

from contextlib import suppress

import numpy as np

from clothsim.base.errors import InputError
from clothsim.garments.inputs import Figure
from transfer.body_frame import legs_score
from transfer.errors import TransferError

STANDS = 0.5
"""Least score of legs and head along an axis, as in `body_frame`."""
CLEARLY = 0.8
"""Least score with which a body is refused: what has no legs and head (a torso, a hand, a ball) is none of them."""
OTHERS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}
"""Directions from legs to head in which no body stands."""


def refuse_lying(figure: Figure) -> None:
    """InputError for a body whose legs and head are clearly along x, -y or -z, and not along y or z."""

    def score(axis: tuple[int, int, int]) -> float:
        return legs_score(figure.positions, figure.triangles, np.array(axis, np.float64))

    with suppress(TransferError):
        _ = figure.frame  # computed once for the whole fit
        return
    if max(score((0, 1, 0)), score((0, 0, 1))) >= STANDS:  # no feet, say
        return
    lies = [name for name, axis in OTHERS.items() if score(axis) >= CLEARLY]
    if lies:
        raise InputError(
            f"the body {figure.name} does not stand: from legs to head it is along {lies[0]}, gravity along -y or -z.",
            "Turn it so that its head is along y or z.",
        )
