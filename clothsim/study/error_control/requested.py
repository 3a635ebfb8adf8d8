"""Simulation of a scene to a requested error (solver.error): search, confirmation, and the entries of its summary.

Two runs that lie near one another may both be wrong: a strip pushed together by a fifth claimed .5 mm and was 19 mm
away. Errors of single steps, too, say nothing of what a scene makes of them: one tilted by a degree ended 11 mm away
where every step was solved to a hundredth. So an error is called known only where

1. runs coarser by two and by four in everything differ as an order of convergence demands (`from_three`): that is the
   error where they go one way, and the larger one of this and of the search where they turn over;
2. a twin of the run with TWIN of its Newton stop ends where it does; their distance is Newton's part of the error.
   Where that misses the request, the run takes the twin's stop once, and has a new twin.

Where the first fails, or leaves more than what is asked, the run is refined in everything, at most MOST_LEVELS times
and within the budget, and looked at again.
"""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from clothsim import Run, Scene
from clothsim.base.errors import InputError
from clothsim.study.error_control.parameter_errors import COARSER, ThreeRuns, after_halving, from_three
from clothsim.study.error_control.resolution import (
    Resolution,
    Runs,
    Trial,
    acting,
    another_shape,
    differences_of,
    distance_at,
    with_estimate,
    written_run,
)
from clothsim.study.error_control.search import TWIN, Found, Message, ResolutionSearch, error_parts, repeated, searched
from clothsim.study.parameters import CELLS, D_HAT, TIME, d_hats


def simulate_to_error(scene: Scene, runs: Runs, message: Message) -> Run:
    """Simulate a scene with dt, cells, d_hat and Newton's tolerance chosen for its solver.error.

    Returns the last run, whose summary has the estimate, what was chosen and why.
    """
    chosen: list[Scene] = []

    def candidate(some: Scene, resolution: Resolution) -> tuple[Run, Trial]:
        chosen.append(some)
        return written_run(runs, some, resolution)

    search, found = searched(scene, candidate, message)
    found = confirmed(search, found)
    return with_estimate(found.run, _estimate(search, found, chosen[-1]), _why(search, found))


