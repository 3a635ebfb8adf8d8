"""One step of a scene as a differentiable function of a state and of numbers, and chains of such steps.

    z_(n+1) = f(z_n, p),     z = (x, v, the step before, what each effect carries over)

Steps have the length dt of the scene, and the stiffness of contact that a run of it took (`Trace.held_scene`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, overload

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_count, as_finite, as_number, as_points
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.inputs import shown
from clothsim.gradients.backward_pass import (
    Adjoints,
    StateAdjoint,
    StepBack,
    no_adjoint,
    remember,
    step_back,
    with_remembered_pairs,
)
from clothsim.gradients.bridge import held_stiffness
from clothsim.gradients.differentiable_session import RecordedStep, differentiable_session, recorded, with_stiffness
from clothsim.gradients.gradient import rest_derivative, with_rest_positions
from clothsim.gradients.parameters import full_path, scene_derivative, value_at, with_value
from clothsim.gradients.run import Trace, begun
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Constraint, Energy, Prescribed
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.run.session import Session, prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.newton.potential import Potential
from clothsim.solve.pinch.pinch import advance_flypapering
from clothsim.solve.stepping.integrators import prescribed
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import Integrator, advance

ARRAYS = ("pins", "force", "cloth.rest")
"""Parameters that are not numbers of the scene."""

MOST_STEPS = 1_000_000
"""Bound on the steps of a rollout."""

Parameters = Mapping[str, Any]
"""Numbers and arrays by name: paths of the scene, and ARRAYS."""


@dataclass(frozen=True, eq=False)
class LayerState:
    """State between two steps.

    Parameters
    ----------
    inner : State
        With the step before and what each effect carries over, positions relative to `origin`.
    n : int
        Number of cloth vertices.
    origin : (3,) array
        Origin of the positions [m].
    """

    inner: State
    n: int
    origin: Floats

    @property
    def x(self) -> Floats:
        """Positions of all cloth vertices, (n, 3) [m]."""
        return np.asarray(self.inner.positions[: self.n] + self.origin)

    @property
    def v(self) -> Floats:
        """Their velocities, (n, 3) [m/s]."""
        return self.inner.velocities[: self.n]

    @property
    def time(self) -> float:
        """Time [s]."""
        return self.inner.time

    def inner_at(self, origin: Floats) -> State:
        """The state with positions relative to another origin (3,) [m]: that of the world depends on where cloth is."""
        by, before = self.origin - origin, self.inner.previous
        if not by.any():
            return self.inner
        moved = None if before is None else replace(before, positions=before.positions + by)
        return replace(self.inner, positions=self.inner.positions + by, previous=moved)


@dataclass(frozen=True, eq=False)
class ConstantForce(Energy):
    """E = -sum f_i . x_i; forces (N, 3) [N]."""

    forces: Floats

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        return -float(np.vdot(self.forces, x))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return -self.forces

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """No blocks."""
        return ElementHessian(np.zeros((0, 1), np.int64), np.zeros((0, 3, 3)))


@dataclass(frozen=True, eq=False)
class PlacedPins(Constraint):
    """Pins of a scene, the cloth's among them at given places.

    Parameters
    ----------
    pins : Constraint
        Those of the scene.
    rows, places : (k,) int, (k, 3) array
        Pinned vertices of the cloth, and their positions at the end of each step [m].
    """

    pins: Constraint
    rows: Ints
    places: Floats

    @property
    def still(self) -> bool:
        """False: their motion is prescribed by the parameter."""
        return False

    def at(self, time: float) -> Prescribed:
        """All pinned vertices and their positions."""
        target = self.pins.at(time)
        positions, place = target.positions.copy(), {int(row): k for k, row in enumerate(self.rows)}
        for k, row in enumerate(target.vertices):
            if int(row) in place:
                positions[k] = self.places[place[int(row)]]
        return replace(target, positions=positions)


@dataclass(frozen=True, eq=False)
class StepModel:
    """A scene with values of parameters: its session, and the integrator with pins and forces besides."""

    session: Session
    integrator: Integrator
    names: tuple[str, ...]

    @cached_property
    def remembering(self) -> Integrator:
        """The integrator for a backward pass."""
        return with_remembered_pairs(self.integrator)

    def derivatives(self, steps: Sequence[RecordedStep], backs: Sequence[StepBack]) -> dict[str, Floats]:
        """Return dL by each parameter, held over the steps."""
        world = self.session.built.world
        n, zero = world.n_cloth, np.zeros((world.n_vertices, 3))
        held = np.array([back.prescribed for back in backs])
        forces = np.array([back.forces[:n] for back in backs])
        own = held.copy()
        if "pins" in self.names:  # prescribed by the parameter, not by the scene
            own[:, :n] = 0.0
        memory_adjoints = tuple(back.memory_adjoints for back in backs)
        adjoints = Adjoints(forces, own, zero, zero, np.zeros(len(backs)), np.zeros(len(backs)), memory_adjoints)
        trace = Trace(self.session, tuple(steps))
        arrays = {
            "pins": lambda: held[:, steps[0].fixed_rows(self.integrator)].sum(axis=0),
            "force": lambda: forces.sum(axis=0),
            "cloth.rest": lambda: rest_derivative(trace, adjoints),
        }
        return {
            name: arrays[name]() if name in arrays else scene_derivative(trace, adjoints, full_path(name))
            for name in self.names
        }


@dataclass(frozen=True, eq=False)
class Rollout:
    """Steps from a state.

    Attributes
    ----------
    layer : Layer
        The layer.
    states : tuple of LayerState
        The state given, and that after each step.
    """

    layer: "Layer"
    states: tuple[LayerState, ...]
    steps: tuple[RecordedStep, ...]
    models: tuple[StepModel, ...]
    by_step: bool

    @property
    def x(self) -> Floats:
        """Positions of all states, (k + 1, n, 3) [m]."""
        return np.stack([state.x for state in self.states])

    @property
    def v(self) -> Floats:
        """Velocities of all states, (k + 1, n, 3) [m/s]."""
        return np.stack([state.v for state in self.states])

    def vjp(
        self, by_x: Floats | None = None, by_v: Floats | None = None, by_end: StateAdjoint | None = None
    ) -> tuple[StateAdjoint, Any]:
        """Return the derivatives of a loss by the first state and by the parameters.

        Parameters
        ----------
        by_x, by_v : (k + 1, n, 3) array, optional
            dL by the positions [loss/m] and velocities of all states.
        by_end : StateAdjoint, optional
            dL by all that the last state has, from the steps after it.

        Returns
        -------
        StateAdjoint
            By the state at the start, in rows of all vertices (those of the cloth first).
        dict, or list of dict
            By the parameters by name; of each step where they were given step by step.

        Raises
        ------
        NoMinimumError
            Where a step did not end at a minimum.
        """
        rows = self.layer.session.built.world.n_vertices
        given = [_rows("by_x", by_x, self.x.shape, rows), _rows("by_v", by_v, self.x.shape, rows)]
        state, backs = (by_end or no_adjoint(rows)).plus(given[0][-1], given[1][-1]), list[StepBack]()
        for k in range(len(self.steps) - 1, -1, -1):
            integrator = self.models[k].remembering
            for near in self.steps[max(k - 1, 0) : k + 1]:
                remember(integrator, near)
            backs.append(step_back(integrator, self.steps[k], state, f"after step {k + 1}"))
            state = backs[-1].state.plus(given[0][k], given[1][k])
        backs.reverse()
        if not self.by_step:
            return state, self.models[0].derivatives(self.steps, backs) if self.steps else {}
        each = zip(self.models, self.steps, backs, strict=True)
        return state, [model.derivatives([step], [back]) for model, step, back in each]


def _numbers(name: object, value: Any) -> Floats:
    """A parameter as finite numbers. InputError names it."""
    if not isinstance(name, str):
        raise InputError(
            f"{shown(name)} is not a name of a parameter.", f"Give a path of the scene, or {', '.join(ARRAYS)}."
        )
    return as_finite(name, value)


def _rows(name: str, given: Floats | None, shape: tuple[int, ...], rows: int) -> Floats:
    out = np.zeros((shape[0], rows, 3))
    if given is not None:
        array = as_finite(name, given)
        if array.shape != shape:
            raise InputError(f"{name} has the shape {array.shape}, the positions of all states {shape}.")
        out[:, : shape[1]] = array
    return out


@dataclass(frozen=True, eq=False)
class Layer:
    """A step of a scene as a function: of a state, or of positions and velocities without history.

    Parameters
    ----------
    scene : Scene
        The scene, contact stiffnesses held.
    session : Session
        Its session, with polished solves.

    Examples
    --------
    A sheet that hangs from two corners: the mean height after 5 steps, by the velocities at the start.

    >>> import clothsim, numpy
    >>> effects = [clothsim.Inertia(), clothsim.Membrane(), clothsim.Gravity(), clothsim.Pins(select=[0, 3])]
    >>> sheet = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [3, 3], "youngs_modulus": 1e4}
    >>> layer = clothsim.layer(clothsim.Scene(cloth=sheet, effects=effects))
    >>> rollout = layer.rollout(layer.start, {"cloth.youngs_modulus": 2e4}, 5)
    >>> by_x = numpy.zeros_like(rollout.x)
    >>> by_x[-1, :, 2] = 1 / 16
    >>> by_start, by_parameters = rollout.vjp(by_x)
    >>> rollout.x.shape, by_start.velocities.shape, bool(by_parameters["cloth.youngs_modulus"] > 0)
    ((6, 16, 3), (16, 3), True)
    """

    scene: Scene
    session: Session

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self.session.integrator.dt

    @cached_property
    def start(self) -> LayerState:
        """The state at the start of the scene."""
        return _public(self.session.built.world, first_state(self.session.built.world, self.dt))

    @cached_property
    def pinned(self) -> Ints:
        """Pinned vertices of the cloth, (k,): the rows of the parameter `pins`."""
        world = self.session.built.world
        rows = prescribed(world, self.session.integrator.constraints.values(), self.dt).vertices
        return rows[rows < world.n_cloth]

    def state(self, x: Any, v: Any, time: float = 0.0) -> LayerState:
        """Return the state without a past: positions x and velocities v (n, 3) of the cloth at a time [s].

        The cloth must be free of intersections: that is not checked.
        """
        world, inner = self.session.built.world, begun(self.session, {"start": x, "velocity": v})
        positions = inner.positions.copy()
        for body, rows in zip(world.bodies, world.body_slices, strict=True):
            positions[rows] = body.at(time)
        return _public(world, replace(inner, time=as_number("time", time), positions=positions))

    @overload
    def __call__(self, state: LayerState, parameters: Parameters | None = None) -> LayerState: ...

    @overload
    def __call__(self, state: Any, parameters: Any) -> tuple[Floats, Floats]: ...

    def __call__(self, state: Any, parameters: Any = None) -> Any:
        """Return the state after a step; `layer(x, v)` of a state without a past, returned as (x, v).

        Raises
        ------
        ClothsimError
            Where the step cannot be taken.
        """
        if isinstance(state, LayerState):
            return self.rollout(state, parameters, 1).states[-1]
        after = self.rollout(self.state(state, parameters), None, 1).states[-1]
        return after.x, after.v

    def vjp(
        self, x: Any, v: Any, adjoint_x: Any, adjoint_v: Any, parameters: Parameters | None = None
    ) -> tuple[Floats, Floats, dict[str, Floats]]:
        """Return dL by x and v (n, 3) and by the parameters, of a step without a past and dL by its (x, v)."""
        rollout = self.rollout(self.state(x, v), parameters, 1)
        zero = np.zeros_like(rollout.states[0].x)
        for name, given in (("adjoint_x", adjoint_x), ("adjoint_v", adjoint_v)):
            if np.shape(given) != zero.shape:
                raise InputError(f"{name} has the shape {np.shape(given)}, the positions {zero.shape}.")
        by, by_parameters = rollout.vjp(np.stack([zero, adjoint_x]), np.stack([zero, adjoint_v]))
        n = len(zero)
        return by.positions[:n], by.velocities[:n], by_parameters

    def rollout(self, state: LayerState, parameters: Parameters | Sequence[Parameters] | None, k: int) -> Rollout:
        """Take k steps.

        Parameters
        ----------
        state : LayerState
            Where they begin.
        parameters : mapping, or sequence of k mappings
            Held over the steps, or step by step: any number or array of the scene by its path; `pins` (k, 3), the
            places of the pinned vertices at the end of the step [m]; `force` (n, 3) on the vertices [N]; `cloth.rest`
            (n, 3), the rest positions of the one cloth [m].
        k : int
            Number of steps.

        Raises
        ------
        InputError
            For a parameter that is none.
        ClothsimError
            Where a step cannot be taken.
        """
        if not isinstance(state, LayerState):
            raise InputError(f"state is {shown(state)}, not one of a layer.", "Use layer.start or layer.state(x, v).")
        k = as_count("k", k, least=0, most=MOST_STEPS)
        by_step = parameters is not None and not isinstance(parameters, Mapping)
        if by_step and (not isinstance(parameters, Sequence) or not all(isinstance(p, Mapping) for p in parameters)):
            raise InputError(
                f"parameters is {shown(parameters)}, not numbers by name.", 'Give {"cloth.youngs_modulus": 1e4}.'
            )
        held = [parameters or {}] * k if isinstance(parameters, Mapping | None) else list(parameters)
        each = [{name: _numbers(name, value) for name, value in given.items()} for given in held]
        if len(each) != k:
            raise InputError(f"There are parameters of {len(each)} steps, and {k} steps.")
        known, models = dict[bytes, StepModel](), list[StepModel]()
        states, steps = [state], list[RecordedStep]()
        for given in each:
            key = b"".join(name.encode() + value.tobytes() for name, value in given.items())
            if key not in known:
                known[key] = self._model(given)
            inner = states[-1].inner_at(known[key].session.built.world.origin)
            end, integrator = inner.time + self.dt, known[key].integrator
            begun_step = replace(inner, dt=1.01 * self.dt)
            if integrator.flypapers:
                report, _ = advance_flypapering(integrator, begun_step, end)
            else:
                report = advance(integrator, begun_step, end, retries=False)
            if report.failure is not None or report.state.time != end:
                why = "it has to be shorter." if report.failure is None else report.failure.sentence
                raise ClothsimError(f"Step {len(steps) + 1}: {why}", "Give a shorter solver.dt.")
            steps.append(recorded(inner, report))
            models.append(known[key])
            states.append(_public(known[key].session.built.world, report.state))
        return Rollout(self, tuple(states), tuple(steps), tuple(models), by_step)

    def _model(self, values: Mapping[str, Floats]) -> StepModel:
        session, world, scene = self.session, self.session.built.world, self.scene
        for name, value in values.items():
            if name not in ARRAYS:
                value_at(scene, world, full_path(name))
                scene = with_value(scene, full_path(name), value)
        if scene is not self.scene:
            session = differentiable_session(prepare(scene, build(scene, affordable=True)))
        if "cloth.rest" in values:
            session = with_rest_positions(session, values["cloth.rest"])
        integrator = session.integrator
        if "pins" in values:
            if values["pins"].shape != (len(self.pinned), 3) or not len(self.pinned):
                raise InputError(f"pins has the shape {values['pins'].shape}, and {len(self.pinned)} are pinned.")
            given = as_points("pins", values["pins"])
            here = session.built.world.origin
            places = PlacedPins(integrator.constraints["pins"], self.pinned, given - here)
            integrator = replace(integrator, constraints={**integrator.constraints, "pins": places})
        if "force" in values:
            forces = np.zeros((world.n_vertices, 3))
            given = as_points("force", values["force"])
            if len(given) != world.n_cloth:
                raise InputError(f"force has {len(given)} rows, the cloth {world.n_cloth} vertices.")
            forces[: world.n_cloth] = given
            energies = {**integrator.potential.energies, "force": ConstantForce(forces)}
            integrator = replace(integrator, potential=Potential(energies, integrator.potential.timers))
        return StepModel(session, integrator, tuple(values))


def _public(world: World, inner: State) -> LayerState:
    return LayerState(inner, world.n_cloth, world.origin)


def layer(scene: Scene) -> Layer:
    """Return a step of a scene as a differentiable function of its state and of numbers.

    Parameters
    ----------
    scene : Scene
        The scene. Contact whose stiffness a rule chooses is held at the largest of a run of it.

    Raises
    ------
    InputError
        For what has no gradient, by its name.
    """
    if not isinstance(scene, Scene):
        raise InputError(
            f"A layer is made from a clothsim.Scene, not from {shown(scene)}.",
            'Load one: clothsim.load_scene("scene.toml").',
        )
    scene.refuse_without_cloth("a layer")
    held = held_stiffness(scene)
    session = prepare(scene, build(scene, affordable=True))
    made = differentiable_session(with_stiffness(session, held))
    return Layer(Trace(made, ()).held_scene, made)
