"""Named fabrics: a source for every value, physical ranges, and recomputed conversions."""

from pathlib import Path

import numpy as np
import pytest
from effect_builders import membrane
from meshes import cloth, grid

from clothsim.base.errors import InputError
from clothsim.keys.fabric import BENDINGS
from clothsim.keys.fabric_table import (
    FABRICS,
    PENAVA,
    SHEAR_UNIT,
    TABLE,
    WANG,
    WEAVES,
    fabric_named,
)
from clothsim.mesh.world import make_world
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene

MEASURED = Path(__file__).parents[3] / "shared" / "data" / "real" / "bending_618.csv"
SCENE = {"mesh": "rectangle", "cells": [2, 2]}
KNITS = ("interlock", "rib_knit", "ponte_roma", "swimwear")
KEYS_WITH_A_SOURCE = (
    "density",
    "thickness",
    "youngs_modulus",
    "poisson_ratio",
    "bending_stiffness",
    "warp_stiffness",
    "weft_stiffness",
    "shear_stiffness",
    "thread_poisson_ratio",
    "warp_extension",
    "weft_extension",
    "bending_warp",
    "bending_weft",
    "bending_bias",
    "friction",
)


def test_there_are_at_least_a_dozen_and_cotton_has_its_sheet_of_penava_and_its_bending_of_feng():
    assert len(FABRICS) >= 12
    cotton = FABRICS["cotton"]
    values = (cotton.density, cotton.thickness, cotton.youngs_modulus, cotton.poisson_ratio, cotton.bending_stiffness)
    assert values == (0.150, 0.318e-3, 0.821e6, 0.243, 9.2e-6)
    assert cotton.warp_stiffness is None


@pytest.mark.parametrize("named", TABLE.values(), ids=TABLE)
class TestEveryFabric:
    def test_each_value_has_a_source_and_each_source_a_value(self, named):
        given = {key for key in KEYS_WITH_A_SOURCE if getattr(named.fabric, key) is not None}
        assert set(named.sources) == given
        assert all(len(source) > 5 for source in named.sources.values())
        assert len(named.fabric.source) > 40
        assert named.made_of

    def test_its_numbers_are_those_of_cloth(self, named):
        fabric = named.fabric
        assert 0.05 < fabric.density < 0.6
        assert 0.1e-3 < fabric.thickness < 4e-3
        least, most = (200, 500) if fabric.name in KNITS else (50, 100) if fabric.name == "blanket" else (300, 800)
        assert least < fabric.density / fabric.thickness < most
        assert 0.02 < fabric.warp_extension <= fabric.weft_extension < 1.0
        assert 10 < fabric.stiffness_along_weft <= fabric.stiffness_along_warp < 1e4
        assert 1 < fabric.stiffness_in_shear < 200
        assert 1e-6 < fabric.bending_stiffness < 5e-5

    def test_it_drapes_inside_the_published_range(self, named):
        beside = named.compared
        low, high = beside.published or (15, 90)
        assert low <= beside.coefficient <= high
        assert 0 <= beside.stiffer_than <= 100

    def test_its_sheet_is_stable(self, named):
        world = make_world([cloth(*grid(1, 1), named.fabric)])
        for material in ("orthotropic", "neo_hookean"):
            blocks = membrane(world, material=material).hessian(world.start(), project=False).blocks
            values = np.linalg.eigvalsh(blocks)
            assert values.min() > -1e-9 * values.max()
            assert ((values > 1e-6 * values.max()).sum(axis=1) == 3).all()

    def test_a_scene_may_name_it(self, named):
        built = build(Scene(cloth=SCENE | {"fabric": named.fabric.name}, effects={"membrane": {}}))
        assert built.world.cloths[0].fabric is not None
        assert built.world.cloths[0].fabric.density == named.fabric.density


