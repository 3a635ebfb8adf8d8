"""Error estimate of a run with given settings: pilot runs with all of them coarser by two and by four."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from clothsim import Run, Scene
from clothsim.study.error_control.parameter_errors import COARSER, from_three, root_sum
from clothsim.study.error_control.resolution import (
    RefinableScene,
    Resolution,
    Runs,
    Trial,
    acting,
    another_shape,
    differences_of,
    has_cells_for,
    refinable_scene,
    trial_at,
    with_estimate,
    written_run,
)
from clothsim.study.error_control.search import Message
from clothsim.study.parameters import CELLS, D_HAT, TIME, steps_per_frame


@dataclass(frozen=True)
class Coarsened:
    """Resolutions of the pilot runs, what is coarser in them, and the reason for each parameter that is not."""

    resolutions: tuple[Resolution, ...]
    parameters: tuple[str, ...]
    fixed: Mapping[str, str]


def simulate_with_estimate(scene: Scene, runs: Runs, message: Message) -> Run:
    """Simulate a scene, then with dt x 2, half the cells and d_hat x 2, and once more with all of them by four.

    The summary of the run that is returned has the estimate; what could not be coarser is named there, and its error
    is not known.
    """
    refinable = refinable_scene(replace(scene, solver={"integrator": scene.solver_settings.integrator, **scene.solver}))
    run, own = written_run(runs, scene, Resolution(steps_per_frame(refinable.scene)[0]))
    if run.status != "completed":
        return run
    coarser = coarsened(refinable)
    trials = [own]
    for resolution in coarser.resolutions if coarser.parameters else ():
        message(f"pilot run for the error: {refinable.text(resolution)}")
        trials.append(trial_at(refinable.at(resolution, scene.solver_settings.stop_fraction), resolution))
        if trials[-1].reason:
            break
    newton = run.summary["certificate"]["error_estimate"]["newton"]
    seconds = sum(trial.seconds for trial in trials)
    return with_estimate(run, {**_estimate(trials, coarser, newton), "seconds": seconds})


def coarsened(refinable: RefinableScene) -> Coarsened:
    """Return the resolutions coarser by COARSER; a parameter that cannot be coarser by all of them stays as it is."""
    steps, fixed = steps_per_frame(refinable.scene)[0], dict(refinable.fixed)
    if steps < COARSER[-1]:
        longest = 1 / (refinable.scene.run_settings.frames_per_second * COARSER[-1])
        few = f"a frame has {steps} step{'s' * (steps > 1)}, and {COARSER[-1]} are needed"
        fixed[TIME] = f"{few}: solver.dt = {longest:.3g} or less"
    if CELLS in refinable.parameters and not has_cells_for(refinable.scene, COARSER[-1], fewest=1):
        fixed[CELLS] = "the cells cannot be quartered"
    parameters = tuple(name for name in refinable.parameters if name not in fixed)
    resolutions = tuple(
        Resolution(
            steps // factor if TIME in parameters else steps,
            Fraction(1, factor if CELLS in parameters else 1),
            Fraction(factor if D_HAT in parameters else 1),
        )
        for factor in COARSER
    )
    return Coarsened(resolutions, parameters, fixed)


def _estimate(trials: list[Trial], coarser: Coarsened, newton: Any) -> dict[str, Any]:
    """Entries of the estimate; fixed: what could not be coarser, and why else the error is not known."""
    fixed = dict(coarser.fixed)
    if not coarser.parameters:
        return {"total": "not estimated (nothing can be coarser)", "known": False, "fixed": fixed}
    if trials[-1].reason:
        return {"total": f"not estimated (a coarser run failed: {trials[-1].reason})", "known": False, "fixed": fixed}
    differences = differences_of(*trials)
    moved, further = differences.fine, differences.coarse
    found = from_three(differences, acting(coarser.parameters, trials))
    reason = found.reason
    if another_shape(trials[0], max(moved, further)):
        reason = f"a coarser run ends in another shape, {max(moved, further):.2g} m away"
    parts = {"all": found.error, "newton": newton if isinstance(newton, float) else 0.0}
    entries: dict[str, Any] = {"total": root_sum(parts.values()), "parts": parts, "coarser_run_moved": moved}
    entries |= {"coarsest_run_moved": further, "known": not fixed and not reason}
    if reason:
        fixed["coarser runs"] = reason
    if fixed:
        entries["of_refined"] = {"known": not reason}
    return {**entries, "fixed": fixed}
