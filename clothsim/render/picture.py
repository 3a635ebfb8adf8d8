"""PNG of cloths and bodies at one time."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from clothsim.arrays import Floats, as_points, as_triangles, as_vector
from clothsim.errors import InputError
from clothsim.render.camera import VIEWS, Camera, extreme_points, frame, named_view, three_quarter_view
from clothsim.render.colormap import log_stretch
from clothsim.render.colour_scale import Quantity, Scale, sequential_scale, stretch_scale
from clothsim.render.legend import add_legend, margins
from clothsim.render.smooth_surface import smoothed
from clothsim.render.surface_look import Surface, looks

_UP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_SMALLEST = 64


@dataclass(frozen=True)
class PictureSetup:
    """Camera, colour range and renderer of a picture, the same for every frame of a movie.

    Parameters
    ----------
    camera : Camera
        Position and axes.
    size : (int, int)
        Width and height in pixels.
    scale : Scale or None
        Colours of the cloth; None where it is plain.
    up : (3,) array
        Unit vector.
    title : str
        Text at the top left.
    renderer : "vtk" or "ray"
        Rasterisation by VTK, or ray casting.
    samples : int
        Samples of a pixel in each direction.
    note : str
        One line that names the renderer.
    smooth : bool
        True: cloths are drawn as smooth surfaces through their vertices.
    """

    camera: Camera
    size: tuple[int, int]
    scale: Scale | None
    up: Floats
    title: str
    renderer: str
    samples: int
    note: str
    smooth: bool = True


def draw(
    path: str | Path,
    surfaces: Sequence[Surface],
    *,
    size: tuple[int, int] = (1280, 960),
    colour: str | Quantity = "stretch",
    up: ArrayLike | str = "z",
    view: ArrayLike | str = "auto",
    title: str = "",
    renderer: str = "auto",
    smooth: bool = True,
) -> str:
    """Write a PNG of surfaces.

    Parameters
    ----------
    path : str or Path
        The file.
    surfaces : sequence of Surface
        Cloths and bodies at one time.
    size : (int, int)
        Width and height in pixels.
    colour : "stretch", "plain" or Quantity
        Of the cloths: the principal stretch farthest from 1, with a scalar bar; none; or that of their `values`.
    up : (3,) array, "x", "y" or "z"
        The upward direction of the picture.
    view : (3,) array, "auto", "front", "back", "left", "right" or "top"
        Direction from the scene to the camera.
    title : str
        Text at the top left.
    renderer : "vtk", "ray" or "auto"
        "auto": the environment variable CLOTHSIM_RENDERER, else VTK where it works.
    smooth : bool
        True: a smooth surface through the vertices of each cloth; False: its triangles.

    Returns
    -------
    str
        One line that names the renderer, and how to get the better one.

    Raises
    ------
    InputError
        For a bad argument, or a renderer that does not work here.
    """
    from PIL import Image

    given = {"size": size, "colour": colour, "up": up, "view": view, "title": title, "smooth": smooth}
    setup = picture_setup([surfaces], renderer=renderer, **given)  # type: ignore[arg-type]
    Image.fromarray(rendered(setup, surfaces)).save(path, format="PNG")
    return setup.note


def picture_setup(
    frames: Sequence[Sequence[Surface]],
    *,
    size: tuple[int, int],
    colour: str | Quantity,
    up: ArrayLike | str,
    view: ArrayLike | str,
    title: str,
    renderer: str,
    samples: int = 2,
    focus: Floats | None = None,
    smooth: bool = True,
) -> PictureSetup:
    """The one camera, colour range and renderer that suit all frames.

    Parameters
    ----------
    frames : sequence of sequences of Surface
        The surfaces of each frame.
    size, colour, up, view, title, renderer, smooth
        As of `draw`.
    samples : int
        Samples of a pixel in each direction.
    focus : (k, 3) array, optional
        Points to be framed instead of the cloth [m].

    Raises
    ------
    InputError
        For a bad argument, or without a frame.
    """
    if not len(frames):
        raise InputError("There is no frame to draw.")
    if not isinstance(colour, Quantity) and colour not in ("stretch", "plain"):
        raise InputError(f'colour must be "stretch" or "plain", not {colour!r}.')
    pixels = pixel_counts(size)
    if min(pixels) < _SMALLEST:
        raise InputError(f"A picture needs at least {_SMALLEST} x {_SMALLEST} pixels, not {pixels[0]} x {pixels[1]}.")
    for surface in (s for surfaces in frames for s in surfaces):
        _check(surface)
    upright = _direction("up", _UP.get(up, up) if isinstance(up, str) else up)
    chosen, note = choose_renderer(renderer)
    scale = scale_of(colour, [s for surfaces in frames for s in surfaces if s.role == "cloth"])
    everything = np.concatenate([extreme_points(s.positions) for surfaces in frames for s in surfaces])
    cloths = [s for surfaces in frames for s in surfaces if s.role == "cloth"]
    cloth = np.concatenate([np.zeros((0, 3)), *(extreme_points(s.positions) for s in cloths)])
    if isinstance(view, str):
        if view not in ("auto", *VIEWS):
            raise InputError(f"view must be a direction, auto or one of {', '.join(VIEWS)}, not {view!r}.")
        last = [s for s in frames[-1] if s.role == "cloth"] or list(frames[-1])
        corners = np.concatenate([s.positions[s.triangles] for s in last])
        backward = three_quarter_view(corners, upright) if view == "auto" else named_view(view, upright)
    else:
        backward = _direction("view", view)
    room = margins(pixels, scale is not None, title)
    if focus is not None:
        cloth = everything = focus
    camera = frame(cloth, everything, aspect=pixels[0] / pixels[1], up=upright, backward=backward, margins=room)
    return PictureSetup(camera, pixels, scale, upright, title, chosen, samples, note, smooth)


def pixel_counts(size: Any) -> tuple[int, int]:
    """The width and height in pixels. InputError where `size` is no pair of numbers."""
    try:
        width, height = (int(pixels) for pixels in size)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"size must be (width, height) in pixels, not {size!r:.80}.", "Give size=(1280, 960)."
        ) from error
    return width, height


def rendered(setup: PictureSetup, surfaces: Sequence[Surface]) -> np.ndarray:
    """The picture of one frame with its legend, (height, width, 3) uint8."""
    return add_legend(rendered_without_legend(setup, surfaces), setup.scale, setup.title)


def rendered_without_legend(setup: PictureSetup, surfaces: Sequence[Surface]) -> np.ndarray:
    """The picture of one frame without a legend, (height, width, 3), sRGB in [0, 1]."""
    from clothsim.render.backdrop import backdrop

    if setup.renderer == "vtk":
        from clothsim.render.vtk_scene import render
    else:
        from clothsim.render.ray_caster import render
    made = looks([smoothed(each) for each in surfaces] if setup.smooth else surfaces, setup.scale)
    seen = render(made, setup.camera, setup.size, setup.up, setup.samples)
    behind = backdrop(made, setup.camera, setup.size, setup.up)
    return np.asarray(seen[:, :, :3] + (1 - seen[:, :, 3:]) * behind)


def choose_renderer(renderer: str) -> tuple[str, str]:
    """Name of the renderer, "vtk" or "ray", and a line of text that names it.

    VTK is only tried where it is known to work, or asked for by name.
    """
    from clothsim.render.display import why_not_vtk

    wanted = os.environ.get("CLOTHSIM_RENDERER", "auto") if renderer == "auto" else renderer
    if wanted not in ("auto", "vtk", "ray"):
        raise InputError(f'The renderer must be "auto", "vtk" or "ray", not {wanted!r}.')
    if wanted == "ray":
        return "ray", "Drawn by ray casting, as asked."
    missing = why_not_vtk()
    if not missing:
        return "vtk", "Drawn by VTK."
    if wanted == "vtk":
        raise InputError(f"VTK cannot draw here: {missing}.", 'Or use the renderer "ray".')
    return "ray", f"Drawn by ray casting, as {missing}."


def scale_of(colour: str | Quantity, cloths: Sequence[Surface]) -> Scale | None:
    """The colours that suit all `cloths`; None where they are plain."""
    if isinstance(colour, Quantity) and colour.log_stretch:
        return stretch_scale([cloth.values for cloth in cloths], colour.name)
    if isinstance(colour, Quantity):
        return sequential_scale(colour, [cloth.values for cloth in cloths])
    logs = [log_stretch(cloth.principal_stretches) for cloth in cloths]
    return stretch_scale(logs) if colour == "stretch" and any(len(part) for part in logs) else None


def _check(surface: Surface) -> None:
    name = surface.name
    as_points(f"{name} positions", surface.positions)
    as_triangles(f"{name} triangles", surface.triangles, len(surface.positions))
    if not len(surface.triangles):
        raise InputError(f"{name} has no triangles to draw.")
    if surface.role not in ("cloth", "body"):
        raise InputError(f'{name}: role must be "cloth" or "body", not {surface.role!r}.')
    stretches = as_points(f"{name} principal_stretches", surface.principal_stretches, 2)
    if len(stretches) not in (0, len(surface.triangles)):
        raise InputError(f"{name}: {len(stretches)} principal_stretches for {len(surface.triangles)} triangles.")
    if len(surface.values) not in (0, len(surface.positions)):
        raise InputError(f"{name}: {len(surface.values)} values for {len(surface.positions)} vertices.")


def _direction(name: str, values: ArrayLike | str) -> Floats:
    if isinstance(values, str):
        raise InputError(f'{name} must be a direction, "x", "y" or "z", not {values!r}.')
    vector = as_vector(name, values)
    if not vector.any():
        raise InputError(f"{name} must not be zero.")
    return vector / np.linalg.norm(vector)
