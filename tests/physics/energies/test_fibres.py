"""Fibres: energy of stretch and shear of threads, and the orthotropic sheet against plane stress."""

from dataclasses import replace

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from effect_builders import fibres, membrane
from meshes import UNIT, cloth, deformed, irregular_grid, random_rotation, small_world

from clothsim.base.errors import InputError
from clothsim.geometry.kinematics.deformation_gradient import thread_axes
from clothsim.mesh.cloth import make_cloth
from clothsim.mesh.generators.shapes import tube
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.solve.linear.sparsity import make_pattern

WARP, WEFT, SHEAR, NU = 3.0, 1.2, 0.4, 0.3
WOVEN = replace(UNIT, warp_stiffness=WARP, weft_stiffness=WEFT, shear_stiffness=SHEAR, poisson_ratio=NU)


def stretched(world, U):
    """The sheet under x = U X in its own plane, turned in space."""
    flat = world.start() @ np.vstack([np.hstack([U, np.zeros((2, 1))]), [0, 0, 1]])
    return flat @ random_rotation(3).T


def stress(energy, world, U):
    """dW/d(e11, e22, g) over the area at the stretch U = [[1 + e11, g/2], [g/2, 1 + e22]], (3,)."""
    gradient, area = energy.gradient(stretched(world, U)), world.rest_areas.sum()
    modes = np.array([[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 0.5], [0.5, 0]]], float)
    zero = stretched(world, np.zeros((2, 2)))
    return np.array([np.sum(gradient * (stretched(world, mode) - zero)) for mode in modes]) / area


def compliance(energy, world, step=1e-5):
    """S (3, 3) of e = S s about rest, from central differences of the stress."""
    columns = []
    for k in range(3):
        e = step * np.eye(3)[k]
        change = np.array([[e[0], e[2] / 2], [e[2] / 2, e[1]]])
        columns.append(
            (stress(energy, world, np.eye(2) + change) - stress(energy, world, np.eye(2) - change)) / step / 2
        )
    return np.linalg.inv(np.array(columns))


