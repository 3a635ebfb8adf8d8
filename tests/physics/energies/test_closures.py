"""Zips and buttons against closed forms: the V of a slider, forces, the gap of contact, refused input."""

import numpy as np
import pytest
from effect_builders import closures, self_contact
from meshes import cloth, grid
from small_scenes import SHEET, small_scene
from solving import step_at

from clothsim import simulate
from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off
from clothsim.physics.energies.closures import ZONE

SIDES = {"from": {"side": "left"}, "to": {"side": "right"}}


def sheet(n=10):
    return make_world([cloth(*grid(n, n))])


def one(n=10, **keys):
    return closures(sheet(n), zip=[{**SIDES, "stiffness": 20.0, **keys}])


@pytest.mark.parametrize("u", [0.0, 0.5, 1.0])
def test_the_strings_of_a_slider_are_a_v(u):
    """Borders 1 m apart: closed below the slider, free above the V, the gap over its length in between."""
    energy = one(closed=u, gap=0.1)
    p = energy.closures[0].parameters
    np.testing.assert_allclose(p, np.linspace(0, 1, 11), atol=1e-12)
    head = u * (1 + ZONE) - ZONE
    expected = np.interp(p, [head, head + ZONE], [0.1, 1.0])
    acts = p < head + ZONE - 1e-12
    np.testing.assert_allclose(energy.lengths[acts], expected[acts], atol=1e-12)
    np.testing.assert_allclose(energy.stiffnesses, np.where(acts, 20.0, 0.0))
    assert energy.idle == (u == 0)
    assert len(energy.joined_rows) == acts.sum()


def test_a_closed_zip_pulls_as_its_stitches_do():
    x = sheet(4).start()
    gradient = one(4, gap=0.25).gradient(x)
    left, right = x[:, 0] < 1e-9, x[:, 0] > 1 - 1e-9
    if not left.any():  # a grid about the origin
        left, right = x[:, 0] == x[:, 0].min(), x[:, 0] == x[:, 0].max()
    np.testing.assert_allclose(gradient[left], np.tile([-15.0, 0, 0], (5, 1)), atol=1e-12)
    np.testing.assert_allclose(gradient[right], np.tile([15.0, 0, 0], (5, 1)), atol=1e-12)
    assert one(4, gap=0.25).value(x) == pytest.approx(5 * 0.5 * 20.0 * 0.75**2)
    assert one(4, gap=1.0).value(x) == 0.0


def test_the_second_border_may_run_the_other_way():
    straight, turned = one(4), one(4, flip=True)
    np.testing.assert_array_equal(np.sort(straight.rows[:, 0]), np.sort(turned.rows[:, 0]))
    assert one(4, flip=True).value(sheet(4).start()) > straight.value(sheet(4).start())


def test_it_closes_from_its_first_end_and_opens_again():
    energy = one(closed=[[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    assert energy.drives
    assert not one().drives
    counts = [
        int((energy.begin(step_at(sheet().start(), dt=t)).stiffnesses > 0).sum()) for t in (0.0, 0.5, 1.0, 1.5, 2.0)
    ]
    assert counts[0] == counts[4] == 0
    assert 0 < counts[1] == counts[3] < counts[2] == 11


@pytest.mark.parametrize(("count", "expected"), [(1, [0.5]), (2, [0.0, 1.0]), (3, [0.0, 0.5, 1.0]), (99, None)])
def test_buttons_are_evenly_spread(count, expected):
    energy = closures(sheet(), buttons=[{**SIDES, "stiffness": 20.0, "count": count}])
    wanted = np.linspace(0, 1, 11) if expected is None else expected
    np.testing.assert_allclose(energy.closures[0].parameters, wanted, atol=1e-12)


def test_contact_leaves_the_gap_at_which_it_pushes_nothing():
    contact = self_contact(sheet(4))
    energy = closures(sheet(4), zip=[{**SIDES, "stiffness": 20.0}], built={"self_contact": contact})
    np.testing.assert_allclose(energy.lengths, contact.activation_distance)


def test_a_tube_is_zipped_in_a_run(tmp_path):
    table = {"zip": [{**SIDES, "stiffness": 60.0, "closed": [[0.0, 0.0], [0.4, 1.0]]}]}
    effects = {"inertia": {}, "membrane": {}, "bending": {}, "damping": {"rate": 20.0}, "closures": table}
    run = simulate(
        small_scene(cloth=SHEET, body=(), effects=effects | {"self_contact": {}}, run={"duration": 0.6}), tmp_path
    )
    assert run.status == "completed", run.reason
    x = run.positions(0)
    sides = [np.flatnonzero(np.isclose(x[:, 0], side)) for side in (x[:, 0].min(), x[:, 0].max())]
    gaps = [
        np.linalg.norm(run.positions(frame)[sides[0]] - run.positions(frame)[sides[1]], axis=1) for frame in (0, -1)
    ]
    assert gaps[1].max() < 0.1 * gaps[0].min()
    assert any("stitches are closed" in note for note in run.summary["found"])


def test_what_does_nothing_is_off_and_what_is_wrong_is_named():
    assert isinstance(closures(sheet(4)), Off)
    assert isinstance(one(4, stiffness=0), Off)
    for keys in ({"closed": 1.5}, {"closed": [[0.0, 0.0], [1.0, 1.5]]}):
        with pytest.raises(InputError, match=r"zip\[0\].closed"):
            one(4, **keys)
    for flip in (False, True):
        with pytest.raises(InputError, match=r"zip\[0\]"):
            one(4, to={"side": "left"}, flip=flip)
    moving = one(4, closed=lambda time: 3.0 if time > 0.1 else 0.0)
    with pytest.raises(InputError, match=r"zip\[0\].closed is 3"):
        moving.closures[0].open_fractions(0.2)


def test_borders_of_different_lengths_and_buttons_that_are_not_there_are_noted():
    few = closures(sheet(4), buttons=[{**SIDES, "stiffness": 20.0, "count": 9}])
    assert [len(each.notes) for each in (one(4).closures[0], few.closures[0])] == [0, 1]
    assert "5 of 9 buttons" in few.defaults_used()[1]
    uneven = one(4, to={"vertices": [4, 9]}).defaults_used()
    assert "borders of 1 and 0.25 m" in uneven[1]
