"""Shape of a drape's outline: drape coefficient, effective number of folds, their depth."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints, as_finite
from clothsim.base.errors import InputError
from clothsim.base.triangles import unique_edges

RADIUS, PLATE = 0.15, 0.09
"""Radii of the specimen and of the plate of a Cusick tester, ISO 9073-9 and BS 5058 [m]."""
FOLDS = range(2, 16)
"""Fourier numbers of an outline that count as folds; 1 is a shift of its centre."""
ANGLES = 360


@dataclass(frozen=True)
class OutlineShape:
    """Three numbers of an outline.

    Attributes
    ----------
    coefficient : float
        Drape coefficient: area of the shadow beyond the plate over that of the flat specimen, 0 to 1.
    folds : float
        Effective number of folds sqrt(sum n^2 a_n^2 / sum a_n^2) over the amplitudes a_n of r(theta), n of `FOLDS`; 0
        for a circle.
    depth : float
        Standard deviation of r over the angles [m].
    """

    coefficient: float
    folds: float
    depth: float


def outline_shape(radii: Floats, radius: float = RADIUS, plate: float = PLATE) -> OutlineShape:
    """Shape of an outline r(theta) about the centre of the plate.

    Parameters
    ----------
    radii : (k,) array
        r at the angles 2 pi j/k [m].
    radius, plate : float
        Radii of the flat specimen and of the plate [m].

    Returns
    -------
    OutlineShape
        The area is that of the polygon's limit, the mean of r^2 times pi.

    Raises
    ------
    InputError
        For fewer than 32 angles, which do not resolve 15 folds.

    Examples
    --------
    >>> theta = 2 * np.pi * np.arange(360) / 360
    >>> shape = outline_shape(0.12 + 0.01 * np.cos(7 * theta))
    >>> round(shape.coefficient, 4), round(shape.folds, 6), round(shape.depth, 6)
    (0.441, 7.0, 0.007071)
    """
    r = as_finite("radii", radii)
    if r.ndim != 1 or len(r) < 2 * FOLDS.stop:
        raise InputError(f"An outline has radii of shape {r.shape}.", f"Give {2 * FOLDS.stop} or more, by angle.")
    squares = np.abs(np.fft.rfft(r)[FOLDS.start : FOLDS.stop]) ** 2
    n = np.array(FOLDS)
    wavy = squares.sum() > (1e-12 * len(r) * r.mean()) ** 2
    folds = float(np.sqrt((n**2 * squares).sum() / squares.sum())) if wavy else 0.0
    coefficient = (np.mean(r**2) - plate**2) / (radius**2 - plate**2)
    return OutlineShape(float(coefficient), folds, float(r.std()))


def outline_radii(positions: Floats, border: Ints) -> Floats:
    """Radii of a border seen along z, by angle.

    Parameters
    ----------
    positions : (n, 3) array
        Vertices of the cloth about the centre of the plate [m].
    border : (k, 2) int array
        The border's edges.

    Returns
    -------
    (360,) float64
        Distance from the centre of the outermost crossing of the border and a ray at each angle [m]: where folds hang
        over one another the shadow has the outer one.

    Raises
    ------
    InputError
        Where a ray meets no border: the centre is outside the cloth.
    """
    turn = 2 * np.pi * np.arange(ANGLES) / ANGLES
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    ahead, aside = positions[:, :2] @ along, positions[:, :2] @ across
    start, end = border.T
    crosses = (aside[start] > 0) != (aside[end] > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = aside[start] / (aside[start] - aside[end])
        distance = ahead[start] + share * (ahead[end] - ahead[start])
    radii = np.where(crosses, distance, -np.inf).max(axis=0)
    if not (radii > 0).all():
        raise InputError(f"No border lies at {np.argmin(radii) * 360 / ANGLES:g} degrees.", "Check the centre.")
    return radii


def shadow_radii(positions: Floats, triangles: Ints) -> Floats:
    """Radii of the shadow of a cloth that lies on a plate and hangs over it, by angle.

    The shadow is no smaller than the plate, where soft cloth hangs under it.

    Parameters
    ----------
    positions : (n, 3) array
        Vertices about the centre of the plate [m]; those that the plate holds are among them.
    triangles : (m, 3) int array
        The cloth outside the plate.

    Returns
    -------
    (360,) float64
        See `outline_radii`.
    """
    return outline_radii(positions, unique_edges(triangles))
