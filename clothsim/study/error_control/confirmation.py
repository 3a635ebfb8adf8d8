"""Confirmation of an estimated error: three joint resolutions whose distances fall, and a twin of a finer Newton stop.

Two runs that lie near one another may both be wrong: a strip pushed together by a fifth claimed .5 mm and was 19 mm
away. Errors of single steps, too, say nothing of what a scene makes of them: one tilted by a degree ended 11 mm away
where every step was solved to a hundredth. So an error is called known only where

1. runs coarser by two and by four in everything differ as an order of convergence demands (`from_three`); else the run
   is refined in everything, at most MOST_LEVELS times and within the budget, and looked at again;
2. a twin of the run with TWIN of its Newton stop ends where it does; their distance is Newton's part of the error.
   Where that misses the request, the run takes the twin's stop once, and has a new twin.
"""

from dataclasses import replace
from fractions import Fraction

from clothsim.base.errors import InputError
from clothsim.study.error_control.resolution import Resolution
from clothsim.study.error_control.search import TWIN, Found, Search, parts_of, repeated
from clothsim.study.error_control.three_runs import from_three
from clothsim.study.error_control.trial import Trial, another_shape, distance_at
from clothsim.study.parameters import CELLS, D_HAT, TIME

MOST_LEVELS = 2
"""Further joint refinements of a run whose coarser ones show no order of convergence."""
REFINED_COST = 10.0
"""Processor time of a run refined by two in everything, over that of the run."""
COARSER = (2, 4)


def confirmed(search: Search, found: Found) -> Found:
    """Return the last run of a search with what three resolutions and a twin say of its error.

    Parameters
    ----------
    search : Search
        Its runs.
    found : Found
        Its last run.
    """
    for left in reversed(range(MOST_LEVELS + 1)):
        if not _is_known(found):
            return found
        error, reason = _of_three(search, found)
        if not reason:
            return _compared_with_twins(search, _at_least(found, error))
        if not left or search.spent + REFINED_COST * found.trial.seconds > search.budget:
            return replace(found, known=False)
        finer = search.resolvable.refined(found.trial.resolution, search.resolvable.parameters)
        run, trial = search.run(finer, error)
        if run.status != "completed":
            return replace(repeated(search, found), known=False)
        found = Found(run, trial, parts_of(run, {"all": error}), True)
    return replace(found, known=False)


def _is_known(found: Found) -> bool:
    return found.known and found.run.status == "completed"


def _at_least(found: Found, error: float) -> Found:
    """The run with errors of its resolution that sum to `error` [m] or more."""
    of_resolution = found.resolution_error
    if of_resolution >= error:
        return found
    return replace(found, parts={"all": error, "newton": found.parts["newton"]})


def _of_three(search: Search, found: Found) -> tuple[float, str]:
    """Error of the run by two coarser ones [m], and why it is not known; "" where it is."""
    trials = [found.trial]
    for factor in COARSER:
        try:
            trials.append(search.pilot(_coarser(search, found.trial.resolution, factor)))
        except InputError as error:
            return found.resolution_error, error.sentence
        if trials[-1].reason:
            return found.resolution_error, trials[-1].reason
    distance = distance_at(trials[-1].material)
    near, far = distance(trials[1], trials[0]), distance(trials[2], trials[1])
    three = from_three(near, far, search.resolvable.parameters)
    if another_shape(found.trial, near):
        return three.error, "coarser runs end in another shape"
    return three.error, three.reason


def _coarser(search: Search, resolution: Resolution, factor: int) -> Resolution:
    """The resolution coarser by a factor in everything that can be; InputError where the cells cannot be."""
    parameters = search.resolvable.parameters
    cells = resolution.cells / (factor if CELLS in parameters else 1)
    if TIME in parameters and resolution.steps < factor:
        raise InputError(f"A frame has {resolution.steps} steps, and {factor} are needed.", "Give a shorter dt.")
    if CELLS in parameters and not search.resolvable.whole(cells):
        raise InputError(f"The cells cannot be divided by {factor}.", "Give a number of them that can.")
    return Resolution(
        -(-resolution.steps // factor) if TIME in parameters else resolution.steps,
        cells,
        resolution.d_hat * (Fraction(factor) if D_HAT in parameters else 1),
    )


def _compared_with_twins(search: Search, found: Found) -> Found:
    """The run with the distance to its twin as Newton's part; run again with the twin's stop where that matters."""
    for again in (True, False):
        twin = search.twin(found.trial.resolution)
        if twin.reason:
            return replace(found, known=False)
        moved = _moved(found.trial, twin)
        without, known = found.resolution_error, not another_shape(twin, moved)
        before, found = (
            found,
            replace(found, parts={**found.parts, "newton": max(found.parts["newton"], moved)}, known=known),
        )
        helps = not found.met(search.asked) and without <= search.asked and not search.keeps_tolerance
        if not (again and helps) or search.spent + 2 * twin.seconds > search.budget:
            break
        search.newton_error_fraction *= TWIN
        run, trial = search.run(found.trial.resolution)
        if run.status != "completed":
            return replace(repeated(search, found), known=False)
        of_resolution = {name: part for name, part in before.parts.items() if name != "newton"}
        found = Found(run, trial, parts_of(run, of_resolution), True)
    return found


def _moved(one: Trial, other: Trial) -> float:
    return distance_at(one.material)(one, other)
