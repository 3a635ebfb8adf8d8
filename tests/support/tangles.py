"""Tangled sheets for the tests of untangling: positions, triangles, rest positions."""

import numpy as np

from clothsim.mesh.generators.shapes import rectangle, tube


def joined(*meshes):
    """Meshes in one."""
    firsts = np.cumsum([0, *(len(x) for x, _ in meshes[:-1])])
    triangles = [t + first for (_, t), first in zip(meshes, firsts, strict=True)]
    return np.concatenate([x for x, _ in meshes]), np.concatenate(triangles)


def folded_corner():
    """A corner rolled over and down through its own sheet."""
    rest, triangles = rectangle(size=(1.0, 1.0), cells=(20, 20))
    x, radius, across = rest.copy(), 0.05, np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    beyond = (rest[:, 0] + rest[:, 1] - 0.25) / np.sqrt(2)
    moved = beyond > 0
    angle = np.minimum(beyond[moved] / radius, 1.5 * np.pi)
    straight = beyond[moved] - angle * radius
    along = radius * np.sin(angle) + straight * np.cos(angle)
    up = radius * (1 - np.cos(angle)) + straight * np.sin(angle)
    x[moved] += (along - beyond[moved])[:, None] * across + up[:, None] * [0, 0, 1]
    return x, triangles, rest


def poking_pocket():
    """A patch above a sheet that pokes through it in the middle."""
    patch, triangles = rectangle(size=(0.4, 0.4), cells=(9, 9))
    dent = np.exp(-((patch[:, 0] - 0.05) ** 2 + (patch[:, 1] + 0.03) ** 2) / 0.1**2)
    patch = patch + np.array([0.013, 0.021, 0.01]) - 0.05 * dent[:, None] * [0, 0, 1]
    return same_at_rest(rectangle(size=(1.0, 1.0), cells=(20, 20)), (patch, triangles))


def crossing_sheets(offset=(0.03, 0.02, 0.01)):
    """Two sheets at right angles, each through the whole of the other."""
    x, triangles = rectangle(size=(0.5, 0.5), cells=(10, 10))
    return same_at_rest((x, triangles), (x[:, [0, 2, 1]] + offset, triangles))


def sleeve_through_sheet():
    x, triangles = tube(radius=0.15, height=0.5, cells=(16, 10))
    return same_at_rest(rectangle(size=(1.0, 1.0), cells=(20, 20)), (x + np.array([0.013, 0.021, 0.18]), triangles))


def crossed_skirts():
    """Two coaxial tubes: the upper half of each is inside the other's."""
    x, triangles = tube(radius=0.3, height=0.5, cells=(30, 12))
    cone = x * [1.03, 1.03, 1.0]
    cone[:, :2] *= 1 - 0.25 * x[:, 2:]
    return same_at_rest((x, triangles), (cone + np.array([0, 0, 0.007]), triangles))


def tube_into_tube():
    x, triangles = tube(radius=0.1, height=0.8, cells=(12, 16))
    return same_at_rest(
        tube(radius=0.15, height=0.8, cells=(16, 16)), (x[:, [2, 0, 1]] + [0.35, 0.013, 0.02], triangles)
    )


def random_layers(seed):
    """Two or three sheets over one another with random bumps through each other."""
    rng, sheets = np.random.default_rng(seed), []
    for k in range(rng.integers(2, 4)):
        x, triangles = rectangle(size=(1.0, 1.0), cells=(16, 16))
        for _ in range(4):
            centre, width, height = rng.uniform(-0.4, 0.4, 2), rng.uniform(0.08, 0.2), rng.normal(0, 0.06)
            x[:, 2] += height * np.exp(-((x[:, :2] - centre) ** 2).sum(axis=1) / width**2)
        sheets.append((x + np.array([0, 0, 0.02 * k]) + rng.normal(0, 0.01, 3), triangles))
    return same_at_rest(*sheets)


def same_at_rest(*meshes):
    x, triangles = joined(*meshes)
    return x, triangles, x
