"""VTK pictures: three lights, screen-space ambient occlusion; needs EGL, OSMesa or a display.

Ask `display.why_not_vtk` first: where VTK cannot draw it ends the whole process. Only the modules of VTK that draw are
loaded: pyvista takes half a second more, with matplotlib.

Edges are sampled as often as the caller asks, the occlusion once a pixel: it is smooth, and at four samples took four
fifths of the time and half of the memory of a picture.
"""

from collections.abc import Sequence

import numpy as np
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - what draws registers itself
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray, vtkLogger, vtkPoints, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkLight, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow
from vtkmodules.vtkRenderingOpenGL2 import vtkRenderStepsPass, vtkSSAOPass

from clothsim.base.arrays import Floats, Ints
from clothsim.render.camera import Viewpoint, seen_box
from clothsim.render.display import vtk_attempt
from clothsim.render.surface_look import Look

_AMBIENT, _DIFFUSE = 0.50, 0.56
_MARGIN = 8
"""Pixels about what the surfaces cover: the occlusion is blurred over four."""
_LIGHTS = (((-0.70, 0.85, 0.40), 0.88), ((0.80, 0.15, 0.60), 0.22), ((0.10, 0.90, -0.40), 0.12))
"""Direction towards the light (right, up, backward of the camera) and intensity: key, fill and rim."""


def render(made: Sequence[Look], camera: Viewpoint, size: tuple[int, int], up: Floats, samples: int = 2) -> Floats:
    """Rendered image, (height, width, 4): sRGB times coverage, and the coverage."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # it warns of a missing X server before it takes EGL
    corners = np.concatenate([look.corners for look in made]).reshape(-1, 3)
    low, high = seen_box(corners, camera)
    scale = 1.0 / (float((high - low).max()) or 1.0)
    centre = 0.5 * (low + high)
    renderer = vtkRenderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    renderer.AutomaticLightCreationOff()
    for look in made:
        for actor in _two_sided(look, centre, scale):
            renderer.AddActor(actor)
    (left, bottom), (right, top) = box = _covered_box(corners, camera, size)
    _aim(renderer, camera, (camera.position - centre) * scale, up, 2.0 * box / size - 1.0)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.AddRenderer(renderer)
    pixels = right - left, top - bottom
    try:
        with vtk_attempt():
            seen = _sampled(*_drawn(window, (pixels[0] * samples, pixels[1] * samples)), samples)
            plain, _ = _drawn(window, pixels)
            steps, occlusion = vtkRenderStepsPass(), vtkSSAOPass()
            occlusion.SetRadius(0.10)
            occlusion.SetBias(0.010)
            occlusion.SetKernelSize(16)
            occlusion.BlurOn()
            occlusion.SetDelegatePass(steps)
            renderer.SetPass(occlusion)
            dark, _ = _drawn(window, pixels)
    finally:
        window.Finalize()
    light, unoccluded = (1.0 + each.sum(axis=2, dtype=np.float32) for each in (dark, plain))
    seen[:, :, :3] *= (light / unoccluded)[:, :, None]
    image = np.zeros((size[1], size[0], 4))
    image[size[1] - top : size[1] - bottom, left:right] = seen
    return image


def _covered_box(corners: Floats, camera: Viewpoint, size: tuple[int, int]) -> Ints:
    """Pixels that the surfaces may cover: left and bottom, right and top, (2, 2); else all of them."""
    if (((corners - camera.position) @ camera.axes[2]) >= 0).any():
        return np.array([(0, 0), size])
    at = 0.5 * (1.0 + camera.project(corners)) * size
    low, high = np.floor(at.min(axis=0)) - _MARGIN, np.ceil(at.max(axis=0)) + _MARGIN
    box = np.clip([low, high], 0, size).astype(np.int64)
    return box if (box[0] < box[1]).all() else np.array([(0, 0), size])


def _drawn(window: vtkRenderWindow, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """The picture of that size, (height, width, 3) uint8, and True where a surface was drawn, from the depth buffer."""
    width, height = size
    window.SetSize(width, height)
    window.Render()
    colours, depth = vtkUnsignedCharArray(), vtkFloatArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 0, colours, 0)
    window.GetZbufferData(0, 0, width - 1, height - 1, depth)
    image = vtk_to_numpy(colours).reshape(height, width, 3)[::-1]
    return image, vtk_to_numpy(depth).reshape(height, width)[::-1] < 1.0


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


def _two_sided(look: Look, centre: Floats, scale: float) -> list[vtkActor]:
    """One actor for each side, as VTK gives both sides of an actor the same colours."""
    points = vtkPoints()
    points.SetData(numpy_to_vtk(((look.corners - centre) * scale).reshape(-1, 3).astype(np.float32), deep=True))
    triangles = vtkCellArray()
    triangles.SetData(3, numpy_to_vtkIdTypeArray(np.arange(3 * len(look.corners), dtype=np.int64), deep=True))
    normals = numpy_to_vtk(np.ascontiguousarray(look.normals.reshape(-1, 3), np.float32), deep=True)
    actors = []
    for hides_back, paint in ((True, look.front), (False, look.back)):
        mesh = vtkPolyData()
        mesh.SetPoints(points)
        mesh.SetPolys(triangles)
        colours = np.round(255 * np.reshape(paint, (-1, 3))).astype(np.uint8)
        mesh.GetPointData().SetScalars(numpy_to_vtk(colours, deep=True))
        mesh.GetPointData().SetNormals(normals)
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(mesh)
        actor.SetMapper(mapper)
        look_of = actor.GetProperty()
        look_of.SetAmbient(_AMBIENT)
        look_of.SetDiffuse(_DIFFUSE)
        look_of.SetSpecular(0.0)
        look_of.SetInterpolationToPhong()
        look_of.SetBackfaceCulling(hides_back)
        look_of.SetFrontfaceCulling(not hides_back)
        actors.append(actor)
    return actors


def _aim(renderer: vtkRenderer, camera: Viewpoint, eye: Floats, up: Floats, part: Floats) -> None:
    """Place camera and lights; part: left and bottom, right and top of what is seen of the picture, (2, 2) in -1..1."""
    right, picture_up, backward = camera.axes
    seen_from = renderer.GetActiveCamera()
    seen_from.SetPosition(*eye)
    seen_from.SetFocalPoint(*(eye - backward))
    seen_from.SetViewUp(*picture_up)
    half = 0.5 * (part[1] - part[0])
    seen_from.SetViewAngle(np.degrees(2 * np.arctan(half[1] * camera.tangents[1])))
    seen_from.SetWindowCenter(*(0.5 * (part[0] + part[1]) / half))
    renderer.ResetCameraClippingRange()
    vertical = up / np.linalg.norm(up)
    for (along_right, along_up, along_backward), intensity in _LIGHTS:
        towards = along_right * right + along_up * vertical + along_backward * backward
        light = vtkLight()
        light.SetPosition(*(10 * towards))
        light.SetFocalPoint(0.0, 0.0, 0.0)
        light.SetIntensity(intensity)
        light.SetPositional(False)
        renderer.AddLight(light)
