"""Simulation as a function of PyTorch tensors."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

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
    """Run a scene with tensors in place of some of its numbers.

    Parameters
    ----------
    scene : Scene
    values : mapping of str to tensor
        Numbers by their path in the scene, such as "cloth.youngs_modulus", and `start` and `velocity` of the cloth,
        (n, 3); those that require a gradient get one.
    frames : sequence of int
        Frames whose positions are returned.
    stiffness : mapping, optional
        Contact stiffnesses to hold [Pa], by effect (`Bridge.stiffness`).

    Returns
    -------
    tensor (f, n, 3)
        Positions of all cloths [m], float64, on the CPU.

    Raises
    ------
    ClothsimError
        If PyTorch is not installed, or the run fails.
    """
    bridge = Bridge(scene, tuple(values), tuple(frames), stiffness)
    return _function().apply(bridge, *values.values())[0]


def rollout(
    layer: "Layer", x: Any, v: Any, parameters: Mapping[str, Any], k: int, by_step: Sequence[str] = ()
) -> tuple[Any, Any]:
    """Take k steps of a layer with tensors.

    Parameters
    ----------
    layer : Layer
        From `clothsim.layer`.
    x, v : tensor (n, 3)
        Positions [m] and velocities [m/s] of the cloth, without a past.
    parameters : mapping of str to tensor
        As in `Layer.rollout`, held over the steps.
    k : int
        Number of steps.
    by_step : sequence of str
        Parameters that have a value for each step, along their first axis of length k.

    Returns
    -------
    (k, n, 3) tensors
        Positions and velocities after each step, float64, on the CPU.
    """
    bridge = RolloutBridge(layer, tuple(parameters), k, tuple(by_step))
    return tuple(_function().apply(bridge, x, v, *parameters.values()))


@cache
def _function() -> Any:
    """The autograd function; PyTorch is imported here."""
    try:
        torch: Any = import_module("torch")
    except ImportError as error:
        raise missing("torch") from error

    class Simulated(torch.autograd.Function):
        """Arrays of a run or a rollout, and its backward pass."""

        @staticmethod
        def forward(context: Any, bridge: Differentiable, *tensors: Any) -> Any:
            """Run the scene."""
            context.bridge, context.tensors = bridge, tensors
            return tuple(torch.from_numpy(each.copy()) for each in bridge.outputs([_array(each) for each in tensors]))

        @staticmethod
        def backward(context: Any, *cotangents: Any) -> Any:
            """Go back over the steps."""
            given = [_array(each) for each in context.tensors]
            parts = context.bridge.back(given, [_array(each) for each in cotangents])
            pairs = zip(parts, context.tensors, strict=True)
            return (None, *(torch.as_tensor(part).reshape(each.shape).to(each) for part, each in pairs))

    return Simulated


def _array(tensor: Any) -> Any:
    return tensor.detach().cpu().double().numpy()
