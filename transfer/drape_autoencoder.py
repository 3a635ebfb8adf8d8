"""Variational auto-encoder of drapes in a subspace, and its regressor (Santesteban et al. 2021).

A drape v has coefficients c = B'G(v - mean) in a subspace that is orthonormal in the metric G, so that the squared norm
of an error of the coefficients is that of the drape, e'Ge. The encoder maps c to the mean and the logarithm of the
variance of a code z, the decoder maps z to c, and the regressor maps the parameters of a drape to z. All are small
networks with tanh between their layers, evaluated by NumPy alone and trained in JAX. Loss of a step, with c the
coefficients over their unit, r their reconstruction, sd the signed distance of the vertices to the body, and z codes
drawn from N(0, I):

    |r - c|^2 + kl KL(N(mu, sigma) | N(0, I)) + collision (mean h(sd(r)) + mean h(sd(decoder(z)))),
    h(s) = max(0, 1 - s / clearance)^2

The last mean is over a random code for each of a few drapes that never were: it keeps drapes between the training
drapes out of the body. Then the regressor: smooth L1 of the code + |decoder(code) - c|^2, the decoder held.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import map_coordinates

from transfer.errors import TransferError
from transfer.networks import (
    Layers,
    in_double_precision,
    jax_module,
    layer_arrays,
    minimised,
    network,
    random_layers,
    read_layers,
)
from transfer.signed_distance import BodySurface
from transfer.subspace import Subspace
from transfer.triangle_surface import Floats, as_points


@dataclass(frozen=True, eq=False)
class DrapeAutoencoder:
    """Auto-encoder of drapes with a code of d numbers, and regressor of the code.

    Attributes
    ----------
    space : Subspace
        Of dimension k.
    unit : float
        Coefficients are divided by it: the root of the total variance of the training drapes.
    centre, scale : (p,) ndarray
        Of the parameters: mean and standard deviation.
    low, high : (p,) ndarray
        Their box, to which they are clipped.
    encoder, decoder, regressor : Layers
        From k to 2 d, from d to k, from p to d.
    """

    space: Subspace
    unit: float
    centre: Floats
    scale: Floats
    low: Floats
    high: Floats
    encoder: Layers
    decoder: Layers
    regressor: Layers

    @property
    def code_size(self) -> int:
        """Numbers of a code, d."""
        return len(self.decoder[0][0])

    def codes(self, drapes: ArrayLike) -> Floats:
        """Codes (n, d) of drapes (n, m): the means of the encoder."""
        found = network(self.encoder, self.space.coefficients(drapes) / self.unit)
        return np.asarray(found[:, : self.code_size])

    def drapes(self, codes: ArrayLike) -> Floats:
        """Drapes (n, m) of codes (n, d)."""
        return self.space.drapes(self.unit * network(self.decoder, np.asarray(codes, np.float64)))

    def predicted(self, parameters: ArrayLike) -> Floats:
        """Drapes (n, m) of parameters (n, p), clipped to the box."""
        clipped = np.clip(np.asarray(parameters, np.float64), self.low, self.high)
        return self.drapes(network(self.regressor, (clipped - self.centre) / self.scale))

    def arrays(self) -> dict[str, Any]:
        """All numbers by name, for `numpy.savez`; see `drape_autoencoder`."""
        made: dict[str, Any] = {f"space.{each.name}": getattr(self.space, each.name) for each in fields(Subspace)}
        made |= {name: np.asarray(getattr(self, name)) for name in ("unit", *PARAMETERS)}
        for name in NETWORKS:
            made |= layer_arrays(name, getattr(self, name))
        return made


PARAMETERS = ("centre", "scale", "low", "high")
NETWORKS = ("encoder", "decoder", "regressor")


def drape_autoencoder(arrays: Mapping[str, ArrayLike]) -> DrapeAutoencoder:
    """The auto-encoder of the arrays of `DrapeAutoencoder.arrays`, such as an open .npz file.

    Raises
    ------
    TransferError
        An array is missing, or the layers do not fit together.
    """
    try:
        space = Subspace(*(np.asarray(arrays[f"space.{each.name}"], np.float64) for each in fields(Subspace)))
        centre, scale, low, high = (np.asarray(arrays[name], np.float64) for name in PARAMETERS)
        networks = {name: read_layers(arrays, name) for name in NETWORKS}
        made = DrapeAutoencoder(space, float(np.asarray(arrays["unit"])), centre, scale, low, high, **networks)
    except KeyError as error:
        raise TransferError(f"The auto-encoder has no {error.args[0]!r}.", "Train it again.") from error
    k, d = space.basis.shape[1], made.code_size
    shapes = {name: (len(layers[0][0]), layers[-1][0].shape[1]) for name, layers in networks.items()}
    wanted = {"encoder": (k, 2 * d), "decoder": (d, k), "regressor": (len(made.centre), d)}
    wrong = [name for name in NETWORKS if shapes[name] != wanted[name]]
    if wrong:
        raise TransferError(
            f"The {wrong[0]} maps {shapes[wrong[0]]} numbers, not {wanted[wrong[0]]}.", "Train it again."
        )
    return made


MOST_NODES = 4_000_000


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Signed distances at the nodes of a grid.

    Attributes
    ----------
    origin : (3,) ndarray
        First node [m].
    spacing : float
        Between nodes [m].
    values : (i, j, k) ndarray
        Signed distances, negative inside [m].
    """

    origin: Floats
    spacing: float
    values: Floats

    def cells(self, points: ArrayLike) -> Floats:
        """Positions (3, n) of points (n, 3) [m] in units of the spacing, for interpolation of `values`."""
        return (np.asarray(points, np.float64) - self.origin).T / self.spacing

    def signed_distance(self, points: ArrayLike) -> Floats:
        """Interpolated distances (n,) [m]; outside of the grid those at its boundary."""
        found = map_coordinates(self.values, self.cells(as_points("points", points)), order=1, mode="nearest")
        return np.asarray(found, np.float64)


