"""Resolutions of a scene (steps of a frame, factors of cells and d_hat), and the distance of runs at them."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from clothsim import Run, Scene, engine, open_run
from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.record import SUMMARY_NAME, write_summary
from clothsim.engine import Session, build, last_positions, with_cells
from clothsim.study.evaluation import Material, at_points_of, point_areas, world_material
from clothsim.study.parameters import CELLS, D_HAT, TIME, d_hats, with_explicit_lengths

COARSEST_STEP = 0.01
"""Longest step of the first pilot run [s]. With 20 ms a strip under compression buckled to the other side."""
FEWEST_CELLS = 2
"""Cells along a side below which no pilot run goes."""


@dataclass(frozen=True)
class Resolution:
    """Numerical resolution of a run.

    Parameters
    ----------
    steps : int
        Steps of a frame.
    cells : Fraction
        Factor of the scene's cells.
    d_hat : Fraction
        Factor of the scene's d_hat.
    """

    steps: int
    cells: Fraction = Fraction(1)
    d_hat: Fraction = Fraction(1)


@dataclass(frozen=True)
class RefinableScene:
    """A scene without solver.error and what can be refined of it.

    Parameters
    ----------
    scene : Scene
        Scene with its lengths written out.
    frame : float
        Duration of a frame [s].
    coarsest : Resolution
        Resolution of the first pilot run.
    parameters : tuple of str
        What is refined: TIME, CELLS, D_HAT.
    fixed : mapping
        Reason for each that is not.
    """

    scene: Scene
    frame: float
    coarsest: Resolution
    parameters: tuple[str, ...]
    fixed: Mapping[str, str]

    def sizes(self, resolution: Resolution) -> dict[str, float]:
        """Size of each parameter relative to the coarsest."""
        coarsest = self.coarsest
        sizes = {
            TIME: coarsest.steps / resolution.steps,
            CELLS: float(coarsest.cells / resolution.cells),
            D_HAT: float(resolution.d_hat / coarsest.d_hat),
        }
        return {name: sizes[name] for name in self.parameters}

    def refined(self, resolution: Resolution, parameters: Collection[str]) -> Resolution:
        """A resolution with some parameters refined by two; those that the scene has not stay."""
        both = [name for name in parameters if name in self.parameters]
        return Resolution(
            resolution.steps * (2 if TIME in both else 1),
            resolution.cells * (2 if CELLS in both else 1),
            resolution.d_hat / (2 if D_HAT in both else 1),
        )

    def whole(self, factor: Fraction) -> bool:
        """True where the cells of every cloth times a factor are whole numbers."""
        return all((count * factor).denominator == 1 for count in _counts(self.scene))

    def text(self, resolution: Resolution) -> str:
        """A resolution for people: "dt 5 ms, cells x 2, d_hat x 1/2"."""
        parts = [f"dt {1e3 * self.dt(resolution):.3g} ms"]
        parts += [f"cells x {resolution.cells}"] if CELLS in self.parameters else []
        parts += [f"d_hat x {resolution.d_hat}"] if D_HAT in self.parameters else []
        return ", ".join(parts)

    def dt(self, resolution: Resolution) -> float:
        """Time step [s]."""
        return self.frame / resolution.steps

    def at(self, resolution: Resolution, newton_error_fraction: float) -> Scene:
        """The scene at a resolution; a tolerance of its own stays."""
        scene = engine.replace(self.scene, "solver.dt", self.dt(resolution))
        if "tolerance" not in scene.solver:
            scene = engine.replace(scene, "solver.newton_error_fraction", newton_error_fraction)
        for name, d_hat in d_hats(self.scene).items():
            scene = engine.replace(scene, f"effects.{name}.d_hat", d_hat * float(resolution.d_hat))
        return scene if resolution.cells == 1 else with_cells(scene, resolution.cells)


def refinable_scene(given: Scene) -> RefinableScene:
    """What can be refined of a scene; it takes BDF2 unless the scene names its integrator.

    With solver.error every step is converged.
    """
    threads = given.solver_settings.threads
    solver = {key: value for key, value in given.solver.items() if key != "error"}
    if given.solver_settings.error and "tolerance" not in solver:
        solver["converge"] = True
    scene = replace(given, solver={"integrator": "bdf2", **solver})
    scene = engine.replace(with_explicit_lengths(scene, build(given).energies), "solver.threads", threads)
    run, missing = scene.run_settings, {}
    frame = min(1 / run.frames_per_second, run.duration)
    steps = max(1, -int(-frame // COARSEST_STEP))
    parameters = [TIME]
    cells = Fraction(1)
    try:
        with_cells(scene, Fraction(2))
        parameters.append(CELLS)
        cells = Fraction(1, 2) if has_cells_for(scene, 2) else cells
    except InputError as error:
        missing[CELLS] = error.sentence.rstrip(".")
    if d_hats(scene):
        parameters.append(D_HAT)
    return RefinableScene(scene, frame, Resolution(steps, cells), tuple(parameters), missing)


def has_cells_for(scene: Scene, factor: int, fewest: int = FEWEST_CELLS) -> bool:
    """True where every cloth's cells over a factor are whole numbers, `fewest` or more."""
    if any(count % factor or count < factor * fewest for count in _counts(scene)):
        return False
    try:
        with_cells(scene, Fraction(1, factor))
    except InputError:
        return False
    return True


