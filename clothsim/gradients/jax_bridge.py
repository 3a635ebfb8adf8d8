"""Simulation as a function of JAX arrays."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.gradients.bridge import Bridge, Differentiable, RolloutBridge, missing
from clothsim.scene.scene import Scene

if TYPE_CHECKING:
    from clothsim.gradients.layer import Layer


def simulate(
    scene: Scene,
    values: Mapping[str, Any],
    frames: Sequence[int] = (-1,),
    stiffness: Mapping[str, float] | None = None,
) -> Any:
    """Run a scene with JAX arrays in place of some of its numbers; compatible with `jax.grad` and `jax.jit`.

    Parameters
    ----------
    scene, values, frames, stiffness
        As in `clothsim.gradients.torch_bridge.simulate`.

    Returns
    -------
    array (f, n, 3)
        Positions of all cloths [m], float64 if `jax_enable_x64` is set, else float32.

    Raises
    ------
    ClothsimError
        If JAX is not installed, or the run fails.
    """
    function = _function(Bridge(scene, tuple(values), tuple(frames), stiffness))
    return function(*values.values())[0]


def rollout(
    layer: "Layer", x: Any, v: Any, parameters: Mapping[str, Any], k: int, by_step: Sequence[str] = ()
) -> tuple[Any, Any]:
    """Take k steps of a layer with JAX arrays; `jax.grad` and `jax.jit` go through them.

    Parameters
    ----------
    layer, x, v, parameters, k, by_step
        As in `clothsim.gradients.torch_bridge.rollout`.

    Returns
    -------
    (k, n, 3) arrays
        Positions [m] and velocities [m/s] after each step.
    """
    return tuple(_function(RolloutBridge(layer, tuple(parameters), k, tuple(by_step)))(x, v, *parameters.values()))


def _function(bridge: Differentiable) -> Any:
    """The function of JAX arrays; JAX is imported here."""
    try:
        jax: Any = import_module("jax")
    except ImportError as error:
        raise missing("jax") from error
    kind = jax.numpy.zeros(()).dtype
    shapes = tuple(jax.ShapeDtypeStruct(shape, kind) for shape in bridge.shapes)

    def forward(*arrays: Any) -> Any:
        return tuple(each.astype(kind) for each in bridge.outputs(arrays))

    def back(cotangents: Any, *arrays: Any) -> Any:
        parts = bridge.back(arrays, cotangents)
        return tuple(part.reshape(np.shape(each)).astype(kind) for part, each in zip(parts, arrays, strict=True))

    @jax.custom_vjp
    def run(*arrays: Any) -> Any:
        return jax.pure_callback(forward, shapes, *arrays)

    def run_forward(*arrays: Any) -> Any:
        return run(*arrays), arrays

    def run_back(arrays: Any, cotangents: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(each.shape, kind) for each in arrays)
        return jax.pure_callback(back, shapes, cotangents, *arrays)

    run.defvjp(run_forward, run_back)
    return lambda *values: run(*(jax.numpy.asarray(value, kind) for value in values))
