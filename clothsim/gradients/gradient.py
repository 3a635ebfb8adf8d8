"""Gradient of a loss: derivatives by their names, made when they are asked for."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.gradients import estimate
from clothsim.gradients.backward_pass import Adjoints
from clothsim.gradients.parameters import full_path, scene_derivative
from clothsim.gradients.rest_shape import rest_along, rest_derivative
from clothsim.scene.paths import entry_of, parts_of

if TYPE_CHECKING:
    from clothsim.gradients.run import Trace

ARRAYS = ("start", "velocity", "force", "pins")


@dataclass(frozen=True, eq=False)
class Gradient(Mapping[str, Floats]):
    """Derivatives of a loss, by names.

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
        Of all steps.

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
        """The names of states, forces and bodies; numbers of the scene come besides."""
        bodies = [body.name for body in self.run.session.built.world.bodies]
        parts = [f"body.{name}.{what}" for name in bodies for what in ("position", "turn", "vertices")]
        return (*(ARRAYS if len(self.pinned) else ARRAYS[:-1]), *parts)

    @cached_property
    def pinned(self) -> np.ndarray:
        """The rows of the cloth's vertices that are prescribed in the first step, (k,)."""
        return self.run.steps[0].fixed_rows(self.run.session.integrator)

    @property
    def newton_error(self) -> float:
        """L_converged - L: what the loss would change by if every solve were exact."""
        return estimate.newton_error(self.adjoints)

    @cached_property
    def time_error(self) -> float:
        """Estimate of L_exact - L by the time steps (`estimate.time_error`); nan where there is none."""
        return estimate.time_error(self.run.session.integrator, self.run.steps, self.adjoints)

    @cached_property
    def kappa_share(self) -> float:
        """Derivative of the loss by the logarithm of the barrier's stiffness."""
        return estimate.kappa_share(self.run.session.integrator, self.run.steps, self.adjoints)

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
            return self._of_body(name, keys)
        return scene_derivative(self.run, adjoints, full_path(name))

    def rest_along(self, field: Floats, cloth: str = "") -> float:
        """Return the derivative along a displacement field of a cloth's rest shape, the start held.

        Parameters
        ----------
        field : (n, 3) array, or (m, 3, 2) of a flat pattern
            Displacements of the rest positions, or of the corners of the triangles in the plane of the pattern [m].
        cloth : str
            Its name; not needed where there is one.
        """
        names = [each.name for each in self.run.session.built.world.cloths]
        if cloth not in names and (cloth or len(names) != 1):
            raise InputError(f"There is no cloth {cloth!r}.", f"Cloths: {', '.join(names)}.")
        return rest_along(self.run, self.adjoints, names.index(cloth) if cloth else 0, np.asarray(field, np.float64))

    def _of_body(self, name: str, keys: list[str | int]) -> Floats:
        world = self.run.session.built.world
        names = [body.name for body in world.bodies]
        number, (what, *others) = entry_of(name, names, keys) if names else (0, keys)
        if not names or others:
            raise InputError(f"The gradient has no {name}.", f"Bodies: {', '.join(names) or 'none'}.")
        rows = world.body_slices[number]
        by_step = [self.adjoints.start[rows], *self.adjoints.prescribed[:, rows]]
        if what == "vertices":
            return np.sum(by_step, axis=0)
        if what == "position":
            return np.sum(by_step, axis=(0, 1))
        states = [self.run.steps[0].start, *(step.end for step in self.run.steps)]
        places = [state.positions[rows] for state in states]
        return np.sum(
            [np.cross(x - x.mean(axis=0), d).sum(axis=0) for x, d in zip(places, by_step, strict=True)], axis=0
        )
