"""Search for the resolution that meets a requested error, and the run with it.

A coarse pilot run and a run with every parameter refined by two give a first estimate; where the two end in different
shapes, both start again with half the step. Where the estimate is too large, a path of pilot runs between the two gives
the error of each parameter, the cheapest resolution that is expected to be accurate enough is run, and the distance to
the run before corrects the expectation. A resolution that is expected to miss the request is run as a pilot. Every loop
is bounded.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from typing import Any

from clothsim import Run, Scene, engine
from clothsim.base.errors import InputError
from clothsim.study.error_control.parameter_errors import ParameterErrors, from_all, from_path, root_sum
from clothsim.study.error_control.resolution import (
    Distance,
    RefinableScene,
    Resolution,
    Trial,
    another_shape,
    distance_at,
    refinable_scene,
    trial_at,
)
from clothsim.study.parameters import CELLS, D_HAT, PARAMETERS, TIME

NEWTON_PART = 0.2
"""Fraction of the requested error above which Newton's method stops at FINER times a smaller one."""
FINER = 0.25
TWIN = 0.1
"""Newton's stop of a twin run over that of the run it is compared with."""
PILOT_FROM = 1.5
"""Expected error over the requested one from which a resolution is run as a pilot."""
MOST_ROUNDS = 5
STALLED, MOST_STALLED = 0.8, 2
"""The search ends where so many refinements in a row leave more than that fraction of the estimate."""
MOST_RETRIES = 3
"""Failures of the coarsest pilot run, each followed by one with half the step."""
PATH = (D_HAT, CELLS, TIME)
"""Order in which the path of pilot runs refines the parameters: cells at the longer steps, where they cost least."""

Candidate = Callable[[Scene, Resolution], tuple[Run, Trial]]
"""Runs a scene into the output directory."""
Message = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """Last run of a search and the estimate of its error.

    Parameters
    ----------
    run : Run
        The run; its directory is the output.
    trial : Trial
        Its last positions.
    parts : mapping
        RMS error of each parameter and of Newton's method [m].
    known : bool
        False where the last refinement moved the result by far more than expected, or nothing was compared.
    reason : str
        What else makes the error unknown; empty where nothing does.
    """

    run: Run
    trial: Trial
    parts: dict[str, float]
    known: bool
    reason: str = ""

    @property
    def total(self) -> float:
        """RMS error [m]."""
        return root_sum(self.parts.values())

    @property
    def resolution_error(self) -> float:
        """RMS error of the parameters, without that of Newton's method [m]."""
        return root_sum(part for name, part in self.parts.items() if name != "newton")

    def met(self, asked: float) -> bool:
        """True where the request [m] is met."""
        return self.run.status == "completed" and self.known and self.total <= asked


@dataclass
class ResolutionSearch:
    """State of a search: the runs so far, and newton_error_fraction; `message` receives a line before each run."""

    refinable: RefinableScene
    asked: float
    budget: float
    candidate: Candidate
    message: Message
    newton_error_fraction: float
    trials: list[Trial] = field(default_factory=list)

    @property
    def keeps_tolerance(self) -> bool:
        """True where the scene names its tolerance, which no run but a twin changes."""
        return "tolerance" in self.refinable.scene.solver

    @property
    def coarsest_vertices(self) -> int:
        """Vertices of the mesh of the first run."""
        return sum(len(rest) for rest in self.trials[0].material.rest)

    @property
    def spent(self) -> float:
        """Processor seconds of all runs."""
        return sum(trial.seconds for trial in self.trials)

    def halve_step(self) -> None:
        """Let the coarsest pilot run have half the step."""
        coarsest = self.refinable.coarsest
        self.refinable = replace(self.refinable, coarsest=replace(coarsest, steps=2 * coarsest.steps))

    def twin(self, resolution: Resolution) -> Trial:
        """Run a resolution with TWIN of Newton's stop, without writing anything."""
        self.message(f"twin run: {self.refinable.text(resolution)}, {TWIN:g} of Newton's stop")
        scene = self.refinable.at(resolution, TWIN * self.newton_error_fraction)
        if self.keeps_tolerance:
            scene = engine.replace(scene, "solver.tolerance", TWIN * scene.solver_settings.tolerance)
        self.trials.append(trial_at(scene, resolution))
        return self.trials[-1]

    def pilot(self, resolution: Resolution) -> Trial:
        """Run a pilot, or take the one that was run."""
        for trial in self.trials:
            if trial.resolution == resolution and not trial.reason:
                return trial
        self.message(f"pilot run: {self.refinable.text(resolution)}")
        self.trials.append(trial_at(self.refinable.at(resolution, self.newton_error_fraction), resolution))
        return self.trials[-1]

    def run(self, resolution: Resolution, expected: float | None = None) -> tuple[Run, Trial]:
        """Run a candidate into the output directory."""
        about = "" if expected is None else f", about {1e3 * expected:.2g} mm expected"
        self.message(f"run: {self.refinable.text(resolution)}{about}")
        run, trial = self.candidate(self.refinable.at(resolution, self.newton_error_fraction), resolution)
        self.trials.append(trial)
        return run, trial


