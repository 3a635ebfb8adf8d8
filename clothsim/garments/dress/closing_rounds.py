"""Rounds of closing: which seams are drawn together when, how stiff their strings are, and what is held."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.garments.dress.sewing_state import SewingState
from clothsim.garments.dress.sleeves import is_of_arm
from clothsim.garments.dress.strings import runs_through
from clothsim.patterns import Panel, Seam
from transfer.signed_distance import BodySurface

SPEED = 0.5
"""Largest speed at which a gap closes [m/s]."""
SHORTEST = 0.3
"""Shortest time of closing [s]."""
STIFFNESS, STIFFER = 100.0, 5.0
"""Stiffness of a string [N/m] and its growth in each round after all are closed: stiffer strings pull the fabric into
folds and take twice the iterations."""
FURTHER = 3
"""Bound on the rounds after all seams were drawn together once."""
ON_TOP = ("collar", "hood", "lapel", "strap")
"""Words in the name of a panel that is sewn to the finished torso."""
DART, WITHIN, BELOW, ONTO = 0, 1, 2, 3
"""Order of seams: darts, seams round the torso and within sleeves, seams that join one piece of the torso below
another, seams that join the rest to the torso."""


@dataclass(frozen=True)
class Strings:
    """Strings of one seam.

    Attributes
    ----------
    pairs : (k, 2) int array
        Vertices of the garment.
    start, end : float
        Time of closing [s].
    """

    pairs: Ints
    start: float
    end: float


@dataclass(frozen=True)
class Round:
    """One round of closing.

    Attributes
    ----------
    strings : tuple of Strings
        Seams that are drawn together or kept together.
    stiffness : float
        Of each string [N/m].
    held : (h,) int array
        Vertices that do not move.
    duration : float
        Time until the last seam is closed [s].
    friction : bool
        True for friction with the body.
    """

    strings: tuple[Strings, ...]
    stiffness: float
    held: Ints
    duration: float
    friction: bool


@dataclass(frozen=True)
class Turn:
    """Seams that a round closes.

    Attributes
    ----------
    closing, closed : tuple of Seam
        Seams that are drawn together, and seams that are kept together.
    factor : float
        Factor of the stiffness.
    hold : bool
        True: the torso does not move.
    friction : bool
        True: friction with the body; strings would pull a garment off that is closed round it.
    patient : bool
        True: pairs whose string runs through the body wait. Once their neighbours are closed the panels lie on the
        torso, and a string that ran through an arm passes below it.
    """

    closing: tuple[Seam, ...]
    closed: tuple[Seam, ...] = ()
    factor: float = 1.0
    hold: bool = False
    friction: bool = False
    patient: bool = False

    def made(self, state: SewingState, surface: BodySurface) -> Round:
        """The round from the positions of `state`."""
        darts = [seam for seam in self.closing if order_of(seam, state) == DART]
        others = [seam for seam in self.closing if order_of(seam, state) != DART]
        parts, time = [], 0.0
        for group in (darts, others):
            strings = [pairs for seam in group if len(pairs := self.drawn(state, seam, surface))]
            if strings:
                span = max(SHORTEST, max(float(state.distances(pairs).max()) for pairs in strings) / SPEED)
                parts += [Strings(pairs, time, time + span) for pairs in strings]
                time += span
        parts += [Strings(state.pairs(seam), 0.0, SHORTEST) for seam in self.closed if len(state.pairs(seam))]
        held = torso(state) if self.hold else np.zeros(0, np.int64)
        return Round(tuple(parts), self.factor * STIFFNESS, held, time, self.friction)

    def is_partial(self, state: SewingState, surface: BodySurface) -> bool:
        """True where open pairs of the seams wait, since their strings run through the body."""
        return self.patient and any(
            len(self.drawn(state, seam, surface)) < len(state.pairs(seam)) for seam in self.closing
        )

    def drawn(self, state: SewingState, seam: Seam, surface: BodySurface) -> Ints:
        """Pairs of a seam that are drawn together, (k, 2)."""
        pairs = state.pairs(seam)
        return pairs[~runs_through(state.positions[pairs], surface)] if self.patient and len(pairs) else pairs


def turns(state: SewingState) -> list[Turn]:
    """Turns that draw every open seam together once; strings through the body wait.

    A skirt is sewn to a bodice that hangs on its closed shoulders: drawn together with them it would pull them down.
    """
    seams = [state.mesh.seams[k] for k in state.open_seams]
    order = [order_of(seam, state) for seam in seams]
    within, below, onto = (
        tuple(seam for seam, place in zip(seams, order, strict=True) if place in places)
        for places in ((DART, WITHIN), (BELOW,), (ONTO,))
    )
    planned = (
        Turn(within, patient=True),
        Turn(below, within, patient=True),
        Turn(onto, within + below, hold=True, patient=True),
    )
    return [turn for turn in planned if turn.closing]


def further_turns(state: SewingState) -> list[Turn]:
    """Turns with stiffer and stiffer strings, for seams that are not closed yet."""
    seams = tuple(state.mesh.seams[k] for k in state.open_seams)
    return [Turn(seams, factor=STIFFER**number, friction=True) for number in range(1, FURTHER + 1)]


def order_of(seam: Seam, state: SewingState) -> int:
    """DART, WITHIN, BELOW or ONTO.

    Sleeves and collars that close while they are sewn on would drag the shoulders of the garment off the body.
    """
    first, second = (state.mesh.pattern.panels[side.panel] for side in seam.stitch.sides)
    if first is second:
        return DART
    if is_on_top(first) or is_on_top(second):
        return ONTO
    if is_of_arm(first) != is_of_arm(second):
        return ONTO
    across, up, ahead = np.abs(_middle(second) - _middle(first))
    return BELOW if up > max(across, ahead) and not is_of_arm(first) else WITHIN


def _middle(panel: Panel) -> Floats:
    """Middle of the corners of a panel where the pattern places it, y upward, (3,) [m]."""
    return np.asarray(panel.placed(panel.vertices).mean(axis=0), np.float64)


def is_on_top(panel: Panel) -> bool:
    """True for a collar or another piece that is sewn to the finished torso."""
    return any(word in panel.name.lower() for word in ON_TOP)


def torso(state: SewingState) -> Ints:
    """Vertices of the panels that are neither of an arm nor sewn on top."""
    panels = [panel for panel in state.mesh.pattern.panels.values() if not is_of_arm(panel) and not is_on_top(panel)]
    rows = [state.number[state.mesh.vertices[panel.name]] for panel in panels]
    return np.unique(np.concatenate([np.zeros(0, np.int64), *rows]))
