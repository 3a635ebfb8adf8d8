"""Measured membrane: a stretched strip returns its table, interpolation between rows, and bad rows."""

import numpy as np
import pytest
from differences import dense_hessian, gradient_error, hessian_error
from effect_builders import membrane
from meshes import deformed, random_rotation, small_world
from scipy.integrate import quad
from small_scenes import SHEET, SOLVER

from clothsim import Scene, simulate
from clothsim.base.errors import InputError
from clothsim.physics.energies.measured_membrane import Narrowing, StressCurve

WARP = [[0.02, 4.0], [0.05, 20.0], [0.10, 60.0]]
WEFT = [[0.10, 3.0], [0.30, 30.0]]
SHEAR = [[0.2, 1.0], [0.5, 6.0]]
STEP = np.array([-1e-6, 1e-6])


def sheet(**keys):
    world = small_world(0)
    return world, membrane(world, material="measured", **({"warp": WARP, "weft": WEFT, "shear": SHEAR} | keys))


def pulled(world, along, across=1.0):
    return world.start() * [along, across, 1.0] @ random_rotation(2).T


def nominal_stress(world, energy, along, across=1.0):
    """dW/d(stretch along x), dW/d(stretch along y) over the area [N/m]."""
    gradient, area = energy.gradient(pulled(world, along, across)), world.rest_areas.sum()
    turn = random_rotation(2).T
    return [np.sum(gradient * (world.start() * axis @ turn)) / area for axis in ([1, 0, 0], [0, 1, 0])]


class TestAPulledStrip:
    @pytest.mark.parametrize(("strain", "stress"), WARP)
    def test_along_the_warp_it_returns_the_table_and_does_not_narrow(self, strain, stress):
        world, energy = sheet()
        assert nominal_stress(world, energy, 1 + strain) == pytest.approx([stress, 0], rel=1e-12, abs=1e-12)

    @pytest.mark.parametrize(("strain", "stress"), WEFT)
    def test_along_the_weft_and_turned(self, strain, stress):
        world, energy = sheet()
        assert nominal_stress(world, energy, 1, 1 + strain)[1] == pytest.approx(stress, rel=1e-12)
        world, energy = sheet(angle_degrees=90)
        assert nominal_stress(world, energy, 1 + strain)[0] == pytest.approx(stress, rel=1e-12)

    @pytest.mark.parametrize(("sine", "stress"), SHEAR)
    def test_threads_that_turn_towards_one_another_cost_the_table(self, sine, stress):
        """la = lb = 1, I8 = sin: the slope of the energy, but for mu s^3/(1 - s^2) of the sheet."""
        world, energy = sheet()
        turned = [world.start() @ np.array([[1, 0, 0], [s, np.sqrt(1 - s * s), 0], [0, 0, 1]]) for s in sine + STEP]
        slope = (energy.value(turned[1]) - energy.value(turned[0])) / np.ptp(STEP) / world.rest_areas.sum()
        mu = 0.1 * 1.0 / 0.2
        assert slope == pytest.approx(stress + mu * sine**3 / (1 - sine**2), rel=1e-6)
        assert slope == pytest.approx(stress, rel=0.02)

    def test_between_the_rows_it_rises_and_the_energy_is_the_work(self):
        world, energy = sheet()
        strains = np.linspace(0, 0.15, 40)
        stresses = [nominal_stress(world, energy, 1 + e)[0] for e in strains]
        assert (np.diff(stresses) > 0).all()
        rows = [0.02, 0.05, 0.1]
        work, _ = quad(lambda e: nominal_stress(world, energy, 1 + e)[0], 0, 0.12, points=rows, epsrel=1e-10)
        assert energy.value(pulled(world, 1.12)) == pytest.approx(work * world.rest_areas.sum(), rel=1e-8)

    def test_beyond_the_last_row_and_in_compression_it_is_straight_and_reports_it(self):
        world, energy = sheet()
        beyond = [nominal_stress(world, energy, 1 + e)[0] for e in (0.10, 0.15, 0.20)]
        assert beyond[2] - beyond[1] == pytest.approx(beyond[1] - beyond[0], rel=1e-9)
        squeezed = [nominal_stress(world, energy, 1 - e)[0] for e in (0, 0.05, 0.1)]
        assert squeezed[2] == pytest.approx(2 * squeezed[1], rel=1e-9)
        assert squeezed[1] < 0
        assert any("warp ends at 10 %" in choice for choice in energy.defaults_used())

    def test_a_simulated_strip_hangs_as_long_as_its_table_gives(self, tmp_path):
        """A strip of six cells under its own weight, without inertia: stress(z) = w z, length = sum of 1 + strain."""
        weight = 0.5 * 9.81
        strip = SHEET | {"size": [0.1, 0.6], "cells": [1, 6], "density": 0.5, "rotation_degrees": [90, 0, 0]}
        keys = {"material": "measured", "warp": [[0.02, 1.0], [0.1, 3.0]], "shear": [[0.1, 5.0]], "angle_degrees": 90}
        effects = {"membrane": keys, "bending": {}, "gravity": {}, "pins": {"select": "top"}}
        run = simulate(Scene(cloth=strip, effects=effects, solver=SOLVER | {"tolerance": 1e-8}), tmp_path)
        assert run.status == "completed", run.reason
        curve = StressCurve.through(*np.array([[0, 0], [0.02, 1.0], [0.1, 3.0]]).T)
        levels = weight * 0.1 * (np.arange(6) + 0.5)  # of each row the weight below its middle, as masses are lumped
        strains = [np.interp(level, curve.at(e := np.linspace(0, 0.3, 100001))[1], e) for level in levels]
        longer = np.ptp(run.positions(-1)[:, 2]) - 0.6
        assert longer == pytest.approx(0.1 * np.sum(strains), rel=3e-3)  # corners of one row weigh differently


