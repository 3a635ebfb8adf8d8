"""Small scenes to draw: a bent sheet over a ball."""

import numpy as np
from meshes import grid

from clothsim.render.surface_look import Surface

NO_STRETCHES = np.zeros((0, 2))


def sheet(n=12, size=1.0, lift=0.0, stretch=1.05):
    positions, triangles = grid(n, n, size, size)
    positions[:, :2] -= 0.5 * size
    positions[:, 2] = -0.8 * (positions[:, :2] ** 2).sum(axis=1) / size + lift
    return Surface("sheet", positions, triangles, "cloth", np.tile([stretch, 1.0], (len(triangles), 1)))


def ball(radius=0.3, centre=(0.0, 0.0, -0.35), n=16):
    polar, turn = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1), indexing="ij")
    points = [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
    positions = radius * np.column_stack([part.ravel() for part in points]) + centre
    _, triangles = grid(n, 2 * n)
    return Surface("ball", positions, triangles, "body", NO_STRETCHES)
