"""Named panels of a cloth in memory: what is refused, and fabrics by group in scenes of arrays and files."""

import numpy as np
import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.keys.fabric_table import FABRICS
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import Scene
from clothsim.scene.toml_file import load_scene

CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    "groups",
    [
        {"a": [0, 2]},
        {"a": [-1]},
        {"a": [0.0]},
        {"a": [[0], [1]]},
        {"a": [0, 1], "b": [1]},
        {"": [0]},
        {1: [0]},
        ["a"],
        {"a": "0"},
    ],
)
def test_groups_that_are_none(groups):
    with pytest.raises(InputError):
        clothsim.Cloth(CORNERS, FACES, groups=groups)


def test_a_fabric_for_a_group_of_arrays():
    cloth = clothsim.Cloth(CORNERS, FACES, groups={"b": [1]}, fabric="wool", density=0.2, fabric_of={"b": "denim"})
    world = world_of(Scene(cloth=cloth, effects=[clothsim.Gravity()]))
    assert np.array_equal(world.per_triangle("density"), [0.2, FABRICS["denim"].density])
    assert not cloth.groups["b"].flags.writeable


def test_a_fabric_for_a_group_of_a_file(tmp_path):
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    text = "\n".join([*lines, "g body", "f 1 2 3", "g hem", "f 1 3 4", ""])
    (tmp_path / "sheet.obj").write_text(text)
    toml = '[cloth]\nmesh = "sheet.obj"\nfabric_of = { hem = "denim" }\n[effects.gravity]\n'
    (tmp_path / "scene.toml").write_text(toml)
    world = world_of(load_scene(tmp_path / "scene.toml"))
    assert np.array_equal(world.per_triangle("density"), [FABRICS["cotton"].density, FABRICS["denim"].density])
    (tmp_path / "scene.toml").write_text(toml.replace("hem =", "cuff ="))
    with pytest.raises(InputError):
        world_of(load_scene(tmp_path / "scene.toml"))


def test_a_mesh_without_panels_has_no_fabric_of_one():
    scene = Scene(cloth={"mesh": "rectangle", "fabric_of": {"hem": "denim"}}, effects=[clothsim.Gravity()])
    with pytest.raises(InputError):
        world_of(scene)
