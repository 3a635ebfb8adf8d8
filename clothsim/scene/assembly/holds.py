"""Support of each connected piece of cloth at the start: pins, springs, seams, bodies in the way of its load.

A load on a piece that nothing can hold has no equilibrium: a quasi-static run of it is refused, and a run until rest
goes to its limit. Held is what may come to be held: a body counts that the piece could meet on its way along its load.
Named is what is nearest: pins and the like before all, the pieces that lie between before the body under them all, and
a rigid body, which falls itself, where there is nothing else.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.triangles import connected
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Energy, Step
from clothsim.physics.energies.protocols import Anchored, ChangingMaterial, Driven, Joining, is_idle

ROUND_OFF = 1e-9
"""Fraction of the forces on a piece below which their sum counts as zero: internal forces cancel to the last digits."""
MARGIN, DRIVEN_MARGIN = 0.1, 1.0
"""Width across the load, as fraction of its size, by which a piece may move aside; where wind or pressure drive it."""
LEVEL = 1e-3
"""Difference of depth, as fraction of the size across, up to which pieces lie at the same depth."""
TIMES = 17
"""Times at which a moving body is looked at, over the duration."""
MOST_LINES, MOST_NAMES = 8, 3
MANY = 64
"""Pieces from which on bodies are looked at as boxes, and each piece counts as held by the others."""


@dataclass(frozen=True)
class Hold:
    """What may hold a piece of cloth.

    Parameters
    ----------
    cloth : str
        Name.
    vertex : int
        Its first vertex, counted in the cloth; 0 for a cloth of one piece.
    holders : tuple of str
        What holds it; empty for nothing.
    load : (3,) ndarray
        Sum of the forces on it [N]; 0 where that is round-off.
    way : tuple of str
        Bodies that something tied may come to lie on.
    """

    cloth: str
    vertex: int
    holders: tuple[str, ...]
    load: Floats
    way: tuple[str, ...] = ()

    @property
    def falls(self) -> bool:
        """Whether it has a load and nothing that could hold it."""
        return not self.holders and bool(self.load.any())

    @property
    def name(self) -> str:
        """The piece in words."""
        return f"the piece of {self.cloth} with vertex {self.vertex}" if self.vertex else self.cloth


def holds(
    world: World, energies: Mapping[str, Energy], constraints: Iterable[Constraint], duration: float
) -> tuple[Hold, ...]:
    """What may hold each connected piece of cloth, in the order of their first vertices.

    Stitches join pieces, springs and pins hold them. With body_contact a body holds what its load moves towards it
    within `duration` [s]; with self_contact so does a piece that is held itself.
    """
    start, count = world.start(), world.n_cloth
    pairs = [world.edges]
    for energy in energies.values():
        if isinstance(energy, Joining):
            joined = energy.joined_rows
            pairs += [joined[:, [0, k]] for k in range(1, joined.shape[1])]
    edges = np.concatenate(pairs)
    edges = edges[(edges < count).all(axis=1)]
    labels = connected(edges[:, 0], edges[:, 1], count)  # the piece of each cloth vertex; stitches connect
    if not count:
        return ()
    pieces = np.split(np.argsort(labels, kind="stable"), np.cumsum(np.bincount(labels))[:-1])
    pieces = sorted(pieces, key=lambda rows: int(rows[0]))
    held: dict[str, Ints] = {}  # rows that each group of pins, and each effect, ties to places, by its name
    for constraint in constraints:
        rows = constraint.at(0.0).vertices
        rows = rows[rows < count]
        names = np.array([constraint.holder(int(row)) or "pins" for row in rows])
        held |= {str(name): rows[names == name] for name in np.unique(names)}
    for name, energy in energies.items():
        if isinstance(energy, Anchored):
            held[name] = np.unique(energy.anchored_rows[energy.anchored_rows < count])
    # minus the gradient of the energies at the start under full load, (n_cloth, 3) [N]; without those of contact
    none = np.zeros_like(start)
    step = Step(0.0, 1.0, start, none, 1.0, none)
    forces = none.copy()
    for energy in energies.values():
        if energy.depends_on_other_energies:
            continue
        bound = energy.at(0.0) if isinstance(energy, ChangingMaterial) else energy.begin(step)
        if not is_idle(bound):
            forces -= bound.gradient(start)
    forces = forces[:count]
    bodies = _bodies(world, duration, len(pieces) > MANY) if "body_contact" in energies else []
    driven = any(isinstance(energy, Driven) for energy in energies.values())
    loads = [_load(forces[rows]) for rows in pieces]
    margin = DRIVEN_MARGIN if driven else MARGIN
    swept = [_SweptBox.of(start[rows], load, margin) for rows, load in zip(pieces, loads, strict=True)]
    friction = ", with friction" if "friction" in energies else ""
    rigid = {body.name for body in world.rigid}
    found, ways = list[list[str]](), list[tuple[str, ...]]()
    for rows, box in zip(pieces, swept, strict=True):
        tied = [f"{name} ({number:,})" for name, by in held.items() if (number := int(np.isin(rows, by).sum()))]
        met = [(name, points) for name, points in bodies if box.meets(points)]
        fixed = [each for each in met if each[0] not in rigid]
        under = [name for name, _ in fixed or met]
        if not tied and under and "self_contact" in energies and len(pieces) <= MANY:
            top = min((box.depth(points)[0] for _, points in fixed), default=np.inf)
            between = box.nearest([start[each] for each in pieces if each is not rows], top)
            others = [each for each in pieces if each is not rows]
            under = [Hold(*_place(world, others[j]), (), np.zeros(3)).name for j in between] or under
        found.append(tied or [f"{_listed(under)} under it{friction}"] * bool(under))
        ways.append(tuple(name for name, _ in fixed) if tied else ())
    if "self_contact" in energies:
        _add_held_pieces(world, start, pieces, swept, found)
    return tuple(
        Hold(*_place(world, rows), tuple(holders), load, way)
        for rows, holders, load, way in zip(pieces, found, loads, ways, strict=True)
    )


def _listed(names: Sequence[str]) -> str:
    """The first MOST_NAMES names, and how many there are besides."""
    more = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]) + (f" and {more:,} more" if more > 0 else "")


def refuse_unsupported(found: Sequence[Hold], world: World, energies: Mapping[str, Energy]) -> None:
    """Refuse a piece of cloth under a load without a hold, inertia or damping. InputError with its name and load."""
    # Friction resists only where there is contact, whose forces are known last.
    if any(_resists(world, energy) for energy in energies.values() if not energy.depends_on_other_energies):
        return
    for each in found:
        if each.falls:
            load = float(np.linalg.norm(each.load))
            raise InputError(
                f"Nothing supports {each.name} against its load of {load:.3g} N: no pin, spring or seam holds it, no "
                "body is under it that it could touch, and there is no inertia.",
                "Pin some of its vertices, put a body under it (with effects.body_contact), or add effects.inertia.",
            )


def missed_bodies(found: Sequence[Hold], world: World, energies: Mapping[str, Energy]) -> list[str]:
    """A warning on each cloth that starts at rest and whose load takes it past all bodies that it could touch."""
    if "body_contact" not in energies or not world.bodies:
        return []
    still = {cloth.name for cloth in world.cloths if not np.any(cloth.velocity)}
    falling = {
        each.cloth: each.load / np.linalg.norm(each.load) for each in found if each.falls and each.cloth in still
    }
    ways = {name: ", ".join(f"{c:.2g}" for c in way + 0.0) for name, way in falling.items()}
    return [
        f"There is no body in the way of {name}, which falls along ({way}): look at the position and the up of both."
        for name, way in ways.items()
    ]


def hold_notes(found: Sequence[Hold]) -> list[str]:
    """A line on each piece that has a load, those of a cloth with the same holders together."""
    groups: dict[tuple[str, tuple[str, ...], tuple[str, ...]], list[Hold]] = defaultdict(list)
    for each in found:
        if each.load.any():
            groups[each.cloth, each.holders, each.way].append(each)
    lines = []
    for (cloth, holders, way), members in groups.items():
        name = members[0].name if len(members) == 1 else f"{len(members):,} pieces of {cloth}"
        besides = f"; on its way: {_listed(way)}" if way else ""
        lines.append(f"{name}: held by {', '.join(holders) or 'nothing'}{besides}.")
    more = len(lines) - MOST_LINES
    return lines if more <= 0 else [*lines[:MOST_LINES], f"{more:,} more such lines."]


@dataclass(frozen=True)
class _SweptBox:
    """What a piece could meet on its way along a load: `low` and `high` (3,) in `axes`, of which the last is the load.

    Everything where there is no load. deepest: end of the piece itself along the load [m].
    """

    axes: Floats
    low: Floats
    high: Floats
    deepest: float

    @staticmethod
    def of(points: Floats, load: Floats, margin: float) -> "_SweptBox":
        down = load / np.linalg.norm(load) if load.any() else np.array([0.0, 0.0, -1.0])
        axes = np.linalg.svd(down[None])[2][[1, 2, 0]]  # rows: two across, one along
        axes[2] = down
        low, high = _box(points @ axes.T)
        aside = margin * float(np.linalg.norm(high - low)) if load.any() else np.inf
        back = aside if np.isinf(aside) else 0.0
        far = np.array([high[0] + aside, high[1] + aside, np.inf])
        return _SweptBox(axes, low - [aside, aside, back], far, float(high[2]))

    def meets(self, points: Floats) -> bool:
        """Whether the box of points overlaps."""
        low, high = _box(points @ self.axes.T)
        return bool((low <= self.high).all() and (high >= self.low).all())

    def depth(self, points: Floats) -> tuple[float, float]:
        """Least and mean place of points along the load [m]."""
        along = points @ self.axes[2]
        return float(along.min()), float(along.mean())

    def nearest(self, pieces: Sequence[Floats], top: float) -> list[int]:
        """The pieces that lie first under this one, all of each below its middle, and with theirs above `top` [m]."""
        middle, first = 0.5 * (self.low[2] + self.deepest), dict[int, float]()
        for j, points in enumerate(pieces):
            low, mean = self.depth(points)
            if self.meets(points) and low >= middle and mean <= top:
                first[j] = low
        reached = min(first.values(), default=0.0) + LEVEL * (self.high - self.low)[:2].max()
        return [j for j, low in first.items() if low <= reached]


def _box(points: Floats) -> tuple[Floats, Floats]:
    return points.min(axis=0), points.max(axis=0)


def _add_held_pieces(
    world: World, start: Floats, pieces: list[Ints], swept: "list[_SweptBox]", found: list[list[str]]
) -> None:
    """Give each piece that nothing holds those that are held and in its way, until none is added."""
    names = [Hold(*_place(world, rows), (), np.zeros(3)).name for rows in pieces]
    todo = [k for k, holders in enumerate(found) if not holders]
    if len(pieces) > MANY:
        for k in todo:
            found[k].append("other pieces")
        return
    for _ in pieces:
        met = {
            k: next((j for j, by in enumerate(found) if by and j != k and swept[k].meets(start[pieces[j]])), None)
            for k in todo
        }
        for k, j in met.items():
            if j is not None:
                found[k].append(f"{names[j]} under it")
        before, todo = len(todo), [k for k in todo if met[k] is None]
        if len(todo) == before:
            return


def _place(world: World, rows: Ints) -> tuple[str, int]:
    """Name of the cloth of a piece, and its first vertex there."""
    label = int(world.labels[rows[0]])
    return world.names[label], int(rows[0] - world.cloth_slices[label].start)


def _bodies(world: World, duration: float, as_boxes: bool) -> list[tuple[str, Floats]]:
    """Each body with its vertices, or the corners of their box, of a moving one at several times, (k, 3) [m]."""
    found = []
    for body in world.bodies:
        times = [0.0] if body.motion.still else np.linspace(0.0, duration, TIMES)
        points = np.concatenate([body.at(float(time)) for time in times])
        found.append((body.name, np.array(list(product(*np.column_stack(_box(points))))) if as_boxes else points))
    return found


def _load(forces: Floats) -> Floats:
    """Sum of the forces (k, 3) on a piece, whose internal ones cancel [N]."""
    load = np.asarray(forces.sum(axis=0), np.float64)
    large = np.linalg.norm(load) > ROUND_OFF * np.linalg.norm(forces, axis=1).sum()  # False where one is not finite
    return load if large and np.isfinite(load).all() else np.zeros(3)


def _resists(world: World, energy: Energy) -> bool:
    """True for an incremental energy with a force against a translation: damping of the strain rate has none."""
    if not energy.incremental:
        return False
    start = world.start()
    none = np.zeros_like(start)
    bound = energy.begin(Step(0.0, 1.0, start, none, 1.0, none))
    change = bound.gradient(start + 1.0) - bound.gradient(start)
    return bool(np.abs(change.sum(axis=0)).max() > ROUND_OFF * np.abs(change).sum())
