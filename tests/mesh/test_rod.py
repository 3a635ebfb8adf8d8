"""Rods: sections, masses and edges against closed forms; refused points."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.mesh.rod import make_rod
from clothsim.mesh.world import make_world

STEEL = {"radius": 1e-3, "density": 7800.0, "youngs_modulus": 2e11}
AREA = np.pi * 1e-6


def points(n):
    return np.column_stack([np.linspace(0.0, 0.4, n), np.zeros((n, 2))])


def test_the_section_is_round():
    rod = make_rod("wire", points(5), **STEEL)
    assert rod.stretch_stiffness == pytest.approx(2e11 * AREA)
    assert rod.bending_stiffness == pytest.approx(2e11 * np.pi * 1e-12 / 4)
    assert rod.mass_per_length == pytest.approx(7800 * AREA)


@pytest.mark.parametrize("is_loop", [False, True])
def test_the_world_has_its_mass_edges_and_contact_area(is_loop):
    angles = 2 * np.pi * np.arange(6) / 6
    ring = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    rod = make_rod("ring", ring, **STEEL, is_loop=is_loop)
    world = make_world([make_rod("other", points(3), **STEEL), rod])
    length = 6.0 if is_loop else 5.0
    assert rod.lengths.sum() == pytest.approx(length)
    assert world.masses[3:].sum() == pytest.approx(7800 * AREA * length)
    assert world.vertex_areas[3:].sum() == pytest.approx(1e-3 * length)
    np.testing.assert_allclose(world.masses[:3], 7800 * AREA * np.array([0.1, 0.2, 0.1]))
    expected = [[0, 1], [1, 2], [3, 4], [4, 5], [5, 6], [6, 7], [7, 8]] + ([[3, 8]] if is_loop else [])
    assert world.edges.tolist() == expected
    assert not len(world.triangles)
    assert world.cell == pytest.approx(1.0)


def test_what_is_no_rod_is_named():
    for bad, words in (
        ([[0, 0, 0]], "1 point"),
        ([[0, 0, 0], [0.1, 0, 0], [0, 0, 0]], "point 1"),
        ([[0, 0, 0], [0.1, 0, 0], [0, 0.0019, 0]], "point 1"),
        ([[0, 0, 0], [1e200, 0, 0]], "edge 0"),
        ([[0, 0, 0], [0, 0, 0], [1, 0, 0]], "edge 0"),
        ([[0, 0, 0], [1, 0, np.nan]], "wire points"),
    ):
        with pytest.raises(InputError, match=words):
            make_rod("wire", bad, **STEEL)
    with pytest.raises(InputError, match="loop"):
        make_rod("wire", points(2), **STEEL, is_loop=True)
    with pytest.raises(InputError, match="point 2"):
        make_rod("wire", [[0.1, 0.1, 0], [0.1, 0, 0], [0, 0, 0], [0.1, 0.0005, 0.0]], **STEEL)
    ring = [[0, 0, 0], [0.1, 0.0005, 0], [0.15, 0.1, 0], [0.2, 0, 0], [0.1, -0.0005, 0]]
    with pytest.raises(InputError, match="point 0"):
        make_rod("wire", ring, **STEEL, is_loop=True)


def test_a_bend_that_is_wider_than_the_rod_is_thick_is_a_rod():
    assert len(make_rod("wire", [[0, 0, 0], [0.1, 0, 0], [0, 0.0021, 0]], **STEEL).lengths) == 2
    assert len(make_rod("wire", [[0, 0, 0], [0.0015, 0, 0], [0, 0.001, 0]], **STEEL).lengths) == 2  # finer than thick
