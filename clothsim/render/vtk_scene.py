"""VTK pictures through pyvista: three lights, screen-space ambient occlusion; needs EGL, OSMesa or a display.

Ask `display.why_not_vtk` first: where VTK cannot draw it ends the whole process.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkLogger

from clothsim.base.arrays import Floats
from clothsim.render.camera import Camera, seen_box
from clothsim.render.surface_look import Look

_AMBIENT, _DIFFUSE = 0.50, 0.56
_LIGHTS = (((-0.70, 0.85, 0.40), 0.88), ((0.80, 0.15, 0.60), 0.22), ((0.10, 0.90, -0.40), 0.12))
"""Direction towards the light (right, up, backward of the camera) and intensity: key, fill and rim."""


def render(made: Sequence[Look], camera: Camera, size: tuple[int, int], up: Floats, samples: int = 2) -> Floats:
    """Rendered image, (height, width, 4): sRGB times coverage, and the coverage."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # it warns of a missing X server before it takes EGL
    low, high = seen_box(np.concatenate([look.corners for look in made]).reshape(-1, 3), camera)
    scale = 1.0 / (float((high - low).max()) or 1.0)
    centre = 0.5 * (low + high)
    window = [size[0] * samples, size[1] * samples]
    plotter = pyvista.Plotter(off_screen=True, notebook=False, window_size=window, lighting="none")
    try:
        plotter.set_background("white")
        for look in made:
            _add_two_sided(plotter, look, centre, scale)
        _aim(plotter, camera, (camera.position - centre) * scale, up)
        plotter.enable_ssao(radius=0.10, bias=0.010, kernel_size=16, blur=True)
        plotter.show(auto_close=False)
        image = plotter.screenshot(return_img=True)
        covered = _covered(plotter, window)
    finally:
        plotter.close()
    return _sampled(image, covered, samples)


def _covered(plotter: Any, window: Sequence[int]) -> np.ndarray:
    """True where a surface was drawn, (height, width): from the depth buffer, without a copy of the picture."""
    depth = vtkFloatArray()
    plotter.render_window.GetZbufferData(0, 0, window[0] - 1, window[1] - 1, depth)
    return vtk_to_numpy(depth).reshape(window[1], window[0])[::-1] < 1.0


def _sampled(image: np.ndarray, covered: np.ndarray, samples: int) -> Floats:
    """Mean over the samples of each pixel: sRGB times coverage, and the coverage, (height, width, 4)."""
    height, width = covered.shape[0] // samples, covered.shape[1] // samples
    total = np.zeros((height, width, 4), np.float32)
    for i in range(samples):
        for j in range(samples):
            part = covered[i::samples, j::samples]
            total[:, :, :3] += image[i::samples, j::samples, :3] * part[:, :, None]
            total[:, :, 3] += part
    total /= samples**2
    total[:, :, :3] /= 255.0
    return total


def _add_two_sided(plotter: Any, look: Look, centre: Floats, scale: float) -> None:
    """One actor for each side, as VTK gives both sides of an actor the same colours."""
    points = ((look.corners - centre) * scale).reshape(-1, 3)
    for hidden, paint in (("back", look.front), ("front", look.back)):
        mesh = pyvista.PolyData.from_regular_faces(points, np.arange(len(points)).reshape(-1, 3))
        mesh.point_data["colour"] = np.round(255 * np.reshape(paint, (-1, 3))).astype(np.uint8)
        mesh.point_data.active_normals = look.normals.reshape(-1, 3)
        actor = plotter.add_mesh(
            mesh, scalars="colour", rgb=True, culling=hidden, ambient=_AMBIENT, diffuse=_DIFFUSE, specular=0.0
        )
        actor.prop.interpolation = "Phong"


def _aim(plotter: Any, camera: Camera, eye: Floats, up: Floats) -> None:
    right, picture_up, backward = camera.axes
    plotter.camera.position = eye
    plotter.camera.focal_point = eye - backward
    plotter.camera.up = picture_up
    plotter.camera.view_angle = np.degrees(2 * np.arctan(camera.tangents[1]))
    plotter.reset_camera_clipping_range()
    vertical = up / np.linalg.norm(up)
    for (along_right, along_up, along_backward), intensity in _LIGHTS:
        towards = along_right * right + along_up * vertical + along_backward * backward
        light = pyvista.Light(position=tuple(10 * towards), focal_point=(0, 0, 0), intensity=intensity)
        light.positional = False
        plotter.add_light(light)
