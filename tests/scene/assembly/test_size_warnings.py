"""Warnings of another unit and of another vertical axis, and the key `up`."""

import numpy as np
import pytest
from small_scenes import BALL, SHEET, small_scene

from clothsim import Body, Cloth, InputError, Scene
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.assembly.warnings import FLAT, LARGEST, LYING, SMALLEST

FALL = {"inertia": {}, "gravity": {}}
TOP = {"inertia": {}, "gravity": {"acceleration": [0, -9.81, 0]}}


def box(extent):
    """A closed box of that extent."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [[a, b, c] for q in quads for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]
    return corners * extent, triangles


def notes(word, **sections):
    return [note for note in build(small_scene(**sections)).notes if word in note]


def body_notes(extent, effects=FALL, **keys):
    body = Body(*box(extent), name="figure", **{"position": [0, 0, -5], **keys})
    scene = Scene(cloth=SHEET, body=body, effects=effects)
    return [note for note in build(scene).notes if note.startswith("figure")]


@pytest.mark.parametrize(
    ("size", "factor"),
    [(60.0, "0.01"), (LARGEST * 1.01, "0.1"), (1700.0, "0.001"), (SMALLEST * 0.99, "100"), (0.001, "100")],
)
def test_a_sheet_in_another_unit_is_named_with_the_factor_that_mends_it(size, factor):
    found = notes(" long;", cloth=SHEET | {"size": [size, size / 2]}, effects=FALL, body=())
    assert len(found) == 1
    assert found[0].startswith("cloth")
    assert f"{size:.3g} m" in found[0]
    if factor not in ("0.1",):
        assert f"scale = {factor} " in found[0]


@pytest.mark.parametrize("size", [LARGEST, SMALLEST, 1.0])
def test_a_sheet_of_usual_size_is_not(size):
    assert notes(" long;", cloth=SHEET | {"size": [size, size]}, effects=FALL, body=()) == []


def test_a_body_of_172_m_is_named_and_a_floor_is_not():
    assert len(body_notes([172, 50, 172])) == 1
    floor = {"name": "floor", "mesh": "slab", "size": [40, 40, 0.1], "position": [0, 0, -1]}
    assert notes(" long;", body=floor, effects=FALL) == []


@pytest.mark.parametrize("extent", [[1.2, 1.7, 0.3], [1.7, 0.4, 0.5], [1.7, 1.7, 0.3]])
def test_a_body_that_lies_across_gravity_is_named_with_the_key(extent):
    found = body_notes(extent)
    assert len(found) == 1
    assert 'up = "y"' in found[0]
    assert body_notes(extent, effects={"inertia": {}}) == []


@pytest.mark.parametrize(
    ("extent", "effects"),
    [
        ([1.2, 0.3, 1.7], FALL),
        ([1.2, 1.7, 0.3], TOP),
        ([1, 1, LYING], FALL),
        ([2, 2, 0.99 * FLAT * 2], FALL),
        ([0.3, 0.3, 0.3], FALL),
    ],
)
def test_a_body_that_stands_and_a_floor_are_not(extent, effects):
    assert body_notes(extent, effects) == []


def test_with_y_up_a_body_stands():
    assert body_notes([1.2, 1.7, 0.3], up="y") == []
    world = build(Scene(cloth=SHEET, body=Body(*box([1.2, 1.7, 0.3]), up="y", position=[0, 0, -5]), effects=FALL)).world
    assert np.ptp(world.bodies[0].positions, axis=0) == pytest.approx([1.2, 0.3, 1.7])
    top = box([1.2, 1.7, 0.3])[0][:, 1] == 1.7
    assert (world.bodies[0].positions[top, 2] + world.origin[2]) == pytest.approx(1.7 - 5)


def test_y_up_comes_before_the_rotation_and_is_a_rotation():
    vertices = np.random.default_rng(0).normal(size=(3, 3))
    scenes = [
        Scene(cloth=Cloth(vertices, [[0, 1, 2]], position=[1, 2, 3], **keys), effects=FALL)
        for keys in ({"up": "y", "rotation_degrees": [0, 0, 30]}, {"rotation_degrees": [90, 0, 30]}, {})
    ]
    turned, same, _ = (build(scene).world for scene in scenes)
    assert turned.cloths[0].positions + turned.origin == pytest.approx(
        same.cloths[0].positions + same.origin, abs=1e-15
    )


def test_another_axis_is_refused():
    with pytest.raises(InputError, match="up"):
        small_scene(body=BALL | {"up": "w"})
