"""Errors and their estimates beside a reference: `python -m tests.known_answers.error_table [--scenes wind,ramp]`.

A row for each scene of `error_scenes` with solver.estimate, and with --asked one with solver.error: the true error (RMS
over the material points of the last frame, against `error_reference`), the estimate of the certificate and its ratio to
the truth, CPU seconds. --by-hand adds the cheapest fixed settings that have the error that is asked for, against the
same reference; --study SECONDS the study's own headline. --reference 32,8,16 takes a finer reference (dt, cells,
d_hat). "+-" is the reference's own error, as it and two coarser ones show it.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from clothsim import Scene
from clothsim.base.errors import ClothsimError
from clothsim.base.text import text_table
from clothsim.scene import paths
from clothsim.study.points import PRESETS, with_preset
from clothsim.study.study import searched_settings
from tests.known_answers.best_by_hand import best_by_hand
from tests.known_answers.error_reference import Refinement, Solution, distance, solution, truth
from tests.known_answers.error_scenes import ERROR_SCENES

HEADER = ("scene", "settings", "error [mm]", "+- [mm]", "estimate [mm]", "ratio", "CPU s")


@dataclass(frozen=True)
class Compared:
    """A run beside the reference: true error, doubt of the reference, estimate [m; nan: not known], CPU seconds."""

    scene: str
    settings: str
    error: float
    doubt: float
    estimate: float
    seconds: float

    @property
    def cells(self) -> list[str]:
        """A line of the table."""
        known = self.estimate == self.estimate
        return [
            self.scene,
            self.settings,
            f"{1e3 * self.error:.3g}",
            f"{1e3 * self.doubt:.2g}",
            f"{1e3 * self.estimate:.3g}" if known else "not known",
            f"{self.estimate / self.error:.2g}" if known else "",
            f"{self.seconds:.2f}",
        ]


def without_step(scene: Scene) -> Scene:
    """The scene without a dt, which solver.error replaces."""
    solver = {key: value for key, value in scene.solver.items() if key != "dt"}
    return Scene(scene.cloth, scene.body, scene.effects, solver, scene.contact, scene.run, scene.seed)


def estimate_of(solution: Solution) -> float:
    """The certificate's estimate of the error of a run [m], nan where it says that it does not know."""
    estimate = solution.summary["certificate"]["error_estimate"]
    value = estimate.get("total") if estimate.get("known") else None
    return value if isinstance(value, float) else float("nan")


def compared(name: str, settings: str, scene: Scene, reference: Solution, doubt: float) -> Compared:
    """Run a scene and compare it."""
    run = solution(scene)
    return Compared(name, settings, distance(run, reference), doubt, estimate_of(run), run.seconds)


def studied(name: str, scene: Scene, budget: float, reference: Solution, doubt: float) -> Compared:
    """The headline of a study beside the error of the scene that it studied; the range in the settings."""
    from clothsim import study_accuracy

    with TemporaryDirectory() as folder:
        result: dict[str, Any] = study_accuracy(scene, Path(folder), budget=budget).result
        base = solution(searched_settings(scene, Path(folder), budget)[0])
    headline = result["headline"]
    known = headline["error"] if headline["known"] else float("nan")
    bounds = "" if headline["high"] is None else f" ({headline['low']:.2g} to {headline['high']:.2g} mm)"
    settings = f"study: {headline['status']}{bounds}"
    return Compared(name, settings, distance(base, reference), doubt, 1e-3 * known, result["seconds"])


def rows(name: str, wanted: argparse.Namespace) -> list[Compared]:
    """The rows of a scene."""
    scene, asked = ERROR_SCENES[name], wanted.asked
    exact = truth(scene, Refinement(*wanted.reference))
    reference, doubt = exact.solution, exact.doubt
    found = [compared(name, "with estimate", paths.replace(scene, "solver.estimate", True), reference, doubt)]
    on = scene if asked is None else paths.replace(without_step(scene), "solver.error", asked)
    if asked is not None:
        found.append(compared(name, f"error {1e3 * asked:g} mm", on, reference, doubt))
    if wanted.by_hand and asked is not None:
        best = best_by_hand(scene, asked, reference)
        if best is not None:
            found.append(Compared(name, f"by hand: {best.settings}", best.error, doubt, float("nan"), best.seconds))
    if wanted.presets:
        for preset in PRESETS:
            estimated = paths.replace(with_preset(scene, preset)[0], "solver.estimate", True)
            found.append(compared(name, f"preset {preset}", estimated, reference, doubt))
    if wanted.study is not None:
        found.append(studied(name, on, wanted.study, reference, doubt))
    return found


def factors(text: str) -> tuple[int, ...]:
    """Three whole numbers with commas."""
    return tuple(int(each) for each in text.split(","))


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; 1 where a run fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.known_answers.error_table", description=__doc__)
    parser.add_argument("--scenes", default=",".join(ERROR_SCENES), help="names, with commas (default: all)")
    parser.add_argument("--asked", type=float, metavar="METRES", help="also a run with this solver.error")
    parser.add_argument("--by-hand", action="store_true", help="also the cheapest fixed settings with that error")
    parser.add_argument("--reference", type=factors, default=(16, 4, 8), metavar="DT,CELLS,D_HAT", help="16,4,8")
    parser.add_argument("--presets", action="store_true", help="also each preset")
    parser.add_argument("--study", type=float, metavar="SECONDS", help="also a study with that budget")
    arguments = parser.parse_args(argv)
    wanted = arguments.scenes.split(",")
    unknown = [name for name in wanted if name not in ERROR_SCENES]
    if unknown:
        parser.error(f"no scene is called {unknown[0]}; there are {', '.join(ERROR_SCENES)}")
    lines, failed = [], False
    for name in wanted:
        try:
            lines += [row.cells for row in rows(name, arguments)]
            print(lines[-1], file=sys.stderr, flush=True)
        except (ClothsimError, ValueError) as error:
            failed = True
            lines.append([name, str(error), *[""] * 5])
    print(text_table(HEADER, lines))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
