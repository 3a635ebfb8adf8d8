"""Accuracy study of a scene: sweeps, reference, Pareto front, error contributions and reports."""

import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import clothsim
from clothsim import Scene, engine, simulate
from clothsim.base.arrays import as_positive
from clothsim.base.errors import InputError
from clothsim.base.file_writing import make_directory, write_atomically
from clothsim.base.inputs import renamed
from clothsim.base.parallel import available_cores
from clothsim.base.record import read_summary, to_json
from clothsim.engine import World, build
from clothsim.gradients import StateAtRest
from clothsim.study.analysis import findings
from clothsim.study.error_control.resolution import Resolution, refinable_scene
from clothsim.study.evaluation import FOLDER, Gatherer, StudyProgress, stored_points, world_material, write_points
from clothsim.study.goal_report import NamedGoal, goal_report, refuse_goal
from clothsim.study.observations import gathered
from clothsim.study.parameters import usable, with_explicit_lengths
from clothsim.study.pictures import draw_study
from clothsim.study.points import BASE, Bench, point
from clothsim.study.report import markdown
from clothsim.study.result import UNFINISHED, StudyData, document, headline, needed_seconds
from clothsim.study.workers import ProcessorTime, Runner, worker_processes

# Settings of a scene with solver.error, found by one search, around which a study then varies its parameters.

SEARCHED_NAME = "searched.json"
LARGEST_FRACTION = 0.3
"""Fraction of a study's budget that the search may take."""


def searched_settings(scene: Scene, directory: Path, budget: float) -> tuple[Scene, dict[str, Any] | None]:
    """Scene with the settings that its solver.error takes, and the statement of the search that found them.

    A scene without solver.error stays as it is, without a statement; what was found in the directory of the study
    before for the same scene is taken again. Settings: dt, cells, d_hat and Newton's stop; statement: asked, total [m],
    known, met, seconds. InputError if the run with these settings does not come to its end.
    """
    if not scene.solver_settings.error:
        return scene, None
    key = sha256(scene.to_text().encode()).hexdigest()[:16]
    file = directory / FOLDER / SEARCHED_NAME
    try:
        stored = read_summary(file) if file.is_file() else {}
    except InputError:  # cut off by a kill: it is searched again
        stored = {}
    if stored.get("scene") != key or "resolution" not in stored:
        limit = min(scene.solver_settings.budget, LARGEST_FRACTION * budget)
        with tempfile.TemporaryDirectory() as folder:
            run = simulate(engine.replace(scene, "solver.budget", limit), folder)
        if run.status != "completed":
            raise _no_data_point(run.reason)
        estimate = run.summary["certificate"]["error_estimate"]
        names = ("asked", "total", "known", "met", "seconds")
        stored = {
            "scene": key,
            "resolution": estimate["chosen"]["resolution"],
            "newton_error_fraction": estimate["chosen"].get("newton_error_fraction", 1.0),
            "estimate": {name: estimate[name] for name in names},
        }
        write_atomically(file, to_json(stored).encode())
    steps, cells, d_hat = stored["resolution"]
    solver = {name: value for name, value in scene.solver.items() if name != "budget"}
    refinable = refinable_scene(replace(scene, solver=solver))
    found = refinable.at(Resolution(steps, Fraction(cells), Fraction(d_hat)), stored["newton_error_fraction"])
    return found, stored["estimate"]


FOR_FILES = 0.15, 8.0
"""Reserve of the budget for picture and tables: fraction of the budget, and most seconds."""
COMPUTES = ("mesh", "geometry", "physics", "solve", "run")
"""The folders of the package on which a result depends: a study made with other code is repeated."""
REPORT_NAME, PICTURE_NAME = "study.md", "study.png"


@dataclass(frozen=True)
class Study:
    """Result of `study_accuracy`; `str(study)` is the text of study.md.

    Attributes
    ----------
    directory : Path
        Directory of study.json, study.md and study.png.
    result : dict
        Content of study.json; errors in millimetres.

    Examples
    --------
    >>> study = clothsim.study_accuracy(scene, budget=60)  # doctest: +SKIP
    >>> headline = study.result["headline"]  # doctest: +SKIP
    >>> headline["known"], headline["error"], headline["low"], headline["high"]  # doctest: +SKIP
    (True, 1.9, 1.7, 2.1)
    """

    directory: Path
    result: dict[str, Any]

    def __str__(self) -> str:
        """Text of study.md."""
        return (self.directory / REPORT_NAME).read_text(encoding="utf-8")


