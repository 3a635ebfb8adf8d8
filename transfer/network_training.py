"""Adam's method in JAX, for the networks of `transfer.networks` (Kingma and Ba 2015)."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from transfer.errors import TransferError

CHUNK = 100
"""Steps that are compiled as one loop."""
DECAYS, FLOOR = (0.9, 0.999), 1e-8
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
    jax = jax_module()
    np_, tree = jax.numpy, jax.tree_util.tree_map
    first, second = DECAYS

    def step(state: Any, number: Any) -> Any:
        values, slope, square, key = state
        key, row_key, loss_key = jax.random.split(key, 3)
        rows = jax.random.randint(row_key, (min(batch, count),), 0, count)
        gradient = jax.grad(loss)(values, rows, loss_key)
        slope = tree(lambda m, g: first * m + (1 - first) * g, slope, gradient)
        square = tree(lambda v, g: second * v + (1 - second) * g * g, square, gradient)
        now = 0.5 * rate * (1 + np_.cos(np_.pi * number / steps))
        now *= np_.sqrt(1 - second ** (number + 1)) / (1 - first ** (number + 1))
        values = tree(lambda p, m, v: p - now * m / (np_.sqrt(v) + FLOOR), values, slope, square)
        return (values, slope, square, key), None

    run = jax.jit(lambda state, numbers: jax.lax.scan(step, state, numbers)[0])
    zero = tree(np_.zeros_like, start)
    state = (tree(np_.asarray, start), zero, zero, jax.random.PRNGKey(seed))
    for begin in range(0, steps, CHUNK):
        state = run(state, np_.arange(begin, min(begin + CHUNK, steps), dtype=np_.float32))
    return state[0]


def jax_module() -> Any:
    """JAX. TransferError where it is not installed."""
    try:
        return import_module("jax")
    except ImportError as error:
        raise TransferError("A training needs the package jax.", "pip install 'clothsim[learn]'") from error