def searched(scene: Scene, candidate: Candidate, message: Message) -> tuple[ResolutionSearch, Found]:
    """Find the resolution for the solver.error of a scene and run it: all runs, and the last one."""
    settings = scene.solver_settings
    fraction = settings.stop_fraction
    search = ResolutionSearch(refinable_scene(scene), settings.error, settings.budget, candidate, message, fraction)
    earlier: Found | None = None
    for _ in range(MOST_RETRIES):
        coarsest = _coarsest(search)
        finer = search.refinable.refined(coarsest.resolution, search.refinable.parameters)
        run, first = search.run(finer)
        distance = distance_at(coarsest.material)
        if run.status != "completed":
            failed = Found(run, first, error_parts(run, {"all": 0.0}), False)
            return search, failed if earlier is None else repeated(search, earlier)
        moved = distance(coarsest, first)
        same = not another_shape(first, moved)
        left = from_all(moved, 2.0, search.refinable.parameters, search.refinable.dt(coarsest.resolution))
        found = Found(run, first, error_parts(run, {"all": left}), same)
        if same or search.spent > search.budget / 2:
            break
        earlier = found
        search.halve_step()
    if not found.known or found.met(search.asked):
        return search, found
    # a path of pilot runs that refines one parameter after the other
    names = [name for name in PATH if name in search.refinable.parameters]
    path = [coarsest]
    for name in names[:-1]:
        trial = search.pilot(search.refinable.refined(path[-1].resolution, [name]))
        path.append(path[-1] if trial.reason else trial)
    path.append(first)
    moves = {name: distance(path[k], path[k + 1]) for k, name in enumerate(names)}
    errors = from_path(search.refinable.sizes(first.resolution), moves, dict.fromkeys(names, 2.0))
    errors = errors.not_below(found.parts["all"])
    found = Found(run, first, error_parts(run, errors.errors), True)
    return search, _refined(search, found, errors, distance)


def _coarsest(search: ResolutionSearch) -> Trial:
    """The first pilot run; where it fails, with shorter steps."""
    for _ in range(MOST_RETRIES):
        trial = search.pilot(search.refinable.coarsest)
        if not trial.reason:
            return trial
        search.halve_step()
    raise InputError(f"No pilot run for solver.error came to its end: {trial.reason}", "Give solver.dt, and run it.")


def _refined(search: ResolutionSearch, found: Found, errors: ParameterErrors, distance: Distance) -> Found:
    """Run finer resolutions until the request is met, the budget is spent or nothing finer is within the bounds.

    Where the last of them was a pilot, it is run into the output directory at the end.
    """
    stalled, last, refinable = 0, found.trial, search.refinable
    for left in reversed(range(MOST_ROUNDS)):
        if found.met(search.asked) or stalled == MOST_STALLED:
            break
        if found.parts["newton"] > NEWTON_PART * search.asked:
            search.newton_error_fraction *= FINER
        vertices = search.coarsest_vertices
        done = [trial.resolution for trial in search.trials]
        unit = last.seconds / work_of(search.refinable, last.resolution, vertices)
        most = (search.budget - search.spent) / max(unit, 1e-9)
        following = chosen(search.refinable, errors, done, search.asked, vertices, most)
        if following is None:
            break
        sizes = refinable.sizes(following)
        expected, run = errors.at(sizes).total, None
        more = work_of(search.refinable, following, vertices) / work_of(search.refinable, last.resolution, vertices)
        room = search.spent + 2 * more * last.seconds <= search.budget  # for a run of it into the output directory
        if expected > PILOT_FROM * search.asked and left and room:
            trial = search.pilot(following)
        else:
            run, trial = search.run(following, expected)
        if trial.reason or (run is not None and run.status != "completed"):
            return replace(found if run is None else repeated(search, found), known=False)
        before, errors = errors.total, errors.after(sizes, distance(last, trial))
        stalled, last = stalled + 1 if errors.total > STALLED * before else 0, trial
        if run is not None:
            found = Found(run, trial, error_parts(run, errors.errors), errors.understood)
    if last is not found.trial:
        run, trial = search.run(last.resolution, errors.total)
        if run.status != "completed":
            return replace(repeated(search, found), known=False)
        found = Found(run, trial, error_parts(run, errors.errors), errors.understood)
    return found if found.met(search.asked) or stalled < MOST_STALLED else replace(found, known=False)


