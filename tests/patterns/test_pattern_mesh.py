"""Meshes of patterns: areas, angles, seams and sewn topology."""

import json
import re
from functools import cache

import numpy as np
import pytest
from real_data import DATA, needs_data
from sewing_patterns import PATTERN_FILES, panel, skirt, specification, stitch

from clothsim.base.errors import InputError
from clothsim.mesh.checks import examine
from clothsim.mesh.topology import border_edges, components
from clothsim.patterns import pattern_mesh
from clothsim.patterns.borders import borders, enclosed_area, segments, with_necks
from clothsim.patterns.pattern import Side, gather_ratios
from clothsim.patterns.pattern_mesh import (
    PatternMesh,
    largest_gap,
    mesh_pattern,
    sewn_vertices,
    without_slivers,
)
from clothsim.patterns.specification import pattern_of, read_specification

LOOPS = dict(
    zip(PATTERN_FILES, (4, 4, 2, 2, 4, 4, 4, 4, 4, 2, 4, 3, 3, 4, 4, 4, 4, 4, 4, 5, 4, 2, 3, 4, 4), strict=True)
)
"""Border loops of the sewn garments, counted by hand: neck, hem and two arms of a shirt; waist and hem of a skirt."""

BESIDE_SHORT_EDGES = 23.0
"""Angle at the corner of an edge of a third of the spacing, whose samples are fixed by its seam [degrees]."""


@cache
def meshed(name: str, spacing: float = 0.02) -> PatternMesh:
    """Mesh of a shared pattern."""
    return mesh_pattern(read_specification(DATA / "patterns" / name), spacing)


def signed_areas(mesh: PatternMesh) -> np.ndarray:
    """Area of each triangle in the material plane, (m,) [m2]."""
    corners = mesh.material_coordinates
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]) / 2


def angles_degrees(corners: np.ndarray) -> np.ndarray:
    """Angles of triangles (m, 3, 2), (m, 3) [degrees]."""
    u, v = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
    return np.degrees(np.arctan2(cross, (u * v).sum(axis=2)))


def sharpest_corner_degrees(points: np.ndarray) -> float:
    """Smallest inner angle of a closed polygon (k, 2) [degrees]."""
    u, v = np.roll(points, -1, axis=0) - points, np.roll(points, 1, axis=0) - points
    turn = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
    inner = turn if enclosed_area(points) > 0 else -turn
    return float(np.degrees(inner % (2 * np.pi)).min())


def test_skirt_has_equal_fronts_and_its_own_area():
    mesh = mesh_pattern(pattern_of(skirt()), 0.02)
    assert (signed_areas(mesh) > 0).all()
    assert np.isclose(signed_areas(mesh).sum(), 2 * 0.1 * 0.2, rtol=1e-12)
    number = sewn_vertices(mesh, mesh.seams)
    sewn = number[mesh.triangles]
    assert number.max() + 1 == len(mesh.positions) - 2 * 11
    assert examine("skirt", np.random.default_rng(0).random((number.max() + 1, 3)), sewn).findings == ()
    corners = mesh.positions[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[mesh.faces["front"], 2] > 0).all()
    assert (normals[mesh.faces["back"], 2] < 0).all()


def test_warp_is_the_first_material_axis_and_runs_along_y_of_the_panel():
    mesh = mesh_pattern(pattern_of(skirt()), 0.02)
    for name, mirror in (("front", 1), ("back", -1)):
        rows = mesh.faces[name]
        plane = mesh.panel_coordinates[mesh.triangles[rows]]
        assert np.array_equal(mesh.material_coordinates[rows, :, 0], plane[..., 1])
        assert np.array_equal(mesh.material_coordinates[rows, :, 1], -mirror * plane[..., 0])


