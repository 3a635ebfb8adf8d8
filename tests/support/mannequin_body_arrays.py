"""Mannequin as a linear body model: arrays under the keys of SMPL-like files."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from clothsim.base.arrays import Floats
from clothsim.keys.generator_keys import Proportions
from clothsim.keys.schema import keys_of
from clothsim.mesh.generators.mannequin.generator import JOINTS, PARENTS, template, warped, warped_joints

MEASURES: tuple[str, ...] = tuple(keys_of(Proportions))
"""What the shape parameters are: changes of these measures of a `Proportions`."""
STEP = 0.05
"""The change of a measure over which its shape direction is taken."""
NEIGHBOURS = 48
"""Vertices from which a joint is regressed."""


def body_arrays() -> dict[str, NDArray]:
    """v_template, shapedirs, posedirs (all 0), J_regressor, weights, kintree_table and f, as SMPL-like files name them.

    shapedirs (n, 3, 6): the change of the vertices with each of MEASURES (linear: exact for the height only).
    """
    made, default = template(), Proportions()
    positions = warped(made.positions, made.weights, default)
    directions = []
    for name in MEASURES:
        more, less = (replace(default, **{name: getattr(default, name) + step}) for step in (STEP, -STEP))
        change = warped(made.positions, made.weights, more) - warped(made.positions, made.weights, less)
        directions.append(change / (2 * STEP))
    return {
        "v_template": positions,
        "shapedirs": np.stack(directions, axis=2),
        "posedirs": np.zeros((len(positions), 3, 9 * (len(JOINTS) - 1))),
        "J_regressor": _regressor(positions, warped_joints(default)),
        "weights": made.weights.copy(),
        "kintree_table": np.stack([PARENTS, np.arange(len(JOINTS))]),
        "f": made.triangles.copy(),
    }


def _regressor(positions: Floats, joints: Floats) -> Floats:
    """Each joint as the least combination, of sum 1, of the vertices nearest to it that gives its place, (j, n)."""
    rows = np.zeros((len(joints), len(positions)))
    for row, place in zip(rows, joints, strict=True):
        near = np.argsort(np.linalg.norm(positions - place, axis=1))[:NEIGHBOURS]
        system = np.column_stack([np.ones(NEIGHBOURS), positions[near] - place])
        row[near] = np.linalg.lstsq(system.T, np.array([1.0, 0, 0, 0]), rcond=None)[0]
    return rows
