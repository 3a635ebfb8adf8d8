"""PNG of cloths and bodies at one time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from clothsim.base.arrays import Floats, as_points, as_triangles, as_vector
from clothsim.base.errors import InputError
from clothsim.base.file_writing import replacing
from clothsim.render.camera import HIGH, LOW, VIEWS, Viewpoint, extreme_points, frame, named_view, three_quarter_view
from clothsim.render.colour_scale import (
    Quantity,
    Scale,
    limits_of,
    log_stretch,
    sequential_scale,
    stretch_scale,
)
from clothsim.render.display import choose_renderer
from clothsim.render.ray_caster import pixel_geometry
from clothsim.render.styles import STYLES, Style, add_legend, backdrop, dyes_of, margins, outlined, woven
from clothsim.render.surface_look import Surface, looks, subdivided

_UP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_COLOURINGS = ("stretch", "plain", "auto")
_SMALLEST = 64
_RENDERERS = {
    "vtk": "clothsim.render.vtk_scene",
    "ray": "clothsim.render.ray_caster",
    "mitsuba": "clothsim.render.studio",
}
"""Modules of the renderers, as text: VTK and Mitsuba are imported only where they draw."""
FIGURE = 4.0
"""Largest size of a body that is shown whole, relative to the cloths'."""
STANDS = 0.8
"""Height of a body that stands, relative to its largest size: a person with arms out does."""
_LONGEST_SIDE, _MOST_SAMPLES = 16_384, 80_000_000
"""Bounds on the samples of a picture, along a side (of a frame buffer) and in all (7 GB of memory)."""


@dataclass(frozen=True)
class PictureSetup:
    """Camera, colour range and renderer of a picture, the same for every frame of a movie.

    Parameters
    ----------
    camera : Viewpoint
        Position and axes.
    size : (int, int)
        Width and height in pixels.
    scale : Scale or None
        Colours of the cloth by its values; None where it is plain.
    up : (3,) array
        Unit vector.
    title : str
        Text at the top left.
    renderer : "vtk", "ray" or "mitsuba"
        Rasterisation by VTK, ray casting, or tracing of light paths.
    samples : int
        Samples of a pixel in each direction.
    note : str
        One line that names the renderer.
    smooth : bool
        True: cloths are drawn as smooth surfaces through their vertices.
    style : Style
        What is added to the surfaces, and left out behind them.
    follow : bool
        True: the camera is that of cloths with their centre at the origin, and moves with the centre.
    dyes : (k, 2, 3) array or None
        sRGB of the threads of plain cloths; None: those of the style.
    """

    camera: Viewpoint
    size: tuple[int, int]
    scale: Scale | None
    up: Floats
    title: str
    renderer: str
    samples: int
    note: str
    smooth: bool = True
    style: Style = STYLES["fields"]
    follow: bool = False
    dyes: Floats | None = None


