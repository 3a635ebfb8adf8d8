"""Closing of seams under contact: springs that shorten draw the panels round the body; nothing ever intersects.

There is no gravity, and strong damping: what counts is the end. Darts and godets close first, then at one time
all seams of the torso and those of each sleeve, so that the panels approach the body as they were placed; then sleeves
and collars are sewn to the torso, which is held. Whether a seam is closed is measured; stiffer rounds follow. Pairs
whose gap is small become one vertex where the exact check allows it.
"""

from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from clothsim import Body, Run, Scene
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import build
from clothsim.garments.dress.limbs import Wearer, limbs_between
from clothsim.garments.dress.placement import is_of_arm
from clothsim.garments.dress.sewing_state import (
    Fabrics,
    SewingState,
    crosses_body,
    mean_edge,
    sewn_cloth,
    welded_where_closed,
    worst_gap,
)
from clothsim.garments.stages import Listener, dress_closing, named_stage, simulate_stage
from clothsim.patterns import MeshedSeam, Panel, PatternMesh
from transfer.signed_distance import BodySurface

SPEED = 0.5
"""Largest speed at which a gap closes [m/s]."""
SHORTEST = 0.3
"""Shortest time of closing [s]."""
STIFFNESS, STIFFER = 100.0, 5.0
"""Stiffness of a spring [N/m] and its growth in each round after all are closed: stiffer springs pull the fabric into
folds and take twice the iterations."""
FURTHER = 3
"""Bound on the rounds after all seams were drawn together once."""
PROGRESS, WIDE = 0.9, 2.0
"""Largest gap after one of these rounds, as a fraction of that before it and of the mean edge, above both of which the
next is not tried: what is between the sides does not give way to springs that are stiffer still. Nor is it where the
round found all within the limit, and no pair was welded after it."""
ON_TOP = ("collar", "hood", "lapel", "strap")
"""Words in the name of a panel that is sewn to the finished torso."""
DART, WITHIN, BELOW, ONTO = 0, 1, 2, 3
"""Order of seams: darts, seams round the torso and within sleeves, seams that join one piece of the torso below
another, seams that join the rest to the torso."""


