"""Smallest d_hat that double precision carries at the coordinates of a scene."""

import numpy as np
import pytest
from effect_builders import body_contact, self_contact
from meshes import cloth, grid
from small_scenes import BALL, EFFECTS, SHEET, small_scene

from clothsim import InputError
from clothsim.mesh.body import make_body
from clothsim.mesh.generators.shapes import slab
from clothsim.mesh.rod import make_rod
from clothsim.mesh.world import make_world
from clothsim.physics.contact.setup import LEAST_D_HAT
from clothsim.scene.assembly.scene_world import build
from tests.known_answers.a14_rods import knotted


def scene(d_hat, away=0.0, unit=1.0):
    sheet = {"size": [0.5 * unit, 0.5 * unit], "position": [away, away, away + 0.33 * unit]}
    ball = {"radius": 0.3 * unit, "position": [away] * 3}
    return small_scene(SHEET | sheet, BALL | ball, EFFECTS | {"body_contact": {"d_hat": d_hat}})


@pytest.mark.parametrize("effect", ["body_contact", "self_contact"])
def test_a_nanometre_on_half_a_metre_is_refused_by_number(effect):
    given = small_scene(SHEET | {"size": [0.5, 0.5]}, BALL, EFFECTS | {effect: {"d_hat": 1e-9}})
    with pytest.raises(InputError, match=rf"{effect}\.d_hat is 1e-09 m, below .*e-09 m"):
        build(given)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_the_bound_goes_with_the_coordinates(unit):
    largest = float(abs(build(scene(1e-3 * unit, unit=unit)).world.start()).max())
    assert build(scene(1.01 * LEAST_D_HAT * largest, unit=unit)).energies["body_contact"].d_hat < 1e-8 * unit
    with pytest.raises(InputError, match="double precision"):
        build(scene(0.99 * LEAST_D_HAT * largest, unit=unit))


def test_a_scene_far_from_the_origin_is_measured_about_its_own():
    assert build(scene(1e-8, away=1000.0)).energies["body_contact"].d_hat == 1e-8


R = 0.01


def crossing(height, radius=R, scale=1.0):
    """Two rods that cross at right angles, their centre lines `height` apart."""
    line = scale * np.array([-0.75, -0.25, 0.25, 0.75])
    nothing = np.zeros(4)
    first = np.column_stack([line, nothing, nothing])
    second = np.column_stack([nothing, line, np.full(4, height)])
    return make_world([make_rod(name, p, radius, 1.0, 1.0) for name, p in (("a", first), ("b", second))])


def test_two_rods_touch_at_two_radii():
    world = crossing(2 * R + 0.02)
    contact = self_contact(world, d_hat=0.05, stiffness=1.0)
    x = world.start()
    assert contact.offset == 2 * R
    assert contact.minimum_gap(x) == pytest.approx(0.02)
    assert contact.value(x) > 0
    force = contact.gradient(x)
    np.testing.assert_allclose(force[:4].sum(axis=0), -force[4:].sum(axis=0), atol=1e-15)
    assert force[:4, 2].sum() > 0 > force[4:, 2].sum()  # the gradient: they repel
    assert not force[:, :2].any()
    assert contact.value(crossing(2 * R + 0.051).start()) == 0.0


def test_the_offset_of_a_scene_comes_on_top_of_the_radii():
    contact = self_contact(crossing(2 * R + 0.02), d_hat=0.05, stiffness=1.0, offset=0.004)
    assert contact.offset == pytest.approx(2 * R + 0.004, rel=1e-12)


def test_the_weight_of_a_contact_is_length_times_radius():
    """Twice the length at the same radius: twice the energy of the middle edges."""
    energies = []
    for scale in (1.0, 2.0):
        world = crossing(2 * R + 0.02, scale=scale)
        energies.append(self_contact(world, d_hat=0.05, stiffness=1.0).value(world.start()))
    assert energies[1] == pytest.approx(2 * energies[0])
    assert energies[0] > 0


def test_a_rod_is_stopped_before_another_one():
    world = crossing(0.3)
    contact = self_contact(world, d_hat=0.05, stiffness=1.0)
    x = world.start()
    through = np.zeros_like(x)
    through[4:, 2] = -1.0  # to the other side of it
    limit = contact.step_limit(x, through)
    assert 0.2 < limit < 0.3 - 2 * R
    assert contact.step_limit(x, -through) == 1.0


def test_a_rod_rests_on_a_body_at_its_radius():
    line = np.column_stack([np.linspace(-0.4, 0.4, 9), np.full(9, 0.1), np.full(9, R + 0.002)])
    block = make_body("block", *slab(size=(1.0, 1.0, 0.2)))
    block = make_body("block", block.positions - [0, 0, 0.1], block.triangles)
    world = make_world([make_rod("rod", line, R, 1.0, 1.0)], [block])
    contact = body_contact(world, d_hat=0.004, stiffness=1.0)
    assert contact.minimum_gap(world.start()) == pytest.approx(0.002)
    assert (contact.gradient(world.start())[:9, 2] < 0).all()


def test_a_loose_knot_pulls_with_half_of_ei_over_r_squared():
    pull, x = knotted(120, 0.03)
    assert pull == pytest.approx(0.5, rel=0.06)
    assert np.isfinite(x).all()


def test_what_is_not_there_yet_is_refused():
    sheet = cloth(*grid(2, 2))
    rod = make_rod("rod", np.array([[0.0, 0, 1], [0.5, 0, 1]]), R, 1.0, 1.0)
    thick = make_rod("thick", np.array([[0.0, 1, 1], [0.5, 1, 1]]), 2 * R, 1.0, 1.0)
    short = make_rod("short", np.column_stack([np.arange(4) * 2 * R, np.zeros((4, 2))]), R, 1.0, 1.0)
    for cloths, words in (([sheet, rod], "cloth"), ([rod, thick], "thick"), ([short], "short has an edge")):
        with pytest.raises(InputError, match=words):
            self_contact(make_world(cloths))
