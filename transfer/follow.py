"""Averages of source deformation gradients over the triangles that a target triangle follows."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from transfer.errors import TransferError
from transfer.gradients import centroids, deformation_gradients, inverse_frames
from transfer.triangle_surface import Floats, Ints, as_points, as_surface

REMEDY = "Pose with the mesh that the pairs were made for."


@dataclass(frozen=True)
class AveragedMotion:
    """Averaged source motion of each target triangle.

    gradients S (m, 3, 3); mean centroids of the followed source triangles at rest, start (m, 3), and deformed, end
    (m, 3) [m].
    """

    gradients: Floats
    start: Floats
    end: Floats

    def vertices(self, positions: Floats, triangles: Ints) -> Floats:
        """Images of vertices (n, 3): the mean over their triangles of b~ + S (x - b) [m]."""
        n, m = len(positions), len(triangles)
        fraction = 1.0 / np.maximum(np.bincount(triangles.ravel(), minlength=n), 1)
        entries = (fraction[triangles].ravel(), (triangles.ravel(), np.repeat(np.arange(m), 3)))
        mean = csr_array(entries, shape=(n, m))
        gradients = (mean @ self.gradients.reshape(m, 9)).reshape(n, 3, 3)
        origin = self.end - np.einsum("tab,tb->ta", self.gradients, self.start)
        return mean @ origin + np.einsum("nab,nb->na", gradients, positions)


@dataclass(frozen=True)
class FollowedSource:
    """Source at rest with inverse frames for many poses; made by `followed_source`.

    vertices: their number; triangles (k, 3): those that are followed; inverses (k, 3, 3) of their rest frames;
    averages (m, k); start (m, 3): mean rest centroid of the triangles that each row follows [m].
    """

    vertices: int
    triangles: Ints
    inverses: Floats
    averages: csr_array
    start: Floats

    @cached_property
    def one_to_one(self) -> bool:
        """True where each row follows only the triangle of the same index, as on bodies with one mesh."""
        same = self.averages.shape == (len(self.triangles),) * 2 and self.averages.nnz == len(self.triangles)
        return same and bool((self.averages.diagonal() == 1.0).all())

    @cached_property
    def middles(self) -> csr_array:
        """Operator from source vertices to the mean centroid of the triangles that each row follows, (m, vertices)."""
        k = len(self.triangles)
        entries = (np.full(3 * k, 1 / 3), (np.repeat(np.arange(k), 3), self.triangles.ravel()))
        return (self.averages @ csr_array(entries, shape=(k, self.vertices))).tocsr()

    def averaged(self, deformed: ArrayLike) -> AveragedMotion:
        """Averaged motion of the pose `deformed` (vertices, 3). TransferError for another number of vertices."""
        positions = as_points("deformed source", deformed)
        if len(positions) != self.vertices:
            raise TransferError(f"the source has {self.vertices} vertices, the deformed one {len(positions)}.", REMEDY)
        gradients = deformation_gradients(self.inverses, positions, self.triangles).reshape(-1, 9)
        mean = gradients if self.one_to_one else self.averages @ gradients
        return AveragedMotion(mean.reshape(-1, 3, 3), self.start, self.middles @ positions)


def followed_source(averages: csr_array, rest: ArrayLike, triangles: ArrayLike) -> FollowedSource:
    """Prepare a source at rest; averages (m, source triangles): weights of the triangles that each row follows.

    TransferError where a followed triangle does not exist or has no area.
    """
    positions, every = as_surface("source", rest, triangles)
    if averages.shape[1] > len(every):
        raise TransferError(
            f"the pairs name triangle {averages.shape[1] - 1} of the source, which has {len(every)}.", REMEDY
        )
    named = np.flatnonzero(np.bincount(averages.indices, minlength=averages.shape[1]))
    used, narrow = every[named], averages[:, named]
    inverses = inverse_frames(positions, used, "the source", named)
    return FollowedSource(len(positions), used, inverses, narrow, narrow @ centroids(positions, used))
