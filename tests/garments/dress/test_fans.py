"""Fans of half a turn or more lie in waves round the body, unstrained and out of its way; others stay."""

import numpy as np
import pytest
from sewing_patterns import panel, specification, stitch

from clothsim.engine import intersecting_pairs
from clothsim.garments.dress import fans
from clothsim.garments.dress.fans import fan_of, folded_fans, widest_fan
from clothsim.garments.dress.limbs import Wearer
from clothsim.garments.dress.rings import arms_between
from clothsim.garments.dress.sewing_state import as_placed, crosses_body
from clothsim.garments.inputs import BodyMesh
from clothsim.mesh.generators.table import GENERATORS
from clothsim.patterns.pattern_mesh import PatternMesh, mesh_pattern
from clothsim.patterns.specification import pattern_of
from transfer.signed_distance import body_surface

HALF_WAIST, LENGTH = 45.0, 50.0
"""Length of the inner edge and of the sides of a fan [cm]."""


@pytest.fixture(scope="module")
def wearer() -> Wearer:
    """The mannequin of the package, y upward."""
    positions, triangles = GENERATORS["mannequin"]()
    body = BodyMesh("mannequin", positions[:, [0, 2, 1]] * [1, 1, -1], triangles, 1.0, ())
    return Wearer(body, body_surface(body.positions, body.triangles))


def fan(degrees: float, **place):
    """A panel whose inner edge, its first, turns by an angle; its middle is below its centre."""
    radius = HALF_WAIST / np.radians(degrees)
    ends = np.radians(-90 + degrees / 2 * np.array([-1, 1]))
    around = np.column_stack([np.cos(ends), np.sin(ends)])
    entries = panel([*(radius * around).tolist(), *((radius + LENGTH) * around[::-1]).tolist()], **place)
    large = int(degrees > 180)
    entries["edges"][0]["curvature"] = {"type": "circle", "params": [radius, large, 1]}
    entries["edges"][2]["curvature"] = {"type": "circle", "params": [radius + LENGTH, large, 0]}
    return entries


def skirt(degrees: float, level: float = 95.0) -> PatternMesh:
    """Two fans below a band whose lower edge is at a level [cm]."""
    half = HALF_WAIST / 2
    band = [[-half, 0], [half, 0], [half, 4], [-half, 4]]
    panels, stitches = {}, []
    for part, z in (("front", 25), ("back", -25)):
        panels[f"band_{part}"] = panel(band, translation=[0, level, z])
        panels[f"skirt_{part}"] = fan(degrees, translation=[0, level, z])
        stitches.append(stitch((f"band_{part}", 0), (f"skirt_{part}", 0)))
    stitches += [
        stitch((f"{piece}_front", k), (f"{piece}_back", k), "right_wrong")
        for piece in ("band", "skirt")
        for k in (1, 3)
    ]
    return mesh_pattern(pattern_of(specification(panels, stitches)), 0.03)


@pytest.mark.parametrize("degrees", [200, 300, 340])
def test_a_wide_fan_is_folded_round_the_body(wearer, degrees):
    mesh = skirt(degrees)
    sides = [seam for seam in mesh.seams if "skirt_front" in seam.name and "skirt_back" in seam.name]
    assert any(crosses_body(mesh.positions[seam.pairs], wearer.surface).any() for seam in sides)
    folded, notes = folded_fans(mesh, wearer.body, wearer.surface)
    state = as_placed(folded)
    assert len(notes) == 2
    assert not len(intersecting_pairs(state.positions, state.triangles))
    assert arms_between(state, wearer) == ()
    for name, rows in mesh.vertices.items():
        if "band" in name:
            assert np.array_equal(folded.positions[rows], mesh.positions[rows])
            continue
        assert np.allclose(np.percentile(state.stretches()[mesh.faces[name]], (25, 50, 75)), 1, atol=0.1)
        points = folded.positions[rows]
        inner = points[fan_of(mesh, name).inner]
        assert np.allclose(inner[:, 1], 0.92, atol=1e-9)
        assert points[:, 1].max() < 0.95
        assert np.abs(points[:, 0].min() + points[:, 0].max()) < 0.05
        assert np.all(points[:, 2] * mesh.positions[rows][0, 2] > 0)


def test_a_fan_is_measured_from_its_inner_edge():
    mesh = skirt(300)
    found = fan_of(mesh, "skirt_front")
    assert np.isclose(found.turn, np.radians(300), rtol=1e-9)
    assert np.isclose(found.radius * found.turn, 0.45, rtol=1e-9)
    assert np.isclose(found.distance.max() - found.radius, 0.5, rtol=1e-9)
    assert np.isclose(np.abs(found.angle).max(), np.radians(150), rtol=1e-9)
    assert fan_of(mesh, "band_front") is None


@pytest.mark.parametrize(("apart", "turn"), [(0.0, 300.0), (0.012, 300.0), (0.06, 150.0)])
def test_a_fan_whose_inner_edge_is_two_arcs_is_measured_from_both(apart, turn):
    """As of a graded waist: the centres of the halves lie apart [m]; halves that lie far apart are no one edge."""
    angles = np.radians(np.linspace(0, 150, 40))
    halves = [np.column_stack([sign * np.sin(angles), -np.cos(angles)]) for sign in (1, -1)]
    inner = [0.085 * half + [sign * apart / 2, 0.0] for sign, half in zip((1, -1), halves, strict=True)]
    sides = [np.linspace(line[-1], 0.5 * half[-1], 9) for line, half in zip(inner, halves, strict=True)]
    points = np.concatenate([*inner, *sides, *(half * 0.5 for half in halves)])
    found = widest_fan(points, np.split(np.arange(98), [40, 80, 89]))
    assert np.degrees(found.turn) == pytest.approx(turn, rel=0.03)


@pytest.mark.parametrize("degrees", [60, 120])
def test_a_narrow_fan_stays(wearer, degrees):
    mesh = skirt(degrees)
    folded, notes = folded_fans(mesh, wearer.body, wearer.surface)
    assert notes == ()
    assert np.array_equal(folded.positions, mesh.positions)


def test_a_fan_above_the_chest_is_a_collar(wearer):
    mesh = skirt(300, level=150.0)
    assert folded_fans(mesh, wearer.body, wearer.surface)[1] == ()


def test_a_fold_that_leaves_most_strings_in_the_body_is_not_made(wearer):
    mesh = skirt(300)
    wide = BodyMesh("wide", wearer.body.positions * [2.5, 1, 1], wearer.body.triangles, 1.0, ())
    folded, notes = folded_fans(mesh, wide, body_surface(wide.positions, wide.triangles))
    assert notes == ()
    assert np.array_equal(folded.positions, mesh.positions)


@pytest.mark.parametrize(("after", "made"), [(1, True), (2, True), (3, False)])
def test_a_fold_after_which_more_strings_cross_the_body_is_not_made(wearer, monkeypatch, after, made):
    mesh, counts = skirt(300), []

    def crosses(pairs, surface):
        counts.append(2 if len(counts) % 2 == 0 else after)
        return np.arange(len(pairs)) < counts[-1]

    monkeypatch.setattr(fans, "crosses_body", crosses)
    folded, notes = folded_fans(mesh, wearer.body, wearer.surface)
    assert len(notes) == (2 if made else 0)
    assert np.array_equal(folded.positions, mesh.positions) != made
