"""Optional protocols: energies without them get the neutral answer, and energies with them their own."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from effect_builders import friction, gravity, membrane
from meshes import deformed, small_world
from solving import step_at

from clothsim.physics.energies.links import Links
from clothsim.physics.energies.protocols import (
    NO_REPORT,
    ChangingMaterial,
    ContactGap,
    is_driven,
    is_idle,
    lag_iterations,
    report_of,
    restricted,
)
from clothsim.physics.energies.quadratic_bending import quadratic_bending


def test_an_energy_without_protocols_gets_the_neutral_answers():
    world = small_world()
    x, energy = world.start(), quadratic_bending(world.hinges, world)
    assert not is_idle(energy)
    assert not is_driven(energy)
    assert lag_iterations([]) == lag_iterations([energy]) == 1
    assert restricted(energy, np.zeros(len(x), bool), x) is energy
    assert report_of(energy) is NO_REPORT
    assert NO_REPORT.defaults_used() == NO_REPORT.final_notes(x, 1.0) == ()
    assert NO_REPORT.tightest(x) == ""
    assert NO_REPORT.counts() == {}
    assert energy.step_limit(x, x, 0.7) == 0.7
    assert gravity(world).begin(step_at(x, load=0.5)).load == 0.5


def test_the_largest_number_of_solves_counts():
    world = small_world()
    lagged = [friction(world, iterations=k, contacts=("self_contact",)) for k in (2, 5, 3)]
    assert lag_iterations([gravity(world), *lagged]) == 5


def test_a_sum_over_elements_is_restricted_to_those_with_a_moving_vertex():
    world = small_world()
    energy, x = membrane(world), world.start()
    moving = np.zeros(len(x), bool)
    moving[energy.triangles[0, 1]] = True
    part = restricted(energy, moving, x)
    expected = moving[energy.triangles].any(axis=1)
    assert 0 < expected.sum() < len(expected)
    assert np.array_equal(part.triangles, energy.triangles[expected])
    assert np.array_equal(part.mu, energy.mu[expected])


def test_links_without_stiffness_idle():
    none = np.zeros(2)
    links = Links(np.array([[0], [1]]), np.ones((2, 1)), np.zeros((2, 3)), none, none, np.zeros(2, bool))
    assert is_idle(links)
    assert not is_idle(replace(links, stiffnesses=np.array([0.0, 1.0])))


def test_contact_begins_at_offset_and_d_hat():
    @dataclass(frozen=True)
    class Gap(ContactGap):
        d_hat: float
        offset: float

        def minimum_gap(self, x):
            return np.inf

        def gap_change(self, x, dx):
            return 0.0

    assert Gap(0.25, 0.5).activation_distance == 0.75


def test_a_material_of_a_step_is_that_of_its_end_and_its_change_works():
    """A stiffness that grows as 1 + t: from 1.3 to 2 in the step from 0.3 s to 1 s."""
    world = small_world()
    first, x = membrane(world), deformed(world, 2, 0.08)

    def made(numbers):
        factor = numbers[0][0]
        return replace(first, mu=factor * first.mu, lam=factor * first.lam)

    changing = ChangingMaterial(first, lambda time: ((1.0 + time,),), made)
    bound = changing.begin(replace(step_at(world.start(), dt=0.7), time=0.3))
    np.testing.assert_allclose(bound.gradient(x), 2.0 * first.gradient(x), rtol=1e-12)
    assert first.value(x) > 0
    assert changing.work_of_change(x, 0.3, 1.0, bound) == pytest.approx((2.0 - 1.3) * first.value(x), rel=1e-12)


def test_a_protocol_without_its_method_cannot_be_made():
    class Nothing(ContactGap):
        pass

    with pytest.raises(TypeError, match="minimum_gap"):
        Nothing()