class TestOrthotropicSheet:
    @pytest.mark.parametrize(("angle", "expected"), [(0, WARP), (90, WEFT)])
    def test_a_strip_along_the_threads_has_their_stiffness_and_narrows_as_its_ratio_gives(self, angle, expected):
        world = small_world(0, WOVEN)
        S = compliance(membrane(world, material="orthotropic", angle_degrees=float(angle)), world)
        assert 1 / S[0, 0] == pytest.approx(expected, rel=1e-8)
        assert -S[1, 0] / S[0, 0] == pytest.approx(NU * np.sqrt(expected * expected / WARP / WEFT), rel=1e-8)
        assert 1 / S[2, 2] == pytest.approx(SHEAR, rel=1e-8)
        assert abs(S[0, 2]) < 1e-8

    @pytest.mark.parametrize("angle", [45, -45, 20, 70])
    def test_a_strip_cut_at_an_angle_follows_plane_stress(self, angle):
        """1/E = c^4/E1 + s^4/E2 + c^2 s^2 (1/G - 2 nu12/E1)."""
        world = small_world(1, WOVEN)
        S = compliance(membrane(world, material="orthotropic", angle_degrees=float(angle)), world)
        c2, s2 = np.cos(np.radians(angle)) ** 2, np.sin(np.radians(angle)) ** 2
        expected = c2**2 / WARP + s2**2 / WEFT + c2 * s2 * (1 / SHEAR - 2 * NU / np.sqrt(WARP * WEFT))
        assert S[0, 0] == pytest.approx(expected, rel=1e-8)

    @pytest.mark.parametrize("shear", [0.05, 5.0])
    def test_soft_and_hard_in_shear(self, shear):
        """mu is G where G is soft; where it is hard the threads take what is left, and nothing turns negative."""
        world = small_world(2, replace(WOVEN, shear_stiffness=shear))
        energy = membrane(world, material="orthotropic")
        S = compliance(energy, world)
        assert 1 / S[2, 2] == pytest.approx(shear, rel=1e-8)
        assert 1 / S[0, 0] == pytest.approx(WARP, rel=1e-8)
        assert np.linalg.eigvalsh(dense_hessian(energy, world.start()))[0] > -1e-10
        coupling = NU * np.sqrt(WARP * WEFT)
        stiffness = np.array([[WARP, coupling], [coupling, WEFT]]) / (1 - NU**2)
        assert energy.sheet.mu == pytest.approx(min(shear, 0.5 * np.linalg.eigvalsh(stiffness)[0]), rel=1e-12)

    def test_an_isotropic_fabric_has_the_small_limit_of_the_isotropic_sheet(self):
        world = small_world(0)
        threaded, plain = (compliance(membrane(world, material=name), world) for name in ("orthotropic", "neo_hookean"))
        assert threaded == pytest.approx(plain, rel=1e-8, abs=1e-9)

    def test_rest_is_rest_turned_as_it_may_be(self):
        world = small_world(0, WOVEN)
        energy = membrane(world, material="orthotropic", angle_degrees=30)
        x = world.start() @ random_rotation(5).T + 2.0
        assert energy.value(x) < 1e-28
        assert np.abs(energy.gradient(x)).max() < 1e-14

    def test_derivatives(self):
        world = small_world(0, WOVEN)
        energy = membrane(world, material="orthotropic", angle_degrees=30)
        x = deformed(world, 2, 0.1)
        assert gradient_error(energy, x) < 1e-8
        assert hessian_error(energy, x) < 1e-8
        assert np.linalg.eigvalsh(dense_hessian(energy, x))[0] < -1
        assert np.linalg.eigvalsh(dense_hessian(energy, x, project=True))[0] > -1e-13

    @pytest.mark.parametrize("compression", [1.0, 0.3])
    @pytest.mark.parametrize("project", [True, False])
    def test_a_matrix_gets_the_bits_of_the_blocks(self, compression, project):
        """Also of the sheet that is relaxed in compression."""
        world = small_world(0, WOVEN)
        energy = membrane(world, material="orthotropic", angle_degrees=30, compression=compression)
        hessian = energy.hessian(deformed(world, 2, 0.1), project)
        blocks = ElementHessian(hessian.elements, hessian.blocks)
        pattern = make_pattern(world.n_unknowns, world.triangles, [])
        (data, outside), (expected, _) = (pattern.assemble([each]) for each in (hessian, blocks))
        assert outside == 0
        assert data.any()
        assert np.array_equal(data, expected)

    def test_a_triangle_without_area_is_refused(self):
        world = small_world(0, WOVEN)
        assert membrane(world, material="orthotropic").value(np.zeros((world.n_vertices, 3))) == np.inf

    def test_it_goes_by_the_cloth_which_way_the_warp_runs(self):
        two = [cloth(*irregular_grid(0), WOVEN, name="one"), cloth(*irregular_grid(0), WOVEN, name="two")]
        world = make_world(two)
        both = membrane(world, material="orthotropic", angle_degrees={"one": 0, "two": 90})
        single = small_world(0, WOVEN)
        x = np.concatenate([stretched(single, np.diag([1.1, 1.0]))] * 2)
        expected = sum(
            membrane(single, material="orthotropic", angle_degrees=angle).value(x[: single.n_vertices])
            for angle in (0, 90)
        )
        assert both.value(x) == pytest.approx(expected, rel=1e-14)

    def test_no_stiffness_is_off_and_bad_keys_are_named(self):
        bare = small_world(0, replace(UNIT, youngs_modulus=0.0))
        assert isinstance(membrane(bare, material="orthotropic"), Off)
        with pytest.raises(InputError, match=r"membrane\.angle_degrees .*orthotropic"):
            membrane(small_world(0), angle_degrees=10)
        with pytest.raises(InputError, match=r"material is 'woven'.*orthotropic"):
            membrane(small_world(0), material="woven")


