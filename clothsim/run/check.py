"""Faults of a mesh or a scene, all at once."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.mesh.checks import Finding, Role, examine
from clothsim.mesh.world_surfaces import world_surfaces
from clothsim.run.certificate.intersection_check import intersection_check_of
from clothsim.run.cost import expected_cost
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.cloth_arrays import Body, Cloth
from clothsim.scene.mesh_objects import surface_of
from clothsim.scene.scene import Scene
from clothsim.scene.toml_file import load_scene

NO_INDICES = np.zeros(0, np.int64)


def check(what: Any, role: Role | None = None) -> list[Finding]:
    """Examine a mesh, or build a scene and test its start for intersections.

    Parameters
    ----------
    what : Scene, Cloth, Body, mesh object, (vertices, triangles), str or Path
        A path names a scene (.toml) or a mesh file.
    role : {"cloth", "sewn cloth", "body"}, optional
        What a mesh is to be: fewer faults matter in a body. None: a body for a `clothsim.Body`, else a cloth.

    Returns
    -------
    list of Finding
        Errors first; empty where there is no fault. Each has severity, kind, sentence, remedy and indices (of the
        vertices or triangles).

    Raises
    ------
    InputError
        Where `what` is neither a mesh nor a scene, or its file cannot be read.

    Examples
    --------
    >>> import clothsim
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> clothsim.check((square, [[0, 1, 2], [0, 2, 3]]))
    []
    >>> [finding.kind for finding in clothsim.check((square, [[0, 1, 2], [2, 3, 9]]))]
    ['index out of range']
    """
    if isinstance(what, str | Path) and Path(what).suffix.lower() == ".toml":
        what = load_scene(what)
    if isinstance(what, Scene):
        return _of_scene(what)
    name, vertices, triangles, usual = _mesh_of(what)
    return sorted(examine(name, vertices, triangles, role or usual).findings, key=lambda finding: finding.severity)


def _mesh_of(what: Any) -> tuple[str, Any, Any, Role]:
    """Name, vertices, triangles and usual role of a mesh."""
    if isinstance(what, str | Path):
        from clothsim.files.meshes.mesh_file import read_mesh

        mesh = read_mesh(what)
        return Path(what).name, mesh.positions, mesh.triangles, "cloth"
    if isinstance(what, Cloth):
        role: Role = "sewn cloth" if what.sewn or what.weld else "cloth"
        return what.name or "cloth", what.arrays.vertices, what.arrays.triangles, role
    if isinstance(what, Body):
        return what.name or "body", what.arrays.vertices, what.arrays.triangles, "body"
    if isinstance(what, Sequence) and len(what) == 2:
        vertices, triangles = what
    else:
        vertices, triangles = surface_of("mesh", what)
    return "mesh", vertices, triangles, "cloth"


def _of_scene(scene: Scene) -> list[Finding]:
    """The errors of building it, one a line; else what intersects at the start, which only contact makes an error.

    One that is too large to be run is not built.
    """
    cost = expected_cost(scene)
    costly = [
        Finding(
            "error" if cost.too_much else "warning",
            "cost",
            f"Expected: {cost}.",
            "Take fewer cells or a larger dt.",
            NO_INDICES,
        )
        for _ in range(cost.notable)
    ]
    if cost.too_much:
        return costly
    try:
        built = build(scene)
    except InputError as error:
        return [
            Finding("error", "scene", sentence, error.remedy, NO_INDICES) for sentence in error.sentence.splitlines()
        ]
    test = intersection_check_of(world_surfaces(built.world), scene.effects, built.energies)
    crossings = test.crossings(built.world.start(), built.world.origin)
    broken = test.violations(crossings)
    selected = [
        Finding(
            "error" if crossing in broken else "warning",
            "intersection",
            f"{crossing.summary} at the start: {crossing.sentence}.",
            "Move them apart, or let seed.untangle do it.",
            crossing.pairs,
        )
        for crossing in crossings
    ]
    return sorted([*selected, *costly], key=lambda finding: finding.severity)
