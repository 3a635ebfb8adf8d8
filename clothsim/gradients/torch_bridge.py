"""Simulation as a function of PyTorch tensors."""

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import Any

from clothsim.gradients.bridge import Bridge, missing
from clothsim.scene.scene import Scene


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
        The scene.
    values : mapping of str to tensor
        Numbers by their path in the scene, as "cloth.youngs_modulus"; those that require a gradient get one.
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
        Where PyTorch is not installed, or the run fails.
    """
    bridge = Bridge(scene, tuple(values), tuple(frames), stiffness)
    return _function().apply(bridge, *values.values())


@cache
def _function() -> Any:
    """The autograd function; PyTorch is imported here."""
    try:
        torch: Any = import_module("torch")
    except ImportError as error:
        raise missing("torch") from error

    class Simulated(torch.autograd.Function):
        """Positions of a run, and its backward pass."""

        @staticmethod
        def forward(context: Any, bridge: Bridge, *tensors: Any) -> Any:
            """Run the scene."""
            context.bridge, context.tensors = bridge, tensors
            return torch.from_numpy(bridge.positions([_array(each) for each in tensors]))

        @staticmethod
        def backward(context: Any, cotangents: Any) -> Any:
            """Go back over the steps."""
            given = [_array(each) for each in context.tensors]
            parts = context.bridge.pulled_back(given, _array(cotangents))
            pairs = zip(parts, context.tensors, strict=True)
            return (None, *(torch.as_tensor(part).reshape(each.shape).to(each) for part, each in pairs))

    return Simulated


def _array(tensor: Any) -> Any:
    return tensor.detach().cpu().double().numpy()