class TestFibres:
    def test_a_thread_pulls_with_its_engineering_strain(self):
        """Nominal stress Ka (la - 1) along the warp and nothing across; at 30 % that is no small strain."""
        world = small_world(0)
        energy = fibres(world, warp=2.0)
        pulled = np.diag([1.3, 0.8])
        assert stress(energy, world, pulled) == pytest.approx([0.6, 0, 0], abs=1e-12)
        assert energy.value(stretched(world, pulled)) == pytest.approx(0.5 * 2.0 * 0.09 * world.rest_areas.sum())

    def test_simple_shear_costs_g_squared_half(self):
        world = small_world(0)
        sheared = world.start() @ np.array([[1, 0, 0], [0.4, 1, 0], [0, 0, 1]])
        assert fibres(world, shear=1.5).value(sheared) == pytest.approx(0.5 * 1.5 * 0.16 * world.rest_areas.sum())

    def test_stiffness_may_vary_from_triangle_to_triangle_and_free_ones_are_left_out(self):
        world = small_world(0)
        warp = np.zeros(len(world.triangles))
        warp[3] = 2.0
        energy = fibres(world, warp=warp)
        assert energy.triangles.tolist() == [world.triangles[3].tolist()]
        x = stretched(world, np.diag([1.1, 1.0]))
        assert energy.value(x) == pytest.approx(0.5 * 2.0 * 0.01 * world.rest_areas[3])

    def test_without_a_stiffness_it_is_off_and_names_the_place_a_fabrics_own_is(self):
        off = fibres(small_world(0), angle_degrees=30)
        assert isinstance(off, Off)
        assert "orthotropic" in off.reason

    def test_a_negative_stiffness_is_refused(self):
        with pytest.raises(InputError, match=r"fibres.weft"):
            fibres(small_world(0), weft=-1.0)


class TestThreadAxes:
    def test_warp_is_the_first_axis_of_a_flat_sheet_whatever_its_triangles(self):
        world = small_world(0)
        energy = fibres(world, warp=2.0)
        along, across = (energy.measured(stretched(world, np.diag(s)))[:, 0] for s in ([1.2, 1], [1, 1.2]))
        assert along == pytest.approx(1.2)
        assert across == pytest.approx(1.0)

    def test_it_is_the_first_texture_axis_where_there_is_a_pattern(self):
        positions, triangles = irregular_grid(0)
        pattern = positions[triangles][:, :, [1, 0]] * [1, -1]  # the pattern lies turned by a right angle
        world = make_world([make_cloth("panel", positions, triangles, UNIT, material_coordinates=pattern)])
        measured = fibres(world, warp=1.0).measured(stretched(world, np.diag([1.0, 1.2])))
        assert measured[:, 0] == pytest.approx(1.2)
        assert measured[:, 1] == pytest.approx(1.0)

    def test_it_runs_along_a_tube(self):
        positions, triangles = tube(0.1, 0.5, (8, 4))
        for turn in (np.eye(3), np.eye(3)[[1, 2, 0]]):
            world = make_world([cloth(positions @ turn, triangles)])
            measured = fibres(world, warp=1.0).measured(positions @ (turn * 1.0) + 0.1 * positions[:, 2:] * turn[2])
            assert measured[:, 0] == pytest.approx(1.1)

    def test_it_turns_against_the_clock_about_the_normal(self):
        world = small_world(0)
        angles = np.full(len(world.triangles), np.radians(30))
        axes = thread_axes(world, angles)
        corners = world.start()[world.triangles]
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        in_space = edges @ world.rest_shape_inverses @ axes
        assert in_space[:, :, 0] == pytest.approx(np.tile([np.cos(np.pi / 6), 0.5, 0], (len(axes), 1)), abs=1e-12)
        assert in_space[:, :, 1] == pytest.approx(np.tile([-0.5, np.cos(np.pi / 6), 0], (len(axes), 1)), abs=1e-12)
