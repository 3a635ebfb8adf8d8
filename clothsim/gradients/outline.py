"""Outline loss: the border of a cloth seen along z against the outline of its shadow, as in a Cusick drape."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from clothsim.base.arrays import Floats, Ints, as_finite
from clothsim.base.errors import InputError
from clothsim.gradients.losses import Loss
from clothsim.mesh.topology import border_edges


@dataclass(frozen=True)
class Outline(Loss):
    """Mean squared radial distance of the border's vertices to an outline, seen along z [m2].

    Parameters
    ----------
    radii : (k,) array
        Radii of the outline about `centre` at the angles 2 pi j/k from x to y [m], interpolated by a periodic cubic
        spline.
    centre : (float, float)
        x and y [m].
    frame : int
        Number of the frame, below 0 from the last.

    Notes
    -----
    For drapes whose border is their outline, one radius at each angle: a cloth on a round table.
    """

    radii: Floats
    centre: tuple[float, float] = (0.0, 0.0)
    frame: int = -1

    def evaluate(self, positions: Floats, triangles: Ints) -> tuple[float, Floats]:
        """Return mean (r - R(angle))^2 over the border, and its derivative."""
        radii = as_finite("radii", self.radii)
        if radii.ndim != 1 or len(radii) < 3:
            raise InputError(f"The outline has radii of shape {radii.shape}.", "Give three or more, by angle.")
        rows = np.unique(border_edges(triangles)[0])
        x, y = (positions[rows, k] - self.centre[k] for k in (0, 1))
        r = np.hypot(x, y)
        curve = CubicSpline(np.linspace(0, 2 * np.pi, len(radii) + 1), np.append(radii, radii[0]), bc_type="periodic")
        angle = np.arctan2(y, x) % (2 * np.pi)
        away, slope = r - curve(angle), curve(angle, 1)
        out = np.zeros_like(positions)
        factor = 2 * away / len(rows)
        out[rows, 0] = factor * (x / r + slope * y / r**2)  # d angle/dx = -y/r^2
        out[rows, 1] = factor * (y / r - slope * x / r**2)
        return float((away**2).mean()), out


def outline_of(shadow: np.ndarray, pixel: float, centre: tuple[float, float], count: int = 180) -> Floats:
    """Return the radii (k,) [m] of the outline of a shadow in a picture.

    Parameters
    ----------
    shadow : (rows, columns) array
        Darkness of each pixel, 1 in the shadow, 0 outside; rows from top to bottom, as y falls.
    pixel : float
        Side of a pixel [m].
    centre : (float, float)
        Column and row of the centre of the drape, pixels.
    count : int
        Number of angles.

    Returns
    -------
    (count,) float64
            sqrt(2 A / (2 pi / k)) of the area A of the shadow in the sector about each angle, pixels divided into 25.

    Raises
    ------
    InputError
        For a sector without shadow.
    """
    grey = as_finite("shadow", shadow)
    row, column = np.indices(grey.shape)
    offsets = (np.arange(5) + 0.5) / 5 - 0.5
    areas = np.zeros(count)
    for down in offsets:
        for right in offsets:
            angle = np.arctan2(centre[1] - row - down, column + right - centre[0]) % (2 * np.pi)
            sector = np.round(angle * count / (2 * np.pi)).astype(np.int64) % count
            areas += np.bincount(sector.ravel(), grey.ravel(), minlength=count) / len(offsets) ** 2
    if not (areas > 0).all():
        raise InputError(
            f"The shadow has no outline at {360 * int(areas.argmin()) / count:g} degrees.", "Check the centre."
        )
    return pixel * np.sqrt(areas * count / np.pi)
