"""Small meshes for the tests."""

import numpy as np

from clothsim.mesh.world import make_world
from tests.known_answers.unit_meshes import UNIT, cloth, grid, irregular_grid, random_rotation

__all__ = ["UNIT", "cloth", "deformed", "grid", "irregular_grid", "random_rotation", "small_world"]


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