def repeated(search: ResolutionSearch, found: Found) -> Found:
    """The last run that came to its end, once more: a failed one has taken its place in the output directory."""
    run, trial = search.run(found.trial.resolution)
    others = {key: part for key, part in found.parts.items() if key != "newton"}
    return Found(run, trial, error_parts(run, others), False)


def error_parts(run: Run, errors: dict[str, float] | Any) -> dict[str, float]:
    """Return the parts of an error: those of the parameters, and the sum of Newton's own estimates."""
    newton = run.summary["certificate"]["error_estimate"]["newton"]
    return {**errors, "newton": newton if isinstance(newton, float) else 0.0}


AIM = 0.95
"""Fraction of the requested error that is aimed at."""
FARTHEST = {name: each.assumed.farthest for name, each in PARAMETERS.items() if each.assumed}
"""Largest refinement of a parameter beyond the finest run so far: further out the expected errors are not trusted."""
OVERHEAD = 100
"""Vertices whose work is that of a Newton iteration without any."""
GROWTH = 0.85
"""Newton iterations grow with that power of the number of steps."""
HALVES = (2, 3, 4, 5, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 256)
FACTORS = tuple(Fraction(count, 2) for count in HALVES)
"""Factors of the coarsest resolution."""


def work_of(refinable: RefinableScene, resolution: Resolution, vertices: int) -> float:
    """Expected work of a run relative to the coarsest: Newton iterations times vertices, counted so that it repeats.

    vertices: of the coarsest mesh.
    """
    coarsest = refinable.coarsest
    size = vertices * float((resolution.cells / coarsest.cells) ** 2)
    contact = float(coarsest.d_hat / resolution.d_hat) ** 0.15
    return (size + OVERHEAD) / (vertices + OVERHEAD) * (resolution.steps / coarsest.steps) ** GROWTH * contact


def chosen(
    refinable: RefinableScene,
    errors: ParameterErrors,
    done: Sequence[Resolution],
    asked: float,
    vertices: int,
    most: float,
) -> Resolution | None:
    """The resolution with the least work whose expected error is AIM of what is asked [m].

    errors: of the last run; done: all runs so far; vertices: of the coarsest mesh; most: largest admissible work. Where
    none within reach is accurate enough: one of those that come nearest. None where none is new.
    """
    coarsest, parameters = refinable.coarsest, refinable.parameters
    finest_steps, finest_cells = max(each.steps for each in done), max(each.cells for each in done)
    least = min(each.d_hat for each in done)
    steps = [coarsest.steps * factor for factor in FACTORS if (coarsest.steps * factor) % 1 == 0]
    cells = [coarsest.cells]
    if CELLS in parameters:
        halves = [Fraction(coarsest.cells * factor) for factor in FACTORS if (coarsest.cells * factor * 2) % 1 == 0]
        cells = [each for each in halves if each <= FARTHEST[CELLS] * finest_cells and refinable.whole(each)]
    d_hat = [coarsest.d_hat / factor for factor in FACTORS]
    tried = product(
        [each for each in steps if each <= FARTHEST[TIME] * finest_steps],
        cells,
        [each for each in d_hat if each >= least / FARTHEST[D_HAT]] if D_HAT in parameters else [coarsest.d_hat],
    )
    candidates = [Resolution(int(n), c, Fraction(d)) for n, c, d in tried]
    candidates = [each for each in candidates if each not in done]
    candidates = [each for each in candidates if work_of(refinable, each, vertices) <= most]
    if not candidates:
        return None
    expected = {each: errors.at(refinable.sizes(each)).total for each in candidates}
    bar = max(AIM * asked, 1.2 * min(expected.values()))
    enough = [each for each in candidates if expected[each] <= bar]
    return min(enough, key=lambda each: work_of(refinable, each, vertices))
