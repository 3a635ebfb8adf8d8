"""Gradient of a loss: derivatives by their names, made when they are asked for, and how wrong the loss is.

By the rest shape the start positions are held. Masses, rest shapes, hinges and the weights of contact pairs all follow
it, because the world and its energies are built from the varied one.
"""

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.gradients.backward_pass import Adjoints
from clothsim.gradients.differentiable_session import bound_to, held_energies
from clothsim.gradients.parameters import SECOND_ORDER, Variant, Variation, full_path, scene_derivative
from clothsim.mesh.cloth import Cloth, triangle_planes
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.protocols import ContactGap, Lagged
from clothsim.run.session import Session
from clothsim.scene.assembly.scene_world import build_effects
from clothsim.scene.paths import parts_of, select_entry

if TYPE_CHECKING:
    from clothsim.gradients.run import Trace


STEP = 3e-5
"""Largest change of a rest position that differences take, as a fraction of the mean edge."""


def rest_along(run: "Trace", adjoints: Adjoints, cloth: int, field: Floats) -> float:
    """Return dL along a displacement field of the rest shape of one cloth.

    Parameters
    ----------
    run, adjoints
        The run and the adjoints of its steps.
    cloth : int
        Number of the cloth in the world.
    field : (n, 3) or (m, 3, 2) array
        Displacements of the rest positions [m]; of a flat pattern of the corners of its triangles in the plane.

    Raises
    ------
    InputError
        For a field of another shape.
    """
    session = run.session
    world = session.built.world
    own = world.cloths[cloth]
    wanted = own.material_coordinates.shape if own.flat else own.rest_positions.shape
    if field.shape != wanted:
        raise InputError(f"The field has the shape {field.shape}, the rest shape of {own.name!r} {wanted}.")
    largest = float(np.abs(field).max())
    if not largest:
        return 0.0
    edges = own.material_coordinates - np.roll(own.material_coordinates, 1, axis=1)

    def built(change: float) -> Variant:
        cloths = [_displaced(each, change * field) if k == cloth else each for k, each in enumerate(world.cloths)]
        varied = replace(make_world(cloths, world.prescribed_bodies, world.rigid), origin=world.origin)
        made = build_effects(session.scene, varied)
        return Variant(made.world, held_energies(made.energies, run.stiffness), made.constraints)

    size = STEP * float(np.linalg.norm(edges, axis=2).mean()) / largest
    variation = Variation(built, size, SECOND_ORDER, tuple(session.built.energies))
    return variation.derivative(session.integrator, run.steps, adjoints)


def with_rest_positions(session: Session, rest: Floats) -> Session:
    """Return the session with other rest positions (n, 3) [m] of its one cloth, the start held."""
    world = session.built.world
    refuse_other_rest(world)
    own = world.cloths[0]
    if rest.shape != own.rest_positions.shape:
        raise InputError(f"cloth.rest has the shape {rest.shape}, the cloth {own.rest_positions.shape}.")
    varied = make_world([_displaced(own, rest - own.rest_positions)], world.prescribed_bodies, world.rigid)
    made = build_effects(session.scene, replace(varied, origin=world.origin))
    potential = replace(session.integrator.potential, energies=made.energies)
    integrator = replace(session.integrator, world=made.world, constraints=made.constraints, potential=potential)
    return replace(session, built=made, integrator=integrator)


def refuse_other_rest(world: World) -> None:
    """InputError if the rest shape is not that of one cloth with rest positions."""
    if len(world.cloths) != 1 or world.cloths[0].flat:
        raise InputError("cloth.rest is for one cloth with rest positions.", "Use Gradient.rest_along for a field.")


def rest_derivative(run: "Trace", adjoints: Adjoints) -> Floats:
    """Return dL by the rest positions of a single cloth that is not a flat pattern, (n, 3): 12 n sets of energies."""
    cloths = run.session.built.world.cloths
    refuse_other_rest(run.session.built.world)
    out = np.zeros(cloths[0].rest_positions.shape)
    for index in np.ndindex(out.shape):
        field = np.zeros(out.shape)
        field[index] = 1.0
        out[index] = rest_along(run, adjoints, 0, field)
    return out


def _displaced(cloth: Cloth, field: Floats) -> Cloth:
    if cloth.flat:
        return replace(cloth, material_coordinates=cloth.material_coordinates + field)
    rest = cloth.rest_positions + field
    return replace(cloth, rest_positions=rest, material_coordinates=triangle_planes(rest, cloth.triangles))


KNOWN = 0.25
"""Fraction of what the solves left that may be of higher order in `Gradient.newton_error`."""

ARRAYS = ("start", "velocity", "force", "pins")


