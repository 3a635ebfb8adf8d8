"""Orthotropic plate law: energies of quadratic surfaces, borders, strips cut at any angle, derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from differences import gradient_error, hessian_error, taylor_slopes
from meshes import UNIT, cloth, deformed, irregular_grid
from scipy.spatial import Delaunay

from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.curvature import IsotropicPlates, OrthotropicPlates, bending_strains, plate_law
from clothsim.mesh.cloth import dihedral_angles, make_cloth
from clothsim.mesh.topology import border_vertices
from clothsim.mesh.world import make_world
from tests.known_answers.plates import drooped, elastica
from tests.known_answers.strips import lattice_strip
from tests.support.effect_builders import bending

SIZE = 1e-4
STIFFNESS = UNIT.bending_stiffness
D1, D2, NU = 4.0 * STIFFNESS, 0.5 * STIFFNESS, 0.3
WOVEN = replace(UNIT, poisson_ratio=NU, bending_warp=D1, bending_weft=D2)
ANGLES = [0.0, 0.4, np.pi / 4, 2.0, np.pi / 2]


def sheet(fabric, seed=0):
    """A unit square of points at random."""
    points = np.random.default_rng(seed).uniform(0, 1, (70, 2))
    edge = np.linspace(0, 1, 9)
    border = [np.column_stack([edge, 0 * edge + k]) for k in (0, 1)]
    points = np.unique(np.concatenate([points, *border, *(b[:, ::-1] for b in border)]), axis=0)
    triangles = Delaunay(points).simplices
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(area[:, None] < 0, triangles[:, [0, 2, 1]], triangles)[np.abs(area) > 1e-9]
    positions = np.column_stack([points, np.zeros(len(points))])
    return make_world([cloth(positions, triangles.astype(np.int64), fabric)])


def densities(world, angle, curvature):
    """Twice the bending energy of each triangle per area of the surface w = SIZE x'Cx/2, over SIZE^2."""
    x = world.start()
    x[:, 2] = SIZE * np.einsum("vi,ij,vj->v", x[:, :2], curvature, x[:, :2]) / 2
    change = dihedral_angles(x, world.hinges.vertices) - world.hinges.rest_angles
    strains = bending_strains(world, world.hinges, np.full(len(world.triangles), angle)) @ change
    return (strains.reshape(-1, 3) ** 2).sum(axis=1) / (world.rest_areas * SIZE**2)


def inner(world):
    """The triangles with a ring of triangles between them and the border."""
    near = np.zeros(world.n_cloth, bool)
    near[border_vertices(world.triangles)] = True
    near[world.triangles[near[world.triangles].any(axis=1)]] = True
    return ~near[world.triangles].any(axis=1)


def turned(angle, curvature):
    """The curvature tensor along warp and weft."""
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return axes.T @ curvature @ axes


def side_free(angle, fabric):
    """Curvature tensor with k_xx = 1 and no moment but along x, by the compliance; and that moment."""
    d1, d2 = fabric.bending_along_warp, fabric.bending_along_weft
    coupled = fabric.poisson_ratio * np.sqrt(d1 * d2)
    stress = turned(angle, np.diag([1.0, 0.0]))
    k1, k2 = np.linalg.solve([[d1, coupled], [coupled, d2]], np.diag(stress))
    k12 = stress[0, 1] / fabric.twisting_stiffness
    curvature = turned(-angle, np.array([[k1, k12], [k12, k2]]))
    return curvature / curvature[0, 0], 1 / curvature[0, 0]


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("curvature", [[[1, 0], [0, 0]], [[0, 1], [1, 0]], [[0.3, -0.7], [-0.7, 0.9]]])
def test_a_quadratic_surface_has_the_energy_of_its_law(angle, curvature):
    """D1 k11^2 + D2 k22^2 + 2 nu sqrt(D1 D2) k11 k22 + 2 T k12^2."""
    world = sheet(WOVEN)
    (k1, k12), (_, k2) = turned(angle, np.array(curvature, float))
    expected = D1 * k1**2 + D2 * k2**2 + 2 * NU * np.sqrt(D1 * D2) * k1 * k2
    expected += 2 * (1 - NU) * np.sqrt(D1 * D2) * k12**2
    chosen = inner(world)
    assert chosen.sum() > 10
    assert densities(world, angle, np.array(curvature, float))[chosen] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("angle", ANGLES)
