"""Simulation of a scene with solver.error, and the entries of its summary."""

from collections.abc import Mapping
from pathlib import Path
from time import process_time
from typing import Any

from clothsim import Run, Scene, open_run
from clothsim.base.record import SUMMARY_NAME, write_summary
from clothsim.engine import Session
from clothsim.study.error_control.confirmation import confirmed
from clothsim.study.error_control.resolution import Resolution
from clothsim.study.error_control.search import Found, Message, Search, searched
from clothsim.study.error_control.trial import Runs, Trial
from clothsim.study.parameters import D_HAT, d_hats
from clothsim.study.resample import world_material


def simulate_to_error(scene: Scene, runs: Runs, message: Message) -> Run:
    """Simulate a scene with dt, cells, d_hat and Newton's tolerance chosen for solver.error.

    Parameters
    ----------
    scene : Scene
        With solver.error.
    runs : callable
        Runs a scene with fixed settings into the output directory.
    message : callable
        Called with a line before each run.

    Returns
    -------
    Run
        The last one, whose summary has the estimate, what was chosen and why.
    """
    chosen: list[Scene] = []

    def candidate(some: Scene, resolution: Resolution) -> tuple[Run, Trial]:
        started, sessions = process_time(), list[Session]()
        run = runs(some, sessions)
        chosen.append(some)
        seconds = process_time() - started
        return run, Trial(resolution, world_material(sessions[0].built.world), run.positions(-1), seconds)

    search, found = searched(scene, candidate, message)
    found = confirmed(search, found)
    return _annotated(search, found, chosen[-1])


def _annotated(search: Search, found: Found, scene: Scene) -> Run:
    """The run with the estimate in the certificate of its summary, and a note on what was chosen and why."""
    run, summary = found.run, dict(found.run.summary)
    certificate = dict(summary["certificate"])
    estimate = {**certificate["error_estimate"], **_estimate(search, found, scene)}
    summary["certificate"] = {**certificate, "error_estimate": estimate}
    summary["notes"] = [*summary["notes"], _why(search, found)]
    write_summary(Path(run.directory) / SUMMARY_NAME, summary)
    return open_run(run.directory)


def _estimate(search: Search, found: Found, scene: Scene) -> dict[str, Any]:
    completed = found.run.status == "completed"
    solver, ladder = scene.solver, search.resolvable
    taken = {
        "resolution": [
            found.trial.resolution.steps,
            str(found.trial.resolution.cells),
            str(found.trial.resolution.d_hat),
        ],
        "dt": solver["dt"],
        "integrator": solver["integrator"],
        **{key: solver[key] for key in ("tolerance", "newton_error_fraction") if key in solver},
        "cells": [keys["cells"] for keys in scene.cloths if "cells" in keys],
        D_HAT: d_hats(scene),
    }
    runs = [
        {"dt": ladder.dt(each.resolution), "cells": str(each.resolution.cells), D_HAT: str(each.resolution.d_hat),
         "seconds": each.seconds}
        for each in search.trials
    ]  # fmt: skip
    return {
        "total": found.total if completed else "not estimated (failed)",
        **with_fixed(found.known and completed, found.met(search.asked), ladder.fixed),
        "parts": found.parts,
        "asked": search.asked,
        "chosen": taken,
        "fixed": dict(ladder.fixed),
        "runs": runs,
        "seconds": search.spent,
    }


def with_fixed(known: bool, met: bool, fixed: Mapping[str, str]) -> dict[str, Any]:
    """Entries "known" and "met" of an estimate; with what could not be refined both are false, its error is not known.

    "of_refined" then has what is known of the others.

    Examples
    --------
    >>> with_fixed(True, True, {})
    {'known': True, 'met': True}
    >>> with_fixed(True, True, {"cells": "a file without cells"})
    {'known': False, 'met': False, 'of_refined': {'known': True, 'met': True}}
    """
    if not fixed:
        return {"known": known, "met": met}
    return {"known": False, "met": False, "of_refined": {"known": known, "met": met}}


def _why(search: Search, found: Found) -> str:
    """What was chosen and why, in a few sentences."""
    parts = {name: f"{1e3 * part:.2g}" for name, part in found.parts.items()}
    left = ", ".join(
        f"{'dt, cells and d_hat together' if name == 'all' else name} {each}" for name, each in parts.items()
    )
    text = [f"solver.error took {search.resolvable.text(found.trial.resolution)}."]
    text.append(f"What they leave [mm]: {left}.")
    if not found.known:
        text.append("The last refinements moved the result by more than expected: the error is not known.")
    elif not found.met(search.asked):
        text.append("Nothing finer was within the bounds of the search or solver.budget.")
    last = found.trial.seconds
    text.append(f"{len(search.trials)} runs took {search.spent:.1f} s, the last of them {last:.1f} s.")
    text += [
        f"{name} stay as given, and their error is not known, nor that of the run: {reason}."
        for name, reason in search.resolvable.fixed.items()
    ]
    return " ".join(text)
