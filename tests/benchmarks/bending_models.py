"""Errors and costs of the bending models on different meshes of one plate.

`python -m tests.benchmarks.bending_models [--cells 40] [--sheet 100] [--json FILE]`.
Free strips that hang from a clamp: the error of tip drop over tip reach on strips cut out of a right-diagonal lattice
at several angles and on Delaunay meshes of points at random, and its spread over those
meshes. A ring that is clamped inside and loaded, on two meshes of which one is twice as fine: an error that does not
shrink does not converge. The time of a call on a sheet, the size of the Newton matrix and the time to factor it.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.safe_files.record import to_json
from clothsim.base.text_table import text_table
from clothsim.keys.fabric import Fabric
from clothsim.mesh.generators.sheets import rectangle
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.bending import MODELS, bending
from clothsim.solve.linear.linear_solvers import make_solver
from clothsim.solve.linear.sparsity import make_pattern
from tests.known_answers.plates import DEFLECTION, INNER, OUTER, drooped, elastica, flat, ring_deflection
from tests.known_answers.strips import lattice_strip, random_ring, random_strip

GAMMAS = (1, 10, 100)
"""Weight over stiffness of the strips, rho_A g L^3/B."""


@dataclass(frozen=True)
class Case:
    """Measurements on one mesh: errors by model, relative to the exact value."""

    what: str
    mesh: str
    vertices: int
    errors: dict[str, float]


@dataclass(frozen=True)
class Price:
    """Cost of a model: ms a call; 3x3 blocks of the Newton matrix a vertex; ms to factor and solve it."""

    model: str
    value: float
    gradient: float
    hessian: float
    blocks: float
    factor: float


def strips(cells: int, seeds: Sequence[int] = (0, 1)) -> dict[str, tuple[Floats, Ints]]:
    """The meshes of the strip by name."""
    cuts = {f"cut at {degrees}": lattice_strip(cells, degrees) for degrees in (0, 45, 90, 135)}
    return cuts | {f"random {seed}": random_strip(cells, seed) for seed in seeds}


def hanging(cells: int, gammas: Sequence[int] = GAMMAS, models: Sequence[str] = tuple(MODELS)) -> list[Case]:
    """Every strip under every weight."""
    meshes = strips(cells)
    return [
        Case(f"Gamma {g}", name, len(mesh[0]), {model: drooped(*mesh, model, g) / elastica(g) - 1 for model in models})
        for g in gammas
        for name, mesh in meshes.items()
    ]


def spread(cases: Sequence[Case], model: str, what: str) -> float:
    """Largest less smallest error of a model over the meshes."""
    errors = [case.errors[model] for case in cases if case.what == what]
    return max(errors) - min(errors)


def rings(cells: Sequence[int] = (4, 8), seed: int = 0, models: Sequence[str] = tuple(MODELS)) -> list[Case]:
    """The deflection of the loaded ring on meshes of points at random, `cells` across."""
    meshes = {n: random_ring(n, seed, INNER, OUTER) for n in cells}
    return [
        Case("ring", f"{n} across", len(mesh[0]), {m: ring_deflection(*mesh, m) / DEFLECTION - 1 for m in models})
        for n, mesh in meshes.items()
    ]


def prices(cells: int, repeats: int = 5) -> list[Price]:
    """Each model on an irregular square sheet of `cells` x `cells`, a little creased."""
    positions, triangles = rectangle(cells=(cells, cells), diagonals="delaunay")
    fabric = Fabric(density=1.0, thickness=1.0, youngs_modulus=1.0, poisson_ratio=0.3, bending_stiffness=1.0)
    world = make_world([flat(positions[:, :2], triangles, fabric)])
    energies = {model: bending(world, model=model) for model in MODELS}
    return [_price(model, energy, world, repeats) for model, energy in energies.items() if isinstance(energy, Energy)]


def _price(model: str, energy: Energy, world: World, repeats: int) -> Price:
    x = world.start() + 5e-4 * np.random.default_rng(0).standard_normal((world.n_vertices, 3))
    hessian = energy.hessian(x)
    pattern = make_pattern(world.n_cloth, world.triangles, [hessian])
    data, _ = pattern.assemble([hessian])
    data = pattern.shift(data, np.full(3 * world.n_cloth, pattern.diagonal(data).mean()))
    solver, load = make_solver("auto", pattern, 1), np.ones(3 * world.n_cloth)
    calls: tuple[Callable[[], object], ...] = (
        lambda: energy.value(x),
        lambda: energy.gradient(x),
        lambda: energy.hessian(x),
        lambda: solver.solve(data, load),
    )
    value, gradient, second, factor = (_milliseconds(call, repeats) for call in calls)
    return Price(model, value, gradient, second, len(pattern.columns) / world.n_cloth, factor)


def _milliseconds(call: Callable[[], object], repeats: int) -> float:
    """The shortest of several calls; one before them compiles."""
    call()
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return 1e3 * min(times)


def as_text(cases: Sequence[Case], cost: Sequence[Price]) -> str:
    """A table of errors for each quantity, with their spread where that is over meshes of one size, and the prices."""
    tables = []
    for what in dict.fromkeys(case.what for case in cases):
        mine = [case for case in cases if case.what == what]
        models = list(mine[0].errors)
        rows = [[case.mesh, str(case.vertices), *(_percent(case.errors[m]) for m in models)] for case in mine]
        if what != "ring":
            rows.append(["spread", "", *(_percent(spread(mine, model, what)) for model in models)])
        tables.append(text_table((what, "vertices", *models), rows))
    numbers = [(p.value, p.gradient, p.hessian, p.blocks, p.factor) for p in cost]
    header = ("model", "value ms", "gradient ms", "Hessian ms", "blocks a vertex", "factor and solve ms")
    rows = [[p.model, *(f"{number:.1f}" for number in row)] for p, row in zip(cost, numbers, strict=True)]
    return "\n\n".join([*tables, text_table(header, rows)])


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2f} %"


def main(argv: Sequence[str] | None = None) -> int:
    """Print the tables, and write them as JSON where asked."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.bending_models", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--cells", type=int, default=40, help="cells along the strips")
    parser.add_argument("--sheet", type=int, default=100, help="cells along the sheet whose calls are timed")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there too")
    arguments = parser.parse_args(argv)
    cases, cost = [*hanging(arguments.cells), *rings()], prices(arguments.sheet)
    print(as_text(cases, cost))
    if arguments.json:
        rows = {"errors": [asdict(case) for case in cases], "prices": [asdict(price) for price in cost]}
        arguments.json.write_text(to_json(rows, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