def test_a_strip_cut_at_any_angle_is_exact_at_its_free_sides(angle):
    """Moments along x alone: exact up to the sides y = 0, 1, away from the ends."""
    world = sheet(WOVEN)
    curvature, moment = side_free(angle, WOVEN)
    x = world.start()[world.triangles][:, :, 0]
    middle = (x.min(axis=1) > 0.3) & (x.max(axis=1) < 0.7)
    assert (~inner(world) & middle).sum() > 3
    assert densities(world, angle, curvature)[middle] == pytest.approx(moment, rel=1e-6)


@pytest.mark.parametrize("bias", [0.6, 1.0])
def test_strips_have_their_own_stiffness_along_warp_weft_and_bias(bias):
    fabric = replace(WOVEN, bending_bias=bias * STIFFNESS)
    for angle, own in ((0.0, D1), (np.pi / 2, D2), (np.pi / 4, bias * STIFFNESS), (-np.pi / 4, bias * STIFFNESS)):
        assert side_free(angle, fabric)[1] == pytest.approx(own * (1 - NU**2), rel=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_equal_stiffnesses_are_the_isotropic_plate(angle):
    plain, woven = replace(UNIT, poisson_ratio=NU), replace(UNIT, poisson_ratio=NU, bending_bias=STIFFNESS)
    worlds = sheet(plain), sheet(woven)
    angles = np.full(len(worlds[0].triangles), angle)
    assert isinstance(plate_law(worlds[0], angles), IsotropicPlates)
    assert isinstance(plate_law(worlds[1], angles), OrthotropicPlates)
    first, second = (bending_strains(world, world.hinges, angles).toarray() for world in worlds)
    assert woven.twisting_stiffness == pytest.approx((1 - NU) * STIFFNESS, rel=1e-12)
    assert second.T @ second == pytest.approx(first.T @ first, abs=1e-9 * np.abs(first.T @ first).max())


def test_an_angle_changes_no_isotropic_bit():
    world = sheet(UNIT)
    angles = np.full(len(world.triangles), 0.4)
    first, second = (bending_strains(world, world.hinges, a).toarray() for a in (None, angles))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_derivatives_are_those_of_the_energy(angle):
    world = make_world([cloth(*irregular_grid(), WOVEN)])
    energy, x = bending(world, angle_degrees=angle), deformed(world, amplitude=0.05)
    assert gradient_error(energy, x) < 1e-6
    assert hessian_error(energy, x) < 1e-6
    first, second = taylor_slopes(energy, x)
    assert first == pytest.approx(2, abs=0.1)
    assert second > 2.8


@pytest.mark.parametrize(("warp", "own"), [(0.0, 4.0), (90.0, 0.5)])
def test_strips_along_warp_and_weft_droop_as_the_elastica_of_their_own_stiffness(warp, own):
    ratio = drooped(*lattice_strip(12, 0), "midedge", 10, warp, bending_warp=4.0, bending_weft=0.5)
    assert ratio == pytest.approx(elastica(10 / own), rel=0.02)


def test_a_mirrored_pattern_bends_as_its_mirror_image():
    positions, triangles = irregular_grid()
    pattern = positions[triangles][:, :, :2]
    world, mirrored = (
        make_world([make_cloth("panel", positions, triangles, WOVEN, material_coordinates=plane)])
        for plane in (pattern, pattern[..., ::-1].copy())
    )
    angles = np.full(len(world.triangles), 0.4)
    first = bending_strains(world, world.hinges, angles).toarray()
    second = bending_strains(mirrored, mirrored.hinges, np.pi / 2 - angles).toarray()
    assert second.T @ second == pytest.approx(first.T @ first, abs=1e-9 * np.abs(first.T @ first).max())


def test_impossible_values_are_refused():
    with pytest.raises(InputError, match="bending_bias"):
        replace(WOVEN, bending_bias=4 * D1)
    with pytest.raises(InputError, match="angle_degrees"):
        bending(sheet(WOVEN), model="hinge", angle_degrees=10.0)
