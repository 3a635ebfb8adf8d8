"""Elastic bands against closed forms: tension, energy, slack, key frames and a gathered strip."""

import numpy as np
import pytest
from effect_builders import elastic_bands
from meshes import cloth, grid
from small_scenes import SHEET, small_scene
from solving import step_at

from clothsim import Scene, simulate
from clothsim.base.errors import InputError
from clothsim.mesh.world import make_world
from clothsim.physics.energies.base import Off


def sheet():
    return make_world([cloth(*grid(2, 2))])


def one(**keys):
    return elastic_bands(sheet(), band=[{"select": "left", "stiffness": 20.0, **keys}])


@pytest.mark.parametrize("stretch", [1.0, 1.3])
def test_energy_and_tension_are_those_of_a_bar(stretch):
    s, k = 0.8, 20.0
    energy = one(length_ratio=s)
    x = sheet().start() * [1.0, stretch, 1.0]
    assert energy.value(x) == pytest.approx(0.5 * k * (stretch / s - 1) ** 2 * s)
    pulls = energy.gradient(x)[:, 1]
    np.testing.assert_allclose(pulls[[0, 2]], [-k * (stretch / s - 1), k * (stretch / s - 1)])
    assert abs(pulls[1]) < 1e-12


def test_its_stiffness_is_the_force_that_doubles_its_length():
    pulls = one(length_ratio=0.5).gradient(sheet().start())[:, 1]
    np.testing.assert_allclose(pulls[[0, 2]], [-20.0, 20.0])


def test_a_band_that_is_longer_than_its_edge_does_not_push():
    energy = one(length_ratio=1.2)
    x = sheet().start()
    assert energy.value(x) == 0.0
    assert not energy.gradient(x).any()
    assert not len(energy.hessian(x).elements)


def test_a_band_is_drawn_in_over_time():
    energy = one(length_ratio=[[0.0, 1.0], [2.0, 0.5]])
    assert energy.drives
    assert not one().drives
    bound = energy.begin(step_at(sheet().start(), dt=1.0))
    np.testing.assert_allclose(bound.lengths, 0.75 * 0.5)
    assert "37.5 cm" not in energy.final_notes(sheet().start(), 1.0)[0]
    assert "of 75 cm is 100 cm long and pulls with 6.67 N" in energy.final_notes(sheet().start(), 1.0)[0]


def test_it_gathers_what_it_is_sewn_to(tmp_path):
    bands = {"band": [{"select": "left", "stiffness": 50.0, "length_ratio": [[0.0, 1.0], [0.1, 0.6]]}]}
    effects = {"inertia": {}, "membrane": {}, "bending": {}, "damping": {"rate": 20.0}, "elastic_bands": bands}
    run = simulate(small_scene(cloth=SHEET, body=(), effects=effects, run={"duration": 0.3}), tmp_path)
    assert run.status == "completed", run.reason
    left = run.positions(0)[:, 0] < run.positions(0)[:, 0].min() + 1e-6
    long = [np.ptp(run.positions(frame)[left, 1]) for frame in (0, -1)]
    assert long[1] < 0.9 * long[0]
    assert any("elastic_bands" in note for note in run.summary["found"])


def test_what_does_nothing_is_off_and_what_is_wrong_is_named():
    assert isinstance(elastic_bands(sheet(), band=[]), Off)
    assert isinstance(one(stiffness=0), Off)
    with pytest.raises(InputError, match=r"band\[0\].*length_ratio"):
        one(length_ratio=[[0.0, 1.0], [1.0, 0.0]])
    with pytest.raises(InputError, match=r"band\[0\].select"):
        one(select=[0, 8])


def test_a_box_selects_edges_of_the_border():
    keys = {"band": [{"select": {"box": [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]}, "stiffness": 1.0, "length_ratio": 1.0}]}
    cloth = {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [10, 10]}
    with pytest.raises(InputError, match="border"):
        simulate(Scene(cloth, effects={"inertia": {}, "elastic_bands": keys}))
