"""Cords that run through edges of the cloth, as the drawstring of a hood: the effect `cords`.

    E = k/2 (l - L)^2 / L  where l > L, else 0,   l = sum |e|        [J]

over the edges e of a line: the cord slides through it without friction, so that its tension T = k (l/L - 1) is the same
everywhere and only its whole length counts. k [N]: tension at which the cord is twice as long as at rest; L [m]: length
at rest, which may change over time, as where a cord is pulled. A closed line is a loop, as of a cord that is knotted; a
cord along an open line is tied to both of its ends.

With g = dl/dx the Hessian is k/L g g' + T sum (I - n n') / |e|, positive semi-definite as it is; it couples all
vertices of a line.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.typed_effects import Cords
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off, Step
from clothsim.physics.energies.edge_curves import drawn_curves
from clothsim.physics.energies.example import Example, Idle
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.key_values import Schedule
from clothsim.physics.energies.protocols import (
    Coupling,
    Driven,
    Elementwise,
    EnergyReport,
    Idling,
    NoPastSensitivity,
)

SHORTEST = 0.01
"""Least length of a cord over that of its line."""
MOST = 400
"""Vertices of a line, beyond which the dense block of its Hessian would cost more than the rest of a step."""


@dataclass(frozen=True)
class CordSchedule:
    """One cord: k [N] and its length over that of its line, over time; rest_length of the line [m]."""

    stiffness: Schedule
    length_ratio: Schedule
    rest_length: float


@dataclass(frozen=True)
class CordsEnergy(Elementwise, Energy, Idling, Coupling, Driven, NoPastSensitivity, EnergyReport):
    """E = sum k/2 max(l - L, 0)^2 / L over cords.

    Parameters
    ----------
    rows : (m, n) int array
        Rows of x along each cord, in order; a shorter one ends with its last vertex repeated.
    lengths : (m,) array
        L [m].
    stiffnesses : (m,) array
        k [N].
    cords : tuple of CordSchedule
        What they are over time.
    """

    rows: Ints
    lengths: Floats
    stiffnesses: Floats
    cords: tuple[CordSchedule, ...]

    per_element = ("rows", "lengths", "stiffnesses")

    @property
    def idle(self) -> bool:
        """True where no cord has a stiffness."""
        return not self.stiffnesses.any()

    @property
    def drives(self) -> bool:
        """True where a cord changes over time."""
        return not all(cord.stiffness.is_constant and cord.length_ratio.is_constant for cord in self.cords)

    def begin(self, step: Step) -> Self:
        """A copy with the lengths and stiffnesses of the end of the step."""
        return self._evaluate_at(step.time + step.dt)

    def _evaluate_at(self, now: float) -> Self:
        lengths = np.array([cord.length_ratio.at(now) * cord.rest_length for cord in self.cords])
        return replace(self, lengths=lengths, stiffnesses=np.array([cord.stiffness.at(now) for cord in self.cords]))

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        excess = np.maximum(self._edges(x)[1].sum(axis=1) - self.lengths, 0.0)
        return 0.5 * float(np.sum(self.stiffnesses * excess**2 / self.lengths))

    def gradient(self, x: Floats) -> Floats:
        """T dl/dx, (N, 3) [N]."""
        gradient = np.zeros_like(x)
        directions, distances = self._edges(x)
        forces = self._tensions(distances)[:, None, None] * _differentiate_lengths(directions)
        np.add.at(gradient, self.rows.ravel(), forces.reshape(-1, 3))
        return gradient

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m', 3n, 3n) [N/m] of the cords that are taut."""
        directions, distances = self._edges(x)
        tensions = self._tensions(distances)
        taut = np.flatnonzero(tensions > 0)
        n = self.rows.shape[1]
        blocks = np.zeros((len(taut), n, 3, n, 3))
        first, second = np.arange(n - 1), np.arange(1, n)
        for place, k in enumerate(taut):
            g = _differentiate_lengths(directions[k : k + 1])[0]
            blocks[place] = self.stiffnesses[k] / self.lengths[k] * np.einsum("ap,bq->apbq", g, g)
            across = np.eye(3) - directions[k, :, :, None] * directions[k, :, None, :]
            known = distances[k] > 0
            across *= np.where(known, tensions[k] / np.where(known, distances[k], 1.0), 0.0)[:, None, None]
            for a, b, sign in ((first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1)):
                blocks[place, a, :, b, :] += sign * across
        return ElementHessian(self.rows[taut], blocks.reshape(-1, 3 * n, 3 * n))

    def couplings(self, x: Floats, dx: Floats) -> Ints:
        """The rows of all cords."""
        return self.rows

    def final_notes(self, x: Floats, time: float) -> tuple[str, ...]:
        """Length and tension of each cord at x."""
        ended, distances = self._evaluate_at(time), self._edges(x)[1]
        measured = zip(distances.sum(axis=1), ended.lengths, ended._tensions(distances), strict=True)
        return tuple(
            f"cord {k} is {100 * rest:.4g} cm long, its line {100 * line:.4g} cm, and pulls with {tension:.3g} N"
            for k, (line, rest, tension) in enumerate(measured)
        )

    def _edges(self, x: Floats) -> tuple[Floats, Floats]:
        """Unit direction (m, n - 1, 3) and length (m, n - 1) [m] of each edge; the direction of none is 0."""
        edges = np.diff(x[self.rows], axis=1)
        distances = np.linalg.norm(edges, axis=2)
        return edges / np.where(distances > 0, distances, 1.0)[:, :, None], distances

    def _tensions(self, distances: Floats) -> Floats:
        """T = k max(l/L - 1, 0), (m,) [N]."""
        return np.asarray(self.stiffnesses * np.maximum(distances.sum(axis=1) / self.lengths - 1.0, 0.0), np.float64)


