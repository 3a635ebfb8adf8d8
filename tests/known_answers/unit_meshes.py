"""Small meshes and a fabric with every number of order one, for the rows of the table and for the tests."""

from typing import Any

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.keys.fabric import Fabric
from clothsim.mesh.cloth import Cloth, make_cloth

UNIT = Fabric(density=1.3, thickness=1.0, youngs_modulus=2.0, poisson_ratio=0.25, bending_stiffness=0.7)
"""A fabric with every number of order one: a wrong derivative cannot hide behind the scale."""


def grid(nx: int, ny: int, width: float = 1.0, height: float = 1.0) -> tuple[Floats, Ints]:
    """A flat right-diagonal grid in z = 0 from the origin: positions (n, 3), triangles (m, 3)."""
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1), indexing="ij")
    positions = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    a = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    return positions, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def irregular_grid(seed: int = 0, nx: int = 3, ny: int = 2) -> tuple[Floats, Ints]:
    """A grid with jittered vertices and random diagonals: nothing aligned, nothing equal."""
    rng = np.random.default_rng(seed)
    positions, triangles = grid(nx, ny)
    positions[:, :2] += 0.2 / max(nx, ny) * rng.uniform(-1, 1, (len(positions), 2))
    half = len(triangles) // 2
    for k in np.flatnonzero(rng.random(half) < 0.5):
        a, b, c = triangles[k]
        d = triangles[half + k, 2]
        triangles[k], triangles[half + k] = (a, b, d), (b, c, d)
    return positions, triangles


def cloth(positions: Floats, triangles: Ints, fabric: Fabric = UNIT, name: str = "cloth", **keywords: Any) -> Cloth:
    """A cloth of the UNIT fabric, unless another is given."""
    return make_cloth(name, positions, triangles, fabric, **keywords)


def random_rotation(seed: int = 0) -> Floats:
    """A rotation at random, (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q * np.sign(np.linalg.det(q)), np.float64)
