"""The effect `friction`: what touches resists sliding, with the normal forces of the step's start (lagged)."""

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

LEAST_GAP = 0.25
"""Share of d_hat that a gap counts as at least in the first step: a start is no equilibrium, and a pair that happens to
be a millionth of d_hat apart there would be glued by a force that nothing carries."""


@dataclass(frozen=True)
class Contacts:
    """What slides: the bound barriers of the step; `start` (N, 3) [m] and dt [s]: the past that velocities come from.

    least_gap: share of d_hat that a gap counts as at least.
    """

    barriers: tuple[Barrier, ...]
    start: Floats
    dt: float
    least_gap: float


NOWHERE = Contacts((), np.zeros((0, 3)), 1.0, 0.0)


@dataclass(frozen=True)
class Friction(Elementwise, Energy, Idling, Lagged, Report):
    """E = sum mu F f0(|u|), u = (I - n n') sum_i g_i (x_i - x_i(start)) (Li et al. 2020, IPC, section 5).

    F [N], n and g: normal force, line and weights of the closest points of each pair, lagged. f0 is |u| beyond
    eps_v dt and -u^3/(3 e^2) + u^2/e + e/3 below, e = eps_v dt: a contact that sticks creeps slower than eps_v [m/s].
    coefficients (L, L): mu of each pair of objects; labels (N,); elements (p, 4), weights (p, 4), normals (p, 3),
    limits (p,) = mu F [N]: the lagged pairs. iterations: how often a step is solved, each with the forces of the last.
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
        """Bound to the contacts of the step and to their forces at its start.

        The gaps there were found with the stiffness of the step before: this step's own would make other forces of
        them.
        """
        contacts = {name: energy for name, energy in step.bound.items() if isinstance(energy, Barrier)}
        stiffness = [float(step.memory.get(name, barrier.stiffness)) for name, barrier in contacts.items()]
        least_gap = 0.0 if step.time > 0.0 else LEAST_GAP
        past = step.past
        bound = replace(self, contacts=Contacts(tuple(contacts.values()), past.positions, past.dt, least_gap))
        return bound._with_forces(step.positions, stiffness)

    def relag(self, x: Floats) -> Self:
        """Bound to the contact forces at x, for another pass of the same step."""
        return self._with_forces(x, [barrier.stiffness for barrier in self.contacts.barriers])

    def _with_forces(self, x: Floats, stiffness: Sequence[float]) -> Self:
        pairs = zip(self.contacts.barriers, stiffness, strict=True)
        found = [barrier.normal_forces(x, kappa, self.contacts.least_gap) for barrier, kappa in pairs]
        if not found:
            return self
        elements, weights, lines, forces = (np.concatenate(parts) for parts in zip(*found, strict=True))
        limits = self.coefficients[self.labels[elements[:, 0]], self.labels[elements[:, 3]]] * forces
        slides = limits > 0.0
        normals = lines[slides] / np.linalg.norm(lines[slides], axis=1, keepdims=True)
        return replace(self, elements=elements[slides], weights=weights[slides], normals=normals, limits=limits[slides])

    def value(self, x: Floats) -> float:
        """Dissipation potential of the step [J]."""
        return kernels.value(x, *self._lagged)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return kernels.gradient(x, *self._lagged)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (p, 12, 12) [N/m]; positive semi-definite as they are."""
        return ElementHessian(self.elements, kernels.hessian(x, *self._lagged))

    def defaults_used(self) -> tuple[str, ...]:
        """eps_v, and how often the forces are lagged."""
        times = f"{self.lag_iterations} time{'s' * (self.lag_iterations > 1)}"
        return (f"eps_v = {self.eps_v:g} m/s, normal forces lagged {times} a step",)

    def counts(self) -> dict[str, float]:
        """The pairs that were lagged last."""
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
    """Coulomb friction of every contact that the scene has.

    coefficient: mu where `pairs`, a list of [name, name, mu], says nothing else; eps_v [m/s]: the speed below which a
    contact counts as sticking, "auto": a thousandth of the largest cloth a second; iterations: solves of a step.
    """
    table = np.full((len(world.names),) * 2, as_positive("effects.friction.coefficient", coefficient, zero=True))
    given: dict[frozenset[int], int] = {}
    for number, entry in enumerate(pairs):
        a, b, mu = _pair(world, number, entry)
        first = given.setdefault(frozenset((a, b)), number)
        if first != number:
            raise InputError(
                f"effects.friction.pairs[{number}] gives {world.names[a]} and {world.names[b]} a coefficient again, "
                f"after pairs[{first}].",
                "Leave one of the two.",
            )
        table[a, b] = table[b, a] = mu
    if not table.any():
        return Off("every coefficient is 0")
    if not contacts:
        return Off("the scene has no contact")
    size = max(float(np.linalg.norm(np.ptp(cloth.positions, axis=0))) for cloth in world.cloths)
    speed = 1e-3 * size if eps_v == "auto" else as_positive("effects.friction.eps_v", eps_v)  # type: ignore[arg-type]
    lag_iterations = as_count("effects.friction.iterations", iterations)
    none = np.zeros((0, 4))
    return Friction(
        table, world.labels, speed, lag_iterations, NOWHERE, none.astype(np.int64), none, np.zeros((0, 3)), np.zeros(0)
    )


def _pair(world: World, number: int, entry: Sequence[object]) -> tuple[int, int, float]:
    """The objects and the coefficient of an entry of `pairs`."""
    where = f"effects.friction.pairs[{number}]"
    if isinstance(entry, str) or not isinstance(entry, Sequence) or len(entry) != 3:
        raise InputError(f"{where} must be two names and a coefficient, not {entry!r}.")
    for name in entry[:2]:
        if name not in world.names:
            raise InputError(f"{where}: nothing is called {name!r}.", f"There are: {', '.join(world.names)}.")
    a, b = (world.names.index(str(name)) for name in entry[:2])
    return a, b, as_positive(where, entry[2], zero=True)  # type: ignore[arg-type]


EXAMPLE = Example(
    keys={"coefficient": 0.7, "eps_v": 0.3},
    in_scene={},
    zero={"coefficient": 0},
    external=True,
    with_bodies=True,
    idle=Idle(always={"iterations": 3}, scene={"body": {"position": [0.0, 0.0, -50.0]}}),
)
