"""Bodies and garments for the tests of a fit: capsules, and tubes around them."""

import numpy as np

from clothsim.files.meshes.readers.obj import write_obj
from clothsim.garments.fit.pipeline import Task
from clothsim.garments.inputs import BodyMesh, Garment
from clothsim.mesh.generators.shapes import capsule, rectangle, tube

RADIUS = 0.1


def capsule_figure(radius=RADIUS, segments=16, name="capsule"):
    """A capsule 1 m high."""
    return BodyMesh(name, *capsule(radius=radius, height=1.0, segments=segments), 1.0, ())


def wider(figure, factor, name="wide"):
    """The figure with the same mesh, wider across its axis."""
    return BodyMesh(name, figure.positions * [factor, factor, 1.0], figure.triangles, 1.0, ())


def tube_garment(radius, height=0.3, cells=(24, 10)):
    return Garment("tube", *tube(radius=radius, height=height, cells=cells))


def folded_sheet(apart=0.01, through=0.005):
    """A sheet folded double 0.25 m beside the axis; a vertex of the upper layer `through` [m] beyond the lower one."""
    points, triangles = rectangle(size=(1.0, 1.0), cells=(10, 10))
    x, y, _ = points.T
    folded = np.column_stack([0.25 + np.abs(x), y, np.where(x > 0.05, apart, 0.0)])
    folded[np.argmin(np.linalg.norm(points - [0.3, 0.02, 0.0], axis=1)), 2] = -through
    return Garment("folded", folded, triangles)


def moebius_strip(n=9):
    """A strip of 2 n triangles closed with a half turn."""
    angle, side = np.repeat(2 * np.pi * np.arange(n) / n, 2), np.tile([-0.03, 0.03], n)
    radius = 0.2 + side * np.cos(angle / 2)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), side * np.sin(angle / 2)])
    k = 2 * np.arange(n)
    rows = np.column_stack([k, k + 1, k + 2, k + 3]) % (2 * n)
    rows[-1, 2:] = 1, 0
    return points, np.concatenate([rows[:, [0, 2, 1]], rows[:, [1, 2, 3]]])


def task(garment, source, target, folder, *, resize=True, on_stage=lambda stage: None):
    return Task(garment, source, target, "cotton", resize, folder, on_stage)


def in_file(folder, name, positions, triangles):
    """The path of an .obj with these triangles, as text."""
    file = folder / name
    write_obj(file, positions, triangles)
    return str(file)
