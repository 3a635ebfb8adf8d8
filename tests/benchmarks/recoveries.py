"""Numbers recovered from a drape with noise, their stated errors beside the true ones.

`python -m tests.benchmarks.recoveries [skirt towel fabric] [--draws 6] [--seed 0]`. skirt: two sewn panels of 24 cm
about a ball with contact and friction, three numbers of the pattern; towel: a panel that hangs from two corners, two
numbers of the pattern; fabric: Young's modulus and bending stiffness of a sheet that hangs from two corners. 0.1 mm of
noise in each coordinate of the drape; each draw is another noise.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
from sewing_patterns import panel, specification
from small_skirt import HEM, LENGTH, hanging_skirt, skirt_mesh

from clothsim import Cloth, Scene, recover
from clothsim.base.text import text_table
from clothsim.gradients.losses import Distance
from clothsim.gradients.parameters import with_value
from clothsim.gradients.run import traced
from clothsim.gradients.scene_of_pattern import shaped_scene
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern
from clothsim.patterns.specification import pattern_of

NOISE = 1e-4
"""Standard deviation of each coordinate of the target [m]."""
HEADER = ("number", "true", "off, rms", "off, most", "stated", "off / stated, rms", "most")
TOWEL = 0.30, 0.25
"""Width and height [m]."""


@dataclass(frozen=True)
class Case:
    """A scene as the first guess, the numbers of the target by path, and the pattern that they are of."""

    scene: Scene
    true: Mapping[str, float]
    pattern: PatternMesh | None = None

    def drape(self) -> np.ndarray:
        """The drape without noise, (n, 3) [m]."""
        if self.pattern is not None:
            return traced(shaped_scene(self.scene, self.pattern).with_numbers(self.true)).cloth_positions()
        scene = self.scene
        for path, value in self.true.items():
            scene = with_value(scene, path, np.array(value))
        return traced(scene).cloth_positions()


def _skirt() -> Case:
    mesh = skirt_mesh()
    true = {
        "pattern.front.width": 1.05 * HEM / 100,
        "pattern.back.width": 0.98 * HEM / 100,
        "pattern.front+back.height": 1.05 * LENGTH / 100,
    }
    return Case(hanging_skirt(mesh), true, mesh)


def _hanging(cloth: Cloth | Mapping[str, object], corners: Sequence[int], steps: int) -> Scene:
    """A sheet that hangs from two vertices, quasi-static."""
    effects = {"membrane": {}, "bending": {"model": "hinge"}, "gravity": {}, "pins": {"select": list(corners)}}
    solver = {"dt": 0.05, "threads": 1, "linear": "superlu"}
    return Scene(cloth, effects=effects, solver=solver, run={"duration": 0.05 * steps, "frames_per_second": 20})


def _towel() -> Case:
    width, height = TOWEL
    corners = [[0, 0], [100 * width, 0], [100 * width, 100 * height], [0, 100 * height]]
    mesh = mesh_pattern(pattern_of(specification({"towel": panel(vertices=corners)})), 0.04)
    x, y = mesh.panel_coordinates.T
    held = [int(np.argmin((x - at) ** 2 + (y - y.max()) ** 2)) for at in (x.min(), x.max())]
    inwards = 0.9 * (x - x.mean())
    positions = np.column_stack([inwards, 0.1 * (inwards**2 - inwards.max() ** 2) / width - 0.02 * (y.max() - y), y])
    cloth = Cloth(positions, mesh.triangles, rest=mesh.material_coordinates, fabric="cotton", bending_stiffness=1e-4)
    true = {"pattern.towel.width": 1.04 * width, "pattern.towel.height": 0.96 * height}
    return Case(_hanging(cloth, held, 6), true, mesh)


def _fabric() -> Case:
    cloth = {"mesh": "rectangle", "size": [0.3, 0.3], "cells": [6, 6], "rotation_degrees": [3.0, 2.0, 0.0]}
    cloth |= {"youngs_modulus": 6e4, "bending_stiffness": 4e-5, "poisson_ratio": 0.3, "density": 0.15}
    true = {"cloth.youngs_modulus": 3e4, "cloth.bending_stiffness": 1e-5}
    return Case(_hanging({**cloth, "thickness": 3e-4}, [0, 6], 2), true)


CASES = {"skirt": _skirt, "towel": _towel, "fabric": _fabric}


def row(path: str, true: float, values: Sequence[float], relative_errors: Sequence[float]) -> tuple[str, ...]:
    """A row of the table: a number, how far off it is in the draws, and its standard errors, in its own unit."""
    off, stated = np.asarray(values) - true, np.asarray(values) * relative_errors
    ratios = np.abs(off / stated)
    between = f"{stated.min():.2g} to {stated.max():.2g}"
    return path, f"{true:.4g}", f"{_rms(off):.2g}", f"{abs(off).max():.2g}", between, f"{_rms(ratios):.2f}", (
        f"{ratios.max():.2f}"
    )  # fmt: skip


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def rows(case: Case, draws: int, seed: int) -> list[tuple[str, ...]]:
    """Recover the numbers of a case from draws of the noise: the rows of its table."""
    drape, found = case.drape(), []
    for draw in range(draws):
        started = process_time()
        noise = NOISE * np.random.default_rng(seed + draw).standard_normal(drape.shape)
        found.append(recover(case.scene, Distance(drape + noise), list(case.true), 1, pattern=case.pattern))
        values = ", ".join(f"{path} {value:.6g}" for path, value in found[-1].values.items())
        print(f"draw {draw}: {values}; {process_time() - started:.0f} CPU s", file=sys.stderr, flush=True)
    return [
        row(path, true, [each.values[path] for each in found], [each.errors[path] for each in found])
        for path, true in case.true.items()
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and a line for each draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="default: all")
    parser.add_argument("--draws", type=int, default=6, help="of the noise")
    parser.add_argument("--seed", type=int, default=0, help="of the first draw")
    given = parser.parse_args(arguments)
    table = [each for name in given.cases or CASES for each in rows(CASES[name](), given.draws, given.seed)]
    print(text_table(HEADER, table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
