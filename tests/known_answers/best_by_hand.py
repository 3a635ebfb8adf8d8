"""Cheapest fixed settings of a scene that have a given error: what solver.error is compared with.

The grid has dt from 20 ms, cells from half of the scene's, d_hat from half of the scene's. It is searched in the order
of the expected work, and left where that is LATER times the work of the best so far.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

from clothsim import Scene
from clothsim.base.errors import ClothsimError
from clothsim.study.error_control.resolution import CELLS, D_HAT, Resolution, refinable_scene
from clothsim.study.error_control.search import work_of
from tests.known_answers.error_reference import Solution, distance, solution

LONGEST_STEP = 0.02
STEPS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32)
"""Factors of the steps of a frame."""
CELL_FACTORS = (Fraction(1, 2), 1, Fraction(3, 2), 2, 3, 4)
D_HAT_FACTORS = (Fraction(1, 2), Fraction(1, 8))
LATER = 1.5
NEWTON_ERROR_FRACTION = 0.1


@dataclass(frozen=True)
class ByHand:
    """A run with fixed settings: settings in words, true error [m], CPU seconds."""

    settings: str
    error: float
    seconds: float


def best_by_hand(scene: Scene, asked: float, reference: Solution) -> ByHand | None:
    """The cheapest run of the grid whose error is at most `asked` [m]; None where none has it."""
    solver = {key: value for key, value in scene.solver.items() if key not in ("dt", "error")}
    refinable = refinable_scene(replace(scene, solver=solver))
    first = max(1, round(refinable.frame / LONGEST_STEP))
    coarsest = refinable.coarsest.cells
    vertices = len(reference.positions) // 4

    def effort(each: Resolution) -> float:
        return work_of(refinable, each, vertices)

    grid = sorted(
        (
            Resolution(first * steps, Fraction(cells), Fraction(d_hat))
            for steps, cells, d_hat in product(
                STEPS,
                [each for each in CELL_FACTORS if each >= coarsest] if CELLS in refinable.parameters else (1,),
                D_HAT_FACTORS if D_HAT in refinable.parameters else (1,),
            )
        ),
        key=effort,
    )
    best, limit = None, float("inf")
    for each in grid:
        if effort(each) > limit:
            break
        try:
            run = solution(refinable.at(each, NEWTON_ERROR_FRACTION))
        except (ClothsimError, ValueError):
            continue
        error = distance(run, reference)
        if error <= asked and (best is None or run.seconds < best.seconds):
            best, limit = ByHand(refinable.text(each), error, run.seconds), LATER * effort(each)
    return best
