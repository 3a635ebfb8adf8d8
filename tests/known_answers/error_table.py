"""Errors and their estimates beside a reference: `python -m tests.known_answers.error_table [--scenes wind,ramp]`.

A row for each scene of `error_scenes` with solver.estimate, and with --asked one with solver.error: the true error (RMS
over the material points of the last frame, against `error_reference`), the estimate of the certificate and its ratio to
the truth, CPU seconds. --study SECONDS adds the study's own statement.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from clothsim import Scene
from clothsim.build.presets import PRESETS, with_preset
from clothsim.errors import ClothsimError
from clothsim.scene.overrides import set_key
from clothsim.text_table import text_table
from tests.known_answers.error_reference import Refinement, Solution, distance, reference_scene, solution
from tests.known_answers.error_scenes import ERROR_SCENES

HEADER = ("scene", "settings", "error [mm]", "to +- [mm]", "estimate [mm]", "ratio", "CPU s")
COARSER = Refinement(dt=4, cells=1)
"""Refinement of the run that shows the reference's own error, with dt and cells a level coarser."""


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
    """The study's statement on a scene beside its error."""
    from clothsim import study_accuracy

    with TemporaryDirectory() as folder:
        result: dict[str, Any] = study_accuracy(scene, Path(folder), budget=budget).result
    base = solution(scene)
    known = (result.get("base") or {}).get("error")
    estimate = float("nan") if known is None else 1e-3 * known
    return Compared(name, "study", distance(base, reference), doubt, estimate, result.get("seconds", 0.0))


def rows(name: str, asked: float | None, presets: bool, budget: float | None) -> list[Compared]:
    """The rows of a scene."""
    scene = ERROR_SCENES[name]
    reference = solution(reference_scene(scene))
    doubt = distance(solution(reference_scene(scene, COARSER)), reference)
    found = [compared(name, "with estimate", set_key(scene, "solver.estimate", True), reference, doubt)]
    if asked is not None:
        on = set_key(without_step(scene), "solver.error", asked)
        found.append(compared(name, f"error {1e3 * asked:g} mm", on, reference, doubt))
    if presets:
        for preset in PRESETS:
            on = set_key(with_preset(scene, preset)[0], "solver.estimate", True)
            found.append(compared(name, f"preset {preset}", on, reference, doubt))
    if budget is not None:
        found.append(studied(name, scene, budget, reference, doubt))
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; 1 where a run fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.known_answers.error_table", description=__doc__)
    parser.add_argument("--scenes", default=",".join(ERROR_SCENES), help="names, with commas (default: all)")
    parser.add_argument("--asked", type=float, metavar="METRES", help="also a run with this solver.error")
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
            lines += [row.cells for row in rows(name, arguments.asked, arguments.presets, arguments.study)]
            print(lines[-1], file=sys.stderr, flush=True)
        except (ClothsimError, ValueError) as error:
            failed = True
            lines.append([name, str(error), *[""] * 5])
    print(text_table(HEADER, lines))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
