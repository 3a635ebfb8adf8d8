"""Scenes whose cloths are given by arrays: their start and their rest shape free to change."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import clothsim
from clothsim import Scene
from clothsim.base.arrays import Floats, Ints
from clothsim.engine import World, build

PLACED = {"vertices", "triangles", "rest", "groups", "position", "rotation_degrees", "scale", "up"}
"""Keys of a cloth that are of its mesh."""
OF_FABRIC = {each.name for each in fields(clothsim.Cloth)} - PLACED - {"arrays", "section"}
"""Keys of a cloth of arrays that are not."""


def table_of_arrays(
    keys: Any, name: str, start: Floats, triangles: Ints, rest: Floats, groups: Mapping[str, Ints]
) -> Any:
    """The cloth of a table with another mesh.

    Parameters
    ----------
    keys : mapping
        Section [cloth], whose fabric, velocity and sewing are taken.
    name : str
    start : (n, 3) ndarray [m]
    triangles : (m, 3) ndarray
    rest : (n, 3) or (m, 3, 2) ndarray [m]
    groups : mapping of str to (k,) ndarray
        Triangles of each panel.
    """
    own = {key: value for key, value in keys.items() if key in OF_FABRIC}
    return clothsim.Cloth(start, triangles, rest=rest, groups=groups, **{**own, "name": name})


def scene_of_arrays(scene: Scene, world: World | None = None, starts: Sequence[Floats] | None = None) -> Scene:
    """A scene whose cloths are the arrays that the scene makes of them; its rods stay as they are.

    Parameters
    ----------
    scene : Scene
    world : World, optional
        Of the scene, where it is built already.
    starts : sequence of (n, 3) ndarray [m], optional
        Positions of each cloth at the start in place of its own.

    Raises
    ------
    InputError
        For a scene that cannot be built, or an effect by names of a pattern's edges, which arrays have not.
    """
    world = build(scene).world if world is None else world
    places = [each.positions + world.origin for each in world.cloths] if starts is None else starts
    cloths = []
    for keys, cloth, start in zip(scene.cloths, world.cloths, places, strict=False):  # rods are behind the cloths
        rest = cloth.material_coordinates if cloth.flat else cloth.rest_positions
        table = {**keys, "weld": 0.0, "sewn": keys.weld > 0 or keys.sewn}
        cloths.append(table_of_arrays(table, cloth.name, start, cloth.triangles, rest, cloth.groups))
    changed: dict[str, Any] = {"cloth": cloths, "seed": {}}
    return replace(scene, **changed)