@dataclass(frozen=True, eq=False)
class Gradient(Mapping[str, Floats]):
    """Derivatives of a loss, by name.

    | name | derivative by | shape |
    | --- | --- | --- |
    | `start` | positions of the cloth at the start [m] | (n, 3) |
    | `velocity` | velocities at the start [m/s] | (n, 3) |
    | `force` | a constant force on each vertex [N] | (n, 3) |
    | `pins` | the places of the pinned vertices, in the order of `pinned` [m] | (k, 3) |
    | `body.position`, `body.NAME.position` | a shift of the body [m] | (3,) |
    | `body.turn`, `body.NAME.turn` | a turn about the mean of its vertices [rad] | (3,) |
    | `body.vertices`, `body.NAME.vertices` | its vertices, moved alike all the time [m] | (b, 3) |
    | `cloth.rest` | the rest positions of the one cloth [m]; slow, `rest_along` takes a field of them | (n, 3) |
    | a path of a number in the scene, as `cloth.density`; of a fabric also `density` | that number | () or (k,) |

    Attributes
    ----------
    value : float
        The loss.
    adjoints : Adjoints
        Adjoints of all steps.

    Examples
    --------
    See `clothsim.simulate` with ``differentiable=True``.
    """

    run: "Trace"
    value: float
    adjoints: Adjoints
    _known: dict[str, Floats] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        return f"<Gradient of a loss of {self.value:.6g} over {len(self.run.steps)} steps>"

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> Floats:
        if name not in self._known:
            self._known[name] = self._derivative(name)
        return self._known[name]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of states, forces and bodies; in addition there are the numbers of the scene."""
        bodies = [body.name for body in self.run.session.built.world.bodies]
        parts = [f"body.{name}.{what}" for name in bodies for what in ("position", "turn", "vertices")]
        return (*(ARRAYS if len(self.pinned) else ARRAYS[:-1]), *parts)

    @cached_property
    def pinned(self) -> np.ndarray:
        """The rows of the cloth's vertices that are prescribed in the first step, (k,)."""
        return self.run.steps[0].fixed_rows(self.run.session.integrator)

    @property
    def newton_error(self) -> float:
        """L_converged - L = -sum a_k . G(x_k): the change of the loss if every solve were exact.

        An estimate of first order; round-off if the solves were polished. nan (not known) where that order fails:
        where one exact Newton step in each solve leaves more than KNOWN of it, as beside a buckling strip.
        """
        left = float(self.adjoints.newton.sum())
        return left if self.adjoints.doubt.sum() <= KNOWN * abs(left) else math.nan

    @cached_property
    def log_kappa_sensitivity(self) -> float:
        """kappa dL/dkappa: derivative of the loss by the logarithm of the barrier's stiffness.

        The forces of contact and of its friction are proportional to kappa.
        """
        total = 0.0
        for a, record in zip(self.adjoints.forces, self.run.steps, strict=True):
            _, bound = bound_to(record.of_step(self.run.session.integrator), record)
            for energy in bound.acting.values():
                if isinstance(energy, ContactGap | Lagged):
                    total -= float(np.vdot(a, energy.gradient(record.solution)[: len(a)]))
        return total

    @property
    def kappa_share(self) -> float:
        """Earlier name of `log_kappa_sensitivity`."""
        warnings.warn("kappa_share is now log_kappa_sensitivity.", DeprecationWarning, stacklevel=2)
        return self.log_kappa_sensitivity

    def _derivative(self, name: str) -> Floats:
        n, adjoints = self.run.session.built.world.n_cloth, self.adjoints
        of_states = {
            "start": lambda: adjoints.start[:n],
            "velocity": lambda: adjoints.velocities[:n],
            "force": lambda: adjoints.forces.sum(axis=0),
            "pins": lambda: adjoints.prescribed[:, self.pinned].sum(axis=0),
            "cloth.rest": lambda: rest_derivative(self.run, adjoints),
        }
        if name in of_states:
            return of_states[name]()
        section, *keys = parts_of(name)
        if section == "body" and keys and keys[-1] in ("position", "turn", "vertices"):
            return self._differentiate_body(name, keys)
        return scene_derivative(self.run, adjoints, full_path(name))

    def rest_along(self, field: Floats, cloth: str = "") -> float:
        """Return the derivative along a displacement field of a cloth's rest shape, with a fixed start.

        Parameters
        ----------
        field : (n, 3) array, or (m, 3, 2) of a flat pattern
            Displacements of the rest positions, or of the corners of the triangles in the plane of the pattern [m].
        cloth : str
            Name of the cloth; not needed if there is only one.
        """
        names = [each.name for each in self.run.session.built.world.cloths]
        if cloth not in names and (cloth or len(names) != 1):
            raise InputError(f"There is no cloth {cloth!r}.", f"Cloths: {', '.join(names)}.")
        return rest_along(self.run, self.adjoints, names.index(cloth) if cloth else 0, np.asarray(field, np.float64))

    def _differentiate_body(self, name: str, keys: list[str | int]) -> Floats:
        world = self.run.session.built.world
        names = [body.name for body in world.bodies]
        number, (what, *others) = select_entry(name, names, keys) if names else (0, keys)
        if not names or others:
            raise InputError(f"The gradient has no {name}.", f"Bodies: {', '.join(names) or 'none'}.")
        rows = world.body_slices[number]
        by_step = [self.adjoints.start[rows], *self.adjoints.prescribed[:, rows]]
        if what == "turn":
            states = [self.run.steps[0].start, *(step.end for step in self.run.steps)]
            places = [state.positions[rows] for state in states]
            moments = [np.cross(x - x.mean(axis=0), d).sum(axis=0) for x, d in zip(places, by_step, strict=True)]
            return self.adjoints.known(np.sum(moments, axis=0))
        return self.adjoints.known(np.sum(by_step, axis=0 if what == "vertices" else (0, 1)))
