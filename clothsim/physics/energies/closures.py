"""Zips and buttons: borders that are closed and opened over time, and never sewn; the effect `closures`.

    E = sum k/2 max(|r| - L, 0)^2   over the stitches,   r = sum w x        [J]

A stitch joins a vertex of one border to the point of the other at the same fraction p of its length (`mesh.lines`).
It is a string (`links`), whose length is a function of time alone. With u the fraction that is closed, the part of the
border in which it closes is [h, h + ZONE] with h = u (1 + ZONE) - ZONE, so that nothing is closed at u = 0 and all at
u = 1:

    L = g + (R - g) (p - h) / ZONE   there, g before it, no string after it;

R is the distance at the start of the run, g the gap. The borders so form the V above the slider of a zip. A row of
buttons has a stitch for each button in place of one for each vertex.

With self_contact g is at least d_hat + offset, where the barrier begins: closed borders push nothing, and do not
intersect. So contact stays on between them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.effect_tables import Buttons, Zip
from clothsim.keys.typed_effects import Closures
from clothsim.mesh.lines import stitches
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.key_values import Schedule, schedule
from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import (
    ContactGap,
    Coupling,
    Driven,
    EnergyReport,
    Joining,
    NoPastSensitivity,
)
from clothsim.physics.energies.seams import seam_line, stitch_stiffness

UNEVEN = 1.1
"""Ratio of the lengths of two borders from which it is noted."""
ZONE = 0.2
"""Fraction of a border over which it closes: the V above the slider."""


@dataclass(frozen=True)
class ClosureSchedule:
    """A zip or a row of buttons: its name, k [N/m], u and g [m] over time, p and R [m] of its stitches, (m,) each.

    notes: what users must know of it.
    """

    name: str
    stiffness: Schedule
    closed: Schedule
    gap: Schedule
    parameters: Floats
    distances: Floats
    notes: tuple[str, ...]

    @property
    def is_constant(self) -> bool:
        """True where nothing changes over time."""
        return self.stiffness.is_constant and self.closed.is_constant and self.gap.is_constant

    def open_fractions(self, time: float) -> Floats:
        """How far each stitch is open at `time` [s], (m,), from 0, closed, to 1, free.

        InputError where u is above 1, as a function of the user's may be.
        """
        closed = self.closed.at(time)
        if closed > 1:
            raise InputError(f"{self.name}.closed is {closed:g} at {time:g} s.", "It is a fraction, from 0 to 1.")
        head = closed * (1 + ZONE) - ZONE
        return np.asarray(np.clip((self.parameters - head) / ZONE, 0.0, 1.0), np.float64)

    def at(self, time: float, least: float) -> tuple[Floats, Floats]:
        """Lengths [m] and stiffnesses [N/m] of its strings at `time` [s], (m,) each; least: that of a gap [m]."""
        part, gap = self.open_fractions(time), max(self.gap.at(time), least)
        return gap + part * np.maximum(self.distances - gap, 0.0), np.where(part < 1, self.stiffness.at(time), 0.0)


@dataclass(frozen=True)
class ClosuresEnergy(Links, Coupling, Driven, Joining, EnergyReport, NoPastSensitivity):
    """Strings of all zips and buttons.

    Parameters
    ----------
    closures : tuple of ClosureSchedule
        What they are over time, in the order of the strings.
    least_gap : float
        Least length of a string [m].
    """

    closures: tuple[ClosureSchedule, ...]
    least_gap: float

    @property
    def drives(self) -> bool:
        """True where something closes or opens over time."""
        return not all(closure.is_constant for closure in self.closures)

    @property
    def joined_rows(self) -> Ints:
        """The vertices of each stitch that has a stiffness, (m', 3)."""
        return self.rows[self.stiffnesses > 0]

    def begin(self, step: Step) -> Self:
        """A copy with the lengths and stiffnesses of the end of the step."""
        return self._evaluate_at(step.time + step.dt)

    def _evaluate_at(self, now: float) -> Self:
        lengths, stiffnesses = zip(*(closure.at(now, self.least_gap) for closure in self.closures), strict=True)
        return replace(self, lengths=np.concatenate(lengths), stiffnesses=np.concatenate(stiffnesses))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """The rows of the stitches that act."""
        return self.joined_rows

    def defaults_used(self) -> tuple[str, ...]:
        """Number of the stitches, and the least gap; the notes of each."""
        gap = f"; closed to a gap of {self.least_gap:g} m for self_contact" if self.least_gap else ""
        return (f"{len(self.rows)} stitches{gap}", *(note for each in self.closures for note in each.notes))

    def final_notes(self, x: Floats, time: float) -> tuple[str, ...]:
        """How far each is closed at x, how wide it gapes there, and the largest force of a stitch."""
        ended, gaps = self._evaluate_at(time), np.linalg.norm(self.lines(x), axis=1)
        forces, notes, first = ended.stiffnesses * np.maximum(gaps - ended.lengths, 0.0), [], 0
        for closure in self.closures:
            here = slice(first, first := first + len(closure.parameters))
            done = closure.open_fractions(time) == 0
            wide = f", gapes by {1e3 * gaps[here][done].max():.3g} mm at most" if done.any() else ""
            state = f"{done.sum()} of {len(done)} stitches are closed{wide}"
            notes.append(f"{closure.name}: {state}; the largest force is {forces[here].max():.3g} N")
        return tuple(notes)


def closures(world: World, keys: Closures, *, built: Mapping[str, Energy] | None = None) -> Energy | Off:
    """Zips and buttons of the tables of a scene; off where every stiffness is 0.

    built: the energies built so far; self_contact, by which closed borders keep a gap.

    Raises
    ------
    InputError
        Names the table and key.
    """
    tables = [(f"effects.closures.zip[{k}]", each) for k, each in enumerate(keys.zip)]
    tables += [(f"effects.closures.buttons[{k}]", each) for k, each in enumerate(keys.buttons)]
    found = list(_made(world, tables))
    if not found:
        return Off("every stiffness is 0" if tables else "there is no zip and no row of buttons")
    contact = (built or {}).get("self_contact")
    least = contact.activation_distance if isinstance(contact, ContactGap) else 0.0
    rows, weights = (np.concatenate([part[k] for part in found]) for k in (0, 1))
    made, m = tuple(part[2] for part in found), len(rows)
    nothing = np.zeros((m, 3)), np.zeros(m), np.zeros(m), np.ones(m, bool)
    return ClosuresEnergy(rows, weights, *nothing, made, least)._evaluate_at(0.0)


def _made(world: World, tables: Sequence[tuple[str, Zip]]) -> Iterator[tuple[Ints, Floats, ClosureSchedule]]:
    """Rows and weights (m, 3) of the stitches of each table with a stiffness, and its schedule."""
    start = world.start()
    for name, keys in tables:
        given = stitch_stiffness(name, world) if keys.stiffness is None else keys.stiffness
        stiffness, gap = schedule(f"{name}.stiffness", given, 0.0), schedule(f"{name}.gap", keys.gap, 0.0)
        closed = schedule(f"{name}.closed", keys.closed, 0.0)
        if (closed.values > 1).any():
            raise InputError(f"{name}.closed is {closed.values.max():g}.", "It is a fraction, from 0 to 1.")
        if stiffness.is_zero:
            continue
        rows, weights, parameters, (a, b) = _stitches(name, world, keys)
        notes = [f"{name} joins borders of {a:.3g} and {b:.3g} m"] if max(a, b) > UNEVEN * min(a, b) else []
        if isinstance(keys, Buttons):
            places = np.linspace(0.0, 1.0, keys.count) if keys.count > 1 else np.array([0.5])
            chosen = np.unique(np.abs(parameters - places[:, None]).argmin(axis=1))
            if len(chosen) < keys.count:
                notes.append(
                    f"{name} has {len(chosen)} of {keys.count} buttons, as the mesh has no more vertices there"
                )
            rows, weights, parameters = rows[chosen], weights[chosen], parameters[chosen]
        distances = np.linalg.norm(np.einsum("mj,mjp->mp", weights, start[rows]), axis=1)
        yield rows, weights, ClosureSchedule(name, stiffness, closed, gap, parameters, distances, tuple(notes))


def _stitches(name: str, world: World, keys: Zip) -> tuple[Ints, Floats, Floats, tuple[float, float]]:
    """Rows and weights (m, 3) of a stitch for each vertex of the finer border, its fraction p of that, (m,).

    With the lengths of both borders at rest [m].
    """
    first, second = (
        seam_line(f"{name}.{key}", world, line, 2) for key, line in (("from", keys.from_), ("to", keys.to))
    )
    second = second.reversed() if keys.flip else second
    rows, weights = stitches(first, second)
    if not len(rows) or np.array_equal(np.unique(first.vertices), np.unique(second.vertices)):
        raise InputError(f"{name} joins a line to itself.", "Give two lines.")
    finer = first if len(first.vertices) >= len(second.vertices) else second
    fractions = dict(zip(finer.vertices.tolist(), finer.parameters.tolist(), strict=True))
    rest = np.concatenate([cloth.rest_positions for cloth in world.cloths])
    a, b = (float(np.linalg.norm(np.diff(rest[line.vertices], axis=0), axis=1).sum()) for line in (first, second))
    return rows, weights, np.array([fractions[vertex] for vertex in rows[:, 0].tolist()]), (a, b)


_SIDES = {"from": {"side": "left"}, "to": {"side": "right"}}
EXAMPLE = Example(
    keys={"zip": [{"from": {"vertices": [0, 1, 2]}, "to": {"vertices": [9, 10, 11]}, "stiffness": 2.0}]},
    in_scene={"zip": [{**_SIDES, "stiffness": 20.0}]},
    zero={"zip": [{**_SIDES, "stiffness": 0}]},
    idle=Idle(
        always={"zip": [{**_SIDES, "closed": [[0.0, 0.0], [10.0, 0.0], [11.0, 1.0]]}]},
        sometimes={"buttons": [{**_SIDES, "closed": [[0.05, 0.0], [0.2, 1.0]], "stiffness": 20.0}]},
    ),
)
