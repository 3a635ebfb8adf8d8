"""Cameras that look at a scene, and what they see of it."""

import numpy as np

from clothsim.base.ray_casting import first_hits
from clothsim.gradients.camera import Camera


def looking(eye, at=(0.0, 0.0, 0.0), focal=600.0, size=(320, 240)):
    """A camera at `eye` that looks at `at`, z up in the picture."""
    forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    middle = (np.array(size) - 1) / 2
    return Camera(*size, (focal, focal), middle, np.array([right, np.cross(forward, right), forward]), eye)


def seen(camera, *parts):
    """Number of the part, corners (m, 3, 3) each, that every pixel shows, -1 for none, and its distance."""
    v, u = np.indices((camera.height, camera.width))
    owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    hits = first_hits(np.concatenate(parts), camera.position, rays)
    found = np.where(hits.triangle >= 0, owner[hits.triangle], -1)
    return found.reshape(v.shape), hits.distance.reshape(v.shape)
