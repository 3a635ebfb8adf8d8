"""Errors of hinges and of the mid-edge model that refinement leaves: twist, vibration and buckling.

`python -m tests.benchmarks.hinge_errors [--cells 10 20]`. The energy of a square plate that is twisted to z = k x y,
exactly D (1 - nu) k^2 an area; the frequency of the first mode of a free strip of 1 x .1, 22.373 sqrt(D (1 - nu^2)/rho)
over L^2; the load at which the same strip buckles between clamped ends, as a beam 4 pi^2 D (1 - nu^2)/L^2 per width.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from clothsim.base.arrays import Floats
from clothsim.base.text_table import text_table
from clothsim.mesh.generators.sheets import rectangle
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.bending import bending
from clothsim.physics.energies.pins import pins
from tests.known_answers.unit_meshes import UNIT, cloth
from tests.known_answers.unit_solver import second_derivatives

NU = 0.3
PLATE = replace(UNIT, bending_stiffness=1.0, poisson_ratio=NU, density=1.0)
DIAGONALS = ("right", "alternating", "crisscross", "delaunay")
MODELS = ("hinge", "midedge")


def sheet(size: Sequence[float], cells: Sequence[int], diagonals: str) -> World:
    """A rectangle of PLATE."""
    return make_world([cloth(*rectangle(size, cells, diagonals), PLATE)])


def twist(cells: int, diagonals: str, model: str) -> float:
    """Relative error of the energy of z = k x y."""
    world, k = sheet((1, 1), (cells, cells), diagonals), 1e-3
    x = world.start()
    x[:, 2] = k * x[:, 0] * x[:, 1]
    return float(bending(world, model=model).value(x)) / ((1 - NU) * k**2) - 1  # type: ignore[union-attr]


def mode(cells: int, diagonals: str, model: str) -> float:
    """Relative error of the frequency of the first bending mode of a free strip."""
    world = sheet((1, 0.1), (4 * cells, max(2, cells // 5)), diagonals)
    across = second_derivatives(bending(world, model=model), world.start())[2::3][:, 2::3].tocsc()
    squares = np.sort(eigsh(across, k=5, M=sparse.diags_array(world.masses).tocsc(), sigma=-1.0)[0])
    return float(np.sqrt(squares[3] / (500.5639 * (1 - NU**2)))) - 1  # after three rigid ones


def buckling(cells: int, diagonals: str, model: str) -> float:
    """Relative error of the Euler load of a clamped strip."""
    world = sheet((1, 0.1), (4 * cells, max(2, cells // 5)), diagonals)
    ends = [{"select": "left", "clamp": True}, {"select": "right", "clamp": True}]
    held, pinned = pins(world, group=ends)  # type: ignore[misc]
    free = np.arange(held.n_vertices) < held.n_cloth
    for group in pinned.groups:
        free[group.vertices] = False
    across = second_derivatives(bending(held, model=model), held.start())[2::3][:, 2::3].tocsr()[free][:, free]
    largest = eigsh(shortening(held)[free][:, free].tocsc(), k=1, M=across.tocsc(), which="LA")[0][0]
    return float(1 / (largest * 4 * np.pi**2 * (1 - NU**2))) - 1


def shortening(world: World) -> sparse.csr_array:
    """Matrix of the integral of (dz/dx)^2 over the cloth, (N, N) [1]."""
    x = world.start()[world.triangles][:, :, :2]
    inverse = np.linalg.inv(np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=2))
    along: Floats = (np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]) @ inverse)[:, :, 0]
    blocks = world.rest_areas[:, None, None] * along[:, :, None] * along[:, None, :]
    rows = np.repeat(world.triangles, 3, axis=1).ravel()
    columns = np.tile(world.triangles, (1, 3)).ravel()
    return sparse.coo_array((blocks.ravel(), (rows, columns)), shape=(world.n_vertices,) * 2).tocsr()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs="+", default=[10, 20])
    rows = []
    for diagonals in DIAGONALS:
        for cells in parser.parse_args(arguments).cells:
            cases = (partial(each, cells, diagonals) for each in (twist, mode, buckling))
            errors = (" / ".join(f"{100 * case(model):+.1f} %" for model in MODELS) for case in cases)
            rows.append([diagonals, str(cells), *errors])
    print(text_table(["mesh", "cells", "twist", "strip mode", "Euler load"], rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
