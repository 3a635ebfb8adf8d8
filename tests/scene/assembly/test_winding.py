"""Scenes and shapes of inconsistent winding."""

import numpy as np

from clothsim import Scene
from clothsim.files.meshes.readers.obj import write_obj
from clothsim.mesh.cloth import triangle_planes
from clothsim.mesh.generators.shapes import rectangle
from clothsim.scene.assembly.placement import Shape
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.assembly.winding import wound_alike

NONE = np.zeros((0, 3, 2))


def mixed():
    points, triangles = rectangle(cells=(4, 4))
    turned = np.arange(len(triangles)) % 3 == 0
    return points, triangles, np.where(turned[:, None], triangles[:, [0, 2, 1]], triangles)


def test_a_scene_rewinds_its_cloth_and_notes_it(tmp_path):
    points, triangles, given = mixed()
    write_obj(tmp_path / "sheet.obj", points, given)
    built = build(Scene(cloth={"mesh": "sheet.obj"}, effects={"inertia": {}}, directory=tmp_path))
    assert np.array_equal(built.world.triangles, triangles)
    assert any("11 of 32 triangles" in note for note in built.notes)


def test_a_consistent_shape_is_the_same_object():
    points, triangles, _ = mixed()
    shape = Shape(points, triangles, NONE, ())
    assert wound_alike(shape) is shape


def test_the_material_plane_keeps_its_lengths_and_orientation():
    points, triangles, given = mixed()
    planes = triangle_planes(points, given)
    shape = wound_alike(Shape(points, given, planes, ()))
    assert np.array_equal(shape.triangles, triangles)

    def doubled_areas(corners):
        edges = corners[:, 1:] - corners[:, :1]
        return edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]

    assert np.allclose(doubled_areas(shape.texture), doubled_areas(planes))
    before = np.linalg.norm(points[triangles] - points[np.roll(triangles, 1, axis=1)], axis=2)
    after = np.linalg.norm(shape.texture - np.roll(shape.texture, 1, axis=1), axis=2)
    assert np.allclose(before, after)