def _counts(scene: Scene) -> list[int]:
    """Cells along each side of each cloth."""
    counts = [keys["cells"] for keys in with_cells(scene, Fraction(1)).cloths]
    return [count for each in counts for count in (each if isinstance(each, list | tuple) else [each])]


@dataclass(frozen=True)
class Trial:
    """A run.

    Parameters
    ----------
    resolution : Resolution
        Its resolution.
    material : Material
        Its mesh at rest.
    positions : (n, 3) float64
        Cloth vertices at the last frame [m].
    seconds : float
        Processor seconds.
    reason : str
        Why it came to no end; empty where it did.
    touched : bool
        True where contact acted at the end of a step.
    """

    resolution: Resolution
    material: Material
    positions: Floats
    seconds: float
    reason: str = ""
    touched: bool = True


Runs = Callable[[Scene, list[Session]], Run]
"""Runs a scene with fixed settings into the output directory; the list receives the session that it announces."""
Distance = Callable[[Trial, Trial], float]
ANOTHER_SHAPE = 0.1
"""Distance of two runs over the size of the cloth from which no order of convergence holds between them."""


def trial_at(scene: Scene, resolution: Resolution) -> Trial:
    """Run a scene at a resolution without writing anything."""
    started = process_time()
    world, positions, reason, touched = last_positions(scene)
    return Trial(resolution, world_material(world), positions, process_time() - started, reason, touched)


def written_run(runs: Runs, scene: Scene, resolution: Resolution) -> tuple[Run, Trial]:
    """Run a scene at a resolution into the output directory."""
    started, sessions = process_time(), list[Session]()
    run = runs(scene, sessions)
    seconds = process_time() - started
    touched = run.summary["certificate"]["minimum_gap"] is not None
    material = world_material(sessions[0].built.world)
    return run, Trial(resolution, material, run.positions(-1), seconds, touched=touched)


def with_estimate(run: Run, entries: Mapping[str, Any], *notes: str) -> Run:
    """The run with entries of the error estimate of its certificate, and notes, in its summary."""
    summary, certificate = dict(run.summary), dict(run.summary["certificate"])
    certificate["error_estimate"] = {**certificate["error_estimate"], **entries}
    summary |= {"certificate": certificate, "notes": [*summary["notes"], *notes]}
    write_summary(Path(run.directory) / SUMMARY_NAME, summary)
    return open_run(run.directory)


def another_shape(finer: Trial, moved: float) -> bool:
    """True where a coarser run ends so far away [m] that it is another solution rather than a less accurate one."""
    return moved > ANOTHER_SHAPE * float(np.linalg.norm(np.ptp(finer.positions, axis=0)))


@dataclass(frozen=True)
class Differences:
    """Differences of three runs, each coarser by two than the one before it.

    Parameters
    ----------
    fine, coarse : float
        RMS distances of the first two and of the last two [m].
    alignment : float
        Cosine of the angle between the two fields of displacement: 1 where the error has one shape at all resolutions,
        as in the range of convergence; 0 where the coarser run tells nothing of the finer one's direction; below 0
        where the runs turn back.
    """

    fine: float
    coarse: float
    alignment: float = 1.0


ROUNDING = 2.0**12 * float(np.finfo(float).eps)
"""Differences of runs, over the largest coordinate, that are those of rounding: nothing moves, or all falls freely."""


def differences_of(fine: Trial, middle: Trial, coarse: Trial) -> Differences:
    """Differences of three runs over the material points of the coarsest one; 0 where they agree to rounding."""
    weights, at = _common_points(coarse.material)
    first, second = at(fine) - at(middle), at(middle) - at(coarse)
    products = [float(weights @ (one * other).sum(axis=1)) for one, other in ((first, first), (second, second))]
    moved, further = np.sqrt(products)
    if max(moved, further) <= ROUNDING * np.abs(coarse.positions).max():
        return Differences(0.0, 0.0)
    cosine = (weights @ (first * second).sum(axis=1)) / (moved * further) if moved * further > 0 else 1.0
    return Differences(float(moved), float(further), float(cosine))


def acting(parameters: Collection[str], trials: Collection[Trial]) -> tuple[str, ...]:
    """Return the parameters without d_hat where contact acted in no run: their differences are those of no contact."""
    touched = any(trial.touched for trial in trials)
    return tuple(name for name in parameters if touched or name != D_HAT)


def distance_at(points: Material) -> Distance:
    """RMS distance of two runs [m] over these material points, weighted by their areas."""
    weights, at = _common_points(points)

    def distance(one: Trial, other: Trial) -> float:
        return float(np.sqrt(weights @ ((at(one) - at(other)) ** 2).sum(axis=1)))

    return distance


def _common_points(points: Material) -> tuple[Floats, Callable[[Trial], Floats]]:
    """Fractions of the area (n,) of these material points, and the function that gives their positions in a run."""
    areas = point_areas(points)
    return areas / areas.sum(), lambda trial: at_points_of(points, trial.material, trial.positions)
