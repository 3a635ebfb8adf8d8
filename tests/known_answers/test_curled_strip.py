"""Rods that are curled at rest against known limits and chains of links of least energy; a coarse form of the scene."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from tests.known_answers.a16_curled_strip import BAR, LEAVING, LIGHT, ROD, STRAIGHTENED, TWISTED, aside, hung, leaving
from tests.known_answers.curled_rod import Rod, critical_weight, hanging
from tests.known_answers.twisted_ribbon import MODULUS, SLIGHT, helicoid_torque

NARROW = replace(ROD, width=0.0)
LINKS = 40


def energy_and_joints(rod, weight, turns):
    """Energy (k,) of chains with a rotation (k, LINKS, 3) at each joint, and the ends of their links (k, LINKS, 3).

    A link is turned by half of its rotation before its middle and by half of it after.
    """
    h = 1 / LINKS
    stiffness = np.array([1.0, rod.edgewise, rod.twisting])
    total = 0.5 * h * (stiffness * (turns - [rod.curl, 0, 0]) ** 2).sum(axis=(1, 2))
    frame = np.broadcast_to(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), (len(turns), 3, 3))
    halves = Rotation.from_rotvec((0.5 * h * turns).reshape(-1, 3)).as_matrix().reshape(*turns.shape, 3)
    links = np.empty_like(turns)
    for k in range(LINKS):
        frame = frame @ halves[:, k]
        links[:, k] = h * frame[:, :, 2]
        frame = frame @ halves[:, k]
    joints = np.cumsum(links, axis=1)
    return total + weight * h * (joints[:, :, 2] - links[:, :, 2] / 2).sum(axis=1), joints


def chain(rod, weight, start):
    """Energy, ends of the links (LINKS, 3) and rotations of a chain of least energy, by central differences."""
    step = 1e-5 * np.eye(3 * LINKS)

    def value(turns):
        around = turns + np.concatenate([np.zeros((1, 3 * LINKS)), step, -step])
        energies = energy_and_joints(rod, weight, around.reshape(-1, LINKS, 3))[0]
        return energies[0], (energies[1 : 1 + 3 * LINKS] - energies[1 + 3 * LINKS :]) / 2e-5

    found = minimize(value, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 2000, "maxcor": 40})
    return found.fun, energy_and_joints(rod, weight, found.x.reshape(1, LINKS, 3))[1][0], found.x.reshape(LINKS, 3)


def curled(rod, twist=0.0):
    return np.tile([rod.curl, 0.0, twist], (LINKS, 1))


def test_a_rod_without_weight_is_an_arc_and_a_straight_one_hangs_straight():
    s = np.linspace(0, 1, 9)
    shape = hanging(NARROW, 0.0)
    line = np.stack([np.interp(s, shape.s, column) for column in shape.line.T])
    assert line == pytest.approx(np.stack([(np.cos(6 * s) - 1) / 6, 0 * s, -np.sin(6 * s) / 6]), abs=2e-4)
    assert shape.line[-1] == pytest.approx([(np.cos(6) - 1) / 6, 0, -np.sin(6) / 6], abs=1e-7)
    assert hanging(replace(NARROW, curl=0.0), 20.0).line[-1] == pytest.approx([0, 0, -1], abs=1e-9)


def test_a_rod_in_its_plane_is_the_elastica_that_shooting_finds():
    """theta'' = q r sin theta over the distance r from the end, theta' = -k there: no collocation, no quaternions."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def shoot(angle):
        def rates(r, y):
            return [y[1], STRAIGHTENED * r * np.sin(y[0]), np.sin(y[0]), np.cos(y[0])]

        return solve_ivp(rates, (0, 1), [angle, -NARROW.curl, 0, 0], rtol=1e-11, atol=1e-11).y[:, -1]

    _, _, x, z = shoot(brentq(lambda angle: shoot(angle)[0], 2.5, 3.0, xtol=1e-13))
    assert hanging(NARROW, STRAIGHTENED).line[-1] == pytest.approx([-x, 0, -z], abs=1e-6)


