"""Choice of the resolution with the least work whose expected error is small enough."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from clothsim.study.error_control.knob_errors import KnobErrors
from clothsim.study.error_control.resolution import CELLS, D_HAT, TIME, Resolution, Resolvable

AIM = 0.95
"""Fraction of the requested error that is aimed at."""
FARTHEST = {TIME: 4, CELLS: 2, D_HAT: 4}
"""Largest refinement of a knob beyond the finest run so far: further out the expected errors are not trusted."""
OVERHEAD = 100
"""Vertices whose work is that of a Newton iteration without any."""
GROWTH = 0.85
"""Newton iterations grow with that power of the number of steps."""
FACTORS = (
    1,
    Fraction(3, 2),
    2,
    Fraction(5, 2),
    3,
    4,
    5,
    6,
    7,
    8,
    10,
    12,
    14,
    16,
    20,
    24,
    28,
    32,
    40,
    48,
    56,
    64,
    80,
    96,
    128,
)
"""Factors of the coarsest resolution."""


def work(resolvable: Resolvable, resolution: Resolution, vertices: int) -> float:
    """Expected work of a run relative to the coarsest: Newton iterations times vertices, counted so that it repeats.

    Parameters
    ----------
    resolvable : Resolvable
        The scene.
    resolution : Resolution
        Its resolution.
    vertices : int
        Vertices of its coarsest mesh.
    """
    coarsest = resolvable.coarsest
    size = vertices * float((resolution.cells / coarsest.cells) ** 2)
    contact = float(coarsest.d_hat / resolution.d_hat) ** 0.15
    return (size + OVERHEAD) / (vertices + OVERHEAD) * (resolution.steps / coarsest.steps) ** GROWTH * contact


def chosen(
    resolvable: Resolvable, errors: KnobErrors, done: Sequence[Resolution], asked: float, vertices: int, most: float
) -> Resolution | None:
    """The resolution with the least work whose expected error is AIM of what is asked.

    Parameters
    ----------
    resolvable : Resolvable
        The scene.
    errors : KnobErrors
        Errors of the last run.
    done : sequence of Resolution
        All runs so far.
    asked : float
        Requested error [m].
    vertices : int
        Vertices of the coarsest mesh.
    most : float
        Largest admissible work.

    Returns
    -------
    Resolution or None
        Where none within reach is accurate enough: one of those that come nearest. None where none is new.
    """
    candidates = [each for each in _within_reach(resolvable, done) if each not in done]
    candidates = [each for each in candidates if work(resolvable, each, vertices) <= most]
    if not candidates:
        return None
    expected = {each: errors.at(resolvable.sizes(each)).total for each in candidates}
    bar = max(AIM * asked, 1.2 * min(expected.values()))
    enough = [each for each in candidates if expected[each] <= bar]
    return min(enough, key=lambda each: work(resolvable, each, vertices))


def _within_reach(resolvable: Resolvable, done: Sequence[Resolution]) -> list[Resolution]:
    coarsest, knobs = resolvable.coarsest, resolvable.knobs
    steps = [coarsest.steps * factor for factor in FACTORS if (coarsest.steps * factor) % 1 == 0]
    cells = [Fraction(coarsest.cells * factor) for factor in FACTORS if (coarsest.cells * factor * 2) % 1 == 0]
    d_hat = [coarsest.d_hat / factor for factor in FACTORS]
    finest_steps, finest_cells = max(each.steps for each in done), max(each.cells for each in done)
    least = min(each.d_hat for each in done)
    return [
        Resolution(int(n), c, Fraction(d))
        for n, c, d in product(
            [each for each in steps if each <= FARTHEST[TIME] * finest_steps],
            [each for each in cells if each <= FARTHEST[CELLS] * finest_cells and resolvable.whole(each)]
            if CELLS in knobs
            else [coarsest.cells],
            [each for each in d_hat if each >= least / FARTHEST[D_HAT]] if D_HAT in knobs else [coarsest.d_hat],
        )
    ]
