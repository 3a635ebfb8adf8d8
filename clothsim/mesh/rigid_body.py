"""Rigid body: a solid whose motion is affine, in few coordinates.

Affine body dynamics (Lan et al. 2022, "Affine body dynamics: fast, stable and intersection-free simulation of stiff
materials") follows the map x(X) = A X + t of a solid and keeps A near a rotation by a stiff energy
(`energies.rigid_bodies`). Here the map has k coordinates z_j, rows of x like the vertices of a cloth:

    x(X) = c(X) + sum_j f_j(X) z_j,    A = C + sum_j z_j grad f_j'

with affine f_j that are orthogonal in the mass of the body, so that its kinetic energy is exactly
sum_j mu_j |z_j'|^2 / 2: a free body moves as four points of a quarter of its mass each, at +-s along its principal
axes, s^2 the covariance (c = 0, C = 0). A body that turns about a point keeps three f_j, those that vanish there, and
one on a hinge two: what is held is left out of the coordinates, and holds exactly.

Volume, centroid and covariance of the solid inside a closed surface are sums over the tetrahedra from a point near the
surface to its triangles, with the sign of their volumes (Mirtich 1996, "Fast and accurate computation of polyhedral
mass properties").
"""

from dataclasses import dataclass, replace

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.mesh.topology import border_edges


@dataclass(frozen=True)
class VolumeMoments:
    """Moments of a solid of density 1.

    Parameters
    ----------
    volume : float
        [m3]; negative where the triangles face inwards.
    centroid : (3,) float64
        [m].
    covariance : (3, 3) float64
        Mean of (X - centroid)(X - centroid)' over the solid [m2].
    """

    volume: float
    centroid: Floats
    covariance: Floats


def volume_moments(positions: Floats, triangles: Ints) -> VolumeMoments:
    """Return the moments of the solid inside a closed surface.

    Parameters
    ----------
    positions : (n, 3) float64
        Vertices [m].
    triangles : (m, 3) int64
        Triangles that face outwards.

    Examples
    --------
    A tetrahedron with three edges of 1 m along the axes:

    >>> import numpy as np
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> moments = volume_moments(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> round(6 * moments.volume, 12), moments.centroid
    (1.0, array([0.25, 0.25, 0.25]))
    """
    middle = positions.mean(axis=0)
    corners = positions[triangles] - middle
    volumes = np.linalg.det(corners) / 6
    volume = float(volumes.sum())
    if not volume:
        return VolumeMoments(0.0, middle, np.zeros((3, 3)))
    sums = corners.sum(axis=1)
    centroid = (volumes @ sums) / (4 * volume)
    # integral of X X' over the tetrahedron (0, a, b, c): V/20 (aa' + bb' + cc' + ss'), s = a + b + c
    second = np.einsum("t,tki,tkj->ij", volumes, corners, corners) + np.einsum("t,ti,tj->ij", volumes, sums, sums)
    covariance = second / (20 * volume) - np.outer(centroid, centroid)
    return VolumeMoments(volume, middle + centroid, 0.5 * (covariance + covariance.T))


CORNERS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
"""Corners of a regular tetrahedron: sum = 0, sum of their squares as matrices = 4 I."""
FLATTEST = 1e-4
"""Least thickness of a body over its length; flatter ones are cloth, or have wrong triangles."""


@dataclass(frozen=True)
class Joint:
    """A joint to the world: a ball joint at `point` (3,) [m], or with `axis` (3,), not zero, a hinge about it."""

    point: Floats
    axis: Floats

    @property
    def is_hinge(self) -> bool:
        """True for a hinge."""
        return bool(self.axis.any())


@dataclass(frozen=True)
class RigidBody:
    """A rigid body in affine coordinates.

    Parameters
    ----------
    name : str
        Name in the scene.
    positions : (n, 3) float64
        Vertices of the surface at the start [m].
    triangles : (m, 3) int64
        Triangles that face outwards.
    density : float
        [kg/m3].
    mass, volume : float
        [kg], [m3].
    coordinates, velocities : (k, 3) float64
        z_j at the start [m] and their velocities [m/s].
    weights : (n, k) float64
        f_j at the vertices.
    offset : (n, 3) float64
        c at the vertices [m].
    masses, weighing : (k,) float64
        mu_j, the integrals of f_j^2, and the integrals of f_j, on which gravity acts [kg].
    gradients : (k, 3) float64
        grad f_j [1/m].
    constant : (3, 3) float64
        C.
    stiffness : float
        Of the energy that keeps A near a rotation [Pa].
    """

    name: str
    positions: Floats
    triangles: Ints
    density: float
    mass: float
    volume: float
    coordinates: Floats
    velocities: Floats
    weights: Floats
    offset: Floats
    masses: Floats
    weighing: Floats
    gradients: Floats
    constant: Floats
    stiffness: float

    def deformation(self, coordinates: Floats) -> Floats:
        """Return A for the coordinates (k, 3), (3, 3)."""
        return self.constant + coordinates.T @ self.gradients

    def relative_to(self, origin: Floats) -> "RigidBody":
        """Return the body in coordinates from `origin` (3,) [m]."""
        free = len(self.coordinates) == len(CORNERS)
        return replace(
            self,
            positions=self.positions - origin,
            coordinates=self.coordinates - origin if free else self.coordinates,
            offset=self.offset if free else self.offset - origin,
        )