@renamed(knobs="parameters", on_progress="progress")
def study_accuracy(
    scene: Scene,
    output: str | Path | None = None,
    parameters: Sequence[str] | None = None,
    budget: float = 120.0,
    workers: int | None = None,
    progress: Callable[[StudyProgress], None] = lambda done: None,
    runners: Callable[[int, ProcessorTime], AbstractContextManager[Runner]] = worker_processes,
    name: str = "the scene",
    stopped: Callable[[], bool] = lambda: False,
    goal: NamedGoal | None = None,
) -> Study:
    """Estimate the error of a scene's last frame, its sources, and the cost of a smaller one.

    A scene with solver.error is searched once; its settings are then the base.

    The error is the area-weighted RMS distance of the base mesh's material points at the last frame to the reference;
    for a chaotic scene, it is the distance of its histogram of heights.

    Parameters
    ----------
    scene : Scene
    output : str or Path, optional
        Directory of the results; results of an earlier study of the same scene are reused. None: a new temporary
        directory.
    parameters : sequence of str, optional
        Names of `parameters.PARAMETERS`; None: all that the scene has.
    budget : float
        CPU seconds of all processes of the study together [s]; other processes of the machine do not count.
    workers : int, optional
        Number of processes; None: one per core.
    progress : callable
        Called with a `StudyProgress` at the start and the end of each run.
    runners : callable
        Context manager of a runner of jobs, from the number of processes and a counter of their CPU seconds.
    name : str
        Name of the scene in reports.
    stopped : callable
        Called while the study runs; once it returns True, the workers and the study end with the results so far.
    goal : NamedGoal, optional
        A number of the drape. Its difference from the finest cells is attributed to triangles. For quasi-static scenes.

    Returns
    -------
    Study
        `result["headline"]` has the error, or its range, or what is missing and the seconds that it needs.

    Raises
    ------
    InputError
        Invalid input, or a scene whose own run fails.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.load_scene("scenes/study_strip.toml")  # doctest: +SKIP
    >>> study = clothsim.study_accuracy(scene, budget=60, parameters=["dt", "cells"])  # doctest: +SKIP
    >>> [row["label"] for row in study.result["front"]]  # doctest: +SKIP
    ['cells -1', 'base', 'dt +1']
    """
    spent = ProcessorTime()
    seconds = as_positive("budget", budget)
    most = seconds - min(FOR_FILES[0] * seconds, FOR_FILES[1])
    directory = Path(tempfile.mkdtemp(prefix="clothsim-study-") if output is None else output)
    built = build(scene, affordable=True)
    scene.refuse_without_cloth("a study of the error")
    make_directory(directory / FOLDER)
    scene, found = searched_settings(scene, directory, seconds)
    if found is not None:
        built = build(scene)
    base = with_explicit_lengths(scene, built.energies)
    used, missing = usable(base, None if parameters is None else list(parameters))
    bench = Bench(scene, base, used)
    if goal is not None:
        StateAtRest.refuse_history(built)
        refuse_goal(bench)
    count = workers or available_cores()
    material = world_material(built.world)
    fingerprint = _fingerprint(base, built.world)

    def left() -> float:
        return 0.0 if stopped() else most - spent.seconds()

    coarser: dict[str, int] = {}  # every parameter one level, as far as it goes
    for each, parameter in bench.parameters.items():
        with suppress(InputError):
            parameter.value(bench.base, -1)
            coarser[each] = -1

    with runners(count, spent) as runner:
        gatherer = Gatherer(
            bench,
            material,
            bench.scene(point(coarser)).to_text(),
            directory,
            fingerprint,
            runner,
            spent,
            seconds,
            left,
            progress,
            stored_points(directory, fingerprint),
        )
        seen = gathered(gatherer)
    if BASE in gatherer.outcomes and not gatherer.good(BASE):
        raise _no_data_point(gatherer.outcomes[BASE].failed)
    effort: dict[str, Any] = {
        "budget": seconds,
        "seconds": spent.seconds(),
        "workers": count,
        "stopped": stopped(),
    }
    if goal is not None:
        effort["goal"] = goal_report(gatherer, goal)
    effort["searched"] = found
    study_data = StudyData(name, bench, gatherer, seen, missing)
    compared = study_data.compared
    known = findings(compared) if compared is not None and study_data.complete else None
    statement = headline(seen, known, needed_seconds(seen, FOR_FILES))
    if statement.status == UNFINISHED:
        known = None
    rest = document(study_data, known, statement, effort)
    result = write_points(directory, fingerprint, **rest)
    write_atomically(directory / REPORT_NAME, markdown(name, result).encode())
    (directory / PICTURE_NAME).unlink(missing_ok=True)
    if known is not None:
        draw_study(study_data, known, directory / PICTURE_NAME)
    return Study(directory, result)


def _no_data_point(reason: str) -> InputError:
    sentence = f"The scene itself is not a data point: {reason}"
    return InputError(sentence, "Run it, and change what fails; a shorter dt often helps.")


def _fingerprint(base: Scene, world: World) -> str:
    """Identity of a scene: hash of its settings, its meshes and the code that computes them."""
    digest = sha256(f"{clothsim.__version__} {base.to_text()}".encode())
    for array in (world.start(), world.triangles, world.body_triangles, world.rest_shapes):
        digest.update(np.ascontiguousarray(array).tobytes())
    home = Path(clothsim.__file__).parent
    for folder in COMPUTES:
        for file in sorted((home / folder).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
