"""Automatic camera framing of the scene, or of the cloth where it would be small."""

from dataclasses import dataclass

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.triangles import area_vectors

_HALF_ANGLE = np.radians(13.0)
HIGH, LOW = np.radians(24.0), np.radians(9.0)
"""Elevation of the camera over what it looks at: to see a drape, and at a person's eyes."""
_AZIMUTHS = np.radians([32.0, -32.0, 62.0, -62.0])
_CLOTH_FRACTION = 0.5


@dataclass(frozen=True)
class Viewpoint:
    """A pinhole at `position (3,)` [m]; `axes (3, 3)`: rows right, up and backward (from the scene to the camera).

    tangents: (2,) half the width and half the height of the picture at distance 1.
    """

    position: Floats
    axes: Floats
    tangents: Floats

    def project(self, points: Floats) -> Floats:
        """Project `points` (n, 3): (n, 2), x right and y up, -1..1 inside the picture."""
        local = (points - self.position) @ self.axes.T
        return local[:, :2] / (-local[:, 2:] * self.tangents)

    def columns(self, width: int) -> Floats:
        """The position of the middle of each pixel at distance 1, to the right, (width,)."""
        return ((np.arange(width) + 0.5) / width * 2 - 1) * self.tangents[0]

    def rows(self, height: int) -> Floats:
        """The same upwards, row 0 on top, (height,)."""
        return (1 - (np.arange(height) + 0.5) / height * 2) * self.tangents[1]

    def directions(self, width: int, height: int) -> Floats:
        """The direction through the middle of each pixel, row 0 on top, (height, width, 3), not normalised."""
        x, y = self.columns(width), self.rows(height)
        right, up, backward = self.axes
        return x[None, :, None] * right + y[:, None, None] * up - backward


@dataclass(frozen=True)
class Margins:
    """Margins of the picture, as fractions of its half width and half height."""

    left: float = 0.08
    right: float = 0.08
    bottom: float = 0.08
    top: float = 0.08


def frame(
    cloth: Floats, everything: Floats, *, aspect: float, up: Floats, backward: Floats, margins: Margins
) -> Viewpoint:
    """The nearest camera looking along -`backward` that holds all points between the margins.

    cloth: (n, 3), everything: (k, 3), the cloth among it [m]; aspect: width over height. Where the whole cloth would
    fill less than half of the picture's width and of its height, the camera comes nearer until it does: every camera
    between the one for everything and the one for the cloth alone holds the cloth, as the frustum's conditions are
    linear in its position.
    """
    if not len(cloth):
        cloth = everything
    if not len(everything):
        raise InputError("There is nothing to draw.", "Give at least one surface with vertices.")
    axes = _axes(up, backward)
    tangents = np.tan(_HALF_ANGLE) * np.array([aspect, 1.0]) / min(aspect, 1.0)
    far, near = (_fit(points @ axes.T, tangents, margins) @ axes for points in (everything, cloth))
    low, high = 0.0, 1.0
    if _fraction(Viewpoint(far, axes, tangents), cloth) >= _CLOTH_FRACTION:
        return Viewpoint(far, axes, tangents)
    for _ in range(40):
        middle = 0.5 * (low + high)
        enough = _fraction(Viewpoint((1 - middle) * far + middle * near, axes, tangents), cloth) >= _CLOTH_FRACTION
        low, high = (low, middle) if enough else (middle, high)
    return Viewpoint((1 - high) * far + high * near, axes, tangents)


VIEWS = ("front", "back", "left", "right", "top")
"""Named views: left and right are those of a person who faces the front."""


def named_view(name: str, up: Floats) -> Floats:
    """The direction from the scene to the camera of one of VIEWS, (3,); the front is +z where y is up, -y where z is.

    >>> import numpy as np
    >>> named_view("left", np.array([0.0, 0.0, 1.0])).tolist()
    [1.0, 0.0, 0.0]
    """
    vertical = up / np.linalg.norm(up)
    right = _axes(vertical, _front(up))[0]
    front = np.cross(right, vertical)
    return {"front": front, "back": -front, "left": right, "right": -right, "top": vertical}[name] + 0.0


