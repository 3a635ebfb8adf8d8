"""Bridges to other packages (G-10): gradients in double precision, where the packages are installed."""

import sys

import numpy as np
import pytest
from adjoint_cases import CONTACT, ELASTIC, FRICTION, falling_scene

import clothsim
from clothsim import ClothsimError, InputError
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


@pytest.fixture(scope="module")
def contact_layer():
    """In contact with friction from the start on: the state after a fall of 4 steps."""
    layer = clothsim.layer(falling_scene(ELASTIC | CONTACT | {"friction": {}}))
    return layer, layer.rollout(layer.start, None, 4).states[-1]


def rolled(bridge, mean, layer, k=2):
    """A number of x, v, Young's modulus over its own, and forces step by step."""

    def loss(x, v, modulus, force):
        given = {"cloth.youngs_modulus": 1e5 * modulus, "force": force}
        xs, vs = bridge.rollout(layer, x, v, given, k, by_step=("force",))
        return mean(xs[-1, :, 2] ** 2) + 0.1 * mean(vs**2)

    return loss


def test_rollout_in_torch(contact_layer):
    torch = pytest.importorskip("torch")
    layer, state = contact_layer
    arrays = state.x, state.v, np.array(1.0), np.zeros((2, *state.x.shape))
    tensors = [torch.tensor(each, dtype=torch.float64, requires_grad=True) for each in arrays]
    loss = rolled(torch_bridge, torch.mean, layer)
    scales = [torch.tensor(np.random.default_rng(k).standard_normal(a.shape)) for k, a in enumerate(arrays)]

    def along(*h):  # along one direction of each
        moved = zip(tensors, h, scales, strict=True)
        return loss(*(each.detach() + size * d for each, size, d in moved))

    h = [torch.zeros((), dtype=torch.float64, requires_grad=True) for _ in tensors]
    assert torch.autograd.gradcheck(along, h, eps=1e-6, rtol=1e-5, atol=1e-9)


def test_rollout_in_jax(contact_layer):
    jax = pytest.importorskip("jax")
    from jax.test_util import check_grads

    layer, state = contact_layer
    with jax.enable_x64(True):
        loss = rolled(jax_bridge, jax.numpy.mean, layer)
        arrays = state.x, state.v, np.array(1.0), np.zeros((2, *state.x.shape))
        scales = [np.random.default_rng(k).standard_normal(a.shape) for k, a in enumerate(arrays)]

        def along(h):
            return loss(*(a + h[k] * scales[k] for k, a in enumerate(arrays)))

        check_grads(along, (jax.numpy.zeros(4),), order=1, modes=["rev"], eps=1e-6, rtol=1e-5, atol=1e-9)


def test_the_start_is_a_value(contact_layer):
    scene, state = falling_scene(ELASTIC | CONTACT), contact_layer[1]
    bridge = Bridge(scene, ("start", "velocity"))
    values = [contact_layer[0].start.x, state.v]
    cotangents = np.random.default_rng(0).standard_normal((1, 36, 3))
    found = bridge.pulled_back(values, cotangents)
    for k, part in enumerate(found):
        d = np.random.default_rng(k).standard_normal(part.shape)
        moved = [
            np.vdot(cotangents, bridge.positions([v + sign * 1e-6 * d * (j == k) for j, v in enumerate(values)]))
            for sign in (1, -1)
        ]
        assert (moved[0] - moved[1]) / 2e-6 == pytest.approx(np.vdot(part, d), rel=1e-5)


@pytest.mark.parametrize("bridge", [torch_bridge, jax_bridge])
def test_what_is_no_number_is_refused_as_elsewhere(bridge):
    """Not as an error within a callback of JAX."""
    pytest.importorskip(bridge.__name__.removeprefix("clothsim.gradients.").removesuffix("_bridge"))
    with pytest.raises(InputError):
        bridge.simulate(SCENE, {"cloth.mesh": 1.0})


@pytest.mark.parametrize(("name", "bridge"), [("torch", torch_bridge), ("jax", jax_bridge)])
def test_without_the_package(name, bridge, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    torch_bridge._function.cache_clear()
    with pytest.raises(ClothsimError):
        bridge.simulate(SCENE, VALUES)
    torch_bridge._function.cache_clear()
