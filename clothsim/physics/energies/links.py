"""Straight links: springs and strings between points of the cloth, or between points and positions in space.

    E = sum k/2 (|r| - L)^2,   r = sum w x - c        [J]

over the rows x of a link with weights w; c is a position in space, or 0 where the weights sum to 0. A slack link is a
string: where |r| <= L it contributes exactly nothing. With n = r/|r| the Hessian in r is
k n n' + k (1 - L/|r|) (I - n n'); its second eigenvalue, negative in a compressed spring, is projected to 0. The
Hessian of a stretched string is semi-definite.
"""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats, Ints
from clothsim.physics.energies.base import Energy
from clothsim.physics.energies.hessians import ElementHessian
from clothsim.physics.energies.protocols import Elementwise, Idling


@dataclass(frozen=True)
class Links(Elementwise, Energy, Idling):
    """E = sum k/2 (|r| - L)^2 over links; links of stiffness 0 are left out.

    Parameters
    ----------
    rows : (m, j) int array
        Rows of x.
    weights : (m, j) array
        w.
    targets : (m, 3) array
        c [m].
    lengths : (m,) array
        L [m].
    stiffnesses : (m,) array
        k [N/m].
    slack : (m,) bool array
        The links that are strings.
    """

    rows: Ints
    weights: Floats
    targets: Floats
    lengths: Floats
    stiffnesses: Floats
    slack: np.ndarray

    per_element = ("rows", "weights", "targets", "lengths", "stiffnesses", "slack")

    @property
    def idle(self) -> bool:
        """True where no link has a stiffness."""
        return not self.stiffnesses.any()

    def value(self, x: Floats) -> float:
        """E(x) [J]."""
        active, _, distances = self._active(x)
        return 0.5 * float(np.sum(self.stiffnesses[active] * (distances - self.lengths[active]) ** 2))

    def gradient(self, x: Floats) -> Floats:
        """dE/dx, (N, 3) [N]."""
        active, lines, distances = self._active(x)
        gradient = np.zeros_like(x)
        tension = self.stiffnesses[active] * (distances - self.lengths[active])
        forces = (tension / np.where(distances > 0, distances, 1.0))[:, None] * lines
        parts = self.weights[active][:, :, None] * forces[:, None]
        np.add.at(gradient, self.rows[active].ravel(), parts.reshape(-1, 3))
        return gradient

    def hessian(self, x: Floats, project: bool = True) -> ElementHessian:
        """Blocks (m', 3 j, 3 j) [N/m] of the active links."""
        active, lines, distances = self._active(x)
        known = distances > 0
        directions = lines / np.where(known, distances, 1.0)[:, None]
        across = np.where(known, 1 - self.lengths[active] / np.where(known, distances, 1.0), 1.0)
        if project:
            across = np.maximum(across, 0.0)
        along = directions[:, :, None] * directions[:, None, :]
        inner = across[:, None, None] * np.eye(3) + (1 - across)[:, None, None] * along
        inner *= self.stiffnesses[active][:, None, None]
        w, j = self.weights[active], self.rows.shape[1]
        blocks = np.einsum("ma,mb,mpq->mapbq", w, w, inner).reshape(-1, 3 * j, 3 * j)
        return ElementHessian(self.rows[active], blocks)

    def lines(self, x: Floats) -> Floats:
        """r of every link, (m, 3) [m]."""
        return np.einsum("mj,mjp->mp", self.weights, x[self.rows]) - self.targets

    def _active(self, x: Floats) -> tuple[Ints, Floats, Floats]:
        """The active links, their r (m', 3) and |r| (m',) [m]."""
        lines = self.lines(x)
        distances = np.linalg.norm(lines, axis=1)
        active = np.flatnonzero((self.stiffnesses > 0) & (~self.slack | (distances > self.lengths)))
        return active, lines[active], distances[active]
