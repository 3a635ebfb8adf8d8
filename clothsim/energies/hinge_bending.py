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
from clothsim.compiled import LANES, kernel
from clothsim.energies.base import Energy, LanesHessian
from clothsim.energies.lanes import point, write
from clothsim.kinematics.hinge import has_angle, hinge_angle, hinge_angle_gradient, hinge_blocks, hinge_points
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

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """12 x 12 a hinge [N/m]; projected: Gauss-Newton, k g g', else with k (theta - theta0) d2theta/dx2 too."""
        hinges = self.vertices, self.rest_angles, self.stiffnesses
        return LanesHessian(self.vertices, lambda lanes, first: _fill(lanes, first, *hinges, x, project))


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
def _fill(
    lanes: Floats, first: int, vertices: Ints, rest_angles: Floats, stiffnesses: Floats, x: Floats, project: bool
) -> None:
    """`LanesHessian.fill` of k g g' + k (theta - theta0) d2theta/dx2, projected without its second part.

    A hinge without an angle, and a lane without a hinge, get zeros: those of another hinge, of no stiffness.
    """
    points, factors = np.empty(12 * LANES), np.empty(2 * LANES)
    for group in range(len(lanes)):
        for lane in range(LANES):
            a, b, c, d = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
            moment, stiffness, h = 0.0, 0.0, first + group * LANES + lane
            if h < len(vertices):
                e, f, g, i = hinge_points(x, vertices, h)
                if has_angle(e, f, g, i):
                    a, b, c, d, stiffness = e, f, g, i, stiffnesses[h]
                    moment = 0.0 if project else stiffness * (hinge_angle(a, b, c, d) - rest_angles[h])
            factors[lane], factors[LANES + lane] = moment, stiffness
            for k in range(3):
                points[k * LANES + lane], points[(3 + k) * LANES + lane] = a[k], b[k]
                points[(6 + k) * LANES + lane], points[(9 + k) * LANES + lane] = c[k], d[k]
        out = lanes[group]
        for lane in range(LANES):
            a, b, c, d = point(points, 0, lane), point(points, 3, lane), point(points, 6, lane), point(points, 9, lane)
            aa, ab, ac, ad, bb, bc, bd, cc, cd, dd = hinge_blocks(a, b, c, d, factors[lane], factors[LANES + lane])
            write(out, 0, lane, aa)
            write(out, 1, lane, ab)
            write(out, 2, lane, ac)
            write(out, 3, lane, ad)
            write(out, 4, lane, bb)
            write(out, 5, lane, bc)
            write(out, 6, lane, bd)
            write(out, 7, lane, cc)
            write(out, 8, lane, cd)
            write(out, 9, lane, dd)
