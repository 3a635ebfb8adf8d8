"""Displacement fields of patterns, and gradients by the corners of panels."""

import numpy as np
import pytest
from sewing_patterns import panel, skirt, specification

from clothsim import Cloth, InputError, Scene
from clothsim.gradients.losses import Height
from clothsim.gradients.pattern_numbers import control_gradient, pattern_field, pattern_gradient
from clothsim.gradients.run import traced
from clothsim.patterns.pattern import Side
from clothsim.patterns.pattern_mesh import mesh_pattern
from clothsim.patterns.specification import pattern_of


@pytest.mark.parametrize("name", ["front", "back"])
def test_affine_displacements_are_exact(name):
    """Both panels, of which one is seen from behind: a stretch of the panel stretches the material alike."""
    mesh = mesh_pattern(pattern_of(skirt()), 0.02)
    stretch = np.array([[0.1, 0.3], [0.0, -0.2]])
    field = pattern_field(mesh, {name: mesh.pattern.panels[name].vertices @ stretch})
    other = "back" if name == "front" else "front"
    assert not field[mesh.faces[other]].any()
    faces = mesh.faces[name]
    corners, coordinates = mesh.triangles[faces], mesh.material_coordinates[faces]
    points = mesh.panel_coordinates[corners]
    for t in range(len(corners)):
        edges, moved = np.diff(points[t], axis=0), np.diff(points[t] @ stretch, axis=0)
        old, new = np.diff(coordinates[t], axis=0), np.diff(coordinates[t] + 1e-3 * field[faces][t], axis=0)
        np.testing.assert_allclose(new @ new.T - old @ old.T, 1e-3 * (edges @ moved.T + moved @ edges.T), atol=1e-9)


def test_a_curved_edge_moves_with_its_ends():
    entries = panel()
    entries["edges"][0]["curvature"] = [0.5, -0.2]
    pattern = pattern_of(specification({"front": entries}))
    mesh, name = mesh_pattern(pattern, 0.02), "front"
    moves = np.random.default_rng(0).standard_normal(pattern.panels[name].vertices.shape)
    field = pattern_field(mesh, {name: moves})
    edge, curve = pattern.panels[name].edges[0], pattern.panels[name].edges[0].curve
    corners = pattern.panels[name].vertices
    share = np.linspace(0, 1, 5)
    ends = [corners[[edge.start, edge.end]] + sign * 1e-6 * moves[[edge.start, edge.end]] for sign in (1, -1)]
    wanted = np.subtract(*(curve.by_length(*each, share) for each in ends)) / 2e-6
    turn = np.diff(moves[[edge.start, edge.end]] @ [1, 1j]) / np.diff(corners[[edge.start, edge.end]] @ [1, 1j])
    points = curve.by_length(*corners[[edge.start, edge.end]], share) @ [1, 1j]
    found = moves[edge.start] @ [1, 1j] + turn * (points - corners[edge.start] @ [1, 1j])
    np.testing.assert_allclose(found, wanted @ [1, 1j], atol=1e-6)
    assert np.isfinite(field).all()


def hanging(mesh, change=0.0, moves=None, field=None):
    rest = mesh.material_coordinates
    if moves is not None:
        field = pattern_field(mesh, {"front": moves})
    if field is not None:
        rest = rest + change * field
    top = np.flatnonzero(mesh.panel_coordinates[:, 1] > 0.2 - 1e-9)
    cloth = Cloth(mesh.positions, mesh.triangles, rest=rest, fabric="cotton", youngs_modulus=1e5)
    effects = {"membrane": {}, "bending": {}, "gravity": {"acceleration": [0.0, -9.81, 0.0]}}
    effects["pins"] = {"select": top.tolist()}
    solver = {"dt": 0.05, "threads": 1, "linear": "superlu"}
    return Scene(cloth, effects=effects, solver=solver, run={"duration": 0.1, "frames_per_second": 20})


def test_the_gradient_by_the_corners_of_a_panel():
    mesh = mesh_pattern(pattern_of(specification({"front": panel()})), 0.03)
    loss = Height(direction=(0.0, 1.0, 0.0))
    gradient = traced(hanging(mesh)).gradient(loss)
    by_corners = pattern_gradient(gradient, mesh, "front")
    moves = np.random.default_rng(1).standard_normal(by_corners.shape)
    values = [traced(hanging(mesh, sign * 1e-5, moves)).gradient(loss).value for sign in (1, -1)]
    assert float(np.vdot(by_corners, moves)) == pytest.approx((values[0] - values[1]) / 2e-5, rel=1e-5)


def test_what_is_no_panel():
    mesh = mesh_pattern(pattern_of(skirt()), 0.05)
    for moves in ({"sleeve": np.zeros((4, 2))}, {"front": np.zeros((3, 2))}):
        with pytest.raises(InputError):
            pattern_field(mesh, moves)


def test_the_gradient_by_control_points():
    entries = panel()
    entries["edges"][0]["curvature"] = {"type": "cubic", "params": [[0.3, 0.1], [0.6, -0.2]]}
    mesh = mesh_pattern(pattern_of(specification({"front": entries})), 0.03)
    loss, side = Height(direction=(0.0, 1.0, 0.0)), Side("front", 0)
    gradient = traced(hanging(mesh)).gradient(loss)
    by_controls = control_gradient(gradient, mesh, "front", 0)
    moves = np.random.default_rng(2).standard_normal((2, 2))
    field = pattern_field(mesh, {}, {side: moves})
    values = [traced(hanging(mesh, sign * 1e-5, field=field)).gradient(loss).value for sign in (1, -1)]
    assert float(np.vdot(by_controls, moves)) == pytest.approx((values[0] - values[1]) / 2e-5, rel=1e-5)
    with pytest.raises(InputError):
        control_gradient(gradient, mesh, "front", 1)
    with pytest.raises(InputError):
        pattern_field(mesh, {}, {side: moves[:1]})


NECKED = [[0, 0], [30, 0], [30, 10], [10.3, 10], [10.3, 20], [30, 20], [30, 30], [0, 30], [0, 20], [10, 20], [10, 10]]


@pytest.mark.parametrize(
    ("entries", "number", "controls"),
    [(panel(), 0, [[0.3, 0.1], [0.6, -0.2]]), (panel([*NECKED, [0, 10]]), 3, [[0.3, -0.15], [0.7, -0.15]])],
)
def test_control_points_that_follow_their_ends(entries, number, controls):
    """An affine displacement of vertices and control points is one of the whole panel, also with uneven samples."""
    entries["edges"][number]["curvature"] = {"type": "cubic", "params": controls}
    mesh = mesh_pattern(pattern_of(specification({"front": entries})), 0.03)
    side = Side("front", number)
    uneven = np.ptp(np.diff(mesh.fractions[side])) > 1e-3
    assert uneven == (number == 3)
    corners, edge = mesh.pattern.panels["front"].vertices, mesh.pattern.panels["front"].edges[number]
    controls = edge.curve.points(corners[edge.start], corners[edge.end])[1:-1]
    stretch = np.array([[0.1, 0.3], [0.0, -0.2]])
    field = pattern_field(mesh, {"front": corners @ stretch}, {side: controls @ stretch})
    moved = mesh.panel_coordinates[mesh.triangles] @ stretch
    material = mesh.panel_coordinates[mesh.triangles].reshape(-1, 2)
    to_material = np.linalg.lstsq(material, mesh.material_coordinates.reshape(-1, 2), rcond=None)[0]
    np.testing.assert_allclose(field, moved @ to_material, atol=1e-8)
