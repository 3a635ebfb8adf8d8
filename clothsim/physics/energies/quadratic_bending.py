"""Quadratic bending: a constant Hessian, exact for isometric deformations of a flat sheet.

    E = sum (D/2) |e|^2/(A1 + A2) |K x - R K X|^2

Per hinge K x = sum_i K_i x_i with the cotangent stencil of Bergou et al.
2006, divided by |e|: with the corners at heights h1, h2 over the edge and at fractions u, w along it (at rest)

    K_c = 1/h1,  K_d = 1/h2,  K_b = -(u/h1 + w/h2),  K_a = -((1-u)/h1 + (1-w)/h2)

K annihilates affine maps of the unfolded hinge, so on a flat sheet that does not stretch |K x| = 2 sin(theta/2): the
hinge energy up to terms of fourth order in theta. Non-uniform in-plane stretch costs bending energy too, and the moment
of a fold decreases beyond 90 degrees: both follow from the quadratic form.

A rest shape that is bent has K X = -2 sin(theta0/2) along the mean normal of the hinge, and R rotates it
with the cloth: the Kabsch frame of the hinge's four points, taken at the start of each step (`begin`) and constant
within it. About a rest shape folded by theta0 the stiffness in theta is cos^2(theta0/2) times D: sharp creases need the
hinge model.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import kabsch
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies.base import Energy, Step
from clothsim.physics.energies.hessians import ElementHessian


@dataclass(frozen=True)
class QuadraticBending(Energy):
    """E = sum k/2 |K x - R K X|^2.

    Parameters
    ----------
    vertices : (h, 4) int array
        Rows of x.
    stiffnesses : (h,) array
        k = D |e|^2/(A1 + A2) [N m].
    stencils : (h, N) sparse array
        K [1/m].
    blocks : (h, 12, 12) array
        The constant Hessian [N/m].
    bent : (k,) int array
        Hinges with a rest angle other than 0.
    rest_points : (k, 4, 3) array
        Their corners at rest, folded [m].
    rest_bend : (k,) array
        Their K X along the third axis.
    targets : (h, 3) array
        R K X in the frames of the step.
    """

    vertices: Ints
    stiffnesses: Floats
    stencils: sparse.csr_array
    blocks: Floats
    bent: Ints
    rest_points: Floats
    rest_bend: Floats
    targets: Floats

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        bend = self.stencils @ x - self.targets
        return 0.5 * float(np.sum(self.stiffnesses[:, None] * bend**2))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return self.stencils.T @ (self.stiffnesses[:, None] * (self.stencils @ x - self.targets))

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """12 x 12 a hinge [N/m]: constant, positive semi-definite and exact."""
        return ElementHessian(self.vertices, self.blocks)

    def begin(self, step: Step) -> Self:
        """A copy with the rest shape rotated to the hinges at the start; the energy itself where all is flat."""
        if not len(self.bent):
            return self
        return replace(self, targets=self._targets_at(step.positions))

    def _targets_at(self, positions: Floats) -> Floats:
        frames, _ = kabsch(self.rest_points, positions[self.vertices[self.bent]])
        targets = np.zeros((len(self.vertices), 3))
        targets[self.bent] = self.rest_bend[:, None] * frames[:, :, 2]
        return targets


def quadratic_bending(hinges: Hinges, world: World) -> QuadraticBending:
    """The bending energy of hinges, with the frames R of the start."""
    start = world.start()
    height1, height2 = hinges.corners[:, 2, 1], -hinges.corners[:, 3, 1]
    u, w = (hinges.corners[:, k, 0] / hinges.edge_lengths for k in (2, 3))
    weights = np.column_stack(
        [-(1 - u) / height1 - (1 - w) / height2, -u / height1 - w / height2, 1 / height1, 1 / height2]
    )
    stiffnesses = hinges.stiffness * hinges.edge_lengths**2 / hinges.areas
    rows = np.repeat(np.arange(len(weights)), 4)
    stencils = sparse.csr_array(
        (weights.ravel(), (rows, hinges.vertices.ravel())), shape=(len(weights), len(start)), dtype=np.float64
    )
    blocks = np.einsum("h,hk,hm,ij->hkimj", stiffnesses, weights, weights, np.eye(3)).reshape(-1, 12, 12)
    bent = np.flatnonzero(hinges.rest_angles)
    angles = hinges.rest_angles[bent]
    energy = QuadraticBending(
        hinges.vertices,
        stiffnesses,
        stencils,
        blocks,
        bent,
        folded(hinges.corners[bent], angles),
        -2 * np.sin(angles / 2),
        np.zeros((len(weights), 3)),
    )
    return replace(energy, targets=energy._targets_at(start))


def folded(corners: Floats, angles: Floats) -> Floats:
    """Flat hinges (k, 4, 2) [m] folded by `angles` (k,) [rad] about their edge, (k, 4, 3): each side by a half.

    The edge stays on the first axis, the mean normal is the third; a positive angle folds against it.
    """
    along, across = corners[:, :, 0], corners[:, :, 1]
    half = angles[:, None] / 2
    return np.stack([along, across * np.cos(half), -np.abs(across) * np.sin(half)], axis=2)