def _front(up: Floats) -> Floats:
    return np.array([0.0, -1.0, 0.0]) if abs(up[2]) > 0.7 * np.linalg.norm(up) else np.array([0.0, 0.0, 1.0])


def three_quarter_view(cloth_corners: Floats, up: Floats, elevation: float = HIGH) -> Floats:
    """The direction from the scene to the camera, (3,): from slightly above, turned a third of a right angle.

    cloth_corners: (m, 3, 3) the cloth triangles' corners [m]. It turns to the other side, or further, where the cloth
    would be seen almost edge on. The front is +z where y is up, -y where z is up.
    """
    vertical = up / np.linalg.norm(up)
    right = _axes(vertical, _front(up))[0]
    front = np.cross(right, vertical)
    level = [np.cos(turn) * front + np.sin(turn) * right for turn in _AZIMUTHS]
    views = np.array([np.cos(elevation) * side + np.sin(elevation) * vertical for side in level])
    normals = area_vectors(cloth_corners)
    areas = np.abs(normals @ views.T).sum(axis=0)
    return views[np.argmax(areas >= 0.6 * areas.max())]


def extreme_points(points: Floats, count: int = 128) -> Floats:
    """The points of `points (n, 3)` that lie farthest in `count` directions: enough to frame them all."""
    if len(points) <= count:
        return points
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    directions = np.array([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)])
    return points[np.unique(np.argmax((points - points.mean(0)) @ directions, axis=0))]


def seen_box(points: Floats, camera: Viewpoint) -> tuple[Floats, Floats]:
    """Lowest and highest corner of those `points (n, 3)` that are in the picture (of all, where none is), (3,) each.

    Its size is the scale on which light is blocked: a wide ground must not set it.
    """
    inside = (points - camera.position) @ camera.axes[2] < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        inside &= (np.abs(camera.project(points)) <= 1).all(axis=1)
    seen = points[inside] if inside.any() else points
    return seen.min(axis=0), seen.max(axis=0)


def _axes(up: Floats, backward: Floats) -> Floats:
    """Rows right, up, backward, orthonormal; where `backward` is along `up`, some direction of the picture is up."""
    back = backward / np.linalg.norm(backward)
    upright = np.asarray(up, float) / np.linalg.norm(up)
    if np.linalg.norm(np.cross(upright, back)) < 1e-3:
        upright = np.roll(upright, 1)
    right = np.cross(upright, back)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(back, right), back])


def _fit(local: Floats, tangents: Floats, margins: Margins) -> Floats:
    """The nearest camera position, in the camera's axes, from which all of `local (n, 3)` is between the margins.

    A camera at (c, D) sees a point (x, z) inside where x - c <= t_right (D - z) and c - x <= t_left (D - z), so
    max(x + t_right z) <= c + t_right D and max(-x + t_left z) <= -c + t_left D; the same holds for y.
    """
    z = local[:, 2]
    upper = tangents * (1 - np.array([margins.right, margins.top]))
    lower = tangents * (1 - np.array([margins.left, margins.bottom]))
    above = np.array([(local[:, k] + upper[k] * z).max() for k in (0, 1)])
    below = np.array([(-local[:, k] + lower[k] * z).max() for k in (0, 1)])
    size = float(np.ptp(local, axis=0).max()) or 1.0
    distance = max(((above + below) / (upper + lower)).max(), z.max() + 0.1 * size)
    centre = 0.5 * ((above - upper * distance) + (lower * distance - below))
    return np.array([*centre, distance])


def _fraction(camera: Viewpoint, points: Floats) -> float:
    """Larger fraction of the picture's width and height that the points span."""
    seen = camera.project(points)
    return float(np.ptp(seen, axis=0).max() / 2)
