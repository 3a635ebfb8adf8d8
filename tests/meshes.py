"""The one way to build small meshes in the tests."""

import numpy as np

from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.fabric import Fabric
from clothsim.mesh.world import make_world

UNIT = Fabric(density=1.3, thickness=1.0, youngs_modulus=2.0, poisson_ratio=0.25, bending_stiffness=0.7)
"""A fabric with every number of order one: a wrong derivative cannot hide behind the scale."""


def grid(nx, ny, width=1.0, height=1.0):
    """A flat right-diagonal grid in z = 0 from the origin: positions (n, 3), triangles (m, 3)."""
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1), indexing="ij")
    positions = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    a = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    return positions, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def irregular_grid(seed=0, nx=3, ny=2):
    """A grid with jittered vertices and random diagonals: nothing aligned, nothing equal."""
    rng = np.random.default_rng(seed)
    positions, triangles = grid(nx, ny)
    positions[:, :2] += 0.2 / max(nx, ny) * rng.uniform(-1, 1, (len(positions), 2))
    half = len(triangles) // 2
    for k in np.flatnonzero(rng.random(half) < 0.5):
        a, b, c, d = *triangles[k], triangles[half + k, 2]
        triangles[k], triangles[half + k] = (a, b, d), (b, c, d)
    return positions, triangles


def cloth(positions, triangles, fabric=UNIT, name="cloth", **keywords):
    return make_cloth(name, positions, triangles, fabric, **keywords)


def small_world(seed=0, fabric=UNIT, curved=False):
    """A world of one irregular cloth; `curved`: its rest shape is bent."""
    positions, triangles = irregular_grid(seed)
    if curved:
        positions[:, 2] = 0.3 * np.sin(2 * positions[:, 0]) + 0.2 * positions[:, 1] ** 2
    return make_world([cloth(positions, triangles, fabric)])


def deformed(world, seed=1, amplitude=0.08):
    """The world's start moved at random: strained, bent, no two principal stretches equal."""
    rng = np.random.default_rng(seed)
    x = world.start()
    return x @ random_rotation(seed).T + amplitude * rng.standard_normal(x.shape)


def random_rotation(seed=0):
    q, r = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))