@dataclass(frozen=True)
class SeamSprings:
    """SeamSprings of one seam.

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
class PhaseSprings:
    """Springs of a sewing phase from given positions, and what is held.

    Attributes
    ----------
    springs : tuple of SeamSprings
        Seams that are drawn together or kept together.
    stiffness : float
        Of each spring [N/m].
    held : (h,) int array
        Vertices that do not move.
    duration : float
        Time until the last seam is closed [s].
    friction : bool
        True for friction with the body.
    """

    springs: tuple[SeamSprings, ...]
    stiffness: float
    held: Ints
    duration: float
    friction: bool


@dataclass(frozen=True)
class SewingPhase:
    """Seams that one round of closing draws together.

    Attributes
    ----------
    closing, closed : tuple of MeshedSeam
        Seams that are drawn together, and seams that are kept together.
    factor : float
        Factor of the stiffness.
    hold : bool
        True: the torso does not move.
    friction : bool
        True: friction with the body; springs would pull a garment off that is closed round it.
    patient : bool
        True: pairs whose spring runs through the body wait. Once their neighbours are closed the panels lie on the
        torso, and a spring that ran through an arm passes below it.
    """

    closing: tuple[MeshedSeam, ...]
    closed: tuple[MeshedSeam, ...] = ()
    factor: float = 1.0
    hold: bool = False
    friction: bool = False
    patient: bool = False

    def springs(self, state: SewingState, surface: BodySurface) -> PhaseSprings:
        """The springs from the positions of `state`."""
        inset = insets(state.mesh)
        flat = [order_of(seam, state) == DART or bool(inset & _panels_of(seam)) for seam in self.closing]
        parts, time = [], 0.0
        for first in (True, False):
            group = [seam for seam, each in zip(self.closing, flat, strict=True) if each == first]
            springs = [pairs for seam in group if len(pairs := self.drawn_pairs(state, seam, surface))]
            if springs:
                span = max(SHORTEST, max(float(state.distances(pairs).max()) for pairs in springs) / SPEED)
                parts += [SeamSprings(pairs, time, time + span) for pairs in springs]
                time += span
        parts += [SeamSprings(state.pairs(seam), 0.0, SHORTEST) for seam in self.closed if len(state.pairs(seam))]
        held = torso(state) if self.hold else np.zeros(0, np.int64)
        return PhaseSprings(tuple(parts), self.factor * STIFFNESS, held, time, self.friction)

    def is_partial(self, state: SewingState, surface: BodySurface) -> bool:
        """True where open pairs of the seams wait, since their springs run through the body."""
        return self.patient and any(
            len(self.drawn_pairs(state, seam, surface)) < len(state.pairs(seam)) for seam in self.closing
        )

    def drawn_pairs(self, state: SewingState, seam: MeshedSeam, surface: BodySurface) -> Ints:
        """Pairs of a seam that are drawn together, (k, 2)."""
        pairs = state.pairs(seam)
        return pairs[~crosses_body(state.positions[pairs], surface)] if self.patient and len(pairs) else pairs


def sewing_phases(state: SewingState, surface: BodySurface) -> list[SewingPhase]:
    """Phases that draw every open seam together once; springs through the body wait.

    A skirt is sewn to a bodice that hangs on its closed shoulders: drawn together with them it would pull them down.
    A flounce cut as an arc has its ends before and behind the legs: it is sewn to its skirt first. Where a tight cuff
    began closed round its leg there is friction: it would slide to where the leg is thinner, and pull the garment off.
    """
    seams = [state.mesh.seams[k] for k in state.open_seams]
    order = [order_of(seam, state) for seam in seams]
    within, below, onto = (
        tuple(seam for seam, place in zip(seams, order, strict=True) if place in places)
        for places in ((DART, WITHIN), (BELOW,), (ONTO,))
    )
    ends = _ends_to_sew_later(state, within, below, surface)
    within = tuple(seam for seam in within if seam not in ends)
    planned = (
        SewingPhase(within, patient=True),
        SewingPhase(below, within, patient=True),
        SewingPhase(ends, within + below, patient=True),
        SewingPhase(onto, within + ends + below, hold=True, patient=True),
    )
    return [replace(phase, friction=bool(state.tight)) for phase in planned if phase.closing]


MOST = 0.5
"""Part of the springs of a seam that run through the body beyond which the others cannot draw it round."""


def _ends_to_sew_later(
    state: SewingState, within: tuple[MeshedSeam, ...], below: tuple[MeshedSeam, ...], surface: BodySurface
) -> tuple[MeshedSeam, ...]:
    """Seams of which springs run through the body, of two panels that are sewn to a piece above or below.

    They come round with that piece. Such are the seams of which most springs run through the body, as do those of all
    seams round the body of both their panels: nothing else draws these round it. And those with a spring through the
    body of two panels that hang from a piece above and are sewn round the body to one another alone, as a wide flounce
    of one leg that reaches past the other leg: closed first, it goes round both. A bodice is closed before what hangs
    from it pulls its open sides apart.
    """
    joining = [seam for seam in within if order_of(seam, state) == WITHIN]
    crossing = [crosses_body(state.positions[state.pairs(seam)], surface) for seam in joining]
    panels = [_panels_of(seam) for seam in joining]
    passing = set().union(*(pair for pair, hits in zip(panels, crossing, strict=True) if hits.mean() <= MOST))
    joined = {side.panel for seam in below for side in seam.stitch.sides}
    heights = {
        name: float((state.mesh.positions[rows] @ state.mesh.up).mean()) for name, rows in state.mesh.vertices.items()
    }
    hung = {min(_panels_of(seam), key=lambda name: (heights[name], name)) for seam in below}
    return tuple(
        seam
        for seam, pair, hits in zip(joining, panels, crossing, strict=True)
        if hits.any()
        and (
            (pair <= joined and not pair & passing)
            or (pair <= hung and all(pair == each for each in panels if pair & each))
        )
    )


def insets(mesh: PatternMesh) -> set[str]:
    """Panels that are sewn into a slit of another one, as godets: two edges that meet, to two that meet.

    They are sewn in with the darts, while the other panel is flat: drawn in while its own seams close, those at its
    sides would be caught between both sides of the garment.
    """
    found: dict[str, list[tuple[tuple[str, int], ...]]] = {}
    for seam in mesh.seams:
        sides = tuple((side.panel, side.edge) for side in seam.stitch.sides)
        for pair in (sides, sides[::-1]):
            found.setdefault(pair[0][0], []).append(pair)

    def meet(first: tuple[str, int], second: tuple[str, int]) -> bool:  # edges of one panel with a common corner
        number = len(mesh.pattern.panels[first[0]].edges)
        return first[0] == second[0] and (first[1] - second[1]) % number in (1, number - 1)

    return {
        name
        for name, pairs in found.items()
        if len(pairs) == 2 and all(meet(*each) for each in zip(*pairs, strict=True))
    }


def _panels_of(seam: MeshedSeam) -> set[str]:
    """Both panels of a seam, or the one."""
    return {side.panel for side in seam.stitch.sides}


def stiffer_phases(state: SewingState) -> list[SewingPhase]:
    """Phases with stiffer and stiffer springs, for seams that are not closed yet."""
    seams = tuple(state.mesh.seams[k] for k in state.open_seams)
    return [SewingPhase(seams, factor=STIFFER**number, friction=True) for number in range(1, FURTHER + 1)]


def order_of(seam: MeshedSeam, state: SewingState) -> int:
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
    if is_of_arm(first):
        return WITHIN
    across, up, ahead = np.abs(_panel_middle(second) - _panel_middle(first))
    if up > max(across, ahead):
        return BELOW
    # the lower edge of one panel sewn to the upper edge of another, whose middle need not lie below: the quarter of a
    # bodice is farther from the middle of its waistband across the body than upward, and the corners of half a circle
    # skirt are level with its waist
    mesh, shares = state.mesh, []
    for side in seam.stitch.sides:
        corners = mesh.positions[mesh.vertices[side.panel]]
        heights = corners @ mesh.up
        extent = float(np.ptp(heights))
        lies = extent < LYING * np.ptp(corners, axis=0).max()
        above = float((mesh.positions[mesh.edges[side]] @ mesh.up).mean() - heights.mean())
        shares.append(0.0 if lies else above / extent)  # of the panel's height
    return BELOW if shares[0] * shares[1] < 0 and min(map(abs, shares)) > EDGE else WITHIN


def _panel_middle(panel: Panel) -> Floats:
    """Middle of the corners of a panel where the pattern places it, y upward, (3,) [m]."""
    return np.asarray(panel.placed(panel.vertices).mean(axis=0), np.float64)


EDGE = 0.2
"""Least height of the middle of an edge above or below that of its panel, as a fraction of the panel's height, of an
upper or a lower edge: 0.5 where both are straight, 0 of a side."""
LYING = 0.02
"""Height of a panel, as a fraction of its largest extent, below which it lies level: it has no upper or lower edge."""


def is_on_top(panel: Panel) -> bool:
    """True for a collar or another piece that is sewn to the finished torso."""
    return any(word in panel.name.lower() for word in ON_TOP)


def torso(state: SewingState) -> Ints:
    """Vertices of the panels that are neither of an arm nor sewn on top."""
    panels = [panel for panel in state.mesh.pattern.panels.values() if not is_of_arm(panel) and not is_on_top(panel)]
    rows = [state.number[state.mesh.vertices[panel.name]] for panel in panels]
    return np.unique(np.concatenate([np.zeros(0, np.int64), *rows]))


CLOSED = 1.5
"""Gap of a closed seam while others are open, as a multiple of the distance at which contact begins."""
NEAR = 0.5
"""Gap of a closed seam once all were drawn together, as a fraction of the mean edge: at corners of several panels, in
cuffs and armpits contact keeps springs apart that the weld closes. It moves a vertex by a quarter of an edge at most,
which turns no triangle over; the drape relaxes it."""


@dataclass(frozen=True)
class ClosingResult:
    """End of the closing.

    Attributes
    ----------
    state : SewingState
        The garment at its end.
    failure : str
        Reason in a sentence; empty where all seams are closed.
    description : str
        Rounds, seconds and largest gap.
    runs : tuple of Run
        The rounds.
    between : tuple of str
        Limbs of the body between the sides of seams that stay open.
    """

    state: SewingState
    failure: str
    description: str
    runs: tuple[Run, ...]
    between: tuple[str, ...] = ()


def close(
    state: SewingState,
    wearer: Wearer,
    fabrics: Fabrics,
    folder: Path,
    listener: Listener | None,
    ends: float = np.inf,
) -> ClosingResult:
    """Draw all open seams together. InputError for a start that cannot be simulated.

    ends: the `process_time` at which a budget is spent, and the closing fails.

    After each round the pairs that are closed are welded: at the corners of several panels springs against contact
    would keep one another apart.
    """
    body, surface = wearer.body, wearer.surface
    runs: list[Run] = []
    waiting, further = deque(sewing_phases(state, surface)), deque(stiffer_phases(state))
    largest, limit = 0.0, np.inf
    while waiting or (state.open_seams and further):
        drawn = not waiting
        phase = further.popleft() if drawn else waiting.popleft()
        springs = phase.springs(state, surface)
        if phase.is_partial(state, surface):
            waiting.appendleft(replace(phase, patient=False))
        if not springs.springs:
            continue
        seams = []
        for spring in springs.springs:
            first, second = spring.pairs.T
            lines = {"from": {"vertices": first.tolist()}, "to": {"vertices": second.tolist()}, "match": "vertices"}
            seams.append({**lines, "start": spring.start, "end": spring.end, "stiffness": springs.stiffness})
        sections = dress_closing(mean_edge(state), seams, springs.held.tolist(), springs.duration, springs.friction)
        obstacle = Body(body.positions, body.triangles, name="body")
        scene = sections.scene(cloth=sewn_cloth(state, fabrics), body=obstacle)
        limit = CLOSED * contact_gap(scene) if waiting else NEAR * mean_edge(state)
        most = len(runs) + 1 + len(waiting) + len(further)
        label = f"close, round {len(runs) + 1} of at most {most}"
        run = simulate_stage(scene, folder / f"close{len(runs)}", named_stage(label, listener), ends=ends)
        completed, moved = run.status == "completed", state.moved_to(run.positions(-1))
        welded = welded_where_closed(moved, limit, surface) if completed else moved
        before, gap = largest, worst_gap(welded)[0]
        if drawn and before <= limit and (not completed or gap > limit):
            break  # stiffer springs opened what was closed: it stays as it was
        runs.append(run)
        if not completed:
            open_seam, between = _between_sides(moved, wearer, NEAR * mean_edge(state))
            failure = f"While the seams were closing: {run.reason} {open_seam}".strip()
            return ClosingResult(moved, failure, "", tuple(runs), between)
        idle = largest <= limit and len(welded.joined) == len(state.joined)
        state, largest = welded, gap
        if drawn and (idle or largest > max(WIDE * mean_edge(state), PROGRESS * before)):
            break
    seconds = sum(float(run.times[-1]) for run in runs)
    closed = f"pairs within {1e3 * limit:.2g} mm welded, largest gap left {1e3 * largest:.2g} mm"
    description = f"{len(runs)} rounds, {seconds:.2g} s; {closed}"
    failure, between = _between_sides(state, wearer, limit)
    return ClosingResult(state, failure, description, tuple(runs), between)


def _between_sides(state: SewingState, wearer: Wearer, limit: float) -> tuple[str, tuple[str, ...]]:
    """A sentence on the widest seam, if it is open by more than a limit [m], and the limbs between those of all."""
    gap, name = worst_gap(state)
    if gap <= limit:
        return "", ()
    own = [seam for seam in state.mesh.seams if seam.name == name]
    still_open = [state.mesh.seams[k] for k in state.open_seams]
    here, between = (limbs_between(state, seams, wearer, limit) for seams in (own, still_open))
    what = ", ".join(f"the {limb}" for limb in here) or "only cloth"
    counts = f"(at most {1e3 * limit:.2g} mm counts as closed)"
    sentence = f"Seam {name} stays open by {1e3 * gap:.3g} mm {counts}. Between its sides: {what}."
    return sentence, between


def contact_gap(scene: Scene) -> float:
    """Distance at which contact of the cloth with itself begins in a scene that gives its d_hat [m].

    Nothing else is built: a default d_hat may depend on the bodies.
    """
    alone = Scene(cloth=scene.cloth, effects={"self_contact": scene.effects["self_contact"]})
    contact: Any = build(alone).energies["self_contact"]
    return float(contact.activation_distance)


def stretch_range(stretches: Floats) -> tuple[float, float]:
    """1st and 99th percentile of principal stretches."""
    low, high = np.percentile(stretches, (1.0, 99.0))
    return float(low), float(high)
