"""Measurements: girths against closed forms and against sections of trimesh, areas, marker."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_bodies import person
from real_data import DATA, needs_data
from sewing_patterns import panel, skirt, specification, stitch
from sewn_tubes import tube

from clothsim.garments.dress.measurements import (
    areas_of_panels,
    ends_of,
    girth_along_cloth,
    girths,
    hem_of,
    level_line,
    marker,
    measurement_entries,
    open_darts,
    section,
    torso_girth,
)
from clothsim.garments.dress.sewing_state import as_placed
from clothsim.garments.inputs import BodyMesh, read_body_mesh
from clothsim.keys.fabric_table import FABRICS
from clothsim.mesh.weld import mean_of_parts
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of

BODIES = ("mean_all", "mean_all_tpose", "mean_female", "f_smpl_average_A40")
GARMENTCODE = {"chest": 0.9984, "waist": 0.8433, "hip": 1.0348}
"""Girths of mean_all as GarmentCode lists them (bust, waist, hips) [m]."""
UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    """The person of capsules."""
    return BodyMesh("person", *person(0.05), 1.0, ())


def test_section_of_a_tetrahedron():
    points, segments = section(
        np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0, 1, 0]], float),
        np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]]),
        UP,
        0.5,
    )
    assert sorted(points.tolist()) == [[0, 0.5, 0], [0, 0.5, 0.5], [0.5, 0.5, 0]]
    assert sorted(map(sorted, segments.tolist())) == [[0, 1], [0, 2], [1, 2]]


def test_girths_of_a_tube(body):
    state = tube(0.3, 0.6, 1.4)
    for girth in girths(state, body):
        assert np.isclose(girth.garment, 2 * np.pi * 0.3, rtol=0.01)
        assert np.isclose(girth.outline, girth.garment, rtol=0.005)
        assert girth.ease == girth.garment - girth.body
    assert [girth.name for girth in girths(state, body)] == ["chest", "waist", "hip", "hem"]
    length, level = hem_of(state, body)
    assert np.isclose(length, 2 * np.pi * 0.3, rtol=0.01)
    assert np.isclose(level, 0.6)


def folded(state, radius, depth, folds):
    """A tube bent without stretch, so that its section is a star of as many folds."""
    angle = np.linspace(0, 2 * np.pi, 20001)
    curve = (1 + depth * np.cos(folds * angle)) * np.array([np.sin(angle), np.cos(angle)])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve), axis=0))])
    curve *= 2 * np.pi * radius / along[-1]
    x, y, z = state.positions.T
    share = np.arctan2(x, z) % (2 * np.pi) / (2 * np.pi)
    a, b = (np.interp(share, along / along[-1], row) for row in curve)
    return state.moved_to(np.column_stack([a, y, b]))


def test_folds_change_the_outline_and_not_the_cloth(body):
    smooth = tube(0.3, 0.6, 1.4)
    worn = folded(smooth, 0.3, 0.15, 6)
    for before, after in zip(girths(smooth, body), girths(worn, body), strict=True):
        assert np.isclose(after.garment, before.garment, rtol=0.02)  # chords across the folds
        assert after.outline < 0.95 * before.outline
        assert after.ease == after.garment - after.body


def test_a_garment_that_sank_is_measured_where_its_cloth_is_worn(body):
    """A cone of cloth, 8 cm down: at a level of the body lies cloth that was placed 8 cm above it."""
    state = tube(0.3, 0.6, 1.4)
    slope = 0.5
    x, y, z = state.mesh.positions.T
    placed = np.column_stack([x * (1 + slope * (1.4 - y)), y, z * (1 + slope * (1.4 - y))])
    flat = state.mesh.panel_coordinates * [1, 1]
    flat[:, 0] *= 1 + slope * (0.8 - flat[:, 1])
    mesh = replace(state.mesh, positions=placed, panel_coordinates=flat)
    cone = replace(state, mesh=mesh, positions=mean_of_parts(placed, state.number))
    sunk = cone.moved_to(cone.positions - [0, 0.08, 0])
    at = {level: girth_along_cloth(cone, body, level) for level in (1.0, 1.08)}
    assert np.isclose(girth_along_cloth(sunk, body, 1.0), at[1.08], rtol=1e-3)
    assert np.isclose(at[1.0], 2 * np.pi * 0.3 * (1 + slope * 0.4), rtol=0.01)
    assert girth_along_cloth(sunk, body, 1.5) == 0.0


def test_a_chest_is_measured_below_the_armholes(body):
    """Panels with a notch at one upper corner, bent to a tube: lines through it do not go round the body."""
    radius, low = 0.3, 0.6
    half = 100 * np.pi * radius
    notched = [[0, 0], [half, 0], [half, 50], [half - 25, 50], [half - 25, 80], [0, 80]]
    entries = specification({"front": panel(notched), "back": panel(notched)}, [stitch(("front", 1), ("back", 5))])
    mesh = mesh_pattern(pattern_of(entries), 0.04)
    positions = mesh.positions.copy()
    for name, turn in (("front", 0.0), ("back", np.pi)):
        x, y = mesh.panel_coordinates[mesh.vertices[name]].T
        angle = x / radius + turn
        positions[mesh.vertices[name]] = np.column_stack([radius * np.sin(angle), low + y, radius * np.cos(angle)])
    state = as_placed(replace(mesh, positions=positions))
    whole = 2 * np.pi * radius
    assert np.isclose(girth_along_cloth(state, body, low + 0.3), whole, rtol=0.01)
    assert girth_along_cloth(state, body, low + 0.7) == 0.0
    assert np.isclose(girth_along_cloth(state, body, low + 0.7, highest=True), whole, rtol=0.01)


def sewn_tube(outline, radius, low, seams):
    """Two panels of `outline` [cm], bent to a tube and sewn at `seams`: pairs of edges of front and back."""
    stitches = [stitch(("front", a), ("back", b)) for a, b in seams]
    mesh = mesh_pattern(pattern_of(specification({"front": panel(outline), "back": panel(outline)}, stitches)), 0.03)
    positions = mesh.positions.copy()
    for name, turn in (("front", 0.0), ("back", np.pi)):
        x, y = mesh.panel_coordinates[mesh.vertices[name]].T
        angle = x / radius + turn
        positions[mesh.vertices[name]] = np.column_stack([radius * np.sin(angle), low + y, radius * np.cos(angle)])
    return as_placed(replace(mesh, positions=positions)).weld(range(len(stitches)))


def test_a_line_through_deep_narrow_armholes_is_no_girth(body):
    """Armholes as narrow as a sector of `goes_round`: lines through them seem to go round, and lack 12 cm each."""
    radius, low = 0.3, 0.6
    half = 100 * np.pi * radius
    holed = [[0, 0], [half, 0], [half, 20], [half - 6, 25], [half - 6, 80], [6, 80], [6, 25], [0, 20]]
    state = sewn_tube(holed, radius, low, [(1, 7), (7, 1)])
    whole = 2 * np.pi * radius
    assert np.isclose(girth_along_cloth(state, body, low + 0.1), whole, rtol=0.01)
    assert girth_along_cloth(state, body, low + 0.6) == 0.0
    assert np.isclose(girth_along_cloth(state, body, low + 0.6, highest=True), whole, rtol=0.01)


def test_a_wavy_hem_of_a_short_skirt_is_measured_along_all_of_it(body):
    """A frill of waves of 10 cm under 7 cm of plain tube."""
    radius = 0.3
    half, waves = 100 * np.pi * radius, 6
    hem = [[half * k / (8 * waves), 5 * (1 - np.cos(np.pi * k / 4))] for k in range(8 * waves + 1)]
    state = sewn_tube(
        [*hem, [half, 17], [0, 17]], radius, 0.9, [(len(hem) - 1, len(hem) + 1), (len(hem) + 1, len(hem) - 1)]
    )
    length = np.linalg.norm(np.diff(hem, axis=0), axis=1).sum() / 100
    assert hem_of(state, body)[0] == pytest.approx(2 * length, rel=1e-3)


def test_level_line_of_a_linear_function():
    points = np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]])
    edges, fractions = level_line(points @ [1.0, 2.0], np.array([[0, 1, 2], [0, 2, 3]]), 1.0)
    ends = ends_of(edges, fractions, np.column_stack([points, np.zeros(4)]))
    assert ends.shape == (2, 2, 3)
    assert np.allclose(ends[:, :, :2] @ [1.0, 2.0], 1.0)
    assert np.isclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum(), np.hypot(1, 0.5))


def test_sleeves_do_not_count(body):
    sleeve = {"sleeve": panel([[0, 0], [90, 0], [90, 130], [0, 130]], translation=[-45, 10, 60], label="arm")}
    with_sleeve = [(girth.name, girth.level, girth.garment) for girth in girths(tube(0.3, 0.6, 1.4, sleeve), body)]
    assert with_sleeve == [(girth.name, girth.level, girth.garment) for girth in girths(tube(0.3, 0.6, 1.4), body)]


def test_areas_and_marker():
    pattern = pattern_of(skirt())
    state = as_placed(mesh_pattern(pattern, 0.02))
    assert areas_of_panels(state) == pytest.approx({"front": 0.02, "back": 0.02}, rel=1e-12)
    assert marker(pattern) == pytest.approx((1.4, 0.21))
    many = specification({f"p{k}": panel([[0, 0], [60, 0], [60, 10 + k], [0, 10 + k]]) for k in range(4)})
    assert marker(pattern_of(many)) == pytest.approx((1.4, 0.14 + 0.12))
    wide = specification({"a": panel([[0, 0], [200, 0], [200, 10], [0, 10]])})
    assert marker(pattern_of(wide)) == pytest.approx((2.01, 0.11))


def test_entries_are_numbers(body):
    state = tube(0.3, 0.6, 1.4)
    fabrics = dict.fromkeys(state.mesh.faces, FABRICS["cotton"])
    entries = measurement_entries(state, body, fabrics)
    assert np.isclose(entries["mass"], 0.15 * entries["cloth_area"])
    assert 0 < entries["marker"]["use"] < 1
    assert np.isclose(entries["cloth_area"], 2 * np.pi * 0.3 * 0.8, rtol=1e-12)


@needs_data
@pytest.mark.parametrize("name", BODIES)
def test_girths_against_sections_of_trimesh(name):
    """The loop round the axis by trimesh's own section, joined by position; the arms are loops of their own."""
    trimesh = pytest.importorskip("trimesh")
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import ConvexHull, cKDTree

    body = read_body_mesh(DATA / "bodies" / f"{name}.obj")
    low, height = body.positions[:, 1].min(), np.ptp(body.positions[:, 1])
    mesh = trimesh.Trimesh(body.positions, body.triangles, process=False)
    for share in (0.49, 0.52, 0.62, 0.65, 0.7, 0.72, 0.745):
        level = low + share * height
        points = trimesh.intersections.mesh_plane(mesh, UP, level * UP).reshape(-1, 3)
        pairs = cKDTree(points).query_pairs(1e-7, output_type="ndarray")
        ends = np.arange(0, len(points), 2)
        pairs = np.concatenate([pairs, np.column_stack([ends, ends + 1])])
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
        loops = connected_components(graph, directed=False)[1]
        around = [
            hull.area
            for hull in (ConvexHull(points[loops == loop][:, [0, 2]]) for loop in np.unique(loops))
            if (hull.equations[:, 2] < 0).all()
        ]
        assert len(around) == 1
        assert np.isclose(torso_girth(body, level), around[0], rtol=1e-9)


