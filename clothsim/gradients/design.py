"""Design of a pattern: numbers of its panels for which the garment hangs as wished.

The sum of the aims is minimised by sequential quadratic programming (Kraft 1988, "A software package for sequential
quadratic programming") over the changes of the numbers, with the area of the fabric as a constraint and mirror symmetry
eliminated; each evaluation is a whole run with its gradient. It ends once every aim is met.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.inputs import with_remedies
from clothsim.gradients.design_aims import SeesMaterial, largest_stretch
from clothsim.gradients.loss_of_numbers import count_intersecting_pairs, derivatives
from clothsim.gradients.losses import Loss
from clothsim.gradients.pattern_numbers import SECTION, PatternNumber, PatternNumbers
from clothsim.gradients.run import Trace, traced
from clothsim.gradients.scene_of_pattern import ShapedScene, shaped_scene
from clothsim.patterns.pattern_mesh import PatternMesh
from clothsim.scene.scene import Scene

MOST_RUNS = 40
"""Bound on the runs of a design."""
UNIT = 0.05
"""Change of a number in which the search measures, as a fraction of the size of its panel."""
FARTHEST = 0.3
"""Largest change of a number, as that fraction."""
FAILED = 1e6
"""Loss, relative to the first one, that stands for a run that cannot be taken."""
LEAST_GAIN = 1e-5
"""Gain of a step, of the first loss, below which the search ends."""
DIFFERENCE = 1e-6
"""Change of the numbers, in units, that differences of areas and stretches at held positions take."""


@dataclass(frozen=True)
class DesignRun:
    """A run of a design.

    Parameters
    ----------
    values : mapping
        Numbers of the pattern by path.
    aims : tuple of float
        Each aim: at most 1 where it is met; empty where the run cannot be taken.
    slope : (k,) float64
        Derivative of their sum by the numbers.
    area : float
        Area of the fabric [m2].
    newton_error : float
        What the sum would change by if the run were solved exactly.
    intersecting_pairs : int
        Intersecting triangles in the last state, by the exact test.
    stretch : float
        Largest principal stretch in the last state.
    failure : str
        Why it cannot be taken.
    """

    values: Mapping[str, float]
    aims: tuple[float, ...] = ()
    slope: Floats = field(default_factory=lambda: np.zeros(0), repr=False)
    area: float = float("nan")
    newton_error: float = float("nan")
    intersecting_pairs: int = 0
    stretch: float = float("nan")
    failure: str = ""

    @property
    def loss(self) -> float:
        """Sum of the aims, inf where the run cannot be taken."""
        return float(sum(self.aims)) if self.aims else float("inf")

    @property
    def met(self) -> bool:
        """True where every aim is met."""
        return bool(self.aims) and max(self.aims) <= 1.0


@dataclass(frozen=True)
class Design:
    """Result of a design.

    Parameters
    ----------
    scene : Scene
        The scene with the pattern of the best run.
    best : DesignRun
        The run with the least sum of aims among those within the area.
    runs : tuple of DesignRun
        All of them.
    """

    scene: Scene
    best: DesignRun
    runs: tuple[DesignRun, ...]


class _EnoughError(Exception):
    """End of the search: the aims are met, or the runs are used up."""


@with_remedies()
def design(
    scene: Scene,
    aims: Sequence[Loss],
    free: Sequence[str],
    pattern: PatternMesh | None = None,
    largest_area: float | None = None,
    symmetric: bool = False,
    most_runs: int = MOST_RUNS,
    progress: Callable[[DesignRun], None] | None = None,
) -> Design:
    """Find numbers of a pattern with which a garment meets given aims.

    Parameters
    ----------
    scene : Scene
        With a cloth from a pattern file, or one of arrays and `pattern`; the start is held.
    aims : sequence of Loss
        `HemAt`, `Measured`, `StretchBelow`; a loss that is at most 1 where it is met.
    free : sequence of str
        Numbers of the pattern: "pattern.front+back.height", "pattern.front.edge[0].control[0].y".
    pattern : PatternMesh, optional
        The pattern of a cloth of arrays.
    largest_area : float, optional
        Bound on the area of the fabric [m2].
    symmetric : bool
        True: vertices and control points change as mirror images in each panel.
    most_runs : int
        Bound on the runs.
    progress : callable, optional
        Called after each run.

    Raises
    ------
    InputError
        For a number that there is not, or a scene without a gradient.
    ClothsimError
        Where the scene itself cannot be run.
    """
    paths = tuple(dict.fromkeys(free))
    if not paths or not aims or not all(path.startswith(SECTION) for path in paths):
        raise InputError(
            "A design needs aims, and free numbers of the pattern.", "Name some, such as pattern.front.height."
        )
    shaped = shaped_scene(scene, pattern)
    if len(shaped.scene.cloths) != 1:
        raise InputError(f"The scene has {len(shaped.scene.cloths)} cloths.", "A design needs exactly one.")
    numbers = shaped.numbers
    origin, sizes = np.array([numbers.value(path) for path in paths]), [numbers.size(path) for path in paths]
    tied = mirror_matrix(numbers, paths) if symmetric else np.eye(len(paths))
    search = _Search(shaped, tuple(aims), paths, origin, UNIT * np.array(sizes)[:, None] * tied)
    runs = search.runs_of(largest_area, most_runs, progress)
    within = [run for run in runs if largest_area is None or run.area <= largest_area * (1 + 1e-6)]
    best = min(within or runs, key=lambda run: run.loss)
    if not np.isfinite(best.loss):
        raise ClothsimError(f"No run of the design succeeded: {best.failure}")
    return Design(shaped.with_numbers(best.values), best, tuple(runs))


@dataclass(frozen=True)
class _Search:
    """Aims over the independent changes of numbers, in units; `units (k, r)`: change of the numbers by each."""

    shaped: ShapedScene
    aims: tuple[Loss, ...]
    paths: tuple[str, ...]
    origin: Floats
    units: Floats

    def values(self, point: Floats) -> dict[str, float]:
        return dict(zip(self.paths, (self.origin + self.units @ point).tolist(), strict=True))

    def area(self, point: Floats) -> float:
        return _area(self.shaped.numbers.material_coordinates(self.values(point)))

    def by_area(self, point: Floats) -> Floats:
        steps = DIFFERENCE * np.eye(len(point))
        return np.array([(self.area(point + step) - self.area(point - step)) / (2 * DIFFERENCE) for step in steps])

    def runs_of(
        self, largest_area: float | None, most_runs: int, progress: Callable[[DesignRun], None] | None
    ) -> list[DesignRun]:
        """All runs of the search."""
        first = traced(self.shaped.scene)
        runs = list[DesignRun]()

        def loss(point: Floats) -> tuple[float, Floats]:
            values = self.values(point)
            run = self._run(values, first if not point.any() else None, first.stiffness)
            runs.append(run)
            if progress is not None:
                progress(run)
            if not run.aims and len(runs) == 1:
                raise ClothsimError(run.failure)
            if (run.met and (largest_area is None or run.area <= largest_area)) or len(runs) >= most_runs:
                raise _EnoughError
            return (run.loss / runs[0].loss, run.slope @ self.units / runs[0].loss) if run.aims else (FAILED, point)

        farthest = FARTHEST / UNIT
        constraints = []
        if largest_area is not None:
            constraints = [
                {
                    "type": "ineq",
                    "fun": lambda point: (largest_area - self.area(point)) / largest_area,
                    "jac": lambda point: -self.by_area(point) / largest_area,
                }
            ]
        start = np.zeros(self.units.shape[1])
        with suppress(_EnoughError):
            minimize(
                loss,
                start,
                jac=True,
                method="SLSQP",
                bounds=[(-farthest, farthest)] * len(start),
                constraints=constraints,
                options={"maxiter": most_runs, "ftol": LEAST_GAIN},
            )
        return runs

    def _run(self, values: dict[str, float], taken: Trace | None, stiffness: Mapping[str, float]) -> DesignRun:
        """A run with its gradient; a failed one too."""
        numbers = self.shaped.numbers
        material = numbers.material_coordinates(values)
        area = _area(material)
        try:
            trace = traced(self.shaped.with_numbers(values), stiffness) if taken is None else taken
            aims = [aim.cut_to(material) if isinstance(aim, SeesMaterial) else aim for aim in self.aims]
            gradient = trace.gradient(aims)
            slope = derivatives(values, gradient, self.shaped)
            # of the aims by the numbers by way of the rest shape alone
            at_held_positions = np.zeros(len(self.paths))
            of_cloth = trace.session.built.world.triangles
            for aim in self.aims:
                if not isinstance(aim, SeesMaterial):
                    continue
                x = trace.cloth_positions(aim.frame)
                for k, path in enumerate(self.paths):
                    field = self.shaped.numbers.field(values, path)
                    step = DIFFERENCE * self.shaped.numbers.size(path)
                    sides = [aim.cut_to(material + sign * step * field).evaluate(x, of_cloth)[0] for sign in (1, -1)]
                    at_held_positions[k] += (sides[0] - sides[1]) / (2 * step)
            slope = slope + at_held_positions
        except InputError as error:
            return DesignRun(values, area=area, failure=error.sentence)
        except ClothsimError as error:
            return DesignRun(values, area=area, failure=error.sentence)
        triangles = trace.session.built.world.triangles
        each = tuple(aim.evaluate(trace.cloth_positions(aim.frame), triangles)[0] for aim in aims)
        stretch = largest_stretch(trace.cloth_positions(), triangles, material)
        return DesignRun(values, each, slope, area, gradient.newton_error, count_intersecting_pairs(trace), stretch)


def _area(material: Floats) -> float:
    edges = material[:, 1:] - material[:, :1]
    return float(0.5 * np.abs(np.linalg.det(edges)).sum())


ALIKE = 1e-3
"""Distance of a point from the mirror image of another, as a fraction of the width, below which they are a pair."""


def mirror_matrix(numbers: PatternNumbers, paths: Sequence[str]) -> Floats:
    """Return the matrix (k, r) from r independent changes to those of k numbers, panels mirrored about their middle.

    x of a pair changes by opposite, y by equal amounts; x of a point on the axis stays; widths, heights and flares are
    free.

    Raises
    ------
    InputError
        For a point whose mirror image is not a vertex or control point among the numbers.
    """
    found = [numbers.number(path) for path in paths]
    columns, done = list[Floats](), set[int]()
    for i, number in enumerate(found):
        if i in done:
            continue
        column = np.zeros(len(paths))
        column[i] = 1.0
        if not number.extent:
            j = _partner(numbers, found, i, paths[i])
            done.add(j)
            if j == i and number.axis == 0:
                continue
            column[j] = -1.0 if number.axis == 0 else 1.0
        columns.append(column)
    return np.column_stack(columns) if columns else np.zeros((len(paths), 0))


def _partner(numbers: PatternNumbers, found: Sequence[PatternNumber], i: int, path: str) -> int:
    """Row of the number with the mirror image."""
    low, sides = numbers.extent(found[i].panels[0])
    image = numbers.point(found[i])
    image[0] = 2 * (low[0] + sides[0] / 2) - image[0]
    for j, other in enumerate(found):
        same = not other.extent and other.panels == found[i].panels and other.axis == found[i].axis
        alike = same and (other.vertex < 0) == (found[i].vertex < 0)
        if alike and np.abs(numbers.point(other) - image).max() < ALIKE * sides[0]:
            return j
    raise InputError(
        f"{path} has no mirror image among the free numbers.", "Free its partner, or leave out --symmetric."
    )