def distance_grid(body: BodySurface, points: ArrayLike, spacing: float = 0.01, margin: float = 0.05) -> DistanceGrid:
    """Grid about points.

    Parameters
    ----------
    body : BodySurface
    points : (n, 3) array_like
        The grid covers their box and a margin [m].
    spacing, margin : float
        [m].

    Raises
    ------
    TransferError
        For a spacing that is not above 0, or more than MOST_NODES nodes.
    """
    given = as_points("points", points)
    if not (spacing > 0 and margin >= 0):
        raise TransferError(f"spacing is {spacing}, margin {margin}.", "Give a spacing above 0 and a margin from 0.")
    origin = given.min(axis=0) - margin
    counts = np.ceil((given.max(axis=0) + margin - origin) / spacing).astype(int) + 1
    if np.prod(counts, dtype=float) > MOST_NODES:
        raise TransferError(f"The grid would have {np.prod(counts, dtype=float):.3g} nodes.", "Give a larger spacing.")
    axes = [origin[k] + spacing * np.arange(counts[k]) for k in range(3)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return DistanceGrid(origin, spacing, body.closest(nodes).signed_distance.reshape(counts))


@dataclass(frozen=True, kw_only=True)
class Training:
    """Sizes, weights and steps of a training.

    Attributes
    ----------
    code_size : int
    hidden : tuple of int
        Widths of the encoder's layers; the decoder has them in reverse.
    regressor : tuple of int
        Widths of the regressor's layers.
    steps, regressor_steps, batch : int
        Steps of Adam's method, and drapes in each.
    rate : float
        Of the first step; it falls with half a cosine to 0.
    kl, collision : float
        Weights.
    random_codes : int
        Drapes of random codes in a step; 0: without that term.
    clearance : float
        Distance from which the collision term is 0 [m].
    seed : int
    """

    code_size: int = 24
    hidden: tuple[int, ...] = (128, 64)
    regressor: tuple[int, ...] = (128, 128)
    steps: int = 6000
    regressor_steps: int = 4000
    batch: int = 64
    rate: float = 2e-3
    kl: float = 1e-4
    collision: float = 0.1
    random_codes: int = 32
    clearance: float = 3e-3
    seed: int = 0


def trained_autoencoder(
    space: Subspace, drapes: ArrayLike, parameters: ArrayLike, grid: DistanceGrid, training: Training | None = None
) -> DrapeAutoencoder:
    """Train an auto-encoder of drapes and the regressor of its code.

    Parameters
    ----------
    space : Subspace
        Of `metric_components` of the drapes.
    drapes : (n, m) array_like
        A drape a row, all coordinates one after the other, in the frame of the grid [m].
    parameters : (n, p) array_like
    grid : DistanceGrid
        Of the body.
    training : Training, optional

    Raises
    ------
    TransferError
        JAX is not installed, or the arrays do not fit.
    """
    jax, given = jax_module(), training or Training()
    x, y = np.asarray(parameters, np.float64), space.coefficients(drapes)
    if x.ndim != 2 or len(x) != len(y):
        raise TransferError(f"parameters {x.shape} and {len(y)} drapes do not fit.", "Give a row for each drape.")
    unit = float(np.sqrt((y**2).sum(axis=1).mean()))
    centre, scale = x.mean(axis=0), x.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    coefficients = jax.numpy.asarray(y / unit, jax.numpy.float32)
    count = coefficients.shape[1]
    random = np.random.default_rng(given.seed)
    start = {
        "encoder": random_layers(random, (count, *given.hidden, 2 * given.code_size)),
        "decoder": random_layers(random, (given.code_size, *reversed(given.hidden), count)),
    }
    hits = _collision(space, unit, grid, given.clearance)
    batches = given.rate, given.batch, len(y), given.seed
    found = minimised(start, _loss(coefficients, hits, given), given.steps, *batches)
    code = network(found["encoder"], coefficients, jax.numpy.tanh)[:, : given.code_size]
    inputs = jax.numpy.asarray((x - centre) / scale, jax.numpy.float32)
    first = random_layers(random, (x.shape[1], *given.regressor, given.code_size))
    loss = _regression_loss(inputs, code, coefficients, found["decoder"])
    regressor = minimised(first, loss, given.regressor_steps, *batches)
    networks = [in_double_precision(each) for each in (found["encoder"], found["decoder"], regressor)]
    return DrapeAutoencoder(space, unit, centre, scale, x.min(axis=0), x.max(axis=0), *networks)


def _loss(coefficients: Any, hits: Callable[[Any], Any], given: Training) -> Callable[..., Any]:
    """Loss of the auto-encoder for parameters, rows of the batch and a key."""
    jax = jax_module()
    np_, size = jax.numpy, given.code_size

    def loss(networks: Any, rows: Any, key: Any) -> Any:
        batch, (noise_key, code_key) = coefficients[rows], jax.random.split(key)
        found = network(networks["encoder"], batch, np_.tanh)
        mean, log_variance = found[:, :size], np_.clip(found[:, size:], -20.0, 10.0)
        code = mean + np_.exp(0.5 * log_variance) * jax.random.normal(noise_key, mean.shape)
        made = network(networks["decoder"], code, np_.tanh)
        divergence = 0.5 * (np_.exp(log_variance) + mean**2 - 1 - log_variance).sum(axis=1).mean()
        total = ((made - batch) ** 2).sum(axis=1).mean() + given.kl * divergence
        if given.collision:
            total += given.collision * hits(made)
        if given.collision and given.random_codes:
            codes = jax.random.normal(code_key, (given.random_codes, size))
            total += given.collision * hits(network(networks["decoder"], codes, np_.tanh))
        return total

    return loss


def _regression_loss(inputs: Any, codes: Any, coefficients: Any, decoder: Any) -> Callable[..., Any]:
    np_ = jax_module().numpy

    def loss(regressor: Any, rows: Any, _: Any) -> Any:
        code = network(regressor, inputs[rows], np_.tanh)
        miss = np_.abs(code - codes[rows])
        smooth = np_.where(miss < 1, 0.5 * miss**2, miss - 0.5).mean()
        return smooth + ((network(decoder, code, np_.tanh) - coefficients[rows]) ** 2).sum(axis=1).mean()

    return loss


def _collision(space: Subspace, unit: float, grid: DistanceGrid, clearance: float) -> Callable[[Any], Any]:
    """Mean h(sd) of the vertices of drapes with given coefficients."""
    jax, map_coordinates = jax_module(), import_module("jax.scipy.ndimage").map_coordinates
    single = jax.numpy.float32
    values = jax.numpy.asarray(grid.values, single)
    mean = jax.numpy.asarray(grid.cells(space.mean.reshape(-1, 3)).T.ravel(), single)
    basis = jax.numpy.asarray(space.basis * (unit / grid.spacing), single)

    def hits(coefficients: Any) -> Any:
        cells = (mean + coefficients @ basis.T).reshape(-1, 3).T
        distance = map_coordinates(values, list(cells), order=1, mode="nearest")
        return (jax.numpy.maximum(0.0, 1.0 - distance / clearance) ** 2).mean()

    return hits
