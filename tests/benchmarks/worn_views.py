"""Rendered truth on a body: a worn garment, by default the tunic that comes with the package, in pictures with noise.

`python -m tests.benchmarks.worn_views [-o FOLDER] [--size 4cm] [--pattern FILE --on BODY --true PATH=FACTOR ...]`: a
garment with another hem, another length and twice the bending stiffness is sewn on a body with a mesh of its own;
`clothsim recover --views` sews the garment as it is in its file, and looks for these numbers.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import clothsim
from clothsim import engine
from clothsim.cli import main as command
from clothsim.gradients.camera import Camera
from clothsim.gradients.pattern_numbers import PatternNumbers
from clothsim.gradients.run import traced
from clothsim.patterns import write_specification
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import read_specification
from tests.benchmarks import views

PATTERN, BODY = "tunic", "shirt"
TRUTH = ("pattern.front+back.flare=1.08", "pattern.front+back.height=0.94")
"""Factors of the hem's width and of the length."""
BENDING = "cloth.bending_stiffness"
SCAN = "scan"
"""In place of pictures: points of the cloth and of bare skin, from another pose."""


def cameras(middle, count: int = 4, size: tuple[int, int] = (320, 240)) -> list[Camera]:
    """Cameras 2.2 m around a point, at its height and above."""
    made = []
    for k in range(count):
        turn = np.radians(25 + 360 * k / count)
        eye = middle + np.array([2.2 * np.sin(turn), -2.2 * np.cos(turn), (0.0, 0.4)[k % 2]])
        forward = (middle - eye) / np.linalg.norm(middle - eye)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(forward, right), forward])
        made.append(Camera(*size, (1.5 * size[0],) * 2, (np.array(size) - 1) / 2, axes, eye))
    return made


def write_truth(
    folder: Path,
    size: float,
    pattern: str,
    body: str,
    factors: Mapping[str, float],
    pixels: tuple[int, int],
    scan: bool = False,
) -> tuple[Path, dict[str, float]]:
    """Dress the true garment, write its pictures or scan, and return their file and the true numbers."""
    file = engine.example_file(Path(pattern), "_specification.json")
    numbers = PatternNumbers(mesh_pattern(read_specification(file), 0.1))
    true = {path: factor * numbers.value(path) for path, factor in factors.items()}
    folder.mkdir(parents=True, exist_ok=True)
    write_specification(folder / "true_specification.json", numbers.pattern(true))
    worn = clothsim.dress(
        folder / "true_specification.json", engine.example_file(Path(body)), folder / "true", size=size, overwrite=True
    )
    if worn.run is None:
        raise SystemExit(f"the true garment cannot be worn: {worn.reason}")
    scene = worn.run.scene
    world = traced(scene).session.built.world
    bending = float(world.cloths[0].fabric.bending_stiffness)
    truth = traced(engine.override(scene, f"cloth.bending_stiffness={2 * bending}"))
    if scan:
        return views.write_scan(folder, truth), true | {BENDING: 2 * bending}
    x = truth.cloth_positions()
    made = cameras(0.5 * (x.min(axis=0) + x.max(axis=0)), size=pixels)
    return views.write_views(folder, made, truth), true | {BENDING: 2 * bending}


def main(arguments: list[str] | None = None) -> int:
    """Make the pictures, recover, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("worn_views_output"))
    parser.add_argument("--size", default="4cm", help="of the mesh of the fit")
    parser.add_argument("--pattern", default=PATTERN)
    parser.add_argument("--on", default=BODY)
    parser.add_argument("--true", action="append", metavar="PATH=FACTOR", help="a number of the true pattern")
    parser.add_argument("--width", type=int, default=640, help="of the pictures [pixels]; their height is 3/4 of it")
    parser.add_argument("--true-size", type=float, default=0.035, help="of the mesh of the truth [m]")
    parser.add_argument("--pictures", choices=(*views.PICTURES, SCAN), default="all", help="that the fit has")
    parser.add_argument("--finer", action="store_true", help="end on a mesh of half the size")
    given = parser.parse_args(arguments)
    pairs = (text.rsplit("=", 1) for text in given.true or TRUTH)
    factors = {path: float(factor) for path, factor in pairs}
    size = (given.width, 3 * given.width // 4)
    file, true = write_truth(
        given.output, given.true_size, given.pattern, given.on, factors, size, given.pictures == SCAN
    )
    file = file if given.pictures == SCAN else views.fewer(file, given.pictures)
    before, out = time.process_time(), given.output / "recovered"
    words = ["recover", "--views", str(file), "--pattern", given.pattern, "--on", given.on, "--size", given.size]
    words += ["--finer"] * given.finer
    code = command([*words, "--free", ",".join(true), "-o", str(out), "--overwrite"])
    found = json.loads((out / "recovery.json").read_text())
    for path, value in true.items():
        off, error = found["values"][path] / value - 1, found["total_errors"][path]
        print(f"{path}: {found['values'][path]:.4g} for {value:.4g}, {100 * off:+.2g} %, stated with the model {error}")
    print(f"{time.process_time() - before:.0f} CPU s with the sewing")
    return code


if __name__ == "__main__":
    sys.exit(main())