def test_both_sides_of_a_seam_have_the_samples_of_the_longer():
    entries = specification({"a": panel(), "b": panel([[0, 0], [10, 0], [10, 40], [0, 40]])})
    entries["pattern"]["stitches"] = [stitch(("a", 1), ("b", 3))]
    mesh = mesh_pattern(pattern_of(entries), 0.02)
    assert len(mesh.edges[Side("a", 1)]) == len(mesh.edges[Side("b", 3)]) == 21
    pairs = mesh.seams[0].pairs
    assert np.array_equal(pairs[:, 0], mesh.edges[Side("a", 1)])
    assert np.array_equal(pairs[:, 1], mesh.edges[Side("b", 3)][::-1])
    assert np.isclose(largest_gap(mesh.positions, mesh.seams[0]), np.hypot(0.1, 0.2))


def test_a_dart_joins_no_vertex_to_itself():
    dart = panel([[0, 0], [4, 0], [5, 8], [6, 0], [10, 0], [10, 20], [0, 20]])
    mesh = mesh_pattern(pattern_of(specification({"a": dart}, [stitch(("a", 1), ("a", 2))])), 0.02)
    pairs = mesh.seams[0].pairs
    assert len(pairs) == len(mesh.edges[Side("a", 1)]) - 1
    assert (pairs[:, 0] != pairs[:, 1]).all()
    sewn = sewn_vertices(mesh, mesh.seams)[mesh.triangles]
    assert len(np.unique(components(sewn, sewn.max() + 1))) == 1


def test_slivers_collapse_with_their_partners_and_are_named():
    short = [[0, 0], [10, 0], [10, 20], [10, 20.1], [0, 20.1]]
    entries = specification({"a": panel(short), "b": panel(short)}, [stitch(("a", 2), ("b", 2))])
    pattern = without_slivers(pattern_of(entries), 0.02)
    assert [len(each.edges) for each in pattern.panels.values()] == [4, 4]
    assert pattern.stitches == ()
    assert np.allclose(pattern.panels["a"].vertices[1], [0.1, 0.2005])
    assert "edge 2 of a" in pattern.notes[-1]
    assert "edge 2 of b" in pattern.notes[-1]


def test_a_sliver_sewn_to_a_long_edge_stays():
    short = [[0, 0], [10, 0], [10, 20], [10, 20.1], [0, 20.1]]
    entries = specification({"a": panel(short), "b": panel()}, [stitch(("a", 2), ("b", 1))])
    pattern = pattern_of(entries)
    assert without_slivers(pattern, 0.02) is pattern


def test_a_curve_given_as_a_polyline_keeps_its_shape():
    """Edges of 1.6 mm and of .4 mm at a spacing of 2 cm: they are slivers, each for itself."""
    for count in (1000, 4000):
        angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
        circle = panel(np.column_stack([25 * np.cos(angles), 25 * np.sin(angles)]).tolist())
        mesh = mesh_pattern(pattern_of(specification({"a": circle})), 0.02)
        assert np.isclose(signed_areas(mesh).sum(), np.pi / 16, rtol=0.003)


@pytest.mark.parametrize("spacing", [0.0, -1.0, float("nan"), float("inf"), 1e-300, 1e-5, "2cm", None])
def test_spacing_must_be_a_length_that_can_be_meshed(spacing):
    with pytest.raises(InputError):
        mesh_pattern(pattern_of(skirt()), spacing)


def test_spacing_may_be_a_whole_number_of_metres():
    square = pattern_of(specification({"a": panel([[0, 0], [2000, 0], [2000, 2000], [0, 2000]])}))  # 20 m
    assert np.array_equal(mesh_pattern(square, 10).triangles, mesh_pattern(square, 10.0).triangles)


def test_a_size_larger_than_every_panel_is_of_another_unit():
    with pytest.raises(InputError, match=r"2 m.*0\.2"):
        mesh_pattern(pattern_of(skirt()), 2)