def rigid_body(
    name: str,
    positions: Floats,
    triangles: Ints,
    density: float,
    velocity: Floats,
    angular_velocity: Floats,
    stiffness: float,
    joint: Joint | None = None,
) -> RigidBody:
    """Make a rigid body from a closed surface.

    Parameters
    ----------
    name : str
        Name in the scene.
    positions : (n, 3) float64
        Vertices at the start [m].
    triangles : (m, 3) int64
        Its triangles, wound alike.
    density : float
        [kg/m3].
    velocity : (3,) float64
        Of the centre of mass at the start [m/s]; of a body on a joint it must be zero.
    angular_velocity : (3,) float64
        At the start [rad/s]; of a body on a hinge the part along the axis acts.
    stiffness : float
        Of the energy that keeps it rigid [Pa].
    joint : Joint, optional
        What holds it; a free body has none.

    Raises
    ------
    InputError
        The surface has a border, holds no volume or is too flat; or a body on a joint has a velocity.
    """
    borders = border_edges(triangles)[0]
    if len(borders):
        raise InputError(
            f"{name} is rigid, but its surface is open: {len(borders)} edges have one triangle, the first is of the "
            f"vertices {borders[0, 0]} and {borders[0, 1]}.",
            "Give a closed surface: its mass is that of the solid inside.",
        )
    moments = volume_moments(positions, triangles)
    if moments.volume < 0:
        triangles = triangles[:, [0, 2, 1]]
        moments = volume_moments(positions, triangles)
    extent = float(np.ptp(positions, axis=0).max())
    least = np.linalg.eigvalsh(moments.covariance)[0] if moments.volume > 0 else 0.0
    if moments.volume <= 0 or least <= (FLATTEST * extent) ** 2:
        raise InputError(
            f"{name} is rigid, but its surface holds almost no volume ({moments.volume:.3g} m3 in {extent:.3g} m).",
            "Give a solid: a plate needs a thickness.",
        )
    if joint is not None and velocity.any():
        raise InputError(f"{name} has a joint and a velocity.", "Give its spin, spin_degrees_per_second, alone.")
    made = _free(positions, moments) if joint is None else _jointed(positions, moments, joint)
    coordinates, weights, offset, masses, weighing, gradients, constant = made
    mass = density * moments.volume
    arms = coordinates - moments.centroid if joint is None else coordinates
    axis = angular_velocity
    if joint is not None and joint.is_hinge:
        unit = joint.axis / np.linalg.norm(joint.axis)
        axis = (angular_velocity @ unit) * unit
    return RigidBody(
        name,
        positions,
        triangles,
        density,
        mass,
        moments.volume,
        coordinates,
        velocity + np.cross(axis, arms),
        weights,
        offset,
        mass * masses,
        mass * weighing,
        gradients,
        constant,
        stiffness,
    )


_Made = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]
"""coordinates, weights, offset, masses and weighing of a body of 1 kg, gradients, constant."""


def _free(positions: Floats, moments: VolumeMoments) -> _Made:
    """Four points with a quarter of the mass each."""
    squares, axes = np.linalg.eigh(moments.covariance)
    sizes = np.sqrt(squares)
    points = moments.centroid + (CORNERS * sizes) @ axes.T
    gradients = 0.25 * (CORNERS / sizes) @ axes.T
    weights = 0.25 + (positions - moments.centroid) @ gradients.T
    quarter = np.full(4, 0.25)
    return points, weights, np.zeros_like(positions), quarter, quarter, gradients, np.zeros((3, 3))


def _jointed(positions: Floats, moments: VolumeMoments, joint: Joint) -> _Made:
    """Principal directions about the point, or about the axis, of the joint."""
    arm = moments.centroid - joint.point
    second = moments.covariance + np.outer(arm, arm)
    constant = np.zeros((3, 3))
    if joint.is_hinge:
        unit = joint.axis / np.linalg.norm(joint.axis)
        constant = np.outer(unit, unit)
        across = np.eye(3) - constant
        second = across @ second @ across
    squares, axes = np.linalg.eigh(second)
    if joint.is_hinge:
        squares, axes = squares[1:], axes[:, 1:]  # the smallest is that along the axis, 0
    sizes = np.sqrt(squares)
    gradients = (axes / sizes).T
    from_joint = positions - joint.point
    offset = joint.point + from_joint @ constant.T
    ones = np.ones(len(sizes))
    return (axes * sizes).T, from_joint @ gradients.T, offset, ones, gradients @ arm, gradients, constant
