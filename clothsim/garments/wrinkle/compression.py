"""Compression of coarse cloth at its vertices: the stretch tensor of F = R U over vertex rings, followed over time.

The tensor of a triangle in space, R U R', is brought to rest by the Kabsch rotation Q of the ring of each corner,
Q' (R U R') Q, so that tensors of neighbours, and of one vertex in two frames, are in one frame and can be averaged:
over the triangles of a ring, over the ring, and over the frames before.

Length and height of wrinkles: bending of the sheet against a foundation that its own stretch provides. A sheet of
bending stiffness D on a foundation of stiffness K wrinkles with the length 2 pi (D/K)^(1/4), at which D q^4 + K is
least for a given force. Tension along crests of length L is a foundation T (pi/L)^2 (Cerda and Mahadevan 2003,
"Geometry and physics of wrinkling"), curvature 1/R along them one of Y/R^2 (Paulsen et al. 2016, "Curvature-induced
stiffness and the spatial variation of wavelength in wrinkled sheets").
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from scipy.sparse import csr_array, diags_array

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import eigen_2x2
from clothsim.base.triangles import unique_edges

if TYPE_CHECKING:
    from clothsim import Run

MEMORY = 0.06
"""Time in which what was measured before is forgotten [s]: tensors of contact flicker from frame to frame."""


@dataclass(frozen=True)
class Rings:
    """Averages over the rings of a mesh.

    Attributes
    ----------
    of_triangles : (n, m) sparse array
        Means over the triangles of each vertex, by area at rest.
    of_vertices : (n, n) sparse array
        Means over each vertex, with half of the weight, and its ring.
    """

    of_triangles: csr_array
    of_vertices: csr_array

    @classmethod
    def of(cls, triangles: Ints, areas: Floats, n: int) -> Self:
        """The rings of a mesh of n vertices with triangles (m, 3) of areas (m,) [m2]."""
        corners, faces = triangles.ravel(), np.repeat(np.arange(len(triangles)), 3)
        parts = csr_array((np.repeat(areas, 3), (corners, faces)), shape=(n, len(triangles)))
        ends = unique_edges(triangles)
        one = np.ones(2 * len(ends))
        near = csr_array((one, (np.r_[ends[:, 0], ends[:, 1]], np.r_[ends[:, 1], ends[:, 0]])), shape=(n, n))
        return cls(_rows_of_sum_1(parts), 0.5 * _rows_of_sum_1(near) + 0.5 * diags_array(np.ones(n)).tocsr())


def _rows_of_sum_1(matrix: csr_array) -> csr_array:
    sums = np.asarray(matrix.sum(axis=1)).ravel()
    return csr_array(diags_array(1 / np.where(sums > 0, sums, 1.0)) @ matrix)


def ring_tensors(run: "Run", frame: int, rings: Rings) -> Floats:
    """Stretch tensors of the vertices of a frame in the axes of space at rest, (n, 3, 3), smoothed over rings.

    The stretch across the sheet counts as 1: where it does not stretch the tensor is the identity, and the mean over a
    ring that is folded is no compression.
    """
    stretches = np.asarray(run.field("principal_stretches", frame), np.float64)
    directions = np.asarray(run.field("principal_directions", frame), np.float64)
    rotations = np.asarray(run.field("vertex_frames", frame), np.float64)
    tensors = np.eye(3) + (directions * (stretches[:, None, :] - 1)) @ directions.transpose(0, 2, 1)
    n = len(rotations)
    mean = (rings.of_triangles @ tensors.reshape(-1, 9)).reshape(n, 3, 3)  # R U R' is in space for all triangles
    own = rotations.transpose(0, 2, 1) @ mean @ rotations
    return (rings.of_vertices @ own.reshape(n, 9)).reshape(n, 3, 3)


def blended_in_time(before: Floats | None, tensors: Floats, seconds: float) -> Floats:
    """Tensors (n, 3, 3) of a frame blended with those before it, `seconds` earlier."""
    if before is None:
        return tensors
    kept = np.exp(-seconds / MEMORY)
    return kept * before + (1 - kept) * tensors


@dataclass(frozen=True)
class Compression:
    """Principal stretches of vertices and the directions of crests and of compression at rest.

    Attributes
    ----------
    stretches : (n, 2) array
        s1 >= s2.
    along, across : (n, 3) array
        Unit directions of s1, along the crests, and of s2, of the compression; their signs mean nothing.
    """

    stretches: Floats
    along: Floats
    across: Floats

    @cached_property
    def amount(self) -> Floats:
        """max(0, 1 - s2), (n,), as the field `compression` has it."""
        return np.maximum(0.0, 1 - self.stretches[:, 1])


def compression_of(tensors: Floats, normals: Floats) -> Compression:
    """The compression of tensors (n, 3, 3) in the tangent planes of unit normals (n, 3) at rest.

    Examples
    --------
    >>> found = compression_of(np.diag([0.9, 1.2, 0.0])[None], np.array([[0.0, 0, 1]]))
    >>> found.stretches.round(9).tolist(), found.amount.round(9).tolist(), np.abs(found.across).round(9).tolist()
    ([[1.2, 0.9]], [0.1], [[1.0, 0.0, 0.0]])
    """
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frames = np.stack([first, np.cross(normals, first)], axis=2)
    values, vectors = eigen_2x2(frames.transpose(0, 2, 1) @ tensors @ frames)
    own = frames @ vectors
    return Compression(values, own[:, :, 0], own[:, :, 1])


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