def cords(world: World, keys: Cords) -> Energy | Off:
    """Cords of the tables of a scene; off where every stiffness is 0.

    Raises
    ------
    InputError
        Names the table and key.
    """
    lines, made = [], []
    for name, stiffness, ratio, curves in drawn_curves("effects.cords.cord", world, keys.cord, SHORTEST):
        for curve in curves:
            if len(curve.vertices) > MOST:
                raise InputError(
                    f"{name} runs through {len(curve.vertices)} vertices, more than {MOST}.",
                    "Select a part of the line, or mesh the cloth more coarsely.",
                )
            lines.append(curve.vertices)
            made.append(CordSchedule(stiffness, ratio, float(curve.lengths.sum())))
    if not made:
        return Off("every stiffness is 0" if keys.cord else "there is no cord")
    most = max(len(line) for line in lines)
    rows = np.array([np.pad(line, (0, most - len(line)), mode="edge") for line in lines])
    lengths = np.array([cord.length_ratio.at(0.0) * cord.rest_length for cord in made])
    return CordsEnergy(rows, lengths, np.array([cord.stiffness.at(0.0) for cord in made]), tuple(made))


def _differentiate_lengths(directions: Floats) -> Floats:
    """dl/dx of each vertex, (m, n, 3), from the directions of the edges (m, n - 1, 3)."""
    ends = np.pad(directions, ((0, 0), (1, 1), (0, 0)))
    return np.asarray(ends[:, :-1] - ends[:, 1:], np.float64)


_LEFT = {"select": "left", "length_ratio": 0.7}
EXAMPLE = Example(
    keys={"cord": [{"select": [0, 1, 2, 5], "stiffness": 2.0, "length_ratio": 0.7}]},
    in_scene={"cord": [{**_LEFT, "stiffness": 5.0}]},
    zero={"cord": [{**_LEFT, "stiffness": 0}]},
    idle=Idle(
        always={"cord": [{**_LEFT, "stiffness": [[0.0, 0.0], [10.0, 0.0], [11.0, 30.0]]}]},
        sometimes={"cord": [{**_LEFT, "stiffness": [[0.0, 0.0], [0.05, 0.0], [0.06, 20.0]]}]},
    ),
)
