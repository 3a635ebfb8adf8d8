"""Discrete-shell bending: a spring on every dihedral angle.

    E = sum k/2 (theta - theta0)^2,   k = D |e|^2 / (A1 + A2)

with |e|, A1, A2 at rest (Grinspun et al. 2003, "Discrete shells", with this weight). It gives a cylindrical fold along
a grid the energy D kappa^2/2 per area; the common weight 3 |e|^2/(A1 + A2) is 3 times too stiff.

The model depends on the mesh, whatever the weight. It is exact for cylindrical bending on equilateral meshes and along
the axes of right or alternating grids; along one diagonal of a right-diagonal grid it is 3 times too stiff; on random
Delaunay meshes about 1.29 times, and refinement does not help; its Poisson ratio is the mesh's (0 on a right-diagonal
grid), not the material's (docs/results/validation.md, A3).

The difference of angles is not wrapped. theta lies in [-pi, pi] and reaches +-pi only where the two triangles lie face
to face, which contact prevents; up to there E is smooth. Wrapping would put a jump at theta0 +- pi, which is admissible
where the rest shape is bent. Without self-contact E has a kink (theta0 = 0) or a jump at a fold by pi.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from clothsim.base.arrays import Floats, Ints
from clothsim.base.linalg import dot
from clothsim.base.memo import Memo
from clothsim.mesh.cloth import Hinges
from clothsim.mesh.world import World
from clothsim.physics.energies import hinge_kernels as kernels
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import LanesHessian
from clothsim.physics.energies.protocols import Elementwise


@dataclass(frozen=True)
class HingeBending(Elementwise, Energy):
    """E = sum k/2 (theta - theta0)^2; +inf where a triangle beside a hinge has no area.

    Such a hinge adds nothing to gradient and Hessian. The angles of the last positions are memoised: value, gradient
    and Hessian are evaluated at the same x.

    Parameters
    ----------
    vertices : (h, 4) int array
        Rows of x: both ends of the shared edge and the two opposite corners.
    rest_angles : (h,) array
        theta0 [rad].
    stiffnesses : (h,) array
        k [N m].
    """

    vertices: Ints
    rest_angles: Floats
    stiffnesses: Floats

    per_element = ("vertices", "rest_angles", "stiffnesses")

    _angles: Memo[Floats] = field(default_factory=Memo, init=False, repr=False, compare=False)

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        bent = self._bent(x)
        return 0.5 * dot(self.stiffnesses, bent**2) if np.isfinite(bent).all() else np.inf

    def gradient(self, x: Floats) -> Floats:
        """k (theta - theta0) dtheta/dx, (N, 3) [N]."""
        return kernels.gradient(self.vertices, self._moments(x), x)

    def hessian(self, x: Floats, project: bool = True) -> LanesHessian:
        """12 x 12 a hinge [N/m]: Gauss-Newton k g g', g = dtheta/dx; exact: plus k (theta - theta0) d2theta/dx2."""
        moments = np.zeros(len(self.vertices)) if project else self._moments(x)
        return kernels.hinge_hessian(self.vertices, moments, self.stiffnesses, x)

    def strains_of_angles(self) -> tuple[sparse.csr_array, Floats]:
        """B (h, h) and w (h,) [N m] of E = sum w |B (theta - theta0)|^2/2, a strain a hinge: its own angle."""
        return sparse.eye_array(len(self.stiffnesses)).tocsr(), self.stiffnesses

    def _bent(self, x: Floats) -> Floats:
        """theta - theta0, (h,) [rad]; +inf where a triangle has no area."""
        return self._angles.at(x, lambda x: kernels.angles(self.vertices, x)) - self.rest_angles

    def _moments(self, x: Floats) -> Floats:
        bent = self._bent(x)
        return np.where(np.isfinite(bent), self.stiffnesses * bent, 0.0)


def hinge_bending(hinges: Hinges, world: World | None = None) -> HingeBending:
    """The bending energy of hinges with the stiffness D [N m] of their cloth (`world`: other models need it)."""
    return HingeBending(hinges.vertices, hinges.rest_angles, hinges.stiffness * hinges.edge_lengths**2 / hinges.areas)