def _estimate(search: ResolutionSearch, found: Found, scene: Scene) -> dict[str, Any]:
    completed = found.run.status == "completed"
    solver, refinable = scene.solver, search.refinable
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
        {"dt": refinable.dt(each.resolution), "cells": str(each.resolution.cells), D_HAT: str(each.resolution.d_hat),
         "seconds": each.seconds}
        for each in search.trials
    ]  # fmt: skip
    return {
        "total": found.total if completed else "not estimated (failed)",
        **with_fixed(found.known and completed, found.met(search.asked), refinable.fixed),
        "parts": found.parts,
        "asked": search.asked,
        "chosen": taken,
        "fixed": dict(refinable.fixed),
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


def _why(search: ResolutionSearch, found: Found) -> str:
    """What was chosen and why, in a few sentences."""
    parts = {name: f"{1e3 * part:.2g}" for name, part in found.parts.items()}
    left = ", ".join(
        f"{'dt, cells and d_hat together' if name == 'all' else name} {each}" for name, each in parts.items()
    )
    text = [f"solver.error took {search.refinable.text(found.trial.resolution)}."]
    text.append(f"What they leave [mm]: {left}.")
    if not found.known:
        reason = found.reason.rstrip(".") or "the last refinements moved the result by more than expected"
        text.append(f"{reason[0].upper()}{reason[1:]}. The error is not known.")
    elif not found.met(search.asked):
        text.append("Nothing finer was within the bounds of the search or solver.budget.")
    last = found.trial.seconds
    text.append(f"{len(search.trials)} runs took {search.spent:.1f} s, the last of them {last:.1f} s.")
    text += [
        f"{name} stay as given, and their error is not known, nor that of the run: {reason}."
        for name, reason in search.refinable.fixed.items()
    ]
    return " ".join(text)


MOST_LEVELS = 2
"""Further refinements in everything of a run whose coarser ones show no order of convergence, or miss the request."""
REFINED_COST = 10.0
"""Processor time of a run refined by two in everything, over that of the run."""


def confirmed(search: ResolutionSearch, found: Found) -> Found:
    """Return the last run of a search with what three resolutions and a twin say of its error.

    Where they say nothing, or more than what is asked, the run is refined in everything and looked at again.
    """
    parameters = search.refinable.parameters
    for left in reversed(range(MOST_LEVELS + 1)):
        if not found.known or found.run.status != "completed":
            return found
        three = _estimate_from_three(search, found)
        error, reason = three.error, three.reason
        if not reason and (three.aligned or found.resolution_error < error):
            found = replace(found, parts={"all": error, "newton": found.parts["newton"]})
        room = left > 0 and search.spent + REFINED_COST * found.trial.seconds <= search.budget
        if not reason and (found.resolution_error <= search.asked or not room):
            found = _compared_with_twins(search, found)
            if not found.known or found.met(search.asked):
                return found
        if not room:
            return replace(found, known=not reason, reason=reason)
        expected = error if reason else after_halving(found.resolution_error, parameters)
        finer = search.refinable.refined(found.trial.resolution, parameters)
        run, trial = search.run(finer, expected)
        if run.status != "completed":
            found = repeated(search, found)
            return found if reason else _compared_with_twins(search, found)
        found = Found(run, trial, error_parts(run, {"all": expected}), True)
    return replace(found, known=False)


def _estimate_from_three(search: ResolutionSearch, found: Found) -> ThreeRuns:
    """Estimate the error of the run by two runs that are coarser in everything that can be."""
    resolution, parameters = found.trial.resolution, search.refinable.parameters
    trials = [found.trial]
    for factor in COARSER:
        try:
            cells = resolution.cells / (factor if CELLS in parameters else 1)
            if TIME in parameters and resolution.steps < factor:
                raise InputError(
                    f"A frame has {resolution.steps} steps, and {factor} are needed.", "Give a shorter dt."
                )
            if CELLS in parameters and not search.refinable.whole(cells):
                raise InputError(f"The cells cannot be divided by {factor}.", "Give a number of them that can.")
            coarser = Resolution(
                -(-resolution.steps // factor) if TIME in parameters else resolution.steps,
                cells,
                resolution.d_hat * (Fraction(factor) if D_HAT in parameters else 1),
            )
            trials.append(search.pilot(coarser))
        except InputError as error:
            return ThreeRuns(found.resolution_error, error.sentence)
        if trials[-1].reason:
            return ThreeRuns(found.resolution_error, trials[-1].reason)
    differences = differences_of(*trials)
    three = from_three(differences, acting(search.refinable.parameters, trials))
    if another_shape(found.trial, differences.fine):
        return replace(three, reason="coarser runs end in another shape")
    return three


def _compared_with_twins(search: ResolutionSearch, found: Found) -> Found:
    """The run with the distance to its twin as Newton's part; run again with the twin's stop where that matters."""
    for again in (True, False):
        twin = search.twin(found.trial.resolution)
        if twin.reason:
            return replace(found, known=False, reason=f"the twin run failed: {twin.reason}")
        moved = distance_at(found.trial.material)(found.trial, twin)
        without, before = found.resolution_error, found
        reason = f"{TWIN:g} of Newton's stop leads to another shape" if another_shape(twin, moved) else ""
        parts = {**found.parts, "newton": max(found.parts["newton"], moved)}
        found = replace(found, parts=parts, known=not reason, reason=reason)
        helps = not found.met(search.asked) and without <= search.asked and not search.keeps_tolerance
        if not (again and helps) or search.spent + 2 * twin.seconds > search.budget:
            break
        search.newton_error_fraction *= TWIN
        run, trial = search.run(found.trial.resolution)
        if run.status != "completed":
            return replace(repeated(search, found), known=False)
        of_resolution = {name: part for name, part in before.parts.items() if name != "newton"}
        found = Found(run, trial, error_parts(run, of_resolution), True)
    return found
