"""Worlds: local origin of one far from the origin, and other materials."""

from dataclasses import replace

import numpy as np
import pytest
from contacts import ball, sheet

from clothsim import InputError
from clothsim.keys.fabric_table import FABRICS
from clothsim.mesh.body import make_body, rigid_motion
from clothsim.mesh.world import make_world, with_local_origin, with_material
from clothsim.physics.energies.pins import clamped

FAR = np.array([3e5, -2e5, 1e6])


def world_at(place):
    cloth = sheet(0.4)
    positions, triangles = ball().positions + place, ball().triangles
    motion = rigid_motion(velocity=(1, 2, 3), rotate_degrees_per_second=(0, 0, 40), centre=place)
    moved = cloth.__class__(**{**vars(cloth), "positions": cloth.positions + place})
    return make_world([moved], [make_body("ball", positions, triangles, motion)])


def test_near_the_origin_nothing_changes():
    world = world_at(np.array([1.0, 2.0, 3.0]))
    assert with_local_origin(world) is world
    assert not world.origin.any()


def test_far_away_every_position_is_relative_and_every_motion_the_same():
    world = world_at(FAR)
    local = with_local_origin(world)
    assert np.abs(local.start()[: local.n_cloth]).max() < 1.0
    assert np.abs(local.start() + local.origin - world.start()).max() < 1e-9
    here, there = local.bodies[0].at(0.7), world.bodies[0].at(0.7)
    assert np.abs(here + local.origin - there).max() < 1e-9


@pytest.mark.parametrize(("distance", "is_refused"), [(1e8, False), (1e10, True), (1e15, True), (1e300, True)])
def test_where_coordinates_do_not_resolve_the_cloth_it_is_refused(distance, is_refused):
    world = world_at(np.array([0.0, -distance, 0.0]))
    if is_refused:
        with pytest.raises(InputError, match=r" m from the origin"):
            with_local_origin(world)
    else:
        assert with_local_origin(world).origin[1] == pytest.approx(-distance)


def test_another_material_has_the_hinges_of_a_world_made_of_it():
    """Also where two fabrics meet and where whole triangles and border edges are clamped."""
    groups = {"strong": np.arange(20)}
    cloth, stiffer, bent = sheet(cells=6), FABRICS["denim"], FABRICS["wool"]
    cloth = replace(cloth, groups=groups, fabrics={"strong": stiffer})
    clamped_rows = [np.arange(9), np.array([47, 48])]
    start = clamped(make_world([cloth]), clamped_rows)[0]
    other = replace(cloth, fabric=bent, material_coordinates=cloth.material_coordinates * [1.1, 0.9])
    expected = clamped(make_world([other]), clamped_rows)[0].hinges
    found = with_material(start, [other]).hinges
    assert np.array_equal(found.vertices, expected.vertices)
    assert np.array_equal(found.held, expected.held)
    assert np.abs(found.corners - expected.corners).max() < 1e-15
    assert found.stiffness == pytest.approx(expected.stiffness, rel=1e-12)
