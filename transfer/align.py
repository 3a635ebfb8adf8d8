"""Similarity transforms that align two meshes, from markers or from bounding boxes."""

from dataclasses import dataclass

import numpy as np

from transfer.triangle_surface import Floats, Ints


@dataclass(frozen=True)
class Similarity:
    """Similarity x -> scale * rotation @ x + shift; rotation (3, 3), shift (3,)."""

    scale: float
    rotation: Floats
    shift: Floats

    def apply(self, points: Floats) -> Floats:
        """Transform points (k, 3)."""
        return self.scale * points @ self.rotation.T + self.shift


def by_points(source: Floats, target: Floats) -> Similarity:
    """Least-squares similarity from source to target points, (k, 3) (Umeyama 1991); not all collinear."""
    from_mean, to_mean = source.mean(axis=0), target.mean(axis=0)
    a, b = source - from_mean, target - to_mean
    left, singular, right = np.linalg.svd(b.T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = (left * signs) @ right
    scale = float((singular * signs).sum() / (a**2).sum())
    return Similarity(scale, rotation, to_mean - scale * rotation @ from_mean)


def by_boxes(source: tuple[Floats, Ints], target: tuple[Floats, Ints]) -> Similarity:
    """Similarity without rotation that matches the centres and the longest sides of the bounding boxes."""
    used = [positions[np.unique(triangles)] for positions, triangles in (source, target)]
    low, high = np.array([(p.min(axis=0), p.max(axis=0)) for p in used]).transpose(1, 0, 2)
    side = (high - low).max(axis=1)
    scale = float(side[1] / side[0])
    middle = (low + high) / 2.0
    return Similarity(scale, np.eye(3), middle[1] - scale * middle[0])


def span_a_plane(points: Floats) -> bool:
    """True where points (k, 3) are at least three and not collinear, so that they determine a rotation."""
    if len(points) < 3:
        return False
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(singular[1] > 1e-3 * singular[0])
