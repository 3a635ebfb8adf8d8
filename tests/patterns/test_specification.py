"""Pattern files: units, curves, round trip, and faults with their names."""

import copy
import json

import numpy as np
import pytest
from real_data import DATA, needs_data
from scipy.spatial.transform import Rotation
from sewing_patterns import PATTERN_FILES, SQUARE, panel, skirt, specification, stitch

from clothsim.base.errors import InputError
from clothsim.patterns import specification as specification_module
from clothsim.patterns.curves import Arc, Bezier, Straight
from clothsim.patterns.pattern import Pattern
from clothsim.patterns.pattern_mesh import mesh_pattern, turned_panels
from clothsim.patterns.specification import entries_of, pattern_of, read_specification, write_specification


def apart(first: Pattern, second: Pattern) -> float:
    """Largest difference of two patterns of the same panels and edges."""
    pairs = [(first.panels[name], second.panels[name]) for name in first.panels]
    return max(
        np.abs(getattr(a, key) - getattr(b, key)).max()
        for a, b in pairs
        for key in ("vertices", "translation", "rotation")
    )


def test_lengths_are_metres():
    pattern = pattern_of(skirt())
    assert np.array_equal(pattern.panels["front"].vertices, np.array(SQUARE) / 100)
    assert pattern.panels["front"].edge_length(1) == 0.2
    assert pattern.notes == ()


def test_placement_turns_about_x_then_y_then_z():
    angles = [20.0, -35.0, 70.0]
    placed = pattern_of(specification({"a": panel(rotation=angles, translation=[10, 20, 30])})).panels["a"]
    expected = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()  # of fixed axes: Rz Ry Rx
    assert np.allclose(placed.matrix, expected, atol=1e-15)
    points = np.array([[0.1, 0.2], [0.3, -0.1]])
    assert np.allclose(placed.placed(points), points @ expected[:, :2].T + [0.1, 0.2, 0.3])


def test_a_file_without_units_is_read_as_centimetres_with_a_note():
    pattern = pattern_of(specification({"front": panel()}, units=None))
    assert pattern.panels["front"].edge_length(0) == 0.1
    assert len(pattern.notes) == 1


@pytest.mark.parametrize(
    ("curvature", "kind"),
    [
        ([0.5, 0.2], Bezier),
        ({"type": "quadratic", "params": [[0.5, 0.2]]}, Bezier),
        ({"type": "cubic", "params": [[0.3, 0.2], [0.6, -0.1]]}, Bezier),
        ({"type": "circle", "params": [8, 0, 1]}, Arc),
        (None, Straight),
    ],
)
def test_kinds_of_edges(curvature, kind):
    entries = specification({"front": panel()})
    entries["pattern"]["panels"]["front"]["edges"][0]["curvature"] = curvature
    curve = pattern_of(entries).panels["front"].edges[0].curve
    assert isinstance(curve, kind)
    if kind is Arc:
        assert curve.radius == 0.08


def test_absolute_control_points_are_made_relative():
    entries = specification({"front": panel()})
    entries["properties"]["curvature_coords"] = "absolute"
    entries["pattern"]["panels"]["front"]["edges"][1]["curvature"] = {"type": "quadratic", "params": [[12.0, 5.0]]}
    read = pattern_of(entries).panels["front"]
    assert np.allclose(read.edges[1].curve.points(*read.vertices[1:3])[1], [0.12, 0.05], atol=1e-15)


def test_rotation_orders():
    """Rz Ry Rx of (90, 90, 0) degrees takes x to -z, as by hand; the other order is named in a note."""
    entries = specification({"front": panel(rotation=[90, 90, 0])})
    read = pattern_of(entries)
    assert np.allclose(read.panels["front"].matrix @ [1, 0, 0], [0, 0, -1], atol=1e-15)
    assert len(read.notes) == 1
    other = pattern_of(entries, "xyz").panels["front"].matrix
    about_x, about_y = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    assert np.allclose(other, about_x @ about_y, atol=1e-14)


@needs_data
@pytest.mark.parametrize("name", PATTERN_FILES)
def test_read_written_read(name, tmp_path):
    pattern = read_specification(DATA / "patterns" / name)
    write_specification(tmp_path / "again.json", pattern)
    again = read_specification(tmp_path / "again.json")
    assert apart(pattern, again) < 1e-12
    assert pattern.stitches == again.stitches
    assert [p.edges for p in pattern.panels.values()] == [p.edges for p in again.panels.values()]
    assert set(json.loads((tmp_path / "again.json").read_text())) >= {"pattern", "properties", "parameters"}