def draw(
    path: str | Path,
    surfaces: Sequence[Surface],
    *,
    size: tuple[int, int] = (1280, 960),
    colour: str | Quantity = "auto",
    up: ArrayLike | str = "z",
    view: ArrayLike | str = "auto",
    title: str = "",
    renderer: str = "auto",
    smooth: bool = True,
    style: str = "fields",
    limits: tuple[float, float] | None = None,
    dots_per_inch: float = 0.0,
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
    colour : "stretch", "plain", "auto", Quantity or text
        Of the cloths: the principal stretch farthest from 1, with a scalar bar; none; that of the style ("plain" of
        "fabric", else "stretch"); that of their `values`; or a colour for each, as of `dyes_of`.
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
    style : "fields", "print", "fabric" or "studio"
        Fields on the cloth; the same with outlines on white, bodies half transparent; a woven cloth; the same with
        hems and stitches in the light of a studio, path-traced in minutes (`pip install 'clothsim[look]'`).
    limits : (float, float), optional
        Range of the colours, in place of that of the values.
    dots_per_inch : float
        Written into the file, for its size on paper; 0: nothing is.

    Returns
    -------
    str
        One line that names the renderer, and how to get the better one.

    Raises
    ------
    InputError
        For a bad argument, or a renderer that does not work here.
    """
    setup = picture_setup(
        [surfaces],
        size=size,
        colour=colour,
        up=up,
        view=view,
        title=title,
        renderer=renderer,
        smooth=smooth,
        style=style,
        limits=limits,
    )
    written = {"dpi": (dots_per_inch, dots_per_inch)} if dots_per_inch else {}
    with replacing(Path(path)) as beside:
        beside.touch()  # what cannot be written is named before it is drawn
        Image.fromarray(rendered(setup, surfaces)).save(beside, format="PNG", **written)
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
    style: str = "fields",
    limits: tuple[float, float] | None = None,
    follow: bool = False,
) -> PictureSetup:
    """The one camera, colour range and renderer that suit all frames.

    Parameters
    ----------
    frames : sequence of sequences of Surface
        The surfaces of each frame.
    size, colour, up, view, title, renderer, smooth, style, limits
        As of `draw`.
    samples : int
        Samples of a pixel in each direction.
    follow : bool
        True: the camera moves with the centre of the cloths.
    focus : (k, 3) array, optional
        Points to be framed instead of the cloth [m].

    Raises
    ------
    InputError
        For a bad argument, or without a frame.
    """
    if not len(frames):
        raise InputError("There is no frame to draw.")
    if style not in STYLES:
        raise InputError(f"The style is {style!r}.", f"Known: {', '.join(STYLES)}.")
    dyes = None if isinstance(colour, Quantity) or colour in _COLOURINGS else dyes_of(str(colour))
    pixels = pixel_counts(size)
    named = f"A picture of {pixels[0]:,} x {pixels[1]:,} pixels"
    if min(pixels) < _SMALLEST:
        raise InputError(f"{named} is too small.", f"Give {_SMALLEST} or more each way.")
    if max(pixels) * samples > _LONGEST_SIDE or pixels[0] * pixels[1] * samples**2 > _MOST_SAMPLES:
        longest, most = _LONGEST_SIDE // samples, _MOST_SAMPLES // samples**2
        raise InputError(f"{named} is too large.", f"Give up to {longest:,} each way and {most:,} in all.")
    for surface in (s for surfaces in frames for s in surfaces):
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
    upright = _direction("up", _UP.get(up, up) if isinstance(up, str) else up)
    traced = STYLES[style].traced
    chosen, note = ("mitsuba", "Traced by Mitsuba.") if traced else choose_renderer(renderer)
    wanted = STYLES[style].colour if isinstance(colour, str) and colour == "auto" else colour
    scale = scale_of(wanted, [s for surfaces in frames for s in surfaces if s.role == "cloth"], limits)
    if follow:
        frames = [_centred(surfaces) for surfaces in frames]
    everything = np.concatenate(_extremes(frames, "cloth", "body"))
    backward = _backward(view, frames, upright, everything, traced)
    title = "" if traced else title
    if focus is not None:
        framed = everything = focus
    else:
        worn_by = _figures(frames) if traced else _standing(_figures(frames), upright)
        framed = np.concatenate([np.zeros((0, 3)), *_extremes(frames, "cloth"), *worn_by])
        everything = framed if traced else everything
    room = margins(pixels, scale is not None, title)
    camera = frame(framed, everything, aspect=pixels[0] / pixels[1], up=upright, backward=backward, margins=room)
    return PictureSetup(
        camera, pixels, scale, upright, title, chosen, samples, note, smooth, STYLES[style], follow, dyes
    )


def _backward(
    view: ArrayLike | str, frames: Sequence[Sequence[Surface]], upright: Floats, everything: Floats, traced: bool
) -> Floats:
    """Unit vector (3,) from the scene to the camera; of "auto" by the cloths of the last frame."""
    if not isinstance(view, str):
        return _direction("view", view)
    if view not in ("auto", *VIEWS):
        raise InputError(f"view must be a direction, auto or one of {', '.join(VIEWS)}, not {view!r}.")
    if view != "auto":
        return named_view(view, upright)
    last = [s for s in frames[-1] if s.role == "cloth"] or list(frames[-1])
    corners = np.concatenate([s.positions[s.triangles] for s in last])
    stands = traced and np.ptp(everything @ upright) > 0.6 * np.ptp(everything, axis=0).max()
    return three_quarter_view(corners, upright, LOW if stands else HIGH)


def _extremes(frames: Sequence[Sequence[Surface]], *roles: str) -> list[Floats]:
    """Extreme points (k, 3) [m] of each surface of some roles, in all frames."""
    return [extreme_points(s.positions) for surfaces in frames for s in surfaces if s.role in roles]


def _figures(frames: Sequence[Sequence[Surface]]) -> list[Floats]:
    """Extreme points (k, 3) [m] of each body up to FIGURE times as large as the cloths; of all without a cloth."""
    largest = _largest_figure(frames)
    return [points for points in _extremes(frames, "body") if np.ptp(points, axis=0).max() <= largest]


def _standing(bodies: Sequence[Floats], upright: Floats) -> list[Floats]:
    """Those of the bodies that stand.

    A person who wears a garment is seen from head to feet, a table or a wall that is wider than high is not.
    """
    return [points for points in bodies if np.ptp(points @ upright) > STANDS * np.ptp(points, axis=0).max()]


def centre_of(surfaces: Sequence[Surface]) -> Floats:
    """Mean of the vertices of the cloths, or of all surfaces where there is none, (3,) [m]."""
    cloths = [each.positions for each in surfaces if each.role == "cloth"]
    return np.concatenate(cloths or [each.positions for each in surfaces]).mean(axis=0)


def _centred(surfaces: Sequence[Surface]) -> list[Surface]:
    """The surfaces of a frame with the centre of its cloths at the origin, without what is larger than FIGURE."""
    centre, size = centre_of(surfaces), _largest_figure([surfaces])
    seen = [each for each in surfaces if each.role == "cloth" or np.ptp(each.positions, axis=0).max() <= size]
    return [replace(each, positions=each.positions - centre) for each in seen]


def _largest_figure(frames: Sequence[Sequence[Surface]]) -> float:
    """FIGURE times the size of the cloths of all frames [m]: a larger body is ground; inf without a cloth."""
    cloths = _extremes(frames, "cloth")
    return FIGURE * float(np.ptp(np.concatenate(cloths), axis=0).max()) if cloths else np.inf


def pixel_counts(size: Any) -> tuple[int, int]:
    """The width and height in pixels. InputError where `size` is not a pair of numbers."""
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
    camera, style = setup.camera, setup.style
    if setup.follow:
        camera = replace(camera, position=camera.position + centre_of(surfaces))
    drawn = list(surfaces)
    if setup.smooth:
        cloths = [each for each in surfaces if each.role == "cloth"]
        drawn = [subdivided(each, [other for other in cloths if other is not each]) for each in surfaces]
    if style.traced:
        trace = import_module(_RENDERERS["mitsuba"]).render
        return np.asarray(trace(drawn, setup.scale, camera, setup.size, setup.up, setup.samples, setup.dyes))
    image = _shaded(setup, camera, drawn, surfaces)
    cloths = [each for each in drawn if each.role == "cloth"]
    if style.body_opacity < 1.0 and 0 < len(cloths) < len(drawn):
        behind = _shaded(setup, camera, cloths, surfaces)
        image = style.body_opacity * image + (1.0 - style.body_opacity) * behind
    if not style.needs_geometry:
        return image
    geometry = pixel_geometry(drawn, camera, (setup.size[0] * setup.samples, setup.size[1] * setup.samples))
    if style.woven:
        image = woven(image, geometry, np.array([each.role == "cloth" for each in drawn]), setup.samples)
    return outlined(image, geometry, setup.samples) if style.outlines else image


def _shaded(
    setup: PictureSetup, camera: Viewpoint, drawn: Sequence[Surface], surfaces: Sequence[Surface]
) -> np.ndarray:
    """Surfaces under light before the background; `surfaces`: what throws a soft shadow, unrefined."""
    render = import_module(_RENDERERS[setup.renderer]).render
    seen = render(looks(drawn, setup.scale, setup.dyes), camera, setup.size, setup.up, setup.samples)
    behind: Floats | float = 1.0
    if not setup.style.paper:
        triangles = np.concatenate([each.positions[each.triangles] for each in surfaces])
        behind = backdrop(triangles, camera, setup.size, setup.up)
    return np.asarray(seen[:, :, :3] + (1 - seen[:, :, 3:]) * behind)


def scale_of(
    colour: str | Quantity, cloths: Sequence[Surface], limits: tuple[float, float] | None = None
) -> Scale | None:
    """The colours that suit all `cloths`, or `limits`; None where they are plain."""
    fixed = limits_of(limits)
    if isinstance(colour, Quantity) and colour.log_stretch:
        return stretch_scale([cloth.values for cloth in cloths], colour.name, fixed)
    if isinstance(colour, Quantity):
        return sequential_scale(colour, [cloth.values for cloth in cloths], fixed)
    logs = [log_stretch(cloth.principal_stretches) for cloth in cloths]
    if colour == "stretch" and any(len(part) for part in logs):
        return stretch_scale(logs, limits=fixed)
    if fixed:
        raise InputError(
            "A range of colours is given, and the cloth is plain.", "Leave it out, or colour by stretch or by a field."
        )
    return None


def _direction(name: str, values: ArrayLike | str) -> Floats:
    if isinstance(values, str):
        raise InputError(f'{name} must be a direction, "x", "y" or "z", not {values!r}.')
    vector = as_vector(name, values)
    if not vector.any():
        raise InputError(f"{name} must not be zero.")
    return vector / np.linalg.norm(vector)
