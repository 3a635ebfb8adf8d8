"""Accuracy study of a scene: sweeps, reference, Pareto front, error contributions and reports."""

import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from clothsim.accuracy import analysis
from clothsim.accuracy.evaluation import FOLDER, Gatherer, Progress, stored_points, write_points
from clothsim.accuracy.invariants import drape_coefficient, height_quantiles
from clothsim.accuracy.knobs import usable
from clothsim.accuracy.points import BASE, CONVERGENT, Bench, Point, point
from clothsim.accuracy.pool import Runner, cores, worker_processes
from clothsim.accuracy.reference_solution import Limit, Norm
from clothsim.accuracy.report import StudyData, document, markdown
from clothsim.arrays import Floats, as_positive
from clothsim.build.explicit_lengths import fixed
from clothsim.build.presets import PRESETS
from clothsim.build.scene_world import build
from clothsim.errors import InputError
from clothsim.mesh.resample import material_of, point_areas
from clothsim.mesh.world import World
from clothsim.scene.scene import Scene

TIGHT = 2
"""Level of the tolerance at which a run and its jittered twin are compared."""
CHAOTIC = 0.25
"""Difference of twin runs, over the effect of the largest refinement, above which the solution is not unique."""
SEEDS = 4
COMBINATIONS = 6
LATE = 0.35
"""Largest fraction of the remaining budget for one of the finest runs."""
FINER = 3
"""Number of further levels that are run of the knob whose limit is least certain, one at a time."""
FOR_FILES = 0.15, 8.0
"""Reserve of the budget for picture and tables: fraction of the budget, and most seconds."""
COMPUTES = ("mesh", "kinematics", "energies", "contact", "solve", "sim")
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
    >>> study.result["base"]["error"], study.result["base"]["unit"]  # doctest: +SKIP
    (1.9, 'mm')
    """

    directory: Path
    result: dict[str, Any]

    def __str__(self) -> str:
        """Text of study.md."""
        return (self.directory / REPORT_NAME).read_text(encoding="utf-8")


def study_accuracy(
    scene: Scene,
    output: str | Path | None = None,
    knobs: Sequence[str] | None = None,
    budget: float = 120.0,
    workers: int | None = None,
    on_progress: Callable[[Progress], None] = lambda progress: None,
    runners: Callable[[int], AbstractContextManager[Runner]] = worker_processes,
    name: str = "the scene",
) -> Study:
    """Estimate the error of a scene's last frame, its sources, and the cost of a smaller one.

    The error is the area-weighted RMS distance of the base mesh's material points at the last frame to the reference;
    for a chaotic scene that of its histogram of heights.

    Parameters
    ----------
    scene : Scene
    output : str or Path, optional
        Directory of the results; points of an earlier study of the same scene there are reused. None: a new temporary
        directory.
    knobs : sequence of str, optional
        Names of `knobs.KNOBS`; None: all that the scene has.
    budget : float
        Wall-clock time of the whole study [s].
    workers : int, optional
        Number of processes; None: one a core.
    on_progress : callable
        Called with a `Progress` at the start and the end of each run.
    runners : callable
        Context manager of a runner of jobs, given the number of processes.
    name : str
        Name of the scene in the reports.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        Invalid input, a scene that fails itself, or one that does not complete within the budget.

    Examples
    --------
    >>> import clothsim
    >>> scene = clothsim.load_scene("scenes/study_strip.toml")  # doctest: +SKIP
    >>> study = clothsim.study_accuracy(scene, budget=60, knobs=["dt", "cells"])  # doctest: +SKIP
    >>> [row["label"] for row in study.result["front"]]  # doctest: +SKIP
    ['cells -1', 'base', 'dt +1']
    """
    started = monotonic()
    seconds = as_positive("budget", budget)
    deadline = started + seconds - min(FOR_FILES[0] * seconds, FOR_FILES[1])
    directory = Path(tempfile.mkdtemp(prefix="clothsim-study-") if output is None else output)
    built = build(scene)
    base = fixed(scene, built)
    knobs_used, missing = usable(base, None if knobs is None else list(knobs))
    bench = Bench(scene, base, knobs_used)
    count = workers or cores()
    _make_folder(directory / FOLDER)
    material = material_of([c.rest_positions for c in built.world.cloths], [c.triangles for c in built.world.cloths])
    fingerprint = _fingerprint(base, built.world)
    with runners(count) as runner:
        gatherer = Gatherer(
            bench,
            material,
            bench.scene(_coarsest(bench)).to_text(),
            directory,
            fingerprint,
            runner,
            started,
            seconds,
            deadline,
            count,
            on_progress,
            stored_points(directory, fingerprint),
        )
        observer = _gathered(gatherer, built.world)
    _refuse_nothing_finer(gatherer, observer)
    study_data = StudyData(
        name,
        bench,
        gatherer,
        observer.fields(),
        observer.norm,
        observer.twins,
        observer.noise,
        observer.chaotic,
        missing,
    )
    spent = {"budget": seconds, "seconds": monotonic() - started, "workers": count}
    return _written(study_data, observer, spent)


@dataclass(frozen=True)
class _Observer:
    """Compared data of a run: positions of material points, or with chaotic folds the histogram of their heights.

    twins: how far apart those end that start a hair apart, in places [m]; noise: the same in what is compared [m].
    """

    gatherer: Gatherer
    areas: Floats
    up: Floats
    chaotic: bool
    twins: float
    noise: float

    @property
    def norm(self) -> Norm:
        """RMS over what is compared."""
        if self.chaotic:
            count = len(height_quantiles(self.gatherer.outcomes[BASE].positions, self.areas, self.up))
            return Norm(np.full(count, 1 / count))
        return Norm(self.areas / self.areas.sum())

    def fields(self) -> dict[Point, Floats]:
        """Compared data of each data point: with chaotic folds the mean over its seeds.

        A variant with another bending model is none: it tends to something else.
        """
        outcomes = [
            each for each in self.gatherer.outcomes.values() if not each.failed and each.point.variant != CONVERGENT
        ]
        if not self.chaotic:
            return {each.point: each.positions for each in outcomes if not each.point.seed}
        several: dict[Point, list[Floats]] = {}
        for each in outcomes:
            quantiles = height_quantiles(each.positions, self.areas, self.up)
            several.setdefault(replace(each.point, seed=0), []).append(quantiles)
        return {where: np.mean(each, axis=0) for where, each in several.items()}

    def limits(self) -> dict[str, Limit]:
        """Limits of the one-knob sweeps, as far as known."""
        bench = self.gatherer.bench
        return analysis.limits_of(self.fields(), bench.knobs, bench.base, self.norm, self.noise)

    def worth_trying(self) -> list[Point]:
        """Combinations to run next; none where no limit is known."""
        limits, knobs = self.limits(), self.gatherer.bench.knobs
        known = self.fields(), self.gatherer.field_seconds(), limits
        return analysis.next_points(*known, knobs, self.norm, COMBINATIONS) if limits else []

    def spread(self) -> float:
        """With chaotic folds: RMS distance of the base's seeds to their mean, over the root of their number [m]."""
        seeds = [
            height_quantiles(each.positions, self.areas, self.up)
            for each in self.gatherer.outcomes.values()
            if not each.failed and replace(each.point, seed=0) == BASE
        ]
        mean = np.mean(seeds, axis=0)
        return float(np.sqrt(np.mean([self.norm(each - mean) ** 2 for each in seeds]) / max(1, len(seeds) - 1)))


