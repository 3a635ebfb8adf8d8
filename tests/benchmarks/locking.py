"""Membrane locking: the same fabric on coarser and finer meshes, as it is and with what helps.

`python -m tests.benchmarks.locking [--json FILE]`. A sheared strip at 4, 8 and 16 cells a wrinkle, on meshes that lie
well and badly to its wrinkles: their length and height against those of a fine mesh that lies well. The strip has
equilibria with one wave more or less, 8 % apart: of two starts the one of less energy counts. A balloon of two discs at
6, 12 and 24 cells from pole to rim, against the inextensible one: its own stretch adds about 1 %. Remedies: the
membrane on pairs of triangles (`paired_membrane`), and a membrane that is softer by ten.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import process_time

from clothsim.base.errors import ClothsimError
from clothsim.base.record import to_json
from clothsim.base.text import text_table
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Off
from tests.known_answers.a6_inflation import balloon, blown_up, mylar
from tests.known_answers.a8_wrinkles import Sheared, sheared, strip, thickness_of
from tests.support.effect_builders import membrane

SHEAR, HALF = 0.02, 0.2
"""Shear of the strip, and the half-wavelength that the theory gives it, over its height."""
A_WRINKLE = 2 * HALF
FINE = 40
"""Cells over the height of the mesh that the others are held against, 16 a wrinkle."""
MESHES: Mapping[str, tuple[str, float]] = {
    "diagonals along the wrinkles": ("right", 1.0),
    "alternating diagonals": ("alternating", 1.0),
    "irregular": ("delaunay", 1.0),
    "diagonals across the wrinkles": ("right", -1.0),
}


def softer(world: World, factor: float = 0.1) -> Energy | Off:
    """The membrane with `factor` of its stiffness."""
    cloths = (
        replace(one, fabric=replace(one.fabric, youngs_modulus=factor * one.fabric.youngs_modulus))
        for one in world.cloths
    )
    return membrane(replace(world, cloths=tuple(cloths)))


REMEDIES: Mapping[str, Callable[[World], Energy | Off]] = {
    "none": membrane,
    "pairs": lambda world: membrane(world, elements="pairs"),
    "softer by ten": softer,
}


@dataclass(frozen=True)
class Case:
    """Errors as fractions: of length and height of the wrinkles, or of radius and volume; CPU seconds of the solve."""

    what: str
    mesh: str
    remedy: str
    errors: tuple[float, float]
    seconds: float


def settled(world: World, sheet: Energy | Off, sign: float) -> Sheared:
    """The wrinkles of less energy from two starts."""
    return min((sheared(world, sheet, sign * SHEAR, seed) for seed in range(2)), key=lambda seen: seen.energy)


@lru_cache
def reference() -> Sheared:
    """The wrinkles on the finest mesh that lies well to them, without a remedy."""
    world = strip(thickness_of(HALF, SHEAR), FINE)
    return settled(world, membrane(world), 1.0)


def wrinkles(cells: Sequence[int] = (10, 20, 40), remedies: Sequence[str] = tuple(REMEDIES)) -> Iterator[Case]:
    """Every mesh of every size with every remedy; the largest number of cells on the worst mesh alone."""
    exact = reference()
    for name, (diagonals, sign) in MESHES.items():
        for count in cells if sign < 0 else cells[:-1]:
            world = strip(thickness_of(HALF, SHEAR), count, diagonals)
            for remedy in remedies:
                started = process_time()
                try:
                    seen = settled(world, REMEDIES[remedy](world), sign)
                except ClothsimError as error:
                    print(f"{name}, {count} cells, {remedy}: {error}", file=sys.stderr)
                    continue
                errors = (seen.half_wavelength / exact.half_wavelength - 1, seen.amplitude / exact.amplitude - 1)
                what = f"{count * A_WRINKLE:.0f} cells a wrinkle"
                yield Case(what, name, remedy, errors, process_time() - started)


def balloons(cells: Sequence[int] = (6, 12, 24), remedies: Sequence[str] = tuple(REMEDIES)) -> Iterator[Case]:
    """The balloon of every size with every remedy."""
    exact = mylar()
    for count in cells:
        world = balloon(count)
        for remedy in remedies:
            started = process_time()
            try:
                seen = blown_up(world, REMEDIES[remedy](world))
            except ClothsimError as error:
                print(f"balloon, {count} cells, {remedy}: {error}", file=sys.stderr)
                continue
            errors = (seen[0] / exact[0] - 1, seen[1] / exact[1] - 1)
            yield Case("balloon", f"{count} cells to the rim", remedy, errors, process_time() - started)


def as_text(cases: Sequence[Case]) -> str:
    """A table."""
    header = ("scene", "mesh", "remedy", "length or radius", "height or volume", "CPU s")
    rows = [
        (case.what, case.mesh, case.remedy, *(f"{100 * error:+.1f} %" for error in case.errors), f"{case.seconds:.1f}")
        for case in cases
    ]
    return text_table(header, rows)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.locking", description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there too")
    arguments = parser.parse_args(argv)
    cases = [*wrinkles(), *balloons()]
    print(as_text(cases))
    if arguments.json:
        arguments.json.write_text(to_json([asdict(case) for case in cases], indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
