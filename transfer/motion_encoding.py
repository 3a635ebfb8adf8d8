"""Drapes of moving bodies from a code of the garment that no motion changes (Wang et al. 2019).

The encoder maps the coefficients c = B'G(v - mean) of a drape v to a latent vector h, the decoder maps h to c. The
motion of the last frames gives shares s, by which the maps of two more networks are blended: `into` takes h to the
code z of the garment (its cut, its fabric), `out` takes z back to h. So a code from one frame gives the garment's
drapes in any motion.

They are evaluated by NumPy alone and trained in JAX (section 5): first the auto-encoder, |decoder(encoder(c)) - c|^2 in
the metric of the subspace; then, its latent vectors h held, the motion's shares and the blended networks, on pairs of
drapes of one garment in two frames, with codes z = into(h) and z':

    invariance |z - z'|^2 / q + |out(z) - h|^2 + |decoder(out(z)) - c|^2
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.networks import (
    Layers,
    blended_network,
    in_double_precision,
    jax_module,
    layer_arrays,
    leaky,
    minimised,
    network,
    random_layers,
    read_layers,
    relu6,
    shares_of,
)
from transfer.subspace import Subspace
from transfer.triangle_surface import Floats

NETWORKS = ("encoder", "decoder", "motion", "into", "out")
WINDOW = 20
"""Frames of a motion that a drape depends on."""


@dataclass(frozen=True, eq=False)
class MotionEncoding:
    """Networks from drapes to codes of garments, and from codes and motions to drapes.

    Attributes
    ----------
    space : Subspace
        Of dimension k.
    unit : float
        Coefficients are divided by it: the root of the total variance of the training drapes.
    centre, scale : (p,) ndarray
        Of the motions: mean and standard deviation.
    encoder, decoder : Layers
        From k to d and back, with ReLU6 between their layers.
    motion : Layers
        From p to j shares, with softplus after each layer.
    into, out : Layers
        Blended of j maps: from d to q and back, with `networks.leaky` between their layers.
    """

    space: Subspace
    unit: float
    centre: Floats
    scale: Floats
    encoder: Layers
    decoder: Layers
    motion: Layers
    into: Layers
    out: Layers

    def latent(self, drapes: ArrayLike) -> Floats:
        """Latent vectors (n, d) of drapes (n, m)."""
        return np.asarray(network(self.encoder, self.space.coefficients(drapes) / self.unit, relu6))

    def decoded(self, latent: ArrayLike) -> Floats:
        """Drapes (n, m) of latent vectors (n, d)."""
        return self.space.drapes(self.unit * network(self.decoder, np.asarray(latent, np.float64), relu6))

    def shares(self, motions: ArrayLike) -> Floats:
        """Shares (n, j) of the blended maps in motions (n, p)."""
        given = (np.asarray(motions, np.float64) - self.centre) / self.scale
        return np.asarray(shares_of(_softplus(network(self.motion, given, _softplus))))

    def codes(self, drapes: ArrayLike, motions: ArrayLike) -> Floats:
        """Codes (n, q) of the garments of drapes (n, m) in motions (n, p)."""
        return np.asarray(blended_network(self.into, self.shares(motions), self.latent(drapes), leaky))

    def drapes(self, codes: ArrayLike, motions: ArrayLike) -> Floats:
        """Drapes (n, m) of the garments of codes (n, q) in motions (n, p)."""
        given = np.asarray(codes, np.float64)
        return self.decoded(blended_network(self.out, self.shares(motions), given, leaky))

    def arrays(self) -> dict[str, Any]:
        """All numbers by name, for `numpy.savez`; see `motion_encoding`."""
        made: dict[str, Any] = {f"space.{each.name}": getattr(self.space, each.name) for each in fields(Subspace)}
        made |= {name: np.asarray(getattr(self, name)) for name in ("unit", "centre", "scale")}
        for name in NETWORKS:
            made |= layer_arrays(name, getattr(self, name))
        return made


def motion_encoding(arrays: Mapping[str, ArrayLike]) -> MotionEncoding:
    """The encoding of the arrays of `MotionEncoding.arrays`, such as an open .npz file.

    Raises
    ------
    TransferError
        An array is missing.
    """
    try:
        space = Subspace(*(np.asarray(arrays[f"space.{each.name}"], np.float64) for each in fields(Subspace)))
        unit, centre, scale = (np.asarray(arrays[name], np.float64) for name in ("unit", "centre", "scale"))
        networks = [read_layers(arrays, name) for name in NETWORKS]
    except KeyError as error:
        raise TransferError(f"The encoding has no {error.args[0]!r}.", "Train it again.") from error
    return MotionEncoding(space, float(unit), centre, scale, *networks)


def motion_windows(joints: ArrayLike, root_rotations: ArrayLike, window: int = WINDOW) -> Floats:
    """What a drape can know of the motion: joints of the last frames, seen from the root of the present one.

    Parameters
    ----------
    joints : (f, j, 3) array_like
        Positions of the joints in each frame, the root first [m].
    root_rotations : (f, 3, 3) array_like
        Rotation of the root in each frame, from its own axes to the world's.
    window : int
        Frames; those before the first one are the first one.

    Returns
    -------
    (f, window * j * 3) ndarray [m]

    Examples
    --------
    >>> moving = np.arange(3.0)[:, None, None] * [1.0, 0.0, 0.0]
    >>> motion_windows(moving, np.tile(np.eye(3), (3, 1, 1)), window=2)[:, ::3]
    array([[ 0.,  0.],
           [-1.,  0.],
           [-1.,  0.]])
    """
    places, turns = np.asarray(joints, np.float64), np.asarray(root_rotations, np.float64)
    if places.ndim != 3 or turns.shape != (len(places), 3, 3) or window < 1:
        raise TransferError(
            f"joints {places.shape}, root_rotations {turns.shape} and window {window} do not fit.",
            "Give (f, j, 3), (f, 3, 3) and at least 1.",
        )
    frames = np.maximum(0, np.arange(len(places))[:, None] + np.arange(1 - window, 1))
    seen = np.einsum("fxa,fwjx->fwja", turns, places[frames] - places[:, None, :1])
    return np.asarray(seen.reshape(len(places), -1))


def _softplus(values: Any) -> Any:
    return np.logaddexp(0.0, values)


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

    def shape_loss(networks: Any, rows: Any, _: Any) -> Any:
        made = network(networks["decoder"], network(networks["encoder"], coefficients[rows], relu6), relu6)
        return ((made - coefficients[rows]) ** 2).sum(axis=1).mean()

    found = minimised(start, shape_loss, given.steps, *batches)
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