@needs_data
def test_girths_of_a_body_whose_girths_are_listed():
    body = read_body_mesh(DATA / "bodies" / "mean_all.obj")
    low, height = body.positions[:, 1].min(), np.ptp(body.positions[:, 1])
    state = tube(0.3, low + 0.4 * height, low + 0.8 * height)
    found = {girth.name: girth.body for girth in girths(state, body)}
    assert all(np.isclose(found[name], listed, rtol=0.01) for name, listed in GARMENTCODE.items())


def test_the_hem_of_one_leg_is_compared_with_that_leg(body):
    level = 0.3
    low = body.positions[np.abs(body.positions[:, 1] - level) < 0.06]
    right = low[low[:, 0] > 0].mean(axis=0)
    state = tube(0.12, level, 0.7)
    one = replace(state, positions=state.positions + right * [1, 0, 1])
    hems = [next(girth for girth in girths(each, body) if girth.name == "hem") for each in (one, tube(0.4, level, 0.7))]
    assert np.isclose(hems[0].garment, 2 * np.pi * 0.12, rtol=0.01)
    assert hems[0].body < hems[0].garment  # it is round the leg
    assert hems[1].body > 1.5 * hems[0].body  # that of a skirt is round both


def test_the_hem_of_an_open_front_ends_at_the_opening(body):
    mesh_of_tube = tube(0.3, 0.6, 1.4)
    opened = replace(as_placed(mesh_of_tube.mesh), positions=mesh_of_tube.mesh.positions).weld([0])
    assert np.isclose(hem_of(opened, body)[0], 2 * np.pi * 0.3, rtol=0.01)
    assert np.isclose(hem_of(opened, body)[1], 0.6, atol=0.02)