@pytest.mark.parametrize(("weight", "twist"), [(LIGHT, 1.0), (TWISTED, 3.0)])
def test_a_hanging_rod_is_a_chain_of_least_energy(weight, twist):
    """Both start twisted: below the critical weight the chain returns to its plane."""
    _, joints, _ = chain(NARROW, weight, curled(NARROW, twist))
    end = hanging(NARROW, weight, aside=weight == TWISTED).line[-1]
    assert [joints[-1, 0], abs(joints[-1, 1]), joints[-1, 2]] == pytest.approx([end[0], abs(end[1]), end[2]], abs=2e-3)
    assert (aside(joints) > 0.2) == (weight == TWISTED)


def test_twisted_out_of_its_plane_the_rod_has_less_energy_than_in_it():
    flat, _, _ = chain(NARROW, TWISTED, curled(NARROW))
    twisted, _, _ = chain(NARROW, TWISTED, curled(NARROW, 3.0))
    assert twisted < flat - 0.1


def test_the_critical_weight_is_that_at_which_the_chain_loses_its_stiffness_aside():
    """Second derivatives by differences in the plane; of the two, .3 % apart, a chain of 40 links is stiff below."""
    critical = critical_weight(NARROW, 9.3, 9.6)
    lowest = []
    for weight in (critical, 1.01 * critical):
        _, _, turns = chain(NARROW, weight, curled(NARROW))
        moved = [k for k in range(3 * LINKS) if k % 3]
        e = 1e-3 * np.eye(3 * LINKS)[moved]
        pairs = (e[:, None] + e[None]).reshape(-1, 3 * LINKS), (e[:, None] - e[None]).reshape(-1, 3 * LINKS)
        up, down = (
            energy_and_joints(NARROW, weight, (turns.ravel() + each).reshape(-1, LINKS, 3))[0] for each in pairs
        )
        lowest.append(np.linalg.eigvalsh((up - down).reshape(len(moved), -1) / 2e-6)[0])
    assert lowest[0] > 0 > lowest[1]


def test_near_the_critical_weight_squares_of_the_distance_lead_to_it():
    assert critical_weight(ROD, 9.3, 9.6) < LEAVING[0]
    assert leaving(lambda weight: hanging(ROD, weight, aside=True).line) == pytest.approx(
        critical_weight(ROD, 9.3, 9.6), rel=4e-3
    )


def test_a_rod_that_resists_twist_as_a_homogeneous_sheet_stays_in_its_plane():
    """C = 2/(1 + nu) is at least 4/3."""
    assert aside(hanging(replace(NARROW, twisting=4 / 3), TWISTED, aside=True).line) < 1e-9


def test_what_a_width_changes_is_small_and_the_torque_of_its_borders_is_the_helicoids():
    """Free to shorten, a helicoid's borders add E2 w^5 t^3/360 to the torque; held at its length E2 w^5 t^3/160."""
    end, limit = (hanging(rod, TWISTED, aside=True).line[-1] for rod in (ROD, NARROW))
    assert 1e-4 < np.abs(end - limit).max() < 0.2 * ROD.width
    wide, free = Rod(curl=0.0, edgewise=MODULUS / 12, twisting=2.0, width=1.0), 1e-4
    less = (free - wide.twist(np.array(50.0), np.array(2 * free))) / free**3
    assert less == pytest.approx((helicoid_torque() - SLIGHT) / SLIGHT**3 * 320 / 720, rel=1e-4)


def test_a_coarse_strip_twists_out_of_its_plane_as_the_rod_does():
    line, end = hung(TWISTED, 100), hanging(ROD, TWISTED, aside=True).line[-1]
    assert [line[-1, 0], aside(line), line[-1, 2]] == pytest.approx([end[0], abs(end[1]), end[2]], abs=0.03)
    assert aside(hung(LIGHT, 20)) < BAR
    assert aside(hung(STRAIGHTENED, 20)) < BAR