NARROWING = {"narrowing_warp": [[0.04, 0.01], [0.10, 0.05]], "narrowing_weft": [[0.1, 0.02], [0.3, 0.08]]}


class TestNarrowing:
    @pytest.mark.parametrize(("strain", "lost"), NARROWING["narrowing_warp"])
    def test_a_free_strip_along_the_warp_narrows_by_its_table_and_returns_the_other(self, strain, lost):
        world, energy = sheet(**NARROWING)
        stress = nominal_stress(*sheet(), 1 + strain)[0]
        assert nominal_stress(world, energy, 1 + strain, 1 - lost) == pytest.approx([stress, 0], rel=1e-12, abs=1e-12)

    @pytest.mark.parametrize(("strain", "lost"), NARROWING["narrowing_weft"])
    def test_and_along_the_weft(self, strain, lost):
        world, energy = sheet(**NARROWING)
        stress = nominal_stress(*sheet(), 1, 1 + strain)[1]
        assert nominal_stress(world, energy, 1 - lost, 1 + strain) == pytest.approx([0, stress], rel=1e-12, abs=1e-12)

    def test_a_strip_whose_width_is_held_has_the_stress_of_what_it_cannot_lose(self):
        """W2'(g) across, and g' of it along besides the table."""
        world, energy = sheet(**NARROWING)
        weft = StressCurve.through(*np.array([[0, 0], *WEFT]).T)
        law = Narrowing.through(*np.array([[0, 0], *NARROWING["narrowing_warp"]]).T)
        g, slope, _ = law.at(np.array([0.1]))
        across = weft.at(g)[1]
        along = 60.0 + across * slope
        assert g == pytest.approx(0.05)
        assert nominal_stress(world, energy, 1.1) == pytest.approx([along[0], across[0]], rel=1e-12)

    def test_it_is_level_at_rest_and_straight_beyond_its_last_row(self):
        law = Narrowing.through(np.array([0.0, 0.1, 0.3]), np.array([0.0, 0.02, 0.08]))
        g, slope, curvature = law.at(np.array([-0.2, 0.0, 0.3, 0.4, 0.5]))
        assert (g[:2] == 0).all()
        assert (slope[:2] == 0).all()
        assert g[4] - g[3] == pytest.approx(g[3] - g[2])
        assert (curvature[[0, 1, 3, 4]] == 0).all()

    @pytest.mark.parametrize("stretch", [[1.06, 1.1, 1], [1.2, 0.97, 1], [0.97, 1.15, 1], [1.06, 1.5, 1]])
    def test_derivatives(self, stretch):
        world, energy = sheet(angle_degrees=25, **NARROWING)
        x = deformed(world, 2, 0.01) * stretch
        assert gradient_error(energy, x) < 1e-7
        assert hessian_error(energy, x, step=1e-7) < 1e-4
        projected = dense_hessian(energy, x, project=True)
        assert np.linalg.eigvalsh(projected)[0] > -1e-12 * np.abs(projected).max()

    def test_a_slender_strip_between_clamps_narrows_in_its_middle(self, tmp_path):
        strip = SHEET | {"size": [0.3, 0.06], "cells": [30, 6]}
        pins = {"group": [{"select": "left"}, {"select": "right", "motion": {"velocity": [0.03, 0, 0]}}]}
        stiff = {"warp": WARP, "shear": [[0.2, 60.0]]}  # in shear, lest the clamps be felt in the middle
        keys = {"material": "measured"} | stiff | NARROWING
        scene = Scene(
            cloth=strip,
            effects={"membrane": keys, "pins": pins},
            solver={"dt": 0.25, "unstable_equilibrium": "keep"},
            run={"duration": 1.0, "frames_per_second": 4},
        )
        run = simulate(scene, tmp_path)
        assert run.status == "completed", run.reason
        x = run.positions(-1)
        middle = np.abs(x[:, 0] - x[:, 0].mean()) < 0.01
        assert 1 - np.ptp(x[middle, 1]) / 0.06 == pytest.approx(0.05, abs=0.004)

    @pytest.mark.parametrize(
        ("tables", "output"),
        [
            ({"narrowing_warp": [[0.5, 1.0]]}, r"narrowing_warp takes 1 of the width"),
            ({"narrowing_weft": [[0.1, 0.02], [0.2, 0.01]]}, r"narrowing_weft\[1\] has narrowing 0\.01, not above"),
            ({"narrowing_warp": [[0.1, 0.12]], "narrowing_weft": [[0.1, 0.09]]}, "slopes multiply to"),
            # steep for a ten thousandth only
            ({"narrowing_warp": [[0.5, 0.001], [0.5001, 0.3], [1, 0.31]], "narrowing_weft": [[0.1, 0.05]]}, "multiply"),
        ],
    )
    def test_what_leaves_no_width_or_no_stable_sheet_is_refused(self, tables, output):
        with pytest.raises(InputError, match=output):
            sheet(**tables)


