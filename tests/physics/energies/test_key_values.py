"""Values that vary over the cloth and over time."""

import numpy as np
import pytest
from meshes import cloth, grid

from clothsim import InputError, Scene
from clothsim.mesh.world import make_world
from clothsim.physics.energies.key_values import by_cloth, over_cloth, schedule, selected_vertices
from clothsim.scene.assembly.scene_world import build


def two_cloths():
    """A sheet of 4 triangles and 6 vertices, and one of 12 and 12."""
    small, large = grid(2, 1), grid(3, 2)
    return make_world([cloth(*small, name="small"), cloth(*large, name="large")])


@pytest.mark.parametrize(
    ("side", "axis", "of"), [("left", 0, "min"), ("right", 0, "max"), ("bottom", 1, "min"), ("top", 1, "max")]
)
def test_a_side_is_the_rows_of_every_sheet_that_lie_there(side, axis, of):
    world = two_cloths()
    expected = []
    for sheet, rows in zip(world.cloths, world.cloth_slices, strict=True):
        along = sheet.rest_positions[:, axis]
        expected += [rows.start + k for k in range(len(along)) if abs(along[k] - getattr(along, of)()) < 1e-9]
    assert selected_vertices("p", world, side).tolist() == expected


# --- over time ------------------------------------------------------------------------------------------------------


def test_key_frames_are_linear_between_and_held_outside():
    frames = schedule("p", [[1.0, 10.0], [3.0, 20.0], [4.0, 0.0]])
    assert [frames.at(t) for t in (0.0, 1.0, 2.0, 3.0, 3.5, 9.0)] == [10.0, 10.0, 15.0, 20.0, 10.0, 0.0]
    assert not frames.is_constant
    assert not frames.is_zero


def test_a_number_is_the_same_at_all_times():
    assert schedule("p", 3).at(-1.0) == schedule("p", np.float64(3)).at(7.0) == 3.0
    assert schedule("p", 3).is_constant
    assert not schedule("p", 3).is_zero


@pytest.mark.parametrize("value", [0, 0.0, [[0, 0.0], [1, 0.0]]])
def test_zero_is_only_what_is_zero_at_all_times(value):
    assert schedule("p", value).is_zero


def test_a_schedule_that_passes_through_zero_is_not_zero():
    assert not schedule("p", [[0, 0.0], [1, 1.0], [2, 0.0]]).is_zero
    assert not schedule("p", lambda time: 0.0).is_zero


def test_a_function_of_the_time():
    assert schedule("p", lambda time: 2 * time).at(3.0) == 6.0
    with pytest.raises(InputError, match="p at 3 s must be at least 0, not -6"):
        schedule("p", lambda time: -2 * time, least=0.0).at(3.0)
    with pytest.raises(InputError, match="p at 3 s is nan, not a finite number"):
        schedule("p", lambda time: np.nan).at(3.0)
    with pytest.raises(InputError, match=r"p: .*raised ZeroDivisionError"):
        schedule("p", lambda time: 1 / (time - 3.0)).at(3.0)


@pytest.mark.parametrize("select", ["left", "corners", [0], {"box": [[0, 0, 0], [1, 1, 1]]}, {"label": "waist"}])
def test_without_cloth_nothing_is_selected(select):
    rigid = {"mesh": "slab"}
    world = build(Scene(rigid=rigid, effects={"inertia": {}, "gravity": {}})).world
    with pytest.raises(InputError, match="the scene has none"):
        selected_vertices("pins.select", world, select)
    assert len(selected_vertices("pins.select", world, [])) == 0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([], "p has no key frame"),
        ([[0.0, 1.0], [0.0, 2.0]], r"p\[1\] is at 0 s, not after 0 s"),
        ([[0.0, 1.0], 2.0], r"p\[1\] is 2.0, not a key frame"),
        ([[0.0, 1.0], [1.0, -1.0]], r"p\[1\]\[1\] must be at least 0, not -1"),
        ([[0.0, "1"]], r"p\[0\]\[1\] must be a number"),
        ([[float("nan"), 1.0]], r"p\[0\]\[0\] is nan"),
        (-1.0, "p must be at least 0, not -1"),
        ("1", "p must be a number"),
        (True, "p must be a number"),
        (None, "p must be a number"),
        ({"a": 1}, "p must be a number or key frames"),
        ({"function": "<lambda>"}, "p was the Python function '<lambda>'"),
    ],
)
def test_a_bad_schedule_is_refused_by_name_and_index(value, message):
    with pytest.raises(InputError, match=message):
        schedule("p", value, least=0.0)


