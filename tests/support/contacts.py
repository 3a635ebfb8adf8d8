"""Small worlds in contact."""

from dataclasses import replace

import numpy as np
from meshes import cloth, grid

from clothsim.mesh.body import make_body
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.world import make_world
from clothsim.physics.contact.surface import cloth_body_surface, cloth_surface


def sheet(height=0.0, name="sheet", cells=6):
    """A unit square about the z axis."""
    positions, triangles = grid(cells, cells)
    return replace(cloth(positions, triangles, name=name), positions=positions + np.array([-0.5, -0.5, height]))


def ball(centre=(0.0, 0.0, 0.0), name="ball", radius=0.3, subdivisions=2):
    positions, triangles = GENERATORS["sphere"](radius=radius, subdivisions=subdivisions)
    return make_body(name, positions + np.array(centre), triangles)


def sheet_on_ball(height=0.34):
    return make_world([sheet(height)], [ball()])


def two_sheets(gap=0.03, cells=4):
    """Two equal sheets, one above the other: every edge has a parallel partner."""
    return make_world([sheet(0.0, "low", cells), sheet(gap, "high", cells)])


def body_surface(world):
    return cloth_body_surface(world), world.start()


def self_surface(world):
    return cloth_surface(world), world.start()


def jittered(x, rows, amplitude, seed=0):
    """x with random displacements of the first `rows`."""
    y = x.copy()
    y[:rows] += amplitude * np.random.default_rng(seed).standard_normal((rows, 3))
    return y