def test_a_seam_within_one_triangle_is_named():
    mesh = mesh_pattern(pattern_of(specification({"a": panel()}, [stitch(("a", 0), ("a", 1))])), 0.02)
    with pytest.raises(InputError) as caught:
        sewn_vertices(mesh, mesh.seams)
    assert "a.0 to a.1" in str(caught.value)


@needs_data
@pytest.mark.parametrize("name", PATTERN_FILES)
def test_panels_of_real_patterns(name):
    """Border samples are border vertices, areas are exact, the worst angle is near the sharpest corner of its panel."""
    mesh = meshed(name)
    areas, angles = signed_areas(mesh), angles_degrees(mesh.material_coordinates)
    for panel_name, border in borders(mesh.pattern, 0.02).items():
        faces, first = mesh.faces[panel_name], mesh.vertices[panel_name].start
        outline = border_edges(mesh.triangles[faces])[0]
        assert set(np.unique(outline)) == set(range(first, first + len(border.points)))
        assert abs(areas[faces].sum() / abs(enclosed_area(border.points)) - 1) < 1e-12
        assert areas[faces].min() > 0
        least = min(sharpest_corner_degrees(border.points), BESIDE_SHORT_EDGES)
        assert angles[faces].min() >= 0.7 * least


@needs_data
def test_angles_of_all_real_patterns_together():
    angles = np.concatenate([angles_degrees(meshed(name).material_coordinates).ravel() for name in PATTERN_FILES])
    assert (angles > 20).mean() > 0.999


@needs_data
@pytest.mark.parametrize("name", PATTERN_FILES)
def test_sewn_topology_of_real_patterns(name):
    """One manifold piece of one front, with as many border loops as the garment has openings."""
    mesh = meshed(name)
    number = sewn_vertices(mesh, mesh.seams)
    sewn, count = number[mesh.triangles], int(number.max()) + 1
    assert len(np.unique(components(sewn, count))) == 1
    scattered = np.random.default_rng(0).random((count, 3))
    assert examine(name, scattered, sewn).findings == ()
    outline = border_edges(sewn)[0]
    assert len(np.unique(components(np.column_stack([outline, outline[:, 1]]), count)[outline])) == LOOPS[name]


def openings(name: str) -> int:
    """Border loops of a sewn garment from its file alone: corners that stitches join, and the edges in no stitch."""
    entries = json.loads((DATA / "patterns" / name).read_text())["pattern"]
    parent: dict[tuple[str, int], tuple[str, int]] = {}

    def root(corner: tuple[str, int]) -> tuple[str, int]:
        while parent.get(corner, corner) != corner:
            corner = parent[corner]
        return corner

    def ends(side: dict) -> list[tuple[str, int]]:
        return [(side["panel"], v) for v in entries["panels"][side["panel"]]["edges"][side["edge"]]["endpoints"]]

    sewn = set()
    for first, second, *right_wrong in entries["stitches"]:
        sewn |= {(side["panel"], side["edge"]) for side in (first, second)}
        for a, b in zip(ends(first), ends(second)[:: 1 if right_wrong else -1], strict=True):
            parent[root(a)] = root(b)
    free = [
        ends({"panel": panel, "edge": number})
        for panel, each in entries["panels"].items()
        for number in range(len(each["edges"]))
        if (panel, number) not in sewn
    ]
    corners = {root(corner) for pair in free for corner in pair}
    for a, b in free:
        parent[root(a)] = root(b)
    return len({root(corner) for corner in corners})


@needs_data
@pytest.mark.parametrize("name", PATTERN_FILES)
def test_openings_counted_from_the_file_alone(name):
    assert openings(name) == LOOPS[name]


def gathered(ratio: float) -> dict:
    """A band of 20 cm and a skirt that is longer by a ratio, sewn to it."""
    band = panel([[0, 0], [20, 0], [20, 4], [0, 4]])
    long = panel([[0, 0], [20 * ratio, 0], [20 * ratio, 20], [0, 20]])
    return specification({"band": band, "skirt": long}, [stitch(("band", 0), ("skirt", 2))])