def _gathered(gatherer: Gatherer, world: World) -> _Observer:
    """Run what fits into the budget, the most telling first."""
    bench = gatherer.bench
    tight = bench.tight(TIGHT)
    gatherer.gather([BASE, *tight])
    _refuse_no_base(gatherer)
    gatherer.gather(_alone(bench, (-1, 1)))
    observer = _observer(gatherer, world, tight)
    gatherer.gather([*bench.variants(), *(Point(variant=name) for name in PRESETS)], LATE)
    if observer.chaotic:
        seeds = [replace(where, seed=seed) for seed in range(1, SEEDS + 1) for where in (BASE, *_alone(bench, (1,)))]
        gatherer.gather(seeds, LATE)
        return replace(observer, noise=observer.spread())
    gatherer.gather(_alone(bench, (-2, 2)), LATE)
    gatherer.gather(analysis.joint_points(observer.limits(), gatherer.outcomes[BASE].positions, observer.norm))
    gatherer.gather(observer.worth_trying(), LATE)
    for _ in range(FINER):
        gatherer.gather(analysis.finer_point(observer.fields(), observer.limits()), LATE)
    gatherer.gather(observer.worth_trying(), LATE)
    return observer


def _observer(gatherer: Gatherer, world: World, tight: Sequence[Point]) -> _Observer:
    """Compare the twins: without both of them nothing is known of chaos, and none is assumed."""
    acceleration = gatherer.bench.base.effects.get("gravity", {}).get("acceleration", (0.0, 0.0, -9.81))
    down = np.asarray(acceleration, float)
    length = float(np.linalg.norm(down))
    up = -down / length if "gravity" in gatherer.bench.base.effects and length else np.array([0.0, 0.0, 1.0])
    observer = _Observer(gatherer, point_areas(gatherer.material), up, False, 0.0, 0.0)
    if not all(gatherer.good(each) for each in tight):
        return observer
    norm, outcomes = observer.norm, gatherer.outcomes
    noise = norm(outcomes[tight[0]].positions - outcomes[tight[1]].positions)
    changes = [
        norm(outcomes[BASE].positions - outcomes[each].positions)
        for each in _alone(gatherer.bench, (1,))
        if gatherer.good(each)
    ]
    return replace(observer, twins=noise, noise=noise, chaotic=noise > CHAOTIC * max(changes, default=np.inf))


