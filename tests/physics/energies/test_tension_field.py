"""Tension field of the Neo-Hookean sheet: closed forms, derivatives, and a strip that shortens at no cost."""

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.physics.energies.membrane import membrane
from clothsim.physics.energies.tension_field import natural_width, relaxed_density
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene

SHEET = {"mesh": "rectangle", "size": [1.0, 1.0], "cells": [2, 2], "youngs_modulus": 1e3, "thickness": 1e-3}


def energy_of(compression, **fabric):
    table = {**SHEET, "poisson_ratio": 0.3, **fabric}
    scene = Scene(cloth=table, effects={"inertia": {}, "membrane": {"compression": compression}})
    built = build(scene)
    return built.energies["membrane"], built.world.start()


def stretched(x, along, across):
    return x * [along, across, 1.0]


def test_the_natural_width_is_free_of_stress():
    for mu, lam, s1 in ((1.0, 0.0, 1.3), (1.0, 0.86, 1.2), (0.4, 3.0, 2.0)):
        s = natural_width(mu, lam, s1)
        assert mu * s + (lam * np.log(s1 * s) - mu) / s == pytest.approx(0, abs=1e-13)
        assert relaxed_density(mu, lam, s1, 0.5 * s)[2] == 0
        assert relaxed_density(mu, lam, s1, 0.5 * s)[0] == relaxed_density(mu, lam, s1, s)[0]
    assert relaxed_density(1.0, 0.86, 0.9, 0.8) == (0, 0, 0)


@pytest.mark.parametrize("fabric", [{}, {"warp_stiffness": 2.0, "weft_stiffness": 1.0, "shear_stiffness": 0.2}])
def test_compression_costs_its_fraction_and_stretch_all(fabric):
    full, x = energy_of(1.0, **fabric)
    soft, _ = energy_of(0.05, **fabric)
    assert soft.value(stretched(x, 0.9, 0.9)) == pytest.approx(0.05 * full.value(stretched(x, 0.9, 0.9)), rel=1e-12)
    assert soft.value(stretched(x, 1.2, 1.1)) == pytest.approx(full.value(stretched(x, 1.2, 1.1)), rel=1e-12)
    assert soft.value(stretched(x, 1.1, 0.7)) < 0.5 * full.value(stretched(x, 1.1, 0.7))


@pytest.mark.parametrize("fabric", [{}, {"warp_stiffness": 2.0, "weft_stiffness": 1.0, "shear_stiffness": 0.2}])
@pytest.mark.parametrize("shape", [(1.2, 1.1), (1.2, 0.7), (0.9, 0.8)])
def test_derivatives(fabric, shape):
    energy, x = energy_of(0.1, **fabric)
    rng = np.random.default_rng(0)
    x = stretched(x, *shape) + 0.01 * rng.normal(size=x.shape)
    d, h = rng.normal(size=x.shape), 1e-6
    assert (energy.value(x + h * d) - energy.value(x - h * d)) / (2 * h) == pytest.approx(
        np.sum(energy.gradient(x) * d), rel=1e-6, abs=1e-9
    )
    blocks = energy.hessian(x, project=False).blocks
    local = d[energy.triangles].reshape(-1, 9)
    curvature = np.einsum("ti,tij,tj->", local, blocks, local)
    change = (energy.gradient(x + h * d) - energy.gradient(x - h * d)) / (2 * h)
    assert curvature == pytest.approx(np.sum(change * d), rel=1e-5)
    assert np.linalg.eigvalsh(energy.hessian(x).blocks).min() > -1e-9 * abs(blocks).max()


def test_a_key_that_the_elements_do_not_take_is_refused():
    scene = Scene(cloth=SHEET, effects={"inertia": {}})
    world = build(scene).world
    keys = Scene(cloth=SHEET, effects={"membrane": {"compression": 0.1, "elements": "pairs"}}).effects["membrane"]
    with pytest.raises(InputError, match="compression"):
        membrane(world, keys)
