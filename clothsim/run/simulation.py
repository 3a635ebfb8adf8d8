"""Stepping a scene by hand."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.inputs import with_remedies
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, packed, read_checkpoint, unpacked, write_checkpoint
from clothsim.geometry.intersection.proved_separations import ProvedSeparations
from clothsim.keys.value_checks import refuse_absent
from clothsim.physics.energies.protocols import with_material_at
from clothsim.run.changes import (
    HandMotions,
    body_at,
    driven,
    new_pins,
    pin_groups,
    pinned_rows,
    pins_at,
    refuse_infeasible,
    rows_of_moved_body,
    with_effect,
    with_fabric,
)
from clothsim.run.checkpoints import restored_simulation, saved_simulation
from clothsim.run.fields import Configuration, field
from clothsim.run.intersections import IntersectionHistory, checked_step
from clothsim.run.session import Session, check_rotation_per_step, prepare
from clothsim.run.step_reports import SimulationError, SimulationState, starting_state, state_after
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.failure import Failure
from clothsim.solve.stepping.state import Rest, State, first_state
from clothsim.solve.stepping.time_loop import finished, next_step


class Simulation:
    """A scene that is stepped by hand.

    Iteration takes one step at a time until the duration of the scene; `step` also continues beyond it. Between two
    steps wind, gravity, the keys of effects, fabrics, pins and bodies can be read and changed. A change acts from the
    next step on and is exact: with ``threads = 1``, the steps after it equal, bit for bit, those of a scene that had
    the value from the start and reached the same state. Steps without changes are those of `clothsim.simulate`.

    A step that fails raises `SimulationError`. The simulation stays at its last good state. It can continue after a
    change (a pin moved back, a body slowed down), or be saved.

    Parameters
    ----------
    scene : Scene
        Scene from `clothsim.load_scene`, or from tables or arrays.

    Attributes
    ----------
    state : SimulationState
        The end of the last step.
    failure : Failure or None
        Failure of the last step; None if it succeeded.

    Examples
    --------
    A trimesh cloth falls on a pyvista body; halfway through, wind begins to blow along x:

    >>> import clothsim, numpy, pyvista, trimesh
    >>> x, y = 0.125 * numpy.indices((9, 9)).reshape(2, 81) - 0.5
    >>> corners = numpy.arange(72).reshape(8, 9)[:, :8].reshape(64, 1)
    >>> triangles = numpy.concatenate([corners + [0, 10, 1], corners + [0, 9, 10]])
    >>> sheet = trimesh.Trimesh(numpy.stack([x, y, numpy.full(81, 0.32)], axis=1), triangles, process=False)
    >>> ball = pyvista.Sphere(radius=0.3, theta_resolution=16, phi_resolution=16)
    >>> elastic = [clothsim.Membrane(), clothsim.Bending()]
    >>> loads = [clothsim.Inertia(), clothsim.Gravity(), clothsim.Air()]
    >>> contact = [clothsim.BodyContact(), clothsim.SelfContact()]
    >>> scene = clothsim.Scene(
    ...     cloth=clothsim.Cloth(sheet, name="sheet", fabric="cotton"),
    ...     body=clothsim.Body(ball, name="ball"),
    ...     effects=elastic + loads + contact,
    ...     solver=clothsim.Solver(dt=0.02, threads=1),
    ...     run=clothsim.RunSettings(duration=0.2),
    ... )
    >>> simulation = clothsim.Simulation(scene)
    >>> for state in simulation:
    ...     if state.step == 5:
    ...         simulation.wind = (8.0, 0.0, 0.0)
    >>> bool(state.positions["sheet"][:, 0].mean() > 0.02), state.minimum_gap > 0
    (True, True)
    """

    def __init__(self, scene: Scene) -> None:
        session = prepare(scene, build(scene))
        state = first_state(session.built.world, session.integrator.dt)
        proofs = ProvedSeparations()
        history, _ = checked_step(session, IntersectionHistory(), state, is_frame=True, proofs=proofs)
        self._begin(session, state, HandMotions(), history, proofs)

    def _begin(
        self,
        session: Session,
        state: State,
        by_hand: HandMotions,
        history: IntersectionHistory,
        proofs: ProvedSeparations | None = None,
    ) -> None:
        self._proofs = proofs or ProvedSeparations()
        self._session, self._state, self._by_hand, self._history = session, state, by_hand, history
        self.state: SimulationState = starting_state(session.built.world, state)
        energies = with_material_at(session.built.energies, state.time)
        self._configuration = Configuration(session.built.world, state.positions, energies)
        self.failure: Failure | None = None

    def __repr__(self) -> str:
        ended = ", failed" if self.failure is not None else ""
        ended += ", INTERSECTS" if self.intersection_free is False else ""
        return f"<Simulation at {self.state.time:g} s of {self.duration:g} s, step {self.state.step}{ended}>"

    @property
    def scene(self) -> Scene:
        """The scene with those changes that a scene can express."""
        return self._session.scene

    @property
    def duration(self) -> float:
        """Duration of the scene [s]."""
        return self.scene.run_settings.duration

    @property
    def finished(self) -> bool:
        """True if the duration of the scene is over or, with ``until = "rest"``, the cloth is at rest."""
        run = self.scene.run_settings
        return finished(self._state, run.duration, run.frames_per_second, run.until)

    def __iter__(self) -> Iterator[SimulationState]:
        """Take the steps that are left of the scene, one state a step."""
        while not self.finished:
            yield self.step()

    @with_remedies()
    def step(self) -> SimulationState:
        """Take one step, even beyond the duration of the scene.

        Returns
        -------
        SimulationState
            The end of the step.

        Raises
        ------
        SimulationError
            The step failed, or its end intersects; the simulation is then at the state before it.
        """
        integrator, run = self._session.integrator, self.scene.run_settings
        if integrator.control is not None and self.finished:
            raise InputError("solver.error is for the duration of the scene.", "Give a longer run.duration.")
        report = next_step(integrator, self._state, run.duration, run.frames_per_second)
        history, self.failure = self._history, report.failure
        if report.failure is None:
            history, self.failure = checked_step(
                self._session, history, report.state, report.frame_done, self._proofs, report.dt
            )
        if self.failure is not None:
            raise SimulationError(self.failure)
        world, energies = self._session.built.world, report.potential.energies
        self._state, self.state, self._history = report.state, state_after(world, report), history
        self._configuration = Configuration(world, report.state.positions, energies, bound=True)
        return self.state

    def field(self, name: str) -> NDArray[np.floating]:
        """Values of a field at the end of the last step.

        Parameters
        ----------
        name : str
            As in `Run.field`.

        Returns
        -------
        ndarray
            (m, ...) for a field of the triangles, (n, ...) for one of the vertices, in SI units.

        Raises
        ------
        InputError
            For an unknown name, or for "contact_pressure" before the first step.

        Examples
        --------
        >>> import clothsim
        >>> cloth = clothsim.Cloth([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], velocity=[0, 0, 1])
        >>> scene = clothsim.Scene(cloth, effects=[clothsim.Inertia(), clothsim.Membrane()])
        >>> simulation = clothsim.Simulation(scene)
        >>> state = simulation.step()
        >>> simulation.field("principal_stretches").round(9), simulation.field("contact_pressure")
        (array([[1., 1.]]), array([0., 0., 0.]))
        """
        return field(name, self._configuration)

    @property
    def intersection_free(self) -> bool | None:
        """As in the certificate of a run, for all states so far."""
        return self._history.intersection_free

    @property
    def intersections(self) -> dict[str, Any]:
        """As in the certificate of a run, for all states so far."""
        return self._history.as_dict()

    # --- changes of effects and fabrics ---

    @property
    def wind(self) -> Any:
        """Wind of the effect "air" as a scene gives it: (3,) [m/s], a table with its kind, or a function."""
        return self._key("air", "wind")

    @wind.setter
    def wind(self, value: Any) -> None:
        self.change("air", wind=value)

    @property
    def gravity(self) -> Any:
        """Acceleration of the effect "gravity", (3,) [m/s2]."""
        return self._key("gravity", "acceleration")

    @gravity.setter
    def gravity(self, value: ArrayLike) -> None:
        self.change("gravity", acceleration=value)

    def change(self, effect: str, **keys: Any) -> None:
        """Change keys of an effect; the other keys stay the same.

        Parameters
        ----------
        effect : str
            An effect that the scene names, other than "pins".
        **keys
            As in the scene: ``change("friction", coefficient=0.5)``.

        Raises
        ------
        InputError
            For an effect that the scene does not name, an unknown key or a bad value; nothing is changed then.
        """
        session = with_effect(self._session, self._by_hand, effect, keys)
        refuse_infeasible(session, self._session, effect, self._state)
        self._set_session(session)

    def _key(self, effect: str, key: str) -> Any:
        refuse_absent("effect", effect, self.scene.effects)
        return getattr(self.scene.effects[effect], key)

    def set_fabric(self, fabric: str | None = None, *, cloth: str | None = None, **keys: float) -> None:
        """Give a cloth another fabric. Its masses and all energies are computed again; its rest shape stays the same.

        Parameters
        ----------
        fabric : str, optional
            A named fabric; default: that of the scene.
        cloth : str, optional
            The name of the cloth; not needed if there is only one.
        **keys
            Keys of the cloth that override the fabric: ``density``, ``bending_stiffness``, ...
        """
        self._set_session(with_fabric(self._session, self._by_hand, fabric, cloth, keys))

    # --- pins ---

    @property
    def pins(self) -> dict[str, Floats]:
        """Positions of the pinned vertices of each group by its name ("pins", "pins.group[0]"), (k, 3) [m]."""
        x = self._state.positions + self._session.built.world.origin
        n = self._session.built.world.n_cloth
        return {group.name: x[group.vertices[group.vertices < n]] for group in pin_groups(self._session.built)}

    def move_pins(self, positions: ArrayLike, group: str = "pins") -> None:
        """Prescribe the positions of the vertices of a group at the end of the next step and after it.

        Parameters
        ----------
        positions : (k, 3) array
            In the order of ``simulation.pins[group]`` [m].
        group : str
            A name of `pins`. A clamped group also holds directions; only `drive_pins` can move it.
        """
        pinned = pins_at(self._session.built, self._state, group, positions)
        self._set_motions(self._by_hand.with_pins(group, pinned))

    def drive_pins(
        self,
        group: str = "pins",
        *,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        rotate_degrees_per_second: ArrayLike = (0.0, 0.0, 0.0),
        centre: ArrayLike | None = None,
    ) -> None:
        """Move a group of pins rigidly from where it is now; without arguments it stops.

        Parameters
        ----------
        group : str
            A name of `pins`.
        velocity, rotate_degrees_per_second, centre : (3,) array
            As in the motion of a scene [m/s], [degrees/s], [m]. Default centre: the mean of the group.
        """
        keys = {"velocity": velocity, "rotate_degrees_per_second": rotate_degrees_per_second}
        rows = pinned_rows(self._session.built, group)
        motion = driven(self._session.built.world, self._state, group, rows, keys, centre)
        self._set_motions(self._by_hand.with_pins(group, (rows, motion)))

    def add_pins(self, group: str, vertices: Sequence[int], cloth: str | None = None) -> None:
        """Pin vertices of a cloth where they are now.

        Parameters
        ----------
        group : str
            A name for the new group.
        vertices : sequence of int
            Vertices of the cloth, none of them pinned yet.
        cloth : str, optional
            The name of the cloth; not needed if there is only one.
        """
        pinned = new_pins(self._session.built, self._state, group, vertices, cloth)
        self._set_motions(self._by_hand.with_pins(group, pinned))

    def release_pins(self, group: str = "pins") -> None:
        """Release a group of pins: its vertices move freely from the next step on."""
        if (pinned_rows(self._session.built, group) >= self._session.built.world.n_cloth).any():
            raise InputError(f"{group} is clamped and cannot be released.", "Use clamp = false in the scene.")
        self._set_motions(self._by_hand.with_pins(group, None))

    # --- bodies ---

    def move_body(self, name: str, positions: ArrayLike) -> None:
        """Prescribe the positions of the vertices of a body at the end of the next step and after it, (n, 3) [m]."""
        motion = body_at(self._session.built.world, self._state, name, positions)
        self._set_motions(self._by_hand.with_body(name, motion))

    def drive_body(
        self,
        name: str,
        *,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        rotate_degrees_per_second: ArrayLike = (0.0, 0.0, 0.0),
        centre: ArrayLike | None = None,
    ) -> None:
        """Move a body rigidly from where it is now; without arguments it stops. Parameters as in `drive_pins`."""
        keys = {"velocity": velocity, "rotate_degrees_per_second": rotate_degrees_per_second}
        world = self._session.built.world
        motion = driven(world, self._state, name, rows_of_moved_body(world, name), keys, centre)
        self._set_motions(self._by_hand.with_body(name, motion))

    def _set_motions(self, by_hand: HandMotions) -> None:
        session = self._session
        built = by_hand.applied(session.built)
        check_rotation_per_step(built, session.integrator.dt)
        integrator = replace(session.integrator, world=built.world, constraints=built.constraints)
        previous = self._state.previous if by_hand.pins is self._by_hand.pins else None  # BDF2 restarts at a jump
        self._by_hand, self._state = by_hand, replace(self._state, blocked_at=nan, blocked=0, previous=previous)
        self._set_session(replace(session, built=built, integrator=integrator))

    def _set_session(self, session: Session) -> None:
        """Take a changed session; what was at rest may move now."""
        self._session, self._state = session, replace(self._state, slow_steps=0, rest=Rest.MOVING)

    def branch(self) -> "Simulation":
        """A second, independent simulation at the same state; no array is copied.

        Both share the scene's energies and the linear solver, so do not use them in two threads at the same time.
        """
        other = object.__new__(Simulation)
        other.__dict__.update(self.__dict__)
        return other

    def save(self, path: str | Path) -> None:
        """Write the state, the scene with its mesh files, and all changes to a file (.npz), for `restore`.

        InputError if a key of an effect is a Python function, which cannot be stored.
        """
        write_checkpoint(path, saved_simulation(self._session, self._state, self._by_hand, self._history))

    @classmethod
    def restore(cls, path: str | Path) -> "Simulation":
        """The simulation that `save` wrote, or one at the last good state of a run.

        Parameters
        ----------
        path : str or Path
            A file of `save`, or the directory of a run.

        Returns
        -------
        Simulation
            A simulation that takes the same steps as the saved one, bit for bit with ``threads = 1``.
        """
        file = Path(path) / CHECKPOINT_NAME if Path(path).is_dir() else Path(path)
        simulation = object.__new__(cls)
        simulation._begin(*restored_simulation(read_checkpoint(file), str(file), file.parent))
        return simulation

    __copy__ = branch

    def __getstate__(self) -> dict[str, Any]:
        """What `save` writes, for pickle and `copy.deepcopy`."""
        saved = saved_simulation(self._session, self._state, self._by_hand, self._history)
        return {"saved": packed(saved), "state": self.state, "failure": self.failure}

    def __setstate__(self, given: dict[str, Any]) -> None:
        """Restore the simulation of `__getstate__`, with a linear solver of its own."""
        self._begin(*restored_simulation(unpacked(given["saved"], "The pickle"), "The pickle", Path()))
        self.state, self.failure = given["state"], given["failure"]
