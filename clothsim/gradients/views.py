"""Calibrated pictures and scans of a scene: a TOML file of cameras and of what was segmented or measured in each.

    [[view]]
    name = "front"
    width = 640
    height = 480
    focal = [900, 900]
    principal = [319.5, 239.5]
    rotation = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    position = [0, -1.5, 0.6]
    mask = "front.png"
    normals = "front_normals.npy"

    [[scan]]
    name = "worn"
    points = "garment.ply"
    skin = "skin.ply"

Files are beside the TOML file. A camera may also be `colmap` or `blender`, tables with the arguments of
`Camera.of_colmap` and `Camera.of_blender`.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from clothsim.base.arrays import Floats, Ints, as_positive
from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_numbers, read_regular_file
from clothsim.base.inputs import as_table, refuse_unknown
from clothsim.files.meshes.mesh_file import read_cloud
from clothsim.gradients.camera import Camera, Obstacle, PictureLoss
from clothsim.gradients.mask_border import MaskBorder
from clothsim.gradients.pixel_losses import Depth, Normals
from clothsim.gradients.scan import ScanSurface, registered

NOISE = {"mask": 1.0, "normals_degrees": 5.0, "depth": 5e-3, "points": 2e-3}
"""Keys of [noise] and their defaults: standard deviations of a mask's border [pixels], of normals [degrees], of depths
and of points of a scan [m]."""
OF_CAMERA = ("focal", "principal", "rotation", "position")
OF_MODELS = {
    "colmap": ("model", "params", "quaternion", "translation"),
    "blender": ("field_of_view_degrees", "matrix_world"),
}
PICTURES = ("mask", "labels", "normals", "depth")
OF_SCAN = ("name", "points", "skin", "scale")
KEYS = ("name", "width", "height", *OF_CAMERA, *OF_MODELS, "distortion", *PICTURES)
MOST_PIXELS = 100_000_000
"""Pixels of the largest picture that is read."""


@dataclass(frozen=True, eq=False)
class View:
    """What one camera or one scanner measured.

    Parameters
    ----------
    name : str
        Of the view.
    camera : Camera
        Its camera; of a scan the one that draws it.
    losses : mapping of str to PictureLoss
        By what was measured: "mask", "normals", "depth", "label front", "scan".
    note : str
        How a scan was laid onto the body; empty of others.
    """

    name: str
    camera: Camera
    losses: Mapping[str, PictureLoss]
    note: str = ""


def read_views(path: str | Path, panels: Mapping[str, Ints], obstacle: Obstacle) -> tuple[View, ...]:
    """Return the views of a TOML file.

    Parameters
    ----------
    path : str or Path
        The file.
    panels : mapping of str to int arrays
        Triangles of the cloth by panel, which labels may name.
    obstacle : Obstacle
        What may hide the cloth, and what the skin of a scan is laid onto.

    Raises
    ------
    InputError
        For what is not a view: an unknown key, a distorted camera, a picture of another size, two views of one name.
    """
    file = Path(path)
    try:
        given = tomllib.loads(read_regular_file(file).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file} is not a TOML file ({error}).", "Write a table [[view]] for each picture.") from error
    refuse_unknown(str(file), given, ("view", "scan", "noise", "labels"))
    noise = as_table("noise", given.get("noise", {}))
    refuse_unknown("noise", noise, NOISE)
    noises = {name: as_positive(f"noise.{name}", noise.get(name, default)) for name, default in NOISE.items()}
    labels = as_table("labels", given.get("labels", {}))
    refuse_unknown("labels", labels, panels)
    tables, clouds = given.get("view", []), given.get("scan", [])
    if not isinstance(tables, list) or not isinstance(clouds, list) or not tables + clouds:
        raise InputError(f"{file} has no views.", "Write a table [[view]] for each picture, or [[scan]].")
    made = [_view(f"view[{k}]", as_table(f"view[{k}]", keys), file.parent) for k, keys in enumerate(tables)]
    scans = [
        _scan(f"scan[{k}]", as_table(f"scan[{k}]", keys), file.parent, noises["points"], obstacle)
        for k, keys in enumerate(clouds)
    ]
    names = [view[0] for view in made] + [scan.name for scan in scans]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"{file} has {names.count(twice[0])} views {twice[0]!r}.", "Give each a name of its own.")
    of_label = {name: (int(value), panels[name]) for name, value in labels.items()}
    views = [View(name, camera, _losses(name, camera, maps, noises, of_label, obstacle)) for name, camera, maps in made]
    return (*views, *scans)


def _scan(where: str, keys: Mapping[str, Any], folder: Path, noise: float, body: Obstacle) -> View:
    """The scan of a table, laid onto the body by its skin, where that is given."""
    refuse_unknown(where, keys, OF_SCAN)
    name = str(keys.get("name", where))
    if "points" not in keys:
        raise InputError(f"The scan {name!r} has no points.", "Give the file of the points of the garment.")
    scale = as_positive(f"{where}.scale", keys.get("scale", 1.0))
    points, normals = read_cloud(folder / str(keys["points"]), scale)
    note = ""
    if "skin" in keys:
        skin = read_cloud(folder / str(keys["skin"]), scale)[0]
        laid = registered(skin, np.concatenate([points, skin]), body)
        away = float(np.linalg.norm(laid.moved(points) - points, axis=1).mean())
        points, normals = laid.moved(points), np.asarray(normals @ laid.rotation)
        turn = np.degrees(laid.angle)
        note = (
            f"scan {name}: laid onto the body by its skin, turned by {turn:.3g} degrees, moved by {away:.3g} m in the "
            f"mean; {1e3 * laid.distance:.2g} mm are left (median)"
        )
    loss = ScanSurface(points, normals, noise).checked()
    everything = points if not len(body.positions) else body.positions
    return View(name, loss.camera(int(np.ptp(everything, axis=0).argmax())), {"scan": loss}, note)


def _view(where: str, keys: Mapping[str, Any], folder: Path) -> tuple[str, Camera, dict[str, np.ndarray]]:
    """Name, camera and pictures of a table."""
    refuse_unknown(where, keys, KEYS)
    name = str(keys.get("name", where))
    if np.any(np.asarray(keys.get("distortion", 0.0)) != 0.0):
        raise InputError(f"The view {name!r} has a distortion.", "Undistort its pictures, and leave the key out.")
    files = {key: folder / str(keys[key]) for key in PICTURES if key in keys}
    if not files:
        raise InputError(f"The view {name!r} has no picture.", f"Give {', '.join(PICTURES[:-1])} or {PICTURES[-1]}.")
    maps = {key: read_numbers(file) if key in ("normals", "depth") else _picture(file) for key, file in files.items()}
    return name, _camera(name, keys), {key: np.asarray(each) for key, each in maps.items()}


def _camera(name: str, keys: Mapping[str, Any]) -> Camera:
    models = [model for model in OF_MODELS if model in keys]
    needed = ("width", "height", *(() if models else OF_CAMERA))
    missing = [key for key in needed if key not in keys]
    if missing:
        raise InputError(f"The view {name!r} has no {missing[0]}.", f"A view has {', '.join(needed)}.")
    size = (keys["width"], keys["height"])
    if any(not isinstance(each, int) or each < 1 for each in size):
        raise InputError(f"The view {name!r} has the size {size}.", "Give width and height as whole numbers.")
    if not models:
        return Camera(*size, *(keys[key] for key in OF_CAMERA))
    own = as_table(models[0], keys[models[0]])
    refuse_unknown(models[0], own, OF_MODELS[models[0]])
    absent = [key for key in OF_MODELS[models[0]] if key not in own]
    if absent:
        raise InputError(f"{models[0]} of the view {name!r} has no {absent[0]}.")
    if models[0] == "colmap":
        return Camera.of_colmap(own["model"], *size, own["params"], own["quaternion"], own["translation"])
    angle = np.radians(as_positive("field_of_view_degrees", own["field_of_view_degrees"]))
    return Camera.of_blender(*size, float(angle), own["matrix_world"])


def _picture(file: Path) -> np.ndarray:
    """The grey values of a picture as whole numbers, (height, width); of a palette its numbers."""
    content = read_regular_file(file)
    try:
        with Image.open(BytesIO(content)) as image:
            if image.width * image.height > MOST_PIXELS:
                raise InputError(f"{file.name} has {image.width} x {image.height} pixels.", "Scale it down.")
            values = np.asarray(image.convert("L") if image.mode == "1" else image)
    except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{file.name} is not a picture that can be read ({error}).", "Save it as PNG.") from error
    if values.ndim == 3:
        colours = values[..., :3] if values.shape[2] in (3, 4) else values[..., :1]
        if np.ptp(colours, axis=2).any():
            raise InputError(f"{file.name} has colours.", "Save a mask in grey: white where the cloth is seen.")
        values = colours[..., 0]
    return values


def _losses(
    name: str,
    camera: Camera,
    maps: Mapping[str, np.ndarray],
    noises: Mapping[str, float],
    labels: Mapping[str, tuple[int, Ints]],
    obstacle: Obstacle,
) -> dict[str, PictureLoss]:
    """The losses of a view; each looks at its picture once, so that a bad one is refused before a run."""
    size, made = (camera.height, camera.width), dict[str, PictureLoss]()
    for key, values in maps.items():
        if values.shape[:2] != size:
            raise InputError(
                f"The {key} of the view {name!r} has {values.shape[1]} x {values.shape[0]} pixels, its camera "
                f"{size[1]} x {size[0]}.",
                "Give the size of the picture that was calibrated.",
            )
    try:
        if "mask" in maps:
            top = 65535.0 if maps["mask"].max() > 255 else 255.0 if maps["mask"].max() > 1 else 1.0
            made["mask"] = MaskBorder(camera, maps["mask"] / top, noises["mask"], obstacle=obstacle).checked()
        if "labels" in maps and not labels:
            raise InputError("The file names no panel of its labels.", "Write [labels] front = 1.")
        for panel, (value, triangles) in labels.items() if "labels" in maps else ():
            if not (maps["labels"] == value).any():  # the panel is not seen in this view
                continue
            made[f"label {panel}"] = MaskBorder(
                camera, maps["labels"] == value, noises["mask"], obstacle=obstacle, label=triangles
            )
        if "normals" in maps:
            made["normals"] = Normals(camera, maps["normals"], noises["normals_degrees"], obstacle=obstacle).checked()
        if "depth" in maps:
            made["depth"] = Depth(camera, maps["depth"], noises["depth"], obstacle=obstacle).checked()
    except InputError as error:
        raise InputError(f"View {name!r}: {error.sentence}", error.remedy) from error
    return made


def overlay(view: View, contours: Sequence[tuple[Floats, tuple[int, int, int]]]) -> np.ndarray:
    """Return a picture (height, width, 3) uint8: mask and points in grey, a border black, contours in colours."""
    size = (view.camera.height, view.camera.width)
    picture = np.full((*size, 3), 255, np.uint8)
    clouds = [loss for loss in view.losses.values() if isinstance(loss, ScanSurface)]
    points = [(view.camera.project(loss.points), (190, 190, 190)) for loss in clouds]
    borders = [loss for loss in view.losses.values() if isinstance(loss, MaskBorder)]
    for loss in borders:
        picture[np.asarray(loss.mask) > 0.5] = 215
    black = [(loss.border[0], (0, 0, 0)) for loss in borders]
    for pixels, colour in (*points, *black, *contours):
        u, v = np.rint(pixels).astype(np.int64).T
        inside = (u >= 0) & (u < size[1]) & (v >= 0) & (v < size[0])
        picture[v[inside], u[inside]] = colour
    return picture