@pytest.mark.parametrize(
    ("ratio", "size", "expected"), [(2.0, 0.02, 1), (2.0, 0.005, 0), (1.2, 0.02, 0), (1.3, 0.02, 1)]
)
def test_gathers_are_noted_with_the_size_that_they_need(ratio, size, expected):
    pattern = pattern_of(gathered(ratio))
    notes = mesh_pattern(pattern, size).pattern.notes
    assert len(notes) == expected
    found = gather_ratios(pattern)
    assert found == (pytest.approx({"band.0 to skirt.2": ratio}) if ratio >= 1.25 else {})
    if expected:
        needed = float(re.search(r"--size ([0-9.]+)mm", notes[0])[1])
        assert mesh_pattern(pattern, 0.99e-3 * needed).pattern.notes == ()


def test_the_longest_gathers_are_named_first():
    entries = gathered(1.5)
    more = gathered(3.0)["pattern"]
    entries["pattern"]["panels"] |= {f"other_{name}": each for name, each in more["panels"].items()}
    entries["pattern"]["stitches"] += [stitch(("other_band", 0), ("other_skirt", 2))]
    assert list(gather_ratios(pattern_of(entries)).values()) == pytest.approx([3.0, 1.5])


def necked(width: float) -> dict:
    """Two wide pieces joined by a neck `width` cm wide and 10 cm long, a side of which is sewn to another panel."""
    end = 10 + width
    loop = [[0, 0], [30, 0], [30, 10], [end, 10], [end, 20], [30, 20], [30, 30], [0, 30], [0, 20], [10, 20], [10, 10]]
    wide = [[0, 0], [20, 0], [20, 10], [0, 10]]
    panels = {"necked": panel([*loop, [0, 10]]), "wide": panel(wide)}
    return specification(panels, [stitch(("necked", 3), ("wide", 1))])


@pytest.mark.parametrize("width", [0.3, 0.6, 0.7])
def test_a_neck_has_finer_samples_on_both_sides_of_its_seam(width):
    mesh = mesh_pattern(pattern_of(necked(width)), 0.02)
    angles = angles_degrees(mesh.material_coordinates)
    assert angles[mesh.faces["necked"]].min() > 23
    assert angles[mesh.faces["wide"]].min() > 15
    counts = {side: len(rows) - 1 for side, rows in mesh.edges.items()}
    assert counts[Side("necked", 3)] == counts[Side("wide", 1)] == counts[Side("necked", 9)] > 5
    assert counts[Side("wide", 3)] == 5  # the far side of its partner stays
    lengths = np.linalg.norm(np.diff(mesh.panel_coordinates[mesh.edges[Side("necked", 3)]], axis=0), axis=1)
    assert lengths.max() < 2.5e-2 * width
    partner = np.linalg.norm(np.diff(mesh.panel_coordinates[mesh.edges[Side("wide", 1)]], axis=0), axis=1)
    assert np.allclose(lengths, partner[::-1], rtol=1e-9)


def test_a_panel_without_a_neck_has_even_samples():
    pattern = pattern_of(necked(8))
    assert not any(border.graded for border in borders(pattern, 0.02).values())
    even = {side: np.arange(count + 1) / count for side, count in segments(pattern, 0.02).items()}
    assert all(rows is even[side] for side, rows in with_necks(pattern, even).items())


def bowed(bow: float) -> dict:
    """Two squares of 20 cm behind one another, sewn at both sides, the back mirrored; the hems bow by a part of it."""
    square = [[0, 0], [20, 0], [20, 20], [0, 20]]
    panels = {"front": panel(square, translation=[0, 0, 10])}
    panels["back"] = panel([[-x, y] for x, y in square], translation=[20, 0, -10])
    for each in panels.values():
        each["edges"][0]["curvature"] = {"type": "quadratic", "params": [[0.5, 2 * bow]]}
    return specification(panels, [stitch(("front", 1), ("back", 3)), stitch(("front", 3), ("back", 1))])