def test_a_slit_is_no_part_of_the_hem(body):
    slit = [[-30, 0], [-1, 0], [0, 20], [1, 0], [30, 0], [30, 60], [-30, 60]]
    slanted = [[30, 5], [-30, -15], [-30, 60], [30, 60]]
    panels = {"front": panel(slit, translation=[0, 50, 20]), "back": panel(slanted, translation=[0, 50, -20])}
    sides = [stitch(("front", 4), ("back", 3)), stitch(("front", 6), ("back", 1))]
    state = as_placed(mesh_pattern(pattern_of(specification(panels, sides)), 0.03))
    state = state.weld(range(2))
    assert hem_of(state, body)[0] == pytest.approx(2 * 0.29 + np.hypot(0.6, 0.2), abs=1e-3)


def test_a_hem_of_points_is_measured_along_them(body):
    """Of a skirt so short that its points, of 50 degrees, make more than half of its height."""
    points = [[5 * k - 30, 6 * (k % 2)] for k in range(13)]
    panels = {
        name: panel([[way * x, y] for x, y in (*points, [30, 10], [-30, 10])], translation=[0, 100, 20 * way])
        for name, way in (("front", 1), ("back", -1))
    }
    sides = [stitch(("front", 12), ("back", 14)), stitch(("front", 14), ("back", 12))]
    state = as_placed(mesh_pattern(pattern_of(specification(panels, sides)), 0.03)).weld(range(2))
    length, level = hem_of(state, body)
    assert length == pytest.approx(24 * np.hypot(0.05, 0.06), abs=1e-3)
    assert level == pytest.approx(1.03, abs=2e-3)


def test_only_darts_that_open_upward_hide_cloth_from_a_level_line():
    at_the_side = [[0, 0], [40, 0], [40, 20], [30, 22], [40, 24], [40, 44], [0, 44]]
    upright = [[0, 0], [18, 0], [20, 12], [22, 0], [40, 0], [40, 44], [0, 44]]
    found = [
        open_darts(mesh_pattern(pattern_of(specification({"front": panel(loop)}, [stitches])), 0.03), UP)
        for loop, stitches in (
            (at_the_side, stitch(("front", 2), ("front", 3))),
            (upright, stitch(("front", 1), ("front", 2))),
        )
    ]
    assert np.allclose(found[0], [[0.2, 0.24]])
    assert len(found[1]) == 0