class TestConversions:
    @pytest.mark.parametrize("name", WANG)
    def test_the_threads_energy_is_that_of_the_published_row(self, name):
        """c11 e11^2 + 2 c12 e11 e22 + c22 e22^2 + c33 e12^2, u along the weft; at 1e-5 all measures of strain agree."""
        row = WANG[name]
        (c11, c12, c22, c33), bending = row.stretch, row.bending
        fabric = FABRICS[name]
        world = make_world([cloth(*grid(2, 2), fabric)])
        energy = membrane(world, material="orthotropic", angle_degrees=90)
        e11, e22, e12 = 1e-5 * np.array([2.0, -1.0, 1.5])
        x = world.start() @ (np.eye(3) + np.array([[e11, e12, 0], [e12, e22, 0], [0, 0, 0]]))
        if name == "denim":
            c33 = 2 * fabric.shear_stiffness  # of another source
        expected = c11 * e11**2 + 2 * c12 * e11 * e22 + c22 * e22**2 + c33 * e12**2
        assert energy.value(x) == pytest.approx(expected * world.rest_areas.sum(), rel=1e-3)
        assert fabric.density == row.density
        if name != "denim":  # bends by another source
            assert (fabric.bending_weft, fabric.bending_warp) == pytest.approx((bending[0] / 4, bending[2] / 4))

    def test_the_row_that_is_no_stable_sheet_is_left_out(self):
        """navy-sparkle-sweat: c = 12.486, -19.875, 3.272."""
        assert 12.486332 * 3.272434 < 19.875324**2
        assert not any("navy" in named.made_of for named in TABLE.values())
        assert all(c11 * c22 > c12**2 for c11, c12, c22, _ in (row.stretch for row in WANG.values()))

    def test_what_no_source_gives_is_reported_as_estimated(self):
        extensions = ("warp_extension", "weft_extension")
        assert all(TABLE[name].estimated == ("bending_stiffness", *extensions) for name in PENAVA)
        assert all(TABLE[name].estimated == ("thickness", *extensions) for name in WANG if name != "denim")
        assert set(TABLE["denim"].estimated) == {"thickness", "bending_stiffness", *BENDINGS}
        assert all("bending_warp" not in TABLE[name].estimated for name in WEAVES)

    def test_denim_shears_as_denims_are_measured(self):
        assert 1.5 < FABRICS["denim"].shear_stiffness / SHEAR_UNIT < 3.4


class TestInAScene:
    def test_an_unknown_name_is_answered_with_the_nearest(self):
        with pytest.raises(InputError, match=r"cloth\.fabric.*'denin'.*'denim'"):
            build(Scene(cloth=SCENE | {"fabric": "denin"}, effects={"membrane": {}}))
        with pytest.raises(InputError, match=r"fabric.* 7.*cotton"):
            fabric_named("fabric", 7)

    def test_own_threads_take_the_place_of_the_tables_and_so_does_a_youngs_modulus(self):
        def fabric_of(**keys):
            return (
                build(Scene(cloth=SCENE | {"fabric": "denim"} | keys, effects={"membrane": {}})).world.cloths[0].fabric
            )

        assert fabric_of(warp_stiffness=500.0).stiffness_along_warp == 500.0
        assert fabric_of(warp_stiffness=500.0).stiffness_along_weft == FABRICS["denim"].weft_stiffness
        own = fabric_of(youngs_modulus=1e5)
        assert own.stiffness_along_warp == own.stiffness_along_weft == 1e5 * own.thickness
        assert own.poisson_ratio_of_threads == own.poisson_ratio


@pytest.mark.skipif(not MEASURED.is_file(), reason="the bending of 618 fabrics is not here")
@pytest.mark.parametrize("named", TABLE.values(), ids=TABLE)
def test_its_percentile_is_that_among_the_measured_fabrics(named):
    density, warp, weft = np.loadtxt(MEASURED, delimiter=",", skiprows=1)[:, :3].T
    fabric = named.fabric
    like = np.abs(np.log(density / fabric.density)) < np.log(1.25)
    stiffness = np.sqrt(fabric.bending_along_warp * fabric.bending_along_weft)
    share = 100 * np.mean(np.sqrt(warp * weft)[like] < stiffness)
    assert (named.compared.of, named.compared.stiffer_than) == (like.sum(), pytest.approx(share, abs=0.6))
