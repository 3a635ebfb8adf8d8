"""Variational auto-encoder of drapes in a subspace, and its regressor: evaluation (Santesteban et al. 2021).

A drape v has coefficients c = B'G(v - mean) in a subspace that is orthonormal in the metric G, so that the squared norm
of an error of the coefficients is that of the drape, e'Ge. The encoder maps c to the mean and the logarithm of the
variance of a code z, the decoder maps z to c, and the regressor maps the parameters of a drape to z. All are small
networks with tanh between their layers. `transfer.drape_autoencoder_training` makes them; here is NumPy alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from transfer.errors import TransferError
from transfer.networks import Layers, layer_arrays, network, read_layers
from transfer.subspace import Subspace
from transfer.triangle_surface import Floats


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


def read_drape_autoencoder(path: Path) -> DrapeAutoencoder:
    """The auto-encoder in an .npz file. TransferError for another file."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return drape_autoencoder(arrays)
    except (OSError, ValueError) as error:
        if isinstance(error, TransferError):
            raise
        raise TransferError(f"{path} is no auto-encoder: {error}.", "Give an .npz file of its arrays.") from error