def _spoilt(change):
    entries = skirt()
    change(entries["pattern"])
    return entries


def _set(path, value):
    def change(pattern):
        *parents, last = path
        for key in parents:
            pattern = pattern[key]
        pattern[last] = copy.deepcopy(value)

    return change


FRONT = ("panels", "front")
FAULTS = {
    "open loop": (_set((*FRONT, "edges", 1, "endpoints"), [1, 3]), ("front", "edge 1")),
    "no length": (_set((*FRONT, "vertices", 1), [0, 0]), ("Edge 0", "front")),
    "missing edge": (_set(("stitches", 0, 1, "edge"), 99), ("Stitch 0", "edge 99")),
    "missing panel": (_set(("stitches", 0, 1, "panel"), "sleeve"), ("Stitch 0", "sleeve")),
    "sewn twice": (_set(("stitches", 1, 0), {"panel": "front", "edge": 1}), ("edge 1 of front", "0 and 1")),
    "sewn to itself": (_set(("stitches", 1, 1), {"panel": "front", "edge": 3}), ("edge 3 of front", "1 and 1")),
    "missing vertex": (_set((*FRONT, "edges", 1, "endpoints"), [1, 7]), ("Edge 1", "vertex 7 of 4")),
    "not finite": (_set((*FRONT, "vertices", 1), [float("nan"), 0]), ("front", "vertices")),
    "no vertices": (_set((*FRONT, "vertices"), []), ("front", "vertices")),
    "no edges": (_set((*FRONT, "edges"), []), ("front",)),
    "words": (_set((*FRONT, "translation"), ["a", 0, 0]), ("front", "translation")),
    "unknown curve": (_set((*FRONT, "edges", 2, "curvature"), {"type": "spline", "params": []}), ("Edge 2", "spline")),
    "no pair": (_set(("stitches", 0), [1]), ("Stitch 0",)),
    "no panels": (_set(("panels",), {}), ("panel",)),
    "panel is a list": (_set(FRONT, []), ("front",)),
    "number as a word": (_set((*FRONT, "vertices", 1, 0), "10"), ("front", "vertices")),
    "number as a truth value": (_set((*FRONT, "rotation"), [True, False, True]), ("front", "rotation")),
    "integer beyond a float": (_set((*FRONT, "vertices", 1, 0), 10**400), ("front", "vertices")),
    "far vertex": (_set((*FRONT, "vertices", 1, 0), 1e300), ("front", "vertex 1e+298 m")),
    "far placement": (_set((*FRONT, "translation", 1), 1e9), ("front", "translation 1e+07 m")),
    "long arc": (
        _set((*FRONT, "edges", 0, "curvature"), {"type": "circle", "params": [1e300, 1, 1]}),
        ("Edge 0", "front"),
    ),
    "far control point": (
        _set((*FRONT, "edges", 0, "curvature"), {"type": "quadratic", "params": [[1e200, 0]]}),
        ("Edge 0", "front"),
    ),
    "radius 0": (_set((*FRONT, "edges", 0, "curvature"), {"type": "circle", "params": [0, 0, 1]}), ("Edge 0", "front")),
    "curvature is 0": (_set((*FRONT, "edges", 0, "curvature"), 0), ("Edge 0", "front")),
    "hardly any length": (_set((*FRONT, "vertices", 1), [1e-7, 0]), ("Edge 0", "front")),
    "label is a list": (_set((*FRONT, "label"), ["arm"]), ("front", "arm")),
    "stitches are a word": (_set(("stitches",), ""), ("stitches",)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named(fault):
    change, words = FAULTS[fault]
    with pytest.raises(InputError) as caught:
        pattern_of(_spoilt(change))
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize("properties", [3, True, "cm", [1], *({"units_in_meter": k} for k in (0, -1, 1e-320, True))])
def test_bad_properties_are_refused(properties):
    with pytest.raises(InputError) as caught:
        pattern_of({**skirt(), "properties": properties})
    assert "properties" in str(caught.value)


def test_a_null_is_as_good_as_nothing():
    entries = {**skirt(), "properties": None}
    entries["pattern"]["panels"]["front"] |= {"label": None, "rotation": None}
    assert pattern_of(entries).panels["front"].label == ""


def test_a_key_given_twice_is_refused_by_name(tmp_path):
    (tmp_path / "twice.json").write_text('{"pattern": {"panels": {"front": {}, "front": {}}}}')
    with pytest.raises(InputError) as caught:
        read_specification(tmp_path / "twice.json")
    assert "'front'" in str(caught.value)


def test_entries_nested_too_deep_to_be_written_are_refused():
    nested: list = []
    for _ in range(200):
        nested = [nested]
    with pytest.raises(InputError):
        pattern_of({**skirt(), "parameters": nested})


NARROW = [[0, 0], [40, 0], [40, 40], [20, 1e-4], [0, 40]]
UNMESHABLE = {
    "no area": ([[0, 0], [100, 0], [100, 1e-4], [0, 1e-4]], ("front", "area")),
    "on one line": ([[0, 0], [10, 0], [20, 0], [10, 0]], ("front", "edges 0 and 3")),
    "neck": (NARROW, ("front", "wide")),
    "crossing": (np.random.default_rng(0).random((200, 2)) * 20, ("front", "edges")),
    "too many samples": (np.random.default_rng(0).random((9_000, 2)) * 1000, ("front", "9000 edges")),
    "too many edges": (np.random.default_rng(0).random((20_001, 2)), ("front", "20,001")),
}


@pytest.mark.parametrize("fault", UNMESHABLE)
def test_panels_that_cannot_be_meshed_are_named(fault):
    vertices, words = UNMESHABLE[fault]
    with pytest.raises(InputError) as caught:
        mesh_pattern(pattern_of(specification({"front": panel(vertices)})), 0.02)
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize("text", ["", "[1, 2", '"pattern"', "{}", '{"pattern": 3}', "[" * 100_000])
def test_files_that_are_no_patterns(tmp_path, text):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(InputError):
        read_specification(tmp_path / "bad.json")
    with pytest.raises(InputError):
        read_specification(tmp_path)


def test_a_moebius_band_is_refused_by_its_stitch():
    panels = {"a": panel(), "b": panel()}
    loop = [stitch(("a", 1), ("b", 3)), stitch(("b", 1), ("a", 3), "right_wrong")]
    with pytest.raises(InputError) as caught:
        turned_panels(pattern_of(specification(panels, loop)))
    assert "Stitch 1" in str(caught.value)


def test_a_panel_sewn_right_on_wrong_is_turned():
    panels = {"a": panel(), "b": panel(), "collar": panel()}
    sewn = [stitch(("a", 1), ("b", 3)), stitch(("b", 0), ("collar", 0), "right_wrong")]
    assert turned_panels(pattern_of(specification(panels, sewn))) == {"a": False, "b": False, "collar": True}


def test_a_self_crossing_panel_is_refused_by_both_edges():
    bow_tie = panel([[0, 0], [10, 0], [0, 20], [10, 20]])
    with pytest.raises(InputError) as caught:
        mesh_pattern(pattern_of(specification({"front": bow_tie})), 0.02)
    assert "edges 1 and 3" in str(caught.value)


def test_entries_keep_what_is_not_read():
    entries = {**skirt(), "parameters": {"length": 3}}
    entries["pattern"]["panel_order"] = ["back", "front"]
    written = entries_of(pattern_of(entries))
    assert written["parameters"] == {"length": 3}
    assert written["pattern"]["panel_order"] == ["back", "front"]


def fan(points):
    """A panel with an edge through so many points."""
    spoilt = panel()
    spoilt["edges"][0]["curvature"] = {"type": "polyline", "params": [[0.5, 0.1]] * points}
    return spoilt


@pytest.mark.parametrize(
    "entries",
    [
        specification({f"p{k}": panel() for k in range(10_000)}),
        specification({"front": fan(20_000)}),
        specification({"front": panel()}, [stitch(("front", 0), ("front", 2))] * 30_000),
        specification({"\x1b[2Jfront": panel()}),
    ],
    ids=["panels", "points", "stitches", "name"],
)
def test_promises_and_names_are_bounded_before_a_panel_is_built(entries, monkeypatch):
    monkeypatch.setattr(specification_module, "_edge", lambda *_: pytest.fail("built"))
    with pytest.raises(InputError) as caught:
        pattern_of(entries)
    assert "\x1b" not in str(caught.value)


def test_a_label_has_no_control_characters():
    with pytest.raises(InputError) as caught:
        pattern_of(specification({"front": panel(label="\x1b[31mred")}))
    assert "\x1b" not in str(caught.value)


def test_a_file_of_60_mb_is_not_read(tmp_path):
    file = tmp_path / "large.json"
    with file.open("wb") as handle:
        handle.truncate(60_000_000)
    with pytest.raises(InputError, match=r"large\.json has 57 MiB"):
        read_specification(file)
