"""Claims of solver.error beside finer runs of what it chose: python -m tests.known_answers.honesty_table [SCENE ...].

Scenes of `unseen_scenes`. The truth is a run with a quarter of the dt, four times the cells and a quarter of the d_hat
of the settings that were chosen (--levels 2), and a tolerance of 1e-4 m/s; distances are RMS over the last frame. One
level is no truth: errors of dt and cells may have opposite signs. Of the arch it moved .30 mm, two .86 mm. "Doubt" is
the distance of the truth from the truth of one level less: what it may be off by itself, at most, where errors fall.
"""

import argparse
import sys
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from clothsim import Scene
from clothsim.base.text import text_table
from clothsim.scene import paths
from clothsim.study.error_control.resolution import Resolution, refinable_scene
from tests.known_answers.error_reference import distance, solution
from tests.known_answers.unseen_scenes import UNSEEN_SCENES

HEADER = (
    "scene",
    "claimed",
    "newton [mm]",
    "claimed [mm]",
    "true [mm]",
    "doubt [mm]",
    "claimed / true",
    "dt [ms], cells",
    "CPU s",
    "why",
)
STRICT = 1e-4
"""Tolerance of the truth [m/s]."""


def truth_of(scene: Scene, estimate: dict[str, Any], levels: int = 2) -> Scene:
    """The scene of the truth of a run with solver.error, by the estimate in its summary; levels: halvings."""
    refinable = refinable_scene(scene)
    steps, cells, d_hat = estimate["chosen"]["resolution"]
    taken = Resolution(int(steps), Fraction(cells), Fraction(d_hat))
    for _ in range(levels):
        taken = refinable.refined(taken, refinable.parameters)
    return paths.replace(refinable.at(taken, 0.1), "solver.tolerance", STRICT)


def row(name: str, asked: float, budget: float, levels: int = 2) -> list[str]:
    """A row of the table."""
    scene = UNSEEN_SCENES[name]
    on = paths.replace(paths.replace(scene, "solver.error", asked), "solver.budget", budget)
    run = solution(on)
    estimate = run.summary["certificate"]["error_estimate"]
    print(f"{name}: {run.summary['notes'][-1]}", file=sys.stderr, flush=True)
    before, truth = (solution(truth_of(on, estimate, each)) for each in (levels - 1, levels))
    true, doubt = distance(run, truth), distance(before, truth)
    claim = ("known, met" if estimate["met"] else "known, missed") if estimate["known"] else "not known"
    taken = estimate["chosen"]
    return [
        name, claim, f"{1e3 * estimate['parts']['newton']:.2f}", f"{1e3 * estimate['total']:.2f}", f"{1e3 * true:.2f}",
        f"{1e3 * doubt:.2f}", f"{estimate['total'] / true:.2f}", f"{1e3 * taken['dt']:.3g}, x {taken['resolution'][1]}",
        f"{estimate['seconds']:.1f}", run.summary["notes"][-1],
    ]  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all")
    parser.add_argument("--asked", type=float, default=2e-3, help="solver.error [m]")
    parser.add_argument("--budget", type=float, default=60.0, help="solver.budget [s]")
    parser.add_argument("--levels", type=int, default=2, help="halvings from what was chosen to the truth")
    given = parser.parse_args(arguments)
    rows = []
    for name in given.scenes or UNSEEN_SCENES:
        rows.append(row(name, given.asked, given.budget, given.levels))
        print(rows[-1], file=sys.stderr, flush=True)
    print(text_table(HEADER, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
