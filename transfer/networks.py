"""Small networks: affine layers, and affine layers blended by shares, with an activation between them.

A blended layer is a mean of affine maps, sum_j s_j (W_j h + b_j), with shares s_j >= 0 of sum 1 that depend on another
input (Holden et al. 2017; Wang et al. 2019). All is written for NumPy's arrays and for JAX's alike; training is Adam's
method in JAX (Kingma and Ba 2015).
"""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.triangle_surface import Floats

Layers = tuple[tuple[Floats, Floats], ...]
"""Weights (p, q) and biases (q,) of each layer; of a blended one (j, p, q) and (j, q)."""
Activation = Callable[[Any], Any]


def network(layers: Any, values: Any, activation: Activation = np.tanh) -> Any:
    """Outputs (n, q) of inputs (n, p): affine layers with the activation between them."""
    *hidden, (weights, biases) = layers
    for inner, shift in hidden:
        values = activation(values @ inner + shift)
    return values @ weights + biases


def blended_network(layers: Any, shares: Any, values: Any, activation: Activation) -> Any:
    """Outputs (n, q) of inputs (n, p): layers blended by shares (n, j), with the activation between them."""
    *hidden, last = layers
    for each in hidden:
        values = activation(_blended(each, shares, values))
    return _blended(last, shares, values)


def _blended(layer: Any, shares: Any, values: Any) -> Any:
    weights, biases = layer
    mixed = (shares[:, :, None] * values[:, None, :]).reshape(len(values), -1)
    return mixed @ weights.reshape(mixed.shape[1], -1) + shares @ biases


def relu6(values: Any) -> Any:
    """min(max(0, x), 6)."""
    return values.clip(0.0, 6.0)


def leaky(values: Any) -> Any:
    """x above 0, x / 4 below: PReLU (He et al. 2015) with the slope from which it is trained."""
    return values.clip(0.0) + 0.25 * values.clip(None, 0.0)


def shares_of(positive: Any) -> Any:
    """Rows (n, j) of numbers >= 0, divided by their sums; a row of zeros stays so."""
    return positive / (positive.sum(axis=1, keepdims=True) + 1e-12)


def layer_arrays(name: str, layers: Layers) -> dict[str, Floats]:
    """Arrays of a network by name, for `numpy.savez`; see `read_layers`."""
    made: dict[str, Floats] = {}
    for k, (weights, biases) in enumerate(layers):
        made |= {f"{name}.{k}.weights": weights, f"{name}.{k}.biases": biases}
    return made


def read_layers(arrays: Mapping[str, ArrayLike], name: str) -> Layers:
    """The network of `layer_arrays`. KeyError where it has no layer."""
    made: list[tuple[Floats, Floats]] = []
    while f"{name}.{len(made)}.weights" in arrays:
        at = f"{name}.{len(made)}"
        made.append((np.asarray(arrays[f"{at}.weights"]), np.asarray(arrays[f"{at}.biases"])))
    if not made:
        raise KeyError(f"{name}.0.weights")
    return tuple(made)


def random_layers(random: np.random.Generator, sizes: Sequence[int], maps: int = 0) -> list[tuple[Any, Any]]:
    """Layers between widths in single precision, weights of variance 1 / inputs; blended ones have `maps` each."""
    shape = (maps,) if maps else ()
    made = []
    for inputs, outputs in zip(sizes, sizes[1:], strict=False):
        weights = random.standard_normal((*shape, inputs, outputs)) / np.sqrt(inputs)
        made.append((np.asarray(weights, np.float32), np.zeros((*shape, outputs), np.float32)))
    return made


def in_double_precision(layers: Any) -> Layers:
    """A trained network as NumPy's arrays."""
    return tuple((np.asarray(weights, np.float64), np.asarray(biases, np.float64)) for weights, biases in layers)


CHUNK = 100
"""Steps that are compiled as one loop."""
DECAYS, ADAM_FLOOR = (0.9, 0.999), 1e-8
"""Of Adam's method."""

Loss = Callable[[Any, Any, Any], Any]
"""Loss of parameters, rows of the batch and a key of JAX's random numbers."""


def minimised(start: Any, loss: Loss, steps: int, rate: float, batch: int, count: int, seed: int) -> Any:
    """Parameters after steps of Adam's method.

    Parameters
    ----------
    start : pytree
        Parameters at the beginning.
    loss : callable
        Of parameters, rows and a key.
    steps : int
    rate : float
        Of the first step; it falls with half a cosine to 0.
    batch, count : int
        Rows of a step, drawn from 0 to count - 1.
    seed : int
    """
    return minimised_each(start, loss, (steps,), rate, batch, count, seed)[0]


def minimised_each(
    start: Any, loss: Loss, steps: Sequence[int], rate: float, batch: int, count: int, seed: int
) -> list[Any]:
    """Parameters after each number of steps, as of `minimised`, all from the same start; compiled once."""
    jax = jax_module()
    np_, tree = jax.numpy, jax.tree_util.tree_map
    first, second = DECAYS

    def step(state: Any, at: Any) -> Any:
        (values, slope, square, key), (number, end) = state, at
        key, row_key, loss_key = jax.random.split(key, 3)
        rows = jax.random.randint(row_key, (min(batch, count),), 0, count)
        gradient = jax.grad(loss)(values, rows, loss_key)
        slope = tree(lambda m, g: first * m + (1 - first) * g, slope, gradient)
        square = tree(lambda v, g: second * v + (1 - second) * g * g, square, gradient)
        now = 0.5 * rate * (1 + np_.cos(np_.pi * number / end))
        now *= np_.sqrt(1 - second ** (number + 1)) / (1 - first ** (number + 1))
        values = tree(lambda p, m, v: p - now * m / (np_.sqrt(v) + ADAM_FLOOR), values, slope, square)
        return (values, slope, square, key), None

    run = jax.jit(lambda state, at: jax.lax.scan(step, state, at)[0])
    zero, made = tree(np_.zeros_like, start), []
    for total in steps:
        state = (tree(np_.asarray, start), zero, zero, jax.random.PRNGKey(seed))
        for begin in range(0, total, CHUNK):
            numbers = np_.arange(begin, min(begin + CHUNK, total), dtype=np_.float32)
            state = run(state, (numbers, np_.full_like(numbers, total)))
        made.append(state[0])
    return made


def jax_module() -> Any:
    """JAX. TransferError where it is not installed."""
    try:
        return import_module("jax")
    except ImportError as error:
        raise TransferError("A training needs the package jax.", "pip install 'clothsim[learn]'") from error
