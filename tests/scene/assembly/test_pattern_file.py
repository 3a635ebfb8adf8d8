"""Cloth of a sewing pattern in a scene."""

import json

import numpy as np
import pytest
from sewing_patterns import SQUARE, panel, skirt, specification, stitch

from clothsim import InputError, load_scene
from clothsim.scene.assembly.scene_world import build


def side_by_side(stitches):
    """Two panels in one plane whose edges coincide as placed."""
    panels = {"left": panel(), "right": panel(SQUARE, translation=[10, 0, 0])}
    return specification(panels, stitches)


def built(tmp_path, entries, **keys):
    """The scene of a pattern as built."""
    (tmp_path / "x_specification.json").write_text(json.dumps(entries), encoding="utf-8")
    table = {"mesh": "x_specification.json", "size": 0.05, **keys}
    lines = ["[cloth]", *(f"{key} = {json.dumps(value)}" for key, value in table.items()), "[effects.membrane]"]
    (tmp_path / "scene.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return build(load_scene(tmp_path / "scene.toml"))


def cloth_of(tmp_path, entries, **keys):
    return built(tmp_path, entries, **keys).world.cloths[0]


def area(cloth):
    edges = cloth.material_coordinates[:, 1:] - cloth.material_coordinates[:, :1]
    return 0.5 * np.linalg.det(edges).sum()


def test_panels_that_touch_are_welded_and_keep_their_rest_shape(tmp_path):
    sewn = cloth_of(tmp_path, side_by_side([stitch(("left", 1), ("right", 3))]))
    apart = cloth_of(tmp_path, side_by_side([]))
    assert len(apart.positions) - len(sewn.positions) == 5  # an edge of 20 cm in steps of 5 cm
    assert np.ptp(sewn.positions, axis=0) == pytest.approx([0.2, 0.2, 0.0], abs=1e-12)
    assert sewn.flat
    assert area(sewn) == pytest.approx(0.04, rel=1e-12)
    assert set(sewn.groups) == {"left", "right"}
    assert sum(map(len, sewn.groups.values())) == len(sewn.triangles)


def test_seams_that_do_not_touch_stay_open_and_are_named(tmp_path):
    made = built(tmp_path, skirt())
    assert any("2 of 2 seams stay open" in note and "front.1 to back.3" in note for note in made.notes)
    z = made.world.cloths[0].positions[:, 2] + made.world.origin[2]
    assert sorted(set(np.round(z, 9))) == [-0.1, 0.1]


def test_the_scale_leaves_the_spacing_as_it_is(tmp_path):
    once, twice = (cloth_of(tmp_path, side_by_side([]), size=0.025 * k, scale=k) for k in (1.0, 2.0))
    assert np.array_equal(once.triangles, twice.triangles)
    assert area(twice) == pytest.approx(4 * area(once), rel=1e-12)


@pytest.mark.parametrize(
    ("entries", "keys", "named"),
    [
        (side_by_side([stitch(("left", 99), ("right", 3))]), {}, "99"),
        ({"panels": {}}, {}, "pattern"),
        (side_by_side([]), {"group": "left"}, "group"),
        (side_by_side([]), {"size": -1}, "size"),
        (side_by_side([]), {"mesh": "absent.json"}, "absent.json"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, entries, keys, named):
    with pytest.raises(InputError, match=named):
        built(tmp_path, entries, **keys)
