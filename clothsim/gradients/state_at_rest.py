"""Energy of a quasi-static scene under its loads at the end, and the power of its forces by vertices."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.gradients.exact_system import mean_adjoint
from clothsim.mesh.world import World
from clothsim.physics.energies.protocols import AdaptiveStiffness, ElementGradients, Elementwise, History, Lagged
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import Built, build
from clothsim.scene.scene import Scene
from clothsim.solve.linear.direct_solver import NotPositiveDefiniteError
from clothsim.solve.linear.linear_system import System
from clothsim.solve.newton.potential import Potential
from clothsim.solve.stepping.integrators import BACKWARD_EULER, formula_of, prescribed
from clothsim.solve.stepping.state import first_state
from clothsim.solve.stepping.stepping import step_of


@dataclass(frozen=True)
class StateAtRest:
    """A potential, and positions that minimise it.

    Parameters
    ----------
    world : World
        Of the scene.
    potential : Potential
        Bound to the loads at the end of the run.
    system : System
        To factor its Hessian with.
    x : (N, 3) float64
        All rows, in the coordinates of the world [m].
    fixed : (k,) int array
        Cloth rows with prescribed positions.
    """

    world: World
    potential: Potential
    system: System
    x: Floats
    fixed: Ints

    @classmethod
    def of_scene(cls, scene: Scene, positions: Floats) -> "StateAtRest":
        """Bind a scene to its loads at the end of its run.

        Parameters
        ----------
        scene : Scene
            Without inertia, and without effects that remember how the state was reached.
        positions : (n, 3) float64
            Where its cloths ended [m].

        Raises
        ------
        InputError
            For another scene.
        """
        built = build(scene, affordable=True)
        cls.refuse_history(built)
        session, world, end = prepare(scene, built), built.world, scene.run_settings.duration
        integrator = session.integrator
        target = prescribed(world, integrator.constraints.values(), end)
        x = world.start()
        x[: world.n_cloth] = positions - world.origin
        x[target.vertices] = target.positions
        state = replace(first_state(world, integrator.dt), positions=x, velocities=np.zeros_like(x), time=end)
        formula = formula_of(BACKWARD_EULER, state, integrator.dt)
        potential = integrator.potential.begin(step_of(integrator, state, formula, integrator.dt, end))
        fixed = target.vertices[target.vertices < world.n_cloth]
        return cls(world, potential, integrator.system, x, fixed)

    @staticmethod
    def refuse_history(built: Built) -> None:
        """InputError for a scene whose end is not a minimum of an energy of the positions alone."""
        if "inertia" in built.energies:
            raise InputError(
                "The error of a goal by triangles is that of a cloth at rest, and the scene has effects.inertia.",
                "Leave effects.inertia out: the loads then grow over the run, and the cloth ends at rest.",
            )
        if built.world.rigid:
            raise InputError(
                "The error of a goal by triangles is not known with rigid bodies.",
                "Make them bodies with a motion: [[body]].",
            )
        for name, energy in built.energies.items():
            if isinstance(energy, Lagged | History) and not isinstance(energy, AdaptiveStiffness):
                raise InputError(
                    f"The error of a goal by triangles is not known with effects.{name}, which depends on the path.",
                    f"Leave effects.{name} out.",
                )

    def with_cloth(self, positions: Floats) -> Floats:
        """Return all rows with the cloths at `positions` (n, 3) [m], prescribed ones as they are."""
        x = self.x.copy()
        x[: self.world.n_cloth] = positions - self.world.origin
        x[self.fixed] = self.x[self.fixed]
        return x

    def unfinished(self, velocities: Floats) -> Floats:
        """Return velocity . force that the solve left at each vertex of the cloths, (n,)."""
        return np.asarray((self.potential.gradient(self.x) * velocities).sum(axis=1)[: self.world.n_cloth])

    def adjoint(self, states: Sequence[Floats], forces: Floats) -> Floats | None:
        """Solve with the mean of the exact Hessians at several states; None where it is not positive definite.

        Parameters
        ----------
        states : sequence of (N, 3) arrays
            Positions [m].
        forces : (N, 3) float64
            Right-hand side.

        Returns
        -------
        (N, 3) float64 or None
            0 in the prescribed rows.
        """
        try:
            return mean_adjoint(self.potential, states, self.system, self.fixed, forces)
        except NotPositiveDefiniteError:
            return None

    def powers(self, x: Floats, velocities: Floats, n: int) -> Floats:
        """Return velocity . gradient by the first n rows of x, that of an element shared equally among its ones.

        Energies without elements are taken vertex by vertex; velocities (N, 3) are 0 in the other rows.
        """
        out = np.zeros(len(x))
        for energy in self.potential.acting.values():
            divided = _divided(energy, x)
            if divided is None:
                out += (energy.gradient(x) * velocities).sum(axis=1)
                continue
            elements, forces = divided
            own = elements < n
            shares = (forces * velocities[elements]).sum(axis=(1, 2)) / np.maximum(own.sum(axis=1), 1)
            np.add.at(out, elements, np.where(own, shares[:, None], 0.0))
        return out[:n]


def _divided(energy: Any, x: Floats) -> tuple[Ints, Floats] | None:
    """Rows (m, k) of elements and their gradients (m, k, 3); None for an energy that has none."""
    if isinstance(energy, ElementGradients):
        return energy.element_gradients(x)
    if not isinstance(energy, Elementwise):
        return None
    elements = getattr(energy, energy.per_element[0])
    if elements.ndim == 1:  # vertices
        return None
    apart = np.arange(elements.size).reshape(elements.shape)  # each with vertices of its own
    gradient = replace(cast("Any", energy), **{energy.per_element[0]: apart}).gradient(x[elements].reshape(-1, 3))
    return elements, gradient.reshape(*elements.shape, 3)
