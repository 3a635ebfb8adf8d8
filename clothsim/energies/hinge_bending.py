"""Discrete-shell bending: a spring on the angle of every hinge.

E = sum (D/2) |e|^2/(A1 + A2) (theta - theta0)^2 with |e|, A1, A2 at rest (Grinspun et al. 2003, with this weight). It
makes a cylindrical fold along a grid cost D kappa^2/2 per area; the common weight 3 |e|^2/(A1+A2) is 3 times too stiff.

What no weight can mend: the model belongs to the mesh. It is right for cylindrical bending on equilateral meshes and
along the axes of right or alternating grids; along one diagonal of a right-diagonal grid it is 3 times too stiff; on
random Delaunay meshes about 1.29 times, and refinement does not help; its Poisson ratio is the mesh's (0 on a
right-diagonal grid), not the material's (VALIDATION A3).

The difference of angles is not wrapped. theta lies in [-pi, pi] and reaches +-pi only where the two triangles touch
face to face, which contact forbids; E is smooth everywhere short of that. Wrapping would put a jump at theta0 +- pi,
which is admissible where the rest shape is bent. Without self-contact a fold pushed through pi meets a kink
(theta0 = 0) or a jump there.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.arrays import Floats, Ints
from clothsim.compiled import kernel
from clothsim.energies.base import ElementHessian, Energy, room_for
from clothsim.kinematics.hinge import hinge_angle, hinge_angle_gradient, hinge_hessian, hinge_points
from clothsim.mesh.hinges import Hinges


@dataclass(frozen=True)
class HingeBending(Energy):
    """vertices: (h, 4); rest_angles theta0: (h,) [rad]; stiffnesses: (h,) D |e|^2/(A1 + A2) [N m].

    The value is +inf where a triangle beside a hinge has no area; such a hinge adds nothing to gradient and Hessian.
    """

    vertices: Ints
    rest_angles: Floats
    stiffnesses: Floats

    per_element = ("vertices", "rest_angles", "stiffnesses")

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        return _value(self.vertices, self.rest_angles, self.stiffnesses, x)

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        return _gradient(self.vertices, self.rest_angles, self.stiffnesses, x)

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """12 x 12 a hinge [N/m]; projected: Gauss-Newton, k g g', else with k (theta - theta0) d2theta/dx2 too."""
        blocks = room_for(self.vertices)
        if project:
            _hessian(blocks, self.vertices, self.stiffnesses, x)
        else:
            _exact_hessian(blocks, self.vertices, self.rest_angles, self.stiffnesses, x)
        return ElementHessian(self.vertices, blocks)


def hinge_bending(hinges: Hinges) -> HingeBending:
    """The energy of `hinges`."""
    return HingeBending(hinges.vertices, hinges.rest_angles, hinges.stiffness * hinges.edge_lengths**2 / hinges.areas)


@kernel
def _value(vertices: Ints, rest_angles: Floats, stiffnesses: Floats, x: Floats) -> float:
    energy = 0.0
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        energy += 0.5 * stiffnesses[h] * (hinge_angle(a, b, c, d) - rest_angles[h]) ** 2
    return energy


@kernel
def _gradient(vertices: Ints, rest_angles: Floats, stiffnesses: Floats, x: Floats) -> Floats:
    """k (theta - theta0) dtheta/dx."""
    gradient = np.zeros_like(x)
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        angle = hinge_angle(a, b, c, d)
        if np.isinf(angle):
            continue
        moment = stiffnesses[h] * (angle - rest_angles[h])
        angle_gradient = hinge_angle_gradient(a, b, c, d)
        for k in range(4):
            for i in range(3):
                gradient[vertices[h, k], i] += moment * angle_gradient[k][i]
    return gradient


@kernel
def _hessian(blocks: Floats, vertices: Ints, stiffnesses: Floats, x: Floats) -> None:
    """k g g' with g = dtheta/dx; zeros for a hinge without an angle."""
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        g = hinge_angle_gradient(a, b, c, d)
        for k in range(4):
            for i in range(3):
                row = stiffnesses[h] * g[k][i]
                for m in range(4):
                    for j in range(3):
                        blocks[h, 3 * k + i, 3 * m + j] = row * g[m][j]


@kernel
def _exact_hessian(blocks: Floats, vertices: Ints, rest_angles: Floats, stiffnesses: Floats, x: Floats) -> None:
    """k g g' + k (theta - theta0) d2theta/dx2. By itself: few runs need it, and it takes long to compile."""
    for h in range(len(vertices)):
        a, b, c, d = hinge_points(x, vertices, h)
        angle = hinge_angle(a, b, c, d)
        moment = 0.0 if np.isinf(angle) else stiffnesses[h] * (angle - rest_angles[h])
        hinge_hessian(a, b, c, d, moment, stiffnesses[h], blocks[h])
