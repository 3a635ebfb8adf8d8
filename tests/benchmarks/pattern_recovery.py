"""Numbers of a pattern recovered from a drape with noise, their stated errors beside the true ones.

`python -m tests.benchmarks.pattern_recovery [--draws 6]`. The small skirt of tests/support: two panels of 24 cm, sewn,
about a ball with contact and friction; front width 5 %, back width -2 % and length 5 % off the first guess, 0.1 mm of
noise in the drape.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
from small_skirt import HEM, LENGTH, hanging_skirt, skirt_mesh

from clothsim import recover
from clothsim.base.text import text_table
from clothsim.gradients.losses import Distance
from clothsim.gradients.run import traced
from clothsim.gradients.scene_of_pattern import shaped_scene

TRUE = {
    "pattern.front.width": 1.05 * HEM / 100,
    "pattern.back.width": 0.98 * HEM / 100,
    "pattern.front+back.height": 1.05 * LENGTH / 100,
}
"""Of the drape that is the target [m]."""
NOISE = 1e-4
"""Standard deviation of each coordinate of the target [m]."""
HEADER = ("number", "true [mm]", "off, rms [mm]", "off, most [mm]", "stated [mm]", "off / stated, rms")


def row(path: str, values: Sequence[float], errors: Sequence[float]) -> tuple[str, ...]:
    """A row of the table: a number, its values in the draws and their stated errors [m]."""
    off, stated = np.asarray(values) - TRUE[path], np.asarray(errors)
    cells = 1e3 * TRUE[path], 1e3 * np.sqrt((off**2).mean()), 1e3 * abs(off).max()
    between = f"{1e3 * stated.min():.3f} to {1e3 * stated.max():.3f}"
    return path, f"{cells[0]:.1f}", f"{cells[1]:.3f}", f"{cells[2]:.3f}", between, f"{_rms(off / stated):.2f}"


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and a line for each draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=6, help="of the noise")
    given = parser.parse_args(arguments)
    mesh = skirt_mesh()
    scene = hanging_skirt(mesh)
    drape = traced(shaped_scene(scene, mesh).with_numbers(TRUE)).cloth_positions()
    found = []
    for draw in range(given.draws):
        started = process_time()
        target = drape + NOISE * np.random.default_rng(draw).standard_normal(drape.shape)
        found.append(recover(scene, Distance(target), list(TRUE), 1, pattern=mesh))
        values = {path: round(1e3 * value, 3) for path, value in found[-1].values.items()}
        print(f"draw {draw}: {values}, {process_time() - started:.0f} CPU s", flush=True)
    rows = [row(path, [each.values[path] for each in found], [each.errors[path] for each in found]) for path in TRUE]
    print(text_table(HEADER, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
