"""Error estimate of a run with given settings: its distance to a pilot run with all of them coarser by two."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from time import process_time

from clothsim.build.explicit_lengths import steps_per_frame
from clothsim.io.record import SUMMARY_NAME, write_summary
from clothsim.run.error_control.knob_errors import from_joint, root_sum
from clothsim.run.error_control.requested import Message, Runs
from clothsim.run.error_control.resolution import CELLS, D_HAT, TIME, Resolution, Resolvable, resolvable
from clothsim.run.error_control.trial import Trial, another_shape, distance_at, material, pilot
from clothsim.run.results import Run, open_run
from clothsim.run.session import Session
from clothsim.scene.scene import Scene


def simulate_with_estimate(scene: Scene, runs: Runs, message: Message) -> Run:
    """Simulate a scene, then once more with dt x 2, half the cells and d_hat x 2.

    Parameters
    ----------
    scene : Scene
        With solver.estimate.
    runs : callable
        Runs a scene with fixed settings into the output directory.
    message : callable
        Called with a line before the pilot run.

    Returns
    -------
    Run
        Its summary has the estimate; what could not be coarser is named there, and its error is not known.
    """
    sessions: list[Session] = []
    started = process_time()
    run = runs(scene, sessions)
    if run.status != "completed":
        return run
    ladder = resolvable(replace(scene, solver={"integrator": scene.solver_settings.integrator, **scene.solver}))
    steps = steps_per_frame(ladder.scene)[0]
    coarser = Resolution(max(1, steps // 2), ladder.coarsest.cells, Fraction(2 if D_HAT in ladder.knobs else 1))
    own = Trial(Resolution(steps), material(sessions[0].built.world), run.positions(-1), process_time() - started)
    message(f"pilot run for the error: {ladder.text(coarser)}")
    newton_error_fraction = scene.solver_settings.newton_error_fraction
    other = pilot(ladder.at(coarser, newton_error_fraction), coarser)
    fixed = dict(ladder.fixed)
    if steps == 1:
        fixed[TIME] = "a frame has one step"
    if CELLS in ladder.knobs and coarser.cells == 1:
        fixed[CELLS] = "the cells cannot be halved"
    return _annotated(run, own, other, fixed, ladder)


def _annotated(run: Run, own: Trial, other: Trial, fixed: dict[str, str], ladder: Resolvable) -> Run:
    """The run with its estimate; fixed: what could not be coarser, whose error is not known."""
    summary = dict(run.summary)
    certificate = dict(summary["certificate"])
    estimate = dict(certificate["error_estimate"])
    if other.reason:
        estimate |= {"total": f"not estimated (the coarser run failed: {other.reason})", "known": False}
    else:
        moved = distance_at(other.material)(own, other)
        newton = estimate["newton"] if isinstance(estimate["newton"], float) else 0.0
        parts = {"all": from_joint(moved, 2.0, ladder.knobs, ladder.dt(other.resolution)), "newton": newton}
        if another_shape(own, moved):
            fixed = {**fixed, "coarser run": f"it ends in another shape, {moved:.2g} m away"}
        estimate |= {"total": root_sum(parts.values()), "known": not fixed, "parts": parts, "coarser_run_moved": moved}
        if fixed:
            estimate["of_refined"] = {"known": set(fixed) <= set(ladder.fixed)}
    estimate |= {"fixed": fixed, "seconds": own.seconds + other.seconds}
    summary["certificate"] = {**certificate, "error_estimate": estimate}
    write_summary(Path(run.directory) / SUMMARY_NAME, summary)
    return open_run(run.directory)
