"""Training of motion-invariant codes of garments in JAX (Wang et al. 2019, section 5).

First the auto-encoder of the drapes: |decoder(encoder(c)) - c|^2 of the coefficients c in the metric of their subspace.
Then, its latent vectors h held, the motion's shares and the blended networks, on pairs of drapes of one garment in two
frames, with codes z = into(h) and z':

    invariance |z - z'|^2 / q + |out(z) - h|^2 + |decoder(out(z)) - c|^2
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.motion_encoding import MotionEncoding
from transfer.network_training import jax_module, minimised
from transfer.networks import blended_network, in_double_precision, leaky, network, random_layers, relu6, shares_of
from transfer.subspace import Subspace


@dataclass(frozen=True, kw_only=True)
class MotionTraining:
    """Sizes, weights and steps of a training; the sizes are those of the published code.

    Attributes
    ----------
    latent_size, hidden : int
        Of the auto-encoder: one layer of `hidden` between the coefficients and the latent vector.
    code_size : int
        Of the code of a garment, and of the layer before it.
    motion : tuple of int
        Widths of the layers of the motion; the last is the number of maps of a blended layer.
    steps, code_steps, batch : int
        Steps of Adam's method of the two parts, and drapes in each step.
    rate : float
        Of the first step; it falls with half a cosine to 0.
    invariance : float
        Weight of the distance of the codes of two frames.
    seed : int
    """

    latent_size: int = 30
    hidden: int = 120
    code_size: int = 120
    motion: tuple[int, ...] = (480, 120, 30)
    steps: int = 4000
    code_steps: int = 4000
    batch: int = 64
    rate: float = 1e-3
    invariance: float = 1000.0
    seed: int = 0


def trained_motion_encoding(
    space: Subspace, drapes: ArrayLike, motions: ArrayLike, garments: ArrayLike, training: MotionTraining | None = None
) -> MotionEncoding:
    """Train the auto-encoder and the motion-invariant codes.

    Parameters
    ----------
    space : Subspace
        Of `metric_components` of the drapes.
    drapes : (n, m) array_like
        A drape a row, all coordinates one after the other, in the rest pose of the body [m].
    motions : (n, p) array_like
        Of `motion_windows`.
    garments : (n,) array_like of int
        Which garment each drape is of: equal numbers have one code.
    training : MotionTraining, optional

    Raises
    ------
    TransferError
        JAX is not installed, the arrays do not fit, or a garment has one drape only.
    """
    jax, given = jax_module(), training or MotionTraining()
    x, y, own = np.asarray(motions, np.float64), space.coefficients(drapes), np.asarray(garments)
    if x.ndim != 2 or own.shape != (len(y),) or len(x) != len(y):
        raise TransferError(
            f"{len(y)} drapes, motions {x.shape} and garments {own.shape} do not fit.", "Give a row for each drape."
        )
    if np.unique(own, return_counts=True)[1].min() < 2:
        raise TransferError("A garment has one drape only.", "Give at least two frames of each.")
    unit = float(np.sqrt((y**2).sum(axis=1).mean()))
    centre, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
    coefficients = jax.numpy.asarray(y / unit, jax.numpy.float32)
    inputs = jax.numpy.asarray((x - centre) / scale, jax.numpy.float32)
    random, batches = np.random.default_rng(given.seed), (given.rate, given.batch, len(y), given.seed)
    between = (y.shape[1], given.hidden, given.latent_size)
    start = {"encoder": random_layers(random, between), "decoder": random_layers(random, between[::-1])}
    found = minimised(start, _shape_loss(coefficients), given.steps, *batches)
    widths, maps = (given.latent_size, given.code_size, given.code_size), given.motion[-1]
    first = {
        "motion": random_layers(random, (x.shape[1], *given.motion)),
        "into": random_layers(random, widths, maps),
        "out": random_layers(random, widths[::-1], maps),
    }
    loss = _code_loss(coefficients, inputs, _partner(own), found, given.invariance)
    found |= minimised(first, loss, given.code_steps, *batches)
    plain = {name: in_double_precision(layers) for name, layers in found.items()}
    return MotionEncoding(space, unit, centre, scale, **plain)


def _shape_loss(coefficients: Any) -> Callable[..., Any]:
    def loss(networks: Any, rows: Any, _: Any) -> Any:
        made = network(networks["decoder"], network(networks["encoder"], coefficients[rows], relu6), relu6)
        return ((made - coefficients[rows]) ** 2).sum(axis=1).mean()

    return loss


def _code_loss(coefficients: Any, inputs: Any, partner: Any, shape: Any, invariance: float) -> Callable[..., Any]:
    softplus = jax_module().nn.softplus
    latent = network(shape["encoder"], coefficients, relu6)

    def loss(networks: Any, rows: Any, key: Any) -> Any:
        def code(chosen: Any) -> tuple[Any, Any]:
            shares = shares_of(softplus(network(networks["motion"], inputs[chosen], softplus)))
            return blended_network(networks["into"], shares, latent[chosen], leaky), shares

        (one, shares), (other, _) = code(rows), code(partner(rows, key))
        made = blended_network(networks["out"], shares, one, leaky)
        drape = network(shape["decoder"], made, relu6)
        misses = ((made - latent[rows]) ** 2).sum(axis=1) + ((drape - coefficients[rows]) ** 2).sum(axis=1)
        return invariance * ((one - other) ** 2).mean() + misses.mean()

    return loss


def _partner(garments: Any) -> Callable[[Any, Any], Any]:
    """Rows drawn evenly from those of the same garments as given rows."""
    jax = jax_module()
    _, group, counts = np.unique(garments, return_inverse=True, return_counts=True)
    order = jax.numpy.asarray(np.argsort(group, kind="stable"))
    starts, sizes = jax.numpy.asarray(np.cumsum(counts) - counts), jax.numpy.asarray(counts)
    groups = jax.numpy.asarray(group)

    def drawn(rows: Any, key: Any) -> Any:
        chance = jax.random.uniform(key, rows.shape)
        own = groups[rows]
        return order[starts[own] + (chance * sizes[own]).astype(int).clip(0, sizes[own] - 1)]

    return drawn
