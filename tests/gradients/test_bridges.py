"""Bridges to other packages (G-10): gradients in double precision, where the packages are installed."""

import sys

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, FRICTION, falling_scene

from clothsim import ClothsimError
from clothsim.gradients import jax_bridge, torch_bridge
from clothsim.gradients.bridge import Bridge

SCENE = falling_scene(ELASTIC | CONTACT | FRICTION)
VALUES = {"cloth.youngs_modulus": np.array(1e5), "effects.gravity.acceleration": np.array([0.0, 0.0, -9.81])}


def test_the_bridge_itself():
    bridge = Bridge(SCENE, tuple(VALUES), (1, -1))
    values, rng = list(VALUES.values()), np.random.default_rng(0)
    x = bridge.positions(values)
    assert x.shape == (2, 36, 3)
    cotangents = rng.standard_normal(x.shape)
    by_modulus, by_gravity = bridge.pulled_back(values, cotangents)
    assert bridge.trace(values) is bridge.trace([value.copy() for value in values])  # one run for both
    for part, found, step in ((0, by_modulus, 10.0), (1, by_gravity[2], np.array([0.0, 0.0, 1e-4]))):
        moved = []
        for sign in (1, -1):
            there = [value.copy() for value in values]
            there[part] = there[part] + sign * step
            moved.append(np.vdot(cotangents, bridge.positions(there)))
        assert (moved[0] - moved[1]) / (2 * np.max(step)) == pytest.approx(float(found), rel=1e-6)


def test_the_bridge_holds_the_stiffness_of_its_scene():
    """A number in the call changes no stiffness: positions and derivative are of one function."""
    bridge = Bridge(falling_scene(ELASTIC | {"body_contact": {}}), ("cloth.youngs_modulus",))
    values = [np.array(1.3e5)]
    x = bridge.positions(values)
    assert bridge.trace(values).stiffness == bridge.held
    moved = [bridge.positions([values[0] + sign * 10.0])[0, :, 2].mean() for sign in (1, -1)]
    cotangents = np.zeros_like(x)
    cotangents[0, :, 2] = 1 / x.shape[1]
    found = float(bridge.pulled_back(values, cotangents)[0])
    assert (moved[0] - moved[1]) / 20 == pytest.approx(found, rel=1e-5)


def test_torch():
    torch = pytest.importorskip("torch")
    tensors = [torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in VALUES.values()]

    def scaled(modulus, gravity):  # gradcheck takes one step for all
        return torch_bridge.simulate(SCENE, dict(zip(VALUES, (1e5 * modulus, gravity), strict=True)))

    assert torch.autograd.gradcheck(
        scaled, (tensors[0].detach().div(1e5).requires_grad_(), tensors[1]), eps=1e-5, rtol=1e-6, atol=1e-9
    )


def test_jax():
    jax = pytest.importorskip("jax")
    from jax.test_util import check_grads

    with jax.enable_x64(True):

        def height(modulus, gravity):
            values = {"cloth.youngs_modulus": 1e5 * modulus, "effects.gravity.acceleration": gravity}
            return jax_bridge.simulate(SCENE, values)[0, :, 2].mean()

        at = jax.numpy.asarray(1.0), jax.numpy.asarray(VALUES["effects.gravity.acceleration"])
        check_grads(height, at, order=1, modes=["rev"], eps=1e-4, rtol=1e-6, atol=1e-9)
        assert np.asarray(jax.jit(height)(*at)) == pytest.approx(float(height(*at)))


@pytest.mark.parametrize(("name", "bridge"), [("torch", torch_bridge), ("jax", jax_bridge)])
def test_without_the_package(name, bridge, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    torch_bridge._function.cache_clear()
    with pytest.raises(ClothsimError):
        bridge.simulate(SCENE, VALUES)
    torch_bridge._function.cache_clear()
