"""Errors that results state of themselves, beside the truth: `python -m tests.benchmarks.own_errors [PART ...]`.

scenes: the six of `error_scenes` with solver.estimate, and with solver.error of 1 mm, beside a finer reference
(--reference dt,cells,d_hat) and that one's own doubt; gradients: `Gradient.newton_error` of four of them, unpolished,
beside the change of the loss to exact solves; recoveries: the standard errors of `recover`, six draws of the noise. The
last column is "right" where what is stated lies within a factor of two of every truth within the doubt (of recoveries:
of the RMS of the draws), WRONG where of none, "not known" where nothing is stated.
"""

import argparse
import sys
from argparse import Namespace
from collections.abc import Sequence

import numpy as np

from clothsim.base.text import text_table
from clothsim.gradients.losses import Height
from clothsim.gradients.run import traced
from clothsim.scene import paths
from tests.benchmarks import recoveries
from tests.known_answers import error_table
from tests.known_answers.error_scenes import ERROR_SCENES

GRADIENTS = ("wind", "landing", "compressed", "ball")
EPS_V = 1e-2
"""Of friction in a differentiable run [m/s]."""
EXACT = 1e-9
"""Tolerance of the exact solves [m/s]."""
HEADER = ("what", "true", "+-", "stated", "stated / true", "verdict")


def verdict(stated: float, true: float, doubt: float = 0.0) -> str:
    """What a stated error, or its nan, is called beside a true one that is known to a doubt (all in one unit).

    Examples
    --------
    >>> verdict(1.0, 0.8, 0.2), verdict(1.0, 0.4, 0.2), verdict(1.0, 0.4, 0.05), verdict(float("nan"), 0.8)
    ('right', 'truth not known', 'WRONG', 'not known')
    """
    if np.isnan(stated):
        return "not known"
    least, most = max(true - doubt, 0.0), true + doubt
    if 0.5 * most <= stated <= 2.0 * least:
        return "right"
    return "WRONG" if stated > 2.0 * most or stated < 0.5 * least else "truth not known"


def line(what: str, true: float, stated: float, unit: str, doubt: float = 0.0) -> list[str]:
    """A row of the table."""
    ratio = stated / true
    shown = [f"{stated:.3g} {unit}", f"{ratio:.2f}"] if not np.isnan(ratio) else ["not known", ""]
    return [what, f"{true:.3g} {unit}", f"{doubt:.2g}" if doubt else "", *shown, verdict(stated, true, doubt)]


def scenes(given: Namespace) -> list[list[str]]:
    """Rows of the error of scenes [mm]."""
    wanted = Namespace(asked=1e-3, reference=given.reference, by_hand=False, presets=False, study=None)
    found = []
    for name in given.scenes or ERROR_SCENES:
        found += error_table.rows(name, wanted)
        print(found[-1].cells, file=sys.stderr, flush=True)
    return [
        line(f"{each.scene}, {each.settings}", 1e3 * each.error, 1e3 * each.estimate, "mm", 1e3 * each.doubt)
        for each in found
    ]


def gradients(_given: Namespace) -> list[list[str]]:
    """Rows of Newton's error in the mean height of a run [um]."""
    found = []
    for name in GRADIENTS:
        scene = ERROR_SCENES[name]
        if "friction" in scene.effects:
            scene = paths.replace(scene, "effects.friction.eps_v", EPS_V)
        loose = traced(scene, polish=0)
        gradient = loose.gradient(Height())
        exact = traced(paths.replace(scene, "solver.tolerance", EXACT), loose.stiffness).gradient(Height()).value
        found.append(line(f"{name}, Newton's part", 1e6 * (exact - gradient.value), 1e6 * gradient.newton_error, "um"))
        print(found[-1], file=sys.stderr, flush=True)
    return found


def of_draws(given: Namespace) -> list[list[str]]:
    """Rows of the standard errors of recovered numbers: 1 over the RMS of what they are off in these errors."""
    found = [each for name in recoveries.CASES for each in recoveries.rows(recoveries.CASES[name](), given.draws, 0)]
    return [[path, rms, "", stated, f"{1 / float(ratio):.2f}", verdict(1 / float(ratio), 1.0)]
            for path, _, rms, _, stated, ratio, _ in found]  # fmt: skip


PARTS = {"scenes": scenes, "gradients": gradients, "recoveries": of_draws}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 where a stated error is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--reference", type=error_table.factors, default=(16, 4, 8), metavar="DT,CELLS,D_HAT")
    parser.add_argument("--scenes", nargs="+", choices=ERROR_SCENES, metavar="SCENE", help="default: all")
    parser.add_argument("--draws", type=int, default=6, help="of the noise of a recovery")
    given = parser.parse_args(arguments)
    table = [each for part in given.parts or PARTS for each in PARTS[part](given)]
    print(text_table(HEADER, table))
    return int(any(each[-1] == "WRONG" for each in table))


if __name__ == "__main__":
    sys.exit(main())
