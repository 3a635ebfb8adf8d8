"""The effect `friction`: smoothed Coulomb friction with lagged normal forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from clothsim.arrays import Floats, Ints, as_count, as_positive
from clothsim.contact import friction_kernels as kernels
from clothsim.contact.barrier import Barrier
from clothsim.energies.base import Energy, Off
from clothsim.energies.elementwise import Elementwise
from clothsim.energies.example import Example, Idle
from clothsim.energies.hessians import ElementHessian
from clothsim.energies.protocols import Idling, Lagged, Report
from clothsim.energies.step import Step
from clothsim.errors import InputError
from clothsim.mesh.world import World

MIN_GAP_FRACTION = 0.25
"""Fraction of d_hat below which a gap counts as that in the first step: a start is no equilibrium, and a pair that
happens to be a millionth of d_hat apart there would stick by a normal force that no load balances."""


@dataclass(frozen=True)
class Contacts:
    """Bound barriers of the step; `start` (N, 3) [m] and dt [s] of the past that velocities refer to.

    least_gap: fraction of d_hat below which a gap counts as that.
    """

    barriers: tuple[Barrier, ...]
    start: Floats
    dt: float
    least_gap: float


NO_CONTACTS = Contacts((), np.zeros((0, 3)), 1.0, 0.0)


@dataclass(frozen=True)
class Friction(Elementwise, Energy, Idling, Lagged, Report):
    """E = sum mu F f0(|u|), u = (I - n n') sum_i g_i (x_i - x_i(start)) (Li et al. 2020, IPC, section 5).

    F [N], n and g: normal force, normal and weights of the closest points of each pair, lagged. f0 is |u| beyond eps_v
    dt and -u^3/(3 e^2) + u^2/e + e/3 below, e = eps_v dt: a sticking contact creeps slower than eps_v [m/s].

    Parameters
    ----------
    coefficients : (L, L) array
        mu of each pair of objects.
    labels : (N,) int array
        Object of each row of x.
    eps_v : float
        Speed below which a contact counts as sticking [m/s].
    iterations : int
        Solves of a step, each with the forces of the last.
    contacts : Contacts
        Barriers that the pairs come from.
    elements, weights, normals, limits : (p, 4), (p, 4), (p, 3), (p,) array
        Lagged pairs: rows, weights, normals and limits mu F [N].
    """

    coefficients: Floats
    labels: Ints
    eps_v: float
    iterations: int
    contacts: Contacts
    elements: Ints
    weights: Floats
    normals: Floats
    limits: Floats

    per_element = ("elements", "weights", "normals", "limits")

    begins_last = True
    incremental = True
    exact_in_newton = False  # it is positive semi-definite: the projected Hessian is the exact one

    @property
    def idle(self) -> bool:
        """True where no contact was lagged."""
        return not len(self.elements)

    @property
    def lag_iterations(self) -> int:
        """`iterations`."""
        return self.iterations

    def begin(self, step: Step) -> Self:
        """Copy for the step, with the contacts and their forces at its start.

        The gaps there were solved with the stiffness of the step before: with this step's own the forces would differ.
        """
        contacts = {name: energy for name, energy in step.bound.items() if isinstance(energy, Barrier)}
        stiffness = [float(step.memory.get(name, barrier.stiffness)) for name, barrier in contacts.items()]
        least_gap = 0.0 if step.time > 0.0 else MIN_GAP_FRACTION
        past = step.past
        bound = replace(self, contacts=Contacts(tuple(contacts.values()), past.positions, past.dt, least_gap))
        return bound._with_forces(step.positions, stiffness)

    def relag(self, x: Floats) -> Self:
        """Copy with the contact forces at x, for another lagged solve of the same step."""
        return self._with_forces(x, [barrier.stiffness for barrier in self.contacts.barriers])

    def _with_forces(self, x: Floats, stiffness: Sequence[float]) -> Self:
        """Copy with the active pairs at x and their normal forces."""
        pairs = zip(self.contacts.barriers, stiffness, strict=True)
        found = [barrier.normal_forces(x, kappa, self.contacts.least_gap) for barrier, kappa in pairs]
        if not found:
            return self
        elements, weights, differences, forces = (np.concatenate(parts) for parts in zip(*found, strict=True))
        limits = self.coefficients[self.labels[elements[:, 0]], self.labels[elements[:, 3]]] * forces
        sliding = limits > 0.0
        normals = differences[sliding] / np.linalg.norm(differences[sliding], axis=1, keepdims=True)
        return replace(
            self, elements=elements[sliding], weights=weights[sliding], normals=normals, limits=limits[sliding]
        )

    def value(self, x: Floats) -> float:
        """Dissipation potential of the step [J]."""
        return kernels.value(x, *self._lagged)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._lagged)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; positive semi-definite without projection."""
        return ElementHessian(self.elements, kernels.hessian(x, *self._lagged))

    def defaults_used(self) -> tuple[str, ...]:
        """eps_v, and the number of lagged solves a step."""
        times = f"{self.lag_iterations} time{'s' * (self.lag_iterations > 1)}"
        return (f"eps_v = {self.eps_v:g} m/s, normal forces lagged {times} a step",)

    def counts(self) -> dict[str, float]:
        """Number of lagged pairs."""
        return {"pairs": len(self.elements)}

    @property
    def _lagged(self) -> tuple[Floats, Ints, Floats, Floats, Floats, float]:
        slip = self.eps_v * self.contacts.dt
        return self.contacts.start, self.elements, self.weights, self.normals, self.limits, slip


def friction(
    world: World,
    *,
    coefficient: float = 0.3,
    pairs: Sequence[Sequence[object]] = (),
    eps_v: float | str = "auto",
    iterations: int = 1,
    contacts: Sequence[str] = (),
) -> Energy | Off:
    """Coulomb friction of every contact of the scene.

    Parameters
    ----------
    world : World
        Cloths and bodies.
    coefficient : float
        mu of the pairs of objects that `pairs` does not name.
    pairs : sequence of [name, name, mu]
        Coefficients of single pairs of objects.
    eps_v : float or "auto"
        Speed below which a contact counts as sticking [m/s]; "auto": a thousandth of the largest cloth a second.
    iterations : int
        Solves of a step, each with the normal forces of the last.
    contacts : sequence of str
        Names of the contact effects that are on.

    Returns
    -------
    Energy or Off
        Off where the scene has no contact or every coefficient is 0.

    Raises
    ------
    InputError
        A value is out of range or a name unknown.

    Examples
    --------
    >>> import clothsim
    >>> from clothsim.build.scene_world import build
    >>> cloth, ball = {"mesh": "rectangle", "position": [0, 0, 0.5]}, {"mesh": "sphere", "name": "ball"}
    >>> effects = {"body_contact": {}, "friction": {"coefficient": 0.3, "pairs": [["cloth", "ball", 0.1]]}}
    >>> build(clothsim.Scene(cloth=cloth, body=ball, effects=effects)).energies["friction"].coefficients
    array([[0.3, 0.1],
           [0.1, 0.3]])
    """
    table = np.full((len(world.names),) * 2, as_positive("effects.friction.coefficient", coefficient, zero=True))
    entries: dict[frozenset[int], int] = {}
    for number, entry in enumerate(pairs):
        a, b, mu = _pair(world, number, entry)
        first = entries.setdefault(frozenset((a, b)), number)
        if first != number:
            raise InputError(
                f"effects.friction.pairs[{number}] repeats the pair {world.names[a]} and {world.names[b]} of "
                f"pairs[{first}].",
                "Remove one of the two.",
            )
        table[a, b] = table[b, a] = mu
    if not table.any():
        return Off("every coefficient is 0")
    if not contacts:
        return Off("the scene has no contact")
    size = max(float(np.linalg.norm(np.ptp(cloth.positions, axis=0))) for cloth in world.cloths)
    speed = 1e-3 * size if eps_v == "auto" else as_positive("effects.friction.eps_v", eps_v)  # type: ignore[arg-type]
    lag_iterations = as_count("effects.friction.iterations", iterations)
    empty = np.zeros((0, 4))
    rows = empty.astype(np.int64)
    return Friction(table, world.labels, speed, lag_iterations, NO_CONTACTS, rows, empty, np.zeros((0, 3)), np.zeros(0))


def _pair(world: World, number: int, entry: Sequence[object]) -> tuple[int, int, float]:
    """Objects and coefficient of an entry of `pairs`."""
    key = f"effects.friction.pairs[{number}]"
    if isinstance(entry, str) or not isinstance(entry, Sequence) or len(entry) != 3:
        raise InputError(f"{key} must be two names and a coefficient, not {entry!r}.")
    for name in entry[:2]:
        if name not in world.names:
            raise InputError(f"{key}: unknown object {name!r}.", f"Choose from: {', '.join(world.names)}.")
    a, b = (world.names.index(str(name)) for name in entry[:2])
    return a, b, as_positive(key, entry[2], zero=True)  # type: ignore[arg-type]


EXAMPLE = Example(
    keys={"coefficient": 0.7, "eps_v": 0.3},
    in_scene={},
    zero={"coefficient": 0},
    external=True,
    with_bodies=True,
    idle=Idle(always={"iterations": 3}, scene={"body": {"position": [0.0, 0.0, -50.0]}}),
)