def _alone(bench: Bench, levels: Iterable[int]) -> list[Point]:
    """One-knob points."""
    return [point({name: level}) for level in levels for name in bench.knobs]


def _coarsest(bench: Bench) -> Point:
    """Every knob one level coarser, as far as it goes."""
    levels: dict[str, int] = {}
    for name, knob in bench.knobs.items():
        try:
            knob.value(bench.base, -1)
        except InputError:
            continue
        levels[name] = -1
    return point(levels)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made a directory: {error.strerror}.", "Choose another output.") from error


def _refuse_no_base(gatherer: Gatherer) -> None:
    if gatherer.good(BASE):
        return
    if BASE in gatherer.outcomes:
        raise InputError(
            f"The scene itself is no data point: {gatherer.outcomes[BASE].failed}",
            "Run it, and change what fails; a shorter dt often helps.",
        )
    raise InputError(
        f"The scene alone takes longer than the budget of {gatherer.budget:g} s.", "Give --budget more seconds."
    )


def _refuse_nothing_finer(gatherer: Gatherer, observer: _Observer) -> None:
    if not observer.limits():
        raise InputError(
            f"No finer run of the scene came to its end within the budget of {gatherer.budget:g} s, so its error is "
            "unknown.",
            "Give --budget more seconds: the runs so far are kept.",
        )


def _fingerprint(base: Scene, world: World) -> str:
    """Identity of a scene: hash of its settings, its meshes and the code that computes them."""
    import clothsim

    digest = sha256(f"{clothsim.__version__} {base.to_text()}".encode())
    for array in (world.start(), world.triangles, world.body_triangles, world.rest_shapes):
        digest.update(np.ascontiguousarray(array).tobytes())
    home = Path(clothsim.__file__).parent
    for folder in COMPUTES:
        for file in sorted((home / folder).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _written(study_data: StudyData, observer: _Observer, spent: dict[str, float]) -> Study:
    """Write the three files."""
    from clothsim.accuracy.plot import draw

    directory = study_data.gatherer.directory
    findings = study_data.findings()
    rest = document(study_data, findings, spent, _invariants(observer) if study_data.chaotic else {})
    result = write_points(directory, study_data.gatherer.fingerprint, **rest)
    (directory / REPORT_NAME).write_text(markdown(study_data, findings, result), encoding="utf-8")
    draw(study_data, findings, directory / PICTURE_NAME)
    return Study(directory, result)


def _invariants(observer: _Observer) -> dict[str, Any]:
    """Drape coefficient and energy of the base over its seeds: mean, spread, number."""
    gatherer = observer.gatherer
    triangles, first = [], 0
    for rest, faces in zip(gatherer.material.rest, gatherer.material.triangles, strict=True):
        triangles.append(faces + first)
        first += len(rest)
    runs = [each for each in gatherer.outcomes.values() if not each.failed and replace(each.point, seed=0) == BASE]
    area = float(observer.areas.sum())
    drapes = [drape_coefficient(each.positions, np.concatenate(triangles), area, observer.up) for each in runs]
    energies = [each.energy for each in runs]
    return {
        name: {"mean": float(np.mean(values)), "spread": float(np.std(values)), "seeds": len(values)}
        for name, values in (("drape_coefficient", drapes), ("energy", energies))
    }
