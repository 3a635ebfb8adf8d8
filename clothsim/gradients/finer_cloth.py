"""Cloths with four triangles for one, of the same material and at the same place."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csr_array

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.keys.mesh_arrays import MeshArrays
from clothsim.mesh.refinement import refined
from clothsim.scene import paths as keys_by_path
from clothsim.scene.scene import Scene

HELD = ("inertia", "membrane", "bending", "gravity", "damping", "pins", "body_contact", "self_contact", "friction")
"""Effects that name no vertices, or pins: a cloth with others is not meshed more finely."""


def halved(scene: Scene) -> tuple[Scene, csr_array, Ints]:
    """Return a scene whose cloths of arrays have four triangles for one, its vertices as combinations, and triangles.

    InputError for another mesh, arrays of its keys, and effects that name vertices other than pins.
    """
    others = [name for name in scene.effects if name not in HELD]
    if others:
        raise InputError(f"effects.{others[0]} may select vertices by number, and a finer mesh has other numbers.")
    tables, parts, fine, count = list[Any](), list[csr_array](), list[Ints](), 0
    for keys in scene.cloths:
        mesh = keys.mesh
        if not isinstance(mesh, MeshArrays) or any(isinstance(value, np.ndarray) for value in keys.values()):
            raise InputError("The cloth is not a mesh of arrays, or has keys that are arrays.")
        weights, triangles = refined(mesh.triangles, len(mesh.vertices))
        rest = mesh.vertices if mesh.rest is None else mesh.rest
        groups = {name: (4 * rows[:, None] + np.arange(4)).ravel() for name, rows in mesh.groups.items()}
        finer = MeshArrays.checked(
            "cloth",
            weights @ mesh.vertices,
            triangles,
            quartered(rest) if mesh.is_flat else weights @ rest,
            groups=groups,
        )
        tables.append({**keys, "mesh": finer})
        parts.append(weights)
        fine.append(triangles + count)
        count += weights.shape[0]
    changed: dict[str, Any] = {"cloth": tables}
    made = replace(scene, **changed)
    pins = scene.effects.get("pins")
    if pins is not None and not isinstance(pins.select, str):
        held = np.asarray(pins.select, np.int64)
        if len(scene.cloths) > 1 or pins.group:
            raise InputError("Pins are of several cloths, or of groups.")
        own: Any = scene.cloths[0].mesh
        made = keys_by_path.replace(made, "effects.pins.select", _with_middles(own, held).tolist())
    return made, csr_array(block_diag(parts)), np.concatenate(fine)


def quartered(corners: Floats) -> Floats:
    """Return what is linear over each of m triangles, (m, 3, d) at their corners, at those of four for each.

    Triangles are in the order of `refined`.

    Examples
    --------
    >>> quartered(np.array([[[0.0], [2.0], [4.0]]]))[:, :, 0].tolist()
    [[0.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 3.0, 4.0], [1.0, 3.0, 2.0]]
    """
    a, b, c = (corners[:, k] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3, corners.shape[2])


def _with_middles(mesh: MeshArrays, held: Ints) -> Ints:
    """Vertices of the finer mesh that are held: also those between two that are."""
    _, fine = refined(mesh.triangles, len(mesh.vertices))
    ends = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    middles = fine.reshape(-1, 4, 3)[:, 3].ravel()  # ab, bc, ca
    return np.union1d(held, middles[np.isin(ends, held).all(axis=1)])