def test_a_halved_mesh_is_the_same_surface_in_space_and_the_curves_of_its_pattern_at_rest():
    coarse = mesh_pattern(pattern_of(bowed(0.2)), 0.03, halvings=1)
    fine, parents = coarse.halved()
    assert fine.positions == pytest.approx(coarse.positions[parents].mean(axis=1))
    corners = fine.positions[fine.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    whole = coarse.positions[coarse.triangles]
    of_whole = np.linalg.norm(np.cross(whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]), axis=1)
    assert areas.reshape(-1, 4) == pytest.approx(np.tile(of_whole[:, None] / 4, 4))
    for side, rows in fine.edges.items():
        on_curve = fine.pattern.panels[side.panel].edge_points(side.edge, fine.fractions[side])
        assert fine.panel_coordinates[rows] == pytest.approx(on_curve, abs=1e-12)
        assert rows[::2].tolist() == [np.flatnonzero((parents == k).all(axis=1))[0] for k in coarse.edges[side]]
    for name, rows in fine.faces.items():
        own = fine.triangles[rows]
        assert {fine.vertices[name].start, fine.vertices[name].stop - 1} == {own.min(), own.max()}
        assert (signed_areas(fine)[rows] > 0).all()


def test_a_halved_mesh_has_the_material_of_its_panels_mirrored_as_before_and_joins_twice_the_segments():
    coarse = mesh_pattern(pattern_of(bowed(0.2)), 0.06)
    fine, parents = coarse.halved()
    material = {}
    for mesh in (coarse, fine):
        at = dict(zip(mesh.triangles.ravel().tolist(), mesh.material_coordinates.reshape(-1, 2).tolist(), strict=True))
        material[len(mesh.positions)] = np.array([at[k] for k in range(len(mesh.positions))])
    was, now = material.values()
    assert now[(parents[:, 0] == parents[:, 1])] == pytest.approx(was)
    assert np.sign(was[coarse.vertices["front"], 1].sum()) == np.sign(was[coarse.vertices["back"], 1].sum())
    assert [len(seam.pairs) for seam in fine.seams] == [2 * len(seam.pairs) - 1 for seam in coarse.seams]
    assert largest_gap(fine.positions, fine.seams[0]) == pytest.approx(largest_gap(coarse.positions, coarse.seams[0]))


@pytest.mark.parametrize(("flattest", "on_chord"), [(0.0, False), (1e9, True)])
def test_new_vertices_stay_on_their_chords_where_curves_would_flatten_triangles(monkeypatch, flattest, on_chord):
    monkeypatch.setattr(pattern_mesh, "FLATTEST", flattest)
    coarse = mesh_pattern(pattern_of(bowed(0.2)), 0.06)
    fine, parents = coarse.halved()
    middle = coarse.panel_coordinates[parents].mean(axis=1)
    off = np.linalg.norm(fine.panel_coordinates - middle, axis=1)
    assert (off.max() < 1e-12) == on_chord
    assert (off[parents[:, 0] == parents[:, 1]] < 1e-12).all()


def test_a_mesh_that_will_be_halved_keeps_the_seams_of_the_finer_one():
    strip = [[0, 0], [20, 0], [20, 0.8], [0, 0.8]]
    panels = {"left": panel(strip), "right": panel([[x + 21, y] for x, y in strip])}
    pattern = pattern_of(specification(panels, [stitch(("left", 1), ("right", 3))]))
    assert [len(mesh_pattern(pattern, *each).seams) for each in ((0.02,), (0.02, 1), (0.04,))] == [1, 1, 0]


def test_a_size_that_is_halved_is_refused_by_what_it_ends_at():
    with pytest.raises(InputError, match="vertices on its border at a size of 1e-06"):
        mesh_pattern(pattern_of(skirt()), 1e-6, halvings=16)
