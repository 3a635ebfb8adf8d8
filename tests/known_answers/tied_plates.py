"""Cylindrical bending of plates: columns of vertices tied at a fixed distance (docs/results/validation.md, A3).

The unknowns are the slopes of the cells, x = P(slopes). So the numbers show bending and the clamp alone, not the
membrane. nu = 0, so B = D.
"""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import ClothsimError
from clothsim.mesh.world import World, make_world
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.pins import clamped
from tests.known_answers.unit_meshes import UNIT, cloth, grid
from tests.known_answers.unit_solver import second_derivatives
from tests.support.effect_builders import bending

SHEET = replace(UNIT, poisson_ratio=0.0)
WIDTH, ROWS = 0.2, 2
STIFFNESS = UNIT.bending_stiffness


@dataclass(frozen=True)
class Plate:
    """A plate of length 1 beyond its clamp at x = 0; `held` cells lie behind the clamp and do not turn."""

    world: World
    cells: int
    held: int

    @property
    def columns(self) -> Ints:
        """The column of every vertex that moves with the plate."""
        return np.arange(self.world.n_cloth) // (ROWS + 1)

    def place(self, slopes: Floats) -> tuple[Floats, Floats]:
        """x of all vertices, and the steps (cos, 0, -sin) of each cell times its length."""
        x = self.world.start()
        steps = np.column_stack([np.cos(slopes), 0 * slopes, -np.sin(slopes)]) / self.cells
        corners = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]) - [self.held / self.cells, 0, 0]
        x[: self.world.n_cloth, [0, 2]] = corners[self.columns][:, [0, 2]]
        return x, steps


def plate(cells: int, diagonals: str = "right", clamp: str = "edge", factor: float = 2.0) -> Plate:
    """A plate clamped at its "edge", or by a "band" of cells; `factor` 1 undoes the doubling of the clamp's hinges."""
    held = {"edge": 0, "band": 1}[clamp]
    positions, triangles = grid(cells + held, ROWS, 1 + held / cells, WIDTH)
    positions[:, 0] -= held / cells
    if diagonals == "alternating":
        triangles = flip_every_other_diagonal(triangles)
    world = make_world([cloth(positions, triangles, SHEET)])
    held_world, _ = clamped(world, [np.flatnonzero(positions[:, 0] < 1e-9)])
    doubled = held_world.hinges.stiffness != STIFFNESS
    stiffness = np.where(doubled, factor * STIFFNESS, STIFFNESS)
    return Plate(replace(held_world, hinges=replace(held_world.hinges, stiffness=stiffness)), cells, held)


def flip_every_other_diagonal(triangles: Ints) -> Ints:
    """The triangles of a right-diagonal grid of ROWS rows with the diagonals of the black squares turned."""
    triangles, half = triangles.copy(), len(triangles) // 2
    for k in range(half):
        if (k // ROWS + k % ROWS) % 2:
            a, b, c = triangles[k]
            d = triangles[half + k, 2]
            triangles[k], triangles[half + k] = (a, b, d), (b, c, d)
    return triangles


def bent(
    plate: Plate, model: str, forces: Floats | None = None, moment: float = 0.0, start: Floats | None = None
) -> Floats:
    """The slopes that minimise bending - forces.x - moment * last slope, by Newton with the exact second derivatives.

    forces: (n_cloth, 3); start: slopes to begin with. dx/ds_j = t_j in all columns beyond cell j, so the Hessian is
    J'HJ + diag(sum g.dt_j/ds_j), and dt_j/ds_j is the step of cell j reversed. ClothsimError where it is not positive,
    or after 40 iterations.
    """
    energy = bending(plate.world, model=model)
    if not isinstance(energy, Energy):
        raise ClothsimError("The plate has no bending.")
    slopes = np.zeros(plate.cells + plate.held) if start is None else start.copy()
    load = np.zeros((plate.world.n_vertices, 3))
    load[: plate.world.n_cloth] = 0.0 if forces is None else forces
    beyond = np.zeros((plate.world.n_vertices, len(slopes)))
    beyond[: plate.world.n_cloth] = plate.columns[:, None] > np.arange(len(slopes))
    free = slice(plate.held, None)
    for _ in range(40):
        x, steps = plate.place(slopes)
        turned = np.column_stack([steps[:, 2], 0 * slopes, -steps[:, 0]])
        force = energy.gradient(x) - load
        jacobian = (beyond[:, None, :] * turned.T).reshape(-1, len(slopes))
        gradient = jacobian.T @ force.ravel()
        gradient[-1] -= moment
        hessian = jacobian.T @ second_derivatives(energy, x) @ jacobian
        hessian -= np.diag(np.einsum("vi,vj,ji->j", force, beyond, steps))
        if not np.linalg.eigvalsh(hessian[free, free])[0] > 0:
            raise ClothsimError("The plate is not stable there.")
        change = np.linalg.solve(hessian[free, free], gradient[free])
        slopes[free] -= change
        if np.abs(change).max() < 1e-11:
            return slopes
    raise ClothsimError("Newton did not converge in 40 iterations.")


def tip(plate: Plate, slopes: Floats) -> tuple[float, float]:
    """Reach and drop of the far edge, measured from the clamp."""
    x, _ = plate.place(slopes)
    last = x[plate.world.n_cloth - 1]
    return float(last[0]), float(-last[2])


def weight(plate: Plate, gamma: float) -> Floats:
    """Gravity forces with rho_A g L^3/B = gamma, on the lumped masses."""
    g = gamma * STIFFNESS / UNIT.density
    return plate.world.masses[:, None] * np.array([0.0, 0.0, -g])


def end_shear(plate: Plate, load: float) -> Floats:
    """Forces on the far edge with P L^2/B = load."""
    forces = np.zeros((plate.world.n_cloth, 3))
    forces[-ROWS - 1 :, 2] = -load * STIFFNESS * WIDTH / (ROWS + 1)
    return forces
