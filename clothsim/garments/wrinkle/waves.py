"""Length and height of wrinkles: bending of the sheet against a foundation that its own stretch provides.

A sheet of bending stiffness D on a foundation of stiffness K wrinkles with the length 2 pi (D/K)^(1/4), at which
D q^4 + K is least for a given force. Tension along crests of length L is a foundation T (pi/L)^2 (Cerda and Mahadevan
2003, "Geometry and physics of wrinkling"), curvature 1/R along them one of Y/R^2 (Paulsen et al. 2016, "Curvature-
induced stiffness and the spatial variation of wavelength in wrinkled sheets").
"""

import math
from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats

EDGES = 4
"""Least number of fine edges in a wave: with fewer there are no crests and valleys to bend."""


@dataclass(frozen=True)
class Waves:
    """The wrinkles of a sheet.

    Parameters
    ----------
    bending : float
        D [N m].
    stretching : float
        Y = E t [N/m].
    fine_edge : float
        Edge of the mesh that shall show the wrinkles [m].
    least_radius : float or None
        Least radius of curvature of crests, by fabric [m]: Rohmer's own rule, in place of the foundation.

    Examples
    --------
    Tension alone, R = inf: 2 sqrt(pi) (D/T)^(1/4) L^(1/2) (Cerda and Mahadevan 2003).

    >>> sheet = Waves(bending=1.0, stretching=1.0)
    >>> round(sheet.wavelength(tension=1.0, length=1.0) / (2 * math.pi**0.5), 12)
    1.0

    Curvature alone, T = 0, as of a sleeve: 2 pi (D R^2/Y)^(1/4).

    >>> round(sheet.wavelength(tension=0.0, length=1.0, radius=1.0) / (2 * math.pi), 12)
    1.0

    Neither: one wave, as long as it fits.

    >>> sheet.wavelength(tension=0.0, length=1.0, longest=9.0)
    9.0
    """

    bending: float
    stretching: float
    fine_edge: float = 0.0
    least_radius: float | None = None

    def wavelength(
        self, tension: float, length: float, radius: float = math.inf, longest: float = math.inf, stretch: float = 1.0
    ) -> float:
        """Wavelength 2 pi (D/K)^(1/4) [m], K = T (pi/L)^2 + Y/R^2, of EDGES fine edges at least.

        Parameters
        ----------
        tension : float
            T along the crests [N/m]; compression counts as 0.
        length : float
            L of the crests [m].
        radius : float
            R of the curvature along them [m].
        longest : float
            What fits: the extent of the compressed patch across the crests [m].
        stretch : float
            s2 across them, which a least radius takes: the curvature of a crest is 4 pi sqrt(1 - s2)/lambda.
        """
        if self.least_radius is not None:
            natural = 4 * math.pi * self.least_radius * math.sqrt(max(1 - stretch, 0.0))
        else:
            foundation = max(tension, 0.0) * (math.pi / length) ** 2 + self.stretching / radius**2
            natural = 2 * math.pi * (self.bending / foundation) ** 0.25 if foundation > 0 else math.inf
        return max(min(natural, longest), EDGES * self.fine_edge)


def amplitude(wavelength: Floats | float, stretch: Floats | float) -> Floats:
    """Amplitude (lambda/pi) sqrt(1 - s2) of a sine as long as the sheet at rest on a base shortened to s2 [m].

    A wave of small slopes is shorter than its arc by (pi a/lambda)^2; 0 where s2 >= 1.

    Examples
    --------
    >>> float(amplitude(np.pi, 0.75)), float(amplitude(1.0, 1.1))
    (0.5, 0.0)
    """
    return np.asarray(wavelength) / np.pi * np.sqrt(np.maximum(1 - np.asarray(stretch, np.float64), 0.0))
