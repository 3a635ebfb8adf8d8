"""Simulation of a scene: frames, record, summary and checkpoint in a directory."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.inputs import refuse_uncallable, with_remedies
from clothsim.keys.section_hints import home_of
from clothsim.scene.cost import expected_cost, refuse_costly
from clothsim.scene.scene import Scene

if TYPE_CHECKING:
    from clothsim.run.recorded_run import Announcement, Listener, StepListener
    from clothsim.run.results import Run
    from clothsim.run.session import Session

RUNS_OF_RUNS = {
    "differentiable": "clothsim.gradients.run:simulate_differentiably",
    "solver.error": "clothsim.study.error_control.requested:simulate_to_error",
    "solver.estimate": "clothsim.study.error_control.coarser_run:simulate_with_estimate",
}
"""What takes a run in place of `simulate`, as text: higher rooms, imported only where a scene or a caller asks."""


@with_remedies(home_of)
def simulate(
    scene: Scene,
    output: str | Path | None = None,
    progress: "Listener | None" = None,
    announce: "Announcement | None" = None,
    dump_iterates: int | None = None,
    on_step: "StepListener | None" = None,
    message: Callable[[str], None] | None = None,
    overwrite: bool = False,
    force: bool = False,
    differentiable: bool = False,
    budget: float | None = None,
) -> "Run":
    """Simulate a scene to its end.

    Parameters
    ----------
    scene : Scene
        Scene from `clothsim.load_scene`, or from tables or arrays.
    output : str or Path, optional
        Directory for trajectory, record, summary and checkpoint; None: a new temporary one.
    progress : callable, optional
        Called with a `Progress` after each step.
    announce : callable, optional
        Called once with the session, before the first step.
    dump_iterates : int, optional
        Number of a step, from 1, whose Newton iterates are written too.
    on_step : callable, optional
        Called with the `clothsim.SimulationState` after each step.
    message : callable, optional
        Called with a line of text if the run is expected to need much time or memory, and before each run that
        solver.error needs. All these runs except the pilot runs are announced, shown and written to the directory; the
        last one stays there.
    overwrite : bool
        True: replace an earlier run in the directory.
    force : bool
        True: start the run at any expected cost, with motions of any length in a step, and with cloth that starts
        inside a body (run.allow_inside).
    differentiable : bool
        True: the run stores its steps and has a method `gradient` (docs/howto/gradients.md). With solver.error, the
        settings are chosen first, and the gradient is that of the run with these.
    budget : float, optional
        CPU time [s] of the steps, in place of run.budget; it does not apply to a run that resumes this one.

    Returns
    -------
    Run
        A run that cannot continue has the status "failed" and a reason; its frames and its last good state remain.
        With `differentiable`, it is a `clothsim.gradients.run.DifferentiableRun`.

    Raises
    ------
    InputError
        For a scene that cannot be built, or a directory that cannot be written, that another run writes to, or that
        holds an earlier run without `overwrite`; without `force`, also for a cost beyond the capacity of the machine.

    Warns
    -----
    IntersectionWarning
        If cloth intersects cloth or a body in a step, and the contact effect that would prevent this is off.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.Scene(
    ...     cloth=clothsim.Cloth([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]),
    ...     effects=[clothsim.Inertia(), clothsim.Gravity()],
    ...     run=clothsim.RunSettings(duration=0.08),
    ... )
    >>> run = clothsim.simulate(scene)
    >>> run.status, len(run), run.times.tolist()
    ('completed', 3, [0.0, 0.04, 0.08])
    >>> bool(run[-1].positions["cloth"][0, 2] < -0.03)
    True
    """
    from clothsim.run.resume import begun_run, refuse_earlier_run  # energies, SciPy and numba take over a second

    refuse_uncallable(progress=progress, announce=announce, on_step=on_step, message=message)
    directory = Path(tempfile.mkdtemp(prefix="clothsim-") if output is None else output)
    refuse_earlier_run(directory, overwrite, (), (scene,))  # before minutes of building, and again under the lock
    if isinstance(scene, Scene):
        if budget is not None:
            replace(scene, run={**scene.run, "budget": budget})  # refused as that key is
        if force:
            scene = replace(scene, run={**scene.run, "allow_inside": True})
        if not force:
            refuse_costly(scene)
        cost = expected_cost(scene)
        if message is not None and cost.notable:
            message(f"expected: {cost}")
        asked = scene.solver_settings
        if differentiable or asked.error or asked.estimate:
            scene.refuse_without_cloth("solver.error, solver.estimate or a gradient")
    tell = message or (lambda line: None)
    own: list[Scene] = []

    def run(some: Scene, sessions: "list[Session]", directory: Path = directory) -> "Run":
        replace_it = overwrite or bool(own)  # solver.error takes several runs
        own.append(some)
        announced = [sessions.append, announce]
        listener = progress
        if progress is not None and len(own) > 1:
            label = f"run {len(own)}"
            listener = lambda done: progress(replace(done, stage=label))  # noqa: E731
        return begun_run(some, directory, (listener, on_step), announced, dump_iterates, (replace_it, force), budget)

    if differentiable:
        if budget is not None:
            raise InputError("A differentiable run has no argument budget.", "Give the scene run.budget.")
        if isinstance(scene, Scene) and scene.solver_settings.error:
            with tempfile.TemporaryDirectory(prefix="clothsim-") as folder:
                chosen = _loaded("solver.error")(scene, partial(run, directory=Path(folder)), tell)
                if chosen.status != "completed":
                    raise ClothsimError(f"The run failed, and has no gradient: {chosen.reason}")
                scene = chosen.scene
            tell(f"The gradient is that of the scene with what was chosen. {chosen.summary['notes'][-1]}")
        differentiably = _loaded("differentiable")
        return differentiably(scene, output, progress, announce, on_step, message, overwrite)
    if isinstance(scene, Scene) and scene.solver_settings.error:  # `build` refuses what is not a scene
        return _loaded("solver.error")(scene, run, tell)
    if isinstance(scene, Scene) and scene.solver_settings.estimate:
        return _loaded("solver.estimate")(scene, run, tell)
    return run(scene, [])


def _loaded(kind: str) -> Any:
    """The function of `RUNS_OF_RUNS` of that name."""
    module, function = RUNS_OF_RUNS[kind].split(":")
    return getattr(import_module(module), function)
