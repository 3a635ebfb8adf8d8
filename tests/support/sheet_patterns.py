"""Patterns of Newton matrices of flat sheets."""

import numpy as np
from meshes import grid

from clothsim.solve.linear.sparsity import make_pattern


def pattern_of_sheets(*cells):
    """Pattern of flat sheets side by side, coupled within each by triangles alone."""
    triangles, count = [], 0
    for nx, ny in cells:
        vertices, faces = grid(nx, ny)
        triangles.append(np.asarray(faces) + count)
        count += len(vertices)
    return make_pattern(count, np.concatenate(triangles), [])