class TestTheEnergy:
    def test_derivatives(self):
        world, energy = sheet(angle_degrees=25)
        x = deformed(world, 2, 0.05)
        assert gradient_error(energy, x) < 1e-7
        assert hessian_error(energy, x, step=1e-7) < 1e-4  # the slope of a cubic through rows has kinks
        projected = dense_hessian(energy, x, project=True)
        assert np.linalg.eigvalsh(projected)[0] > -1e-12 * np.abs(projected).max()

    def test_curvatures_of_the_law_are_differences_of_its_slopes(self):
        """Within the rows and beyond them; in the Hessian of a sheet the shear is small beside the stretches."""
        law = sheet(**NARROWING)[1].threads.law
        for measured in ([1.03, 1.15, 0.3], [1.07, 1.2, -0.4], [0.98, 1.4, 0.1], [1.12, 0.97, 0.6]):
            at = np.array([measured])
            forward, back = (np.array([law.slopes(at + h * axis)[0] for axis in np.eye(3)]) for h in STEP[::-1])
            difference = (forward - back) / np.ptp(STEP)
            aa, ab, bb, shear = law.curvatures(at)[0]
            expected = [[aa, ab, 0], [ab, bb, 0], [0, 0, shear]]
            np.testing.assert_allclose(difference, expected, rtol=1e-6, atol=1e-6 * abs(aa))

    def test_rest_is_rest_and_a_triangle_without_area_is_refused(self):
        world, energy = sheet()
        assert abs(energy.value(pulled(world, 1.0))) < 1e-14
        assert np.abs(energy.gradient(pulled(world, 1.0))).max() < 1e-12
        assert energy.value(np.zeros((world.n_vertices, 3))) == np.inf

    def test_weft_is_as_the_warp_and_shear_the_fabrics_where_they_are_not_given(self):
        world, energy = sheet(weft=(), shear=())
        assert nominal_stress(world, energy, 1.0, 1.05)[1] == pytest.approx(20.0)
        sheared = world.start() @ np.array([[1, 0, 0], [1e-4, 1, 0], [0, 0, 1]])
        modulus = world.cloths[0].fabric.shear_modulus
        assert energy.value(sheared) == pytest.approx(0.5 * modulus * 1e-8 * world.rest_areas.sum(), rel=1e-3)


class TestBadTables:
    @pytest.mark.parametrize(
        ("table", "output"),
        [
            ([[0.02, 4.0], [0.05, 3.0]], r"warp\[1\] has stress 3 N/m, not above 4"),
            ([[0.0, 0.0], [0.02, 4.0], [0.05, 4.0]], r"warp\[2\] has stress 4 N/m"),
            ([[0.05, 4.0], [0.02, 5.0]], r"warp\[1\] has strain 0\.02, not above 0\.05"),
            ([[-0.05, -4.0], [0.02, 5.0]], r"warp\[0\] has strain -0\.05"),
            ([[0.02, float("nan")]], r"warp\[0\] is"),
            ([[0.0, 0.0]], "0, 0"),
            ([0.1, 0.2], r"rows \[strain, stress\]"),
            ("steep", r"rows \[strain, stress\]"),
            ((), r"rows \[strain, stress\]"),
        ],
    )
    def test_the_row_is_named(self, table, output):
        with pytest.raises(InputError, match=output):
            membrane(small_world(0), material="measured", warp=table)

    def test_shear_in_degrees_is_refused(self):
        with pytest.raises(InputError, match=r"shear has the sine 5.*not degrees"):
            membrane(small_world(0), material="measured", warp=WARP, shear=[[5.0, 3.0]])

    def test_tables_are_for_this_material_only(self):
        with pytest.raises(InputError, match=r'membrane\.warp .*"orthotropic".*"measured"'):
            membrane(small_world(0), material="orthotropic", warp=WARP)