def test_each_cloth_may_have_its_own_schedule():
    small, large = by_cloth("p", {"small": [[0, 0], [1, 4]], "other": 2}, two_cloths())
    assert (small.at(0.5), large.at(0.5)) == (2.0, 2.0)
    assert (small.at(1.0), large.at(1.0)) == (4.0, 2.0)
    assert [one.at(0.0) for one in by_cloth("p", 7, two_cloths())] == [7.0, 7.0]
    with pytest.raises(InputError, match=r"p.large\[1\] is at 0 s"):
        by_cloth("p", {"small": 1, "large": [[1, 0], [0, 1]]}, two_cloths())
    with pytest.raises(InputError, match="p was the Python function 'f'"):
        by_cloth("p", {"function": "f"}, two_cloths())


# --- over the cloth -------------------------------------------------------------------------------------------------


def test_a_number_is_the_same_for_all_triangles():
    assert np.array_equal(over_cloth("c", 2, two_cloths()), np.full(16, 2.0))


def test_an_array_by_triangle_is_taken_as_it_is():
    numbers = np.arange(16.0)
    assert np.array_equal(over_cloth("c", numbers, two_cloths()), numbers)
    assert np.array_equal(over_cloth("c", numbers.tolist(), two_cloths()), numbers)


def test_an_array_by_vertex_is_averaged_over_the_corners():
    world = two_cloths()
    x = world.start()[: world.n_cloth, 0]
    assert np.allclose(over_cloth("c", x, world), x[world.triangles].mean(axis=1), atol=0, rtol=1e-15)


def test_a_table_by_cloth():
    world = two_cloths()
    numbers = over_cloth("c", {"small": 5, "large": np.arange(12.0)}, world)
    assert np.array_equal(numbers, [5.0] * 4 + list(range(12)))
    assert np.array_equal(over_cloth("c", {"large": 1, "other": 3}, world), [3.0] * 4 + [1.0] * 12)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([1.0, 2.0], "c has 2 numbers. Give one for each of the 16 triangles or of the 18 vertices"),
        (np.zeros((16, 2)), r"c has the shape \(16, 2\)"),
        ([0.0] * 7 + [-1.0] + [0.0] * 8, r"c\[7\] must be at least 0, not -1"),
        ([0.0] * 7 + [float("inf")] + [0.0] * 8, r"c\[7\] is inf"),
        ({"small": 1}, "c .*'large'"),
        ({"smal": 1, "large": 2}, "c names 'smal', which is not a cloth"),
        ({"small": [1, 2, 3], "large": 2}, "c.small has 3 numbers"),
        ("x", "c must be a number"),
        (["x"] * 16, "c must be numbers"),
        ([[1], [1, 2]], "c must be numbers"),
        (lambda time: 1.0, "c must be a number or an array"),
        ({"small": {"large": 1}, "other": 1}, "c.small must be a number or an array"),
    ],
)
def test_a_bad_value_over_the_cloth_is_refused_by_name_and_index(value, message):
    with pytest.raises(InputError, match=message):
        over_cloth("c", value, two_cloths(), least=0.0)


# --- by panel -------------------------------------------------------------------------------------------------------

PANELS = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 2 1 0
g front
f 1 2 3 4
g back
f 2 5 6 3
"""


def panelled(folder, **keys):
    (folder / "shirt.obj").write_text(PANELS)
    cloth = {"name": "shirt", "mesh": "shirt.obj", **keys}
    return build(Scene(cloth=cloth, effects={"inertia": {}, "membrane": {}}, directory=folder)).world


def test_a_panel_of_the_file_has_its_own_number(tmp_path):
    world = panelled(tmp_path)
    assert over_cloth("c", {"front": 1, "back": 2}, world).tolist() == [1, 1, 2, 2]
    assert over_cloth("c", {"back": 2, "other": 5}, world).tolist() == [5, 5, 2, 2]
    assert over_cloth("c", {"shirt": [1, 2, 3, 4], "back": 9}, world).tolist() == [1, 2, 9, 9]


def test_panels_go_with_the_part_of_the_file_and_with_sewing(tmp_path):
    back = panelled(tmp_path, group="back")
    assert over_cloth("c", {"back": 2}, back).tolist() == [2, 2]
    sewn = panelled(tmp_path, weld=1e-6)
    assert over_cloth("c", {"front": 1, "back": 2}, sewn).tolist() == [1, 1, 2, 2]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"back": 2}, "c .* 2 triangles of the cloth 'shirt', .* 0"),
        ({"back": -2, "other": 1}, "c.back must be at least 0, not -2"),
        ({"back": [1, 2], "other": 1}, "c.back must be a number"),
        ({"bakc": 2, "other": 1}, "'bakc', which is not a cloth. Cloths: shirt; or other. Panels: back, front"),
    ],
)
def test_a_bad_value_by_panel_is_refused_by_name(value, message, tmp_path):
    with pytest.raises(InputError, match=message):
        over_cloth("c", value, panelled(tmp_path), least=0.0)
