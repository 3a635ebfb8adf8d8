"""Simulation as a function of JAX arrays."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from clothsim.gradients.bridge import Bridge, missing
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene


def simulate(
    scene: Scene,
    values: Mapping[str, Any],
    frames: Sequence[int] = (-1,),
    stiffness: Mapping[str, float] | None = None,
) -> Any:
    """Run a scene with JAX arrays in place of some of its numbers; `jax.grad` and `jax.jit` go through it.

    Parameters
    ----------
    scene, values, frames, stiffness
        As of `clothsim.gradients.torch_bridge.simulate`.

    Returns
    -------
    array (f, n, 3)
        Positions of all cloths [m], float64 where `jax_enable_x64` is set, else float32.

    Raises
    ------
    ClothsimError
        Where JAX is not installed, or the run fails.
    """
    try:
        jax: Any = import_module("jax")
    except ImportError as error:
        raise missing("jax") from error
    bridge = Bridge(scene, tuple(values), tuple(frames), stiffness)
    kind = jax.numpy.zeros(()).dtype
    shape = jax.ShapeDtypeStruct((len(frames), build(scene).world.n_cloth, 3), kind)

    def forward(*arrays: Any) -> Any:
        return bridge.positions(arrays).astype(kind)

    def back(cotangents: Any, *arrays: Any) -> Any:
        parts = bridge.pulled_back(arrays, cotangents)
        return tuple(part.reshape(np.shape(each)).astype(kind) for part, each in zip(parts, arrays, strict=True))

    @jax.custom_vjp
    def run(*arrays: Any) -> Any:
        return jax.pure_callback(forward, shape, *arrays)

    def run_forward(*arrays: Any) -> Any:
        return run(*arrays), arrays

    def run_back(arrays: Any, cotangents: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(each.shape, kind) for each in arrays)
        return jax.pure_callback(back, shapes, cotangents, *arrays)

    run.defvjp(run_forward, run_back)
    return run(*(jax.numpy.asarray(value, kind) for value in values.values()))
