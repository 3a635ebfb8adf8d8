"""Prior of bending stiffness by weight: a log-normal of 618 measured fabrics.

The logarithms of D along warp, weft and bias are normal about lines in the logarithm of the weight, with the covariance
of what is left: least squares over the cantilever tests of 618 fabrics of 0.015 to 0.87 kg/m2 (Feng, Huang, Wang et al.
2022, "Learning-based bending stiffness parameter estimation by a drape tester", ACM TOG 41). A curve in the weight is
no better (1 to 3 % of the variance).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError

SOURCE = "618 fabrics of Feng et al. 2022"
AT_WEIGHT = 0.2
"""Weight at which `MEANS` stand [kg/m2]."""
MEANS = np.log([15.74e-6, 10.22e-6, 12.49e-6])
"""Of log D along warp, weft and bias, D in N m."""
POWERS = np.array([1.249, 1.111, 1.214])
"""Of the weight."""
COVARIANCE = np.array([[0.964, 0.601, 0.649], [0.601, 0.762, 0.524], [0.649, 0.524, 0.709]])
"""Of log D: standard deviations 0.98, 0.87 and 0.84, a factor of 2.3 to 2.7."""
WEIGHTS: dict[str, tuple[float, float, float]] = {
    "bending_warp": (1.0, 0.0, 0.0),
    "bending_weft": (0.0, 1.0, 0.0),
    "bending_bias": (0.0, 0.0, 1.0),
    "bending_stiffness": (0.5, 0.5, 0.0),
}
"""Keys of a fabric as combinations of the three logarithms."""


@dataclass(frozen=True)
class LogNormal:
    """Logarithms that are normal: mean (k,) and covariance (k, k)."""

    mean: Floats
    covariance: Floats

    def given(self, measured: Floats, precision: Floats) -> "LogNormal":
        """The distribution given a measurement of it.

        Parameters
        ----------
        measured : (k,) array
            Measured logarithms.
        precision : (k, k) array
            Inverse covariance of the measurement; 0 along what it does not tell.

        Examples
        --------
        >>> half = LogNormal(np.zeros(1), np.eye(1)).given(np.ones(1), np.eye(1))
        >>> half.mean, half.covariance
        (array([0.5]), array([[0.5]]))
        """
        prior = np.linalg.inv(self.covariance)
        covariance = np.linalg.inv(prior + precision)
        mean = np.asarray(covariance @ (prior @ self.mean + precision @ measured), np.float64)
        return LogNormal(mean, np.asarray(covariance, np.float64))


def bending_keys(paths: Sequence[str]) -> dict[int, str]:
    """The key of `WEIGHTS` of each path that is one of a cloth, by its number.

    InputError where there is none, or the density, by which the prior goes, is among the paths.
    """
    names = {k: path.rpartition(".")[2] for k, path in enumerate(paths) if path.startswith("cloth.")}
    found = {k: name for k, name in names.items() if name in WEIGHTS}
    if not found:
        raise InputError("The prior covers bending stiffnesses, and none is free.", f"Free {', '.join(WEIGHTS)}.")
    if any(path.endswith(".density") for path in paths):
        raise InputError("The prior is for a cloth of known weight, and the density is free.", "Weigh the cloth.")
    return found


def bending_prior(keys: tuple[str, ...], density: float) -> LogNormal:
    """The prior of keys of a fabric.

    Parameters
    ----------
    keys : tuple of str
        Some of `WEIGHTS`.
    density : float
        Weight of the cloth [kg/m2].

    Raises
    ------
    InputError
        For bending_stiffness beside bending_warp or bending_weft, which it replaces.

    Examples
    --------
    >>> prior = bending_prior(("bending_warp", "bending_weft"), 0.2)
    >>> (1e6 * np.exp(prior.mean)).round(1), np.sqrt(np.diag(prior.covariance)).round(2)
    (array([15.7, 10.2]), array([0.98, 0.87]))
    """
    if "bending_stiffness" in keys and len(keys) > 1:
        raise InputError("bending_stiffness replaces the other stiffnesses of bending.", "Free it, or them.")
    rows = np.array([WEIGHTS[key] for key in keys], np.float64)
    means = np.asarray(MEANS + POWERS * np.log(density / AT_WEIGHT), np.float64)
    return LogNormal(rows @ means, np.asarray(rows @ COVARIANCE @ rows.T, np.float64))
