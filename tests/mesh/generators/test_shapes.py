"""Generated meshes against closed forms: area, volume, Euler characteristic, border, winding, smallest angle."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.mesh.checks import examine
from clothsim.mesh.generators.shapes import capsule, cone, disk, pillow, rectangle, slab, sphere, tube
from clothsim.mesh.generators.table import GENERATORS
from clothsim.mesh.topology import border_edges, unique_edges

DIAGONALS = ("right", "alternating", "crisscross", "delaunay")
CLOSED = ("pillow", "sphere", "slab", "capsule", "cone", "ring")
STANDING = ("mannequin", "shirt", "skirt", "trousers")
"""Not centred: they are where they stand, and have tests of their own."""
SMALL = {
    "rectangle": {"size": (0.7, 0.4), "cells": (6, 5)},
    "disk": {"radius": 0.3, "cells": 4},
    "tube": {"radius": 0.2, "height": 0.5, "cells": (10, 4)},
    "pillow": {"radius": 0.3, "cells": 4, "gap": 0.01},
    "sphere": {"radius": 0.3, "subdivisions": 2},
    "slab": {"size": (0.5, 0.3, 0.1), "cells": (3, 2, 1)},
    "capsule": {"radius": 0.1, "height": 0.5, "segments": 12},
    "cone": {"radius": 0.1, "height": 0.2, "segments": 8},
    "ring": {"radius": 0.1, "thickness": 0.08, "segments": 8, "around": 6, "stretch": 0.05},
}


def normals(positions, triangles):
    corners = positions[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def area(positions, triangles):
    return 0.5 * np.linalg.norm(normals(positions, triangles), axis=1).sum()


def volume(positions, triangles):
    return np.einsum("ij,ij->", positions[triangles[:, 0]], normals(positions, triangles)) / 6


def smallest_angle(positions, triangles):
    corners = positions[triangles]
    angles = []
    for k in range(3):
        one, two = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angles.append(np.arctan2(np.linalg.norm(np.cross(one, two), axis=1), (one * two).sum(axis=1)))
    return np.min(angles)


def euler(positions, triangles):
    return len(positions) - len(unique_edges(triangles)) + len(triangles)


@pytest.mark.parametrize("name", [name for name in GENERATORS if name not in STANDING])
@pytest.mark.parametrize("keywords", ["default", "small"])
def test_every_mesh_is_sound_centred_and_typed(name, keywords):
    positions, triangles = GENERATORS[name](**(SMALL[name] if keywords == "small" else {}))
    assert positions.dtype == np.float64
    assert triangles.dtype == np.int64
    assert positions.shape[1:] == triangles.shape[1:] == (3,)
    assert examine(name, positions, triangles).findings == ()
    np.testing.assert_allclose(positions.min(axis=0) + positions.max(axis=0), 0, atol=1e-12)
    expected = {"rectangle": 1, "disk": 1, "tube": 0, "ring": 0}.get(name, 2)
    assert euler(positions, triangles) == expected
    assert (len(border_edges(triangles)[0]) == 0) == (name in CLOSED)


@pytest.mark.parametrize("name", CLOSED)
def test_closed_bodies_face_outward(name):
    positions, triangles = GENERATORS[name](**SMALL[name])
    assert volume(positions, triangles) > 0
    centres = positions[triangles].mean(axis=1)
    if name == "ring":  # from the middle of its bar
        around = centres[:, :2] / np.linalg.norm(centres[:, :2], axis=1, keepdims=True)
        centres[:, :2] -= 0.1 * around + 0.025 * np.sign(centres[:, :1]) * [1.0, 0.0]
    outward = np.einsum("ij,ij->i", normals(positions, triangles), centres)
    assert (outward > 0).all()


@pytest.mark.parametrize("diagonals", DIAGONALS)
@pytest.mark.parametrize("cells", [(1, 1), (7, 1), (4, 6), (24, 24)])
def test_rectangle_covers_its_area_facing_up(diagonals, cells):
    positions, triangles = rectangle((2.0, 0.5), cells, diagonals)
    facing = normals(positions, triangles)
    assert (facing[:, 2] > 0).all()
    assert area(positions, triangles) == pytest.approx(1.0, rel=1e-14)
    assert (positions[:, 2] == 0).all()
    assert euler(positions, triangles) == 1
    border = border_edges(triangles)[0]
    assert len(border) == 2 * sum(cells)
    assert (np.abs(positions[np.unique(border), :2]) == (1.0, 0.25)).any(axis=1).all()
    n_triangles = 4 * cells[0] * cells[1] if diagonals == "crisscross" else 2 * cells[0] * cells[1]
    assert len(triangles) == n_triangles


def test_rectangle_diagonals_differ_as_named():
    right, alternating = (rectangle((2, 2), (2, 2), diagonals)[1] for diagonals in ("right", "alternating"))
    assert {(0, 4), (1, 5), (3, 7), (4, 8)} <= set(map(tuple, unique_edges(right)))
    assert {(0, 4), (2, 4), (4, 6), (4, 8)} <= set(map(tuple, unique_edges(alternating)))


def test_delaunay_rectangle_is_irregular_decent_and_always_the_same():
    positions, triangles = rectangle((1, 1), (30, 30), "delaunay")
    again = rectangle((1, 1), (30, 30), "delaunay")
    np.testing.assert_array_equal(positions, again[0])
    np.testing.assert_array_equal(triangles, again[1])
    assert np.radians(20) < smallest_angle(positions, triangles) < np.radians(40)
    valence = np.bincount(triangles.ravel())
    assert valence.max() > 6


def test_a_pillow_is_two_disks_joined_at_their_rim():
    positions, triangles = pillow(radius=0.3, cells=5, gap=0.01)
    flat, half = disk(radius=0.3, cells=5)
    assert np.array_equal(positions[: len(flat), :2], flat[:, :2])
    assert len(positions) == 2 * len(flat) - 30
    assert len(triangles) == 2 * len(half)
    rim = np.hypot(*positions[:, :2].T) > 0.3 - 1e-12
    assert rim.sum() == 30
    assert not positions[rim, 2].any()
    assert np.ptp(positions[:, 2]) == pytest.approx(0.01)
    assert volume(positions, triangles) == pytest.approx(np.pi * 0.3**2 * 0.01 / 2, rel=0.05)


@pytest.mark.parametrize("rings", [1, 2, 7])
def test_disk_is_the_inscribed_polygon(rings):
    positions, triangles = disk(0.4, rings)
    corners = 6 * rings
    assert (len(positions), len(triangles)) == (1 + 3 * rings * (rings + 1), 6 * rings**2)
    assert area(positions, triangles) == pytest.approx(0.5 * corners * 0.16 * np.sin(2 * np.pi / corners), rel=1e-13)
    assert (normals(positions, triangles)[:, 2] > 0).all()
    assert smallest_angle(positions, triangles) > np.radians(40)


def test_tube_is_the_inscribed_prism_facing_outward():
    positions, triangles = tube(0.2, 0.6, (12, 5))
    assert area(positions, triangles) == pytest.approx(12 * 2 * 0.2 * np.sin(np.pi / 12) * 0.6, rel=1e-13)
    np.testing.assert_allclose(np.hypot(*positions[:, :2].T), 0.2, rtol=1e-14)
    assert (positions[:, 2].min(), positions[:, 2].max()) == (-0.3, 0.3)
    outward = normals(positions, triangles)[:, :2] * positions[triangles].mean(axis=1)[:, :2]
    assert (outward.sum(axis=1) > 0).all()
    assert len(border_edges(triangles)[0]) == 24


def test_tube_with_a_top_radius_is_a_frustum():
    positions, triangles = tube(0.1, 0.4, (12, 5), top_radius=0.3)
    flat = 12 * np.sin(np.pi / 12) * (0.1 + 0.3) * np.hypot(0.4, 0.2 * np.cos(np.pi / 12))
    assert area(positions, triangles) == pytest.approx(flat, rel=1e-13)
    outward = normals(positions, triangles)[:, :2] * positions[triangles].mean(axis=1)[:, :2]
    assert (outward.sum(axis=1) > 0).all()


def test_cone_is_the_inscribed_pyramid_with_its_tip_up():
    positions, triangles = cone(0.1, 0.3, 8)
    assert volume(positions, triangles) == pytest.approx(4 * 0.01 * np.sin(np.pi / 4) * 0.3 / 3, rel=1e-13)
    np.testing.assert_array_equal(positions[positions[:, 2] > 0], [[0, 0, 0.15]])


def test_sphere_converges_to_the_sphere_at_second_order():
    errors = []
    for subdivisions in (2, 3, 4):
        positions, triangles = sphere(0.5, subdivisions)
        assert len(triangles) == 20 * 4**subdivisions
        np.testing.assert_allclose(np.linalg.norm(positions, axis=1), 0.5, rtol=1e-14)
        errors.append([np.pi - area(positions, triangles), np.pi / 6 - volume(positions, triangles)])
    rates = np.log2(np.array(errors)[:-1] / np.array(errors)[1:])
    np.testing.assert_allclose(rates, 2, atol=0.1)


def test_slab_is_a_box():
    positions, triangles = slab((0.4, 0.3, 0.2), (4, 3, 2))
    assert area(positions, triangles) == pytest.approx(2 * (0.12 + 0.08 + 0.06), rel=1e-14)
    assert volume(positions, triangles) == pytest.approx(0.024, rel=1e-14)
    assert len(positions) == 5 * 4 * 3 - 3 * 2 * 1
    assert len(triangles) == 2 * 2 * (12 + 8 + 6)


def test_capsule_converges_to_its_volume_and_has_its_height():
    exact = np.pi * 0.01 * 0.3 + 4 / 3 * np.pi * 0.001
    errors = []
    for segments in (16, 32, 64):
        positions, triangles = capsule(0.1, 0.5, segments)
        assert (positions[:, 2].min(), positions[:, 2].max()) == (-0.25, 0.25)
        errors.append(exact - volume(positions, triangles))
    np.testing.assert_allclose(np.log2(np.array(errors)[:-1] / np.array(errors)[1:]), 2, atol=0.1)


@pytest.mark.parametrize(
    ("name", "keywords", "key"),
    [
        ("rectangle", {"size": (1, 0)}, "size[1]"),
        ("rectangle", {"size": (1, float("nan"))}, "size[1]"),
        ("rectangle", {"size": 1.0}, "size"),
        ("rectangle", {"size": "ab"}, "size"),
        ("rectangle", {"cells": (2, 2, 2)}, "cells"),
        ("rectangle", {"cells": (2.5, 2)}, "cells[0]"),
        ("rectangle", {"cells": (True, 2)}, "cells[0]"),
        ("rectangle", {"cells": (2, 10**9)}, "cells[1]"),
        ("rectangle", {"diagonals": "left"}, "diagonals"),
        ("disk", {"radius": -1}, "radius"),
        ("disk", {"cells": 0}, "cells"),
        ("tube", {"height": "tall"}, "height"),
        ("tube", {"cells": (2, 4)}, "cells[0]"),
        ("sphere", {"subdivisions": -1}, "subdivisions"),
        ("sphere", {"subdivisions": 30}, "subdivisions"),
        ("slab", {"size": (1, 1)}, "size"),
        ("capsule", {"radius": 0.2, "height": 0.4}, "height"),
        ("capsule", {"segments": 3}, "segments"),
        ("cone", {"segments": 2}, "segments"),
        ("ring", {"thickness": 0.2}, "thickness"),
        ("ring", {"around": 2}, "around"),
        ("tube", {"top_radius": 0}, "top_radius"),
        ("capsule", {"radius": 1e-9, "height": 1.0}, "height"),
    ],
)
def test_a_bad_argument_is_named(name, keywords, key):
    with pytest.raises(InputError) as caught:
        GENERATORS[name](**keywords)
    assert caught.value.sentence.split()[0].removeprefix(f"{name}.") == key
