"""Drapes of moving bodies from a code of the garment that no motion changes: evaluation (Wang et al. 2019).

The encoder maps the coefficients c = B'G(v - mean) of a drape v to a latent vector h, the decoder maps h to c. The
motion of the last frames gives shares s, by which the maps of two more networks are blended: `into` takes h to the
code z of the garment (its cut, its fabric), `out` takes z back to h. So a code from one frame gives the garment's
drapes in any motion. `transfer.motion_encoding_training` makes the networks; here is NumPy alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.networks import Layers, blended_network, layer_arrays, leaky, network, read_layers, relu6, shares_of
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
