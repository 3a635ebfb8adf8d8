"""Pictures and movies of a run, coloured by a field or by its stretches."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim import (
    render,  # its names are imported when they are used: a run without pictures loads nothing that draws
)
from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.process_memory import peak_memory
from clothsim.base.record import GIF_NAME, MOVIE_NAME, SUMMARY_NAME, write_summary
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import Trajectory
from clothsim.mesh.world import World
from clothsim.render.colour_scale import Quantity, per_vertex
from clothsim.render.run_frames import Frames, frame_surfaces, state_surfaces
from clothsim.render.surface_look import Surface, crosses, evenly_spaced, spacing_of
from clothsim.run.fields import FIELDS, known_field, world_stretches
from clothsim.scene.scene import scene_from_text

if TYPE_CHECKING:
    from clothsim.run.results import Run

Drawing = Callable[[Trajectory, int], list[Surface]]
"""The surfaces of a frame."""


def field_settings(run: "Run", name: str) -> dict[str, Any]:
    """The settings of `draw_frame` and `draw_movie` that show a field.

    Principal stretches are the usual colours; principal directions are strokes over them.

    Raises
    ------
    InputError
        For an unknown name.
    """
    scalar, unit = known_field(name).scalar, FIELDS[name].unit
    if name == "principal_stretches":
        return {"colour": "stretch"}
    if name == "principal_directions":
        return {"colour": "stretch", "surfaces_of": _with_strokes(run)}
    title = " ".join([name.replace("_", " "), scalar.name]).strip()
    quantity = Quantity(title, unit if scalar.unit is None else scalar.unit, scalar.stretch)
    return {"colour": quantity, "surfaces_of": _with_values(run, name)}


def _with_values(run: "Run", name: str) -> Drawing:
    """Surfaces with the scalar of a field at the vertices; that of a triangle goes to its corners, by area."""

    @cache  # a movie asks for each frame several times
    def scalars(frame: int) -> Floats:
        scalar = FIELDS[name].scalar
        values = scalar(np.asarray(run.field(name, frame), np.float64))
        values = np.log(np.maximum(values, 1e-6)) if scalar.stretch else values
        on_triangles = FIELDS[name].location == "triangle"  # else on the vertices of cloths or bodies
        return per_vertex(values, run.positions(frame), run.triangles) if on_triangles else values

    def surfaces(trajectory: Trajectory, frame: int) -> list[Surface]:
        made = frame_surfaces(trajectory, frame)
        if FIELDS[name].location == "body":  # drawn as cloths are, without the cloths that hide them
            bodies = [each for each in made if each.role == "body"]
            parts = np.split(scalars(frame), np.cumsum([len(each.positions) for each in bodies])[:-1])
            return [replace(each, role="cloth", values=part) for each, part in zip(bodies, parts, strict=True)]
        rows = {each.name: each.rows for each in trajectory.surfaces if each.role == "cloth"}
        return [
            replace(each, values=scalars(frame)[rows[each.name]]) if each.role == "cloth" else each for each in made
        ]

    return surfaces


def _with_strokes(run: "Run") -> Drawing:
    """Surfaces with the principal directions of evenly spaced triangles, the same ones in all frames."""
    start = run.positions(0)
    spacing = spacing_of(start, run.triangles)
    chosen = evenly_spaced(start[run.triangles].mean(axis=1), spacing)
    ends = np.cumsum([len(each.triangles) for each in run.trajectory.surfaces if each.role == "cloth"])
    cloth_of = np.searchsorted(ends, chosen, side="right")

    def surfaces(trajectory: Trajectory, frame: int) -> list[Surface]:
        directions = np.asarray(run.field("principal_directions", frame), np.float64)[chosen]
        stretches = np.asarray(run.field("principal_stretches", frame), np.float64)[chosen]
        centres = run.positions(frame)[run.triangles[chosen]].mean(axis=1)
        strokes = crosses(centres, directions, stretches, spacing)
        made = frame_surfaces(trajectory, frame)
        for k in range(len(ends)):
            made[k] = replace(made[k], strokes=strokes[cloth_of == k], spacing=spacing)
        return made

    return surfaces


PICTURE_NAME, FAILURE_NAME = "picture.png", "failure.png"

PICTURE_SETTINGS = ("size", "colour", "up", "view", "renderer", "smooth", "style", "limits")
"""Settings of a picture: keywords of `render.picture.draw` without its title, which is the time."""
MOVIE_SETTINGS = ("frames_per_second", "samples", "follow")
"""Settings of a movie beside those of a picture."""


def draw_run(
    run: "Run",
    target: Path,
    frame: int = -1,
    field: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    **settings: Any,
) -> str:
    """Write a picture of a frame (.png), or a movie of all (.mp4, .gif); returns the line that names the renderer.

    field: what colours the cloths; progress: of a movie; settings: PICTURE_SETTINGS, MOVIE_SETTINGS, dots_per_inch; the
    axis against gravity is that of the scene where none is given.
    """
    given = {"up": run.up, **settings, **({} if field is None else field_settings(run, field))}
    if target.suffix.lower() == ".png":
        return draw_frame(run.trajectory, target, frame, **given)
    return draw_movie(run.trajectory, target, progress, **given)


def draw_pictures(
    run: "Run",
    world: World,
    *,
    picture: bool,
    movie: bool,
    message: Callable[[str], None],
    progress: Callable[[int, int], None],
) -> list[str]:
    """Leave the pictures of a run in its directory: the last frame, where it failed, and a movie.

    world: of its scene; message: called with a line before each is drawn; progress: as of `draw_run`. Returns a line
    for each that could not be drawn, which does not change the status of the run. The summary gets the peak memory
    with them.
    """
    directory, trouble = run.directory, list[str]()
    for name in (PICTURE_NAME, MOVIE_NAME, GIF_NAME, FAILURE_NAME):
        (directory / name).unlink(missing_ok=True)
    failure = run.summary.get("failure") or {}
    jobs: list[tuple[str, Callable[[], Any]]] = []
    if picture:
        jobs.append((PICTURE_NAME, lambda: draw_run(run, directory / PICTURE_NAME)))
    if picture and failure.get("position") is not None:
        jobs.append((FAILURE_NAME, lambda: draw_failure(directory, failure, world, directory / FAILURE_NAME, run.up)))
    if movie:
        film, missing = render.movie_file(directory)
        trouble += [missing] if missing else []
        jobs.append((film.name, lambda: draw_run(run, film, progress=progress)))
    for name, job in jobs:
        message(f"drawing {name}")
        try:
            job()
        except (ClothsimError, OSError, ImportError) as error:
            trouble.append(f"No {name}: {error}")
    if jobs and run.summary:  # a picture takes more than the run of a small scene
        run.summary["peak_memory_bytes"] = max(peak_memory(), run.summary.get("peak_memory_bytes", 0))
        write_summary(directory / SUMMARY_NAME, run.summary)
    return trouble


def draw_frame(
    trajectory: Trajectory, target: Path, frame: int = -1, surfaces_of: Drawing | None = None, **settings: Any
) -> str:
    """Write a PNG of one frame; returns the line that names the renderer.

    surfaces_of: in place of the usual surfaces of a frame; settings: as of `render.picture.draw`.
    """
    surfaces = (surfaces_of or frame_surfaces)(trajectory, frame)
    return render.draw(target, surfaces, title=_title(trajectory, frame), **settings)


def frame_picture(
    trajectory: Trajectory, frame: int = -1, surfaces_of: Drawing | None = None, **settings: Any
) -> np.ndarray:
    """The picture of one frame, (height, width, 3) uint8; arguments as of `draw_frame`."""
    surfaces = (surfaces_of or frame_surfaces)(trajectory, frame)
    given = {"size": (1280, 960), "colour": "auto", "view": "auto", "renderer": "auto", **settings}
    return render.rendered(render.picture_setup([surfaces], title=_title(trajectory, frame), **given), surfaces)


def draw_movie(
    trajectory: Trajectory,
    target: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
    surfaces_of: Drawing | None = None,
    **settings: Any,
) -> str:
    """Write a movie of all frames, in real time unless a rate is given; returns the line that names the renderer."""
    times = trajectory.times
    if "frames_per_second" not in settings and len(times) > 1:
        settings["frames_per_second"] = (len(times) - 1) / (times[-1] - times[0])
    return render.write_movie(target, Frames(trajectory, surfaces_of or frame_surfaces), progress=progress, **settings)


def draw_failure(directory: Path, failure: dict[str, Any], world: World, target: Path, up: Any) -> str:
    """Write a PNG of the place where a run failed, in its last good state; returns the line that names the renderer."""
    from clothsim.render.marks import draw_closeup

    x = read_checkpoint(directory / CHECKPOINT_NAME).positions
    surfaces = state_surfaces(world, x, world_stretches(world, x))
    title = f"{failure['time']:.4g} s, {failure['cause']}: {failure['element']}"
    return draw_closeup(target, surfaces, np.array(failure["position"]) - world.origin, title=title, up=up)


def upright(directory: Path) -> tuple[float, ...] | str:
    """The direction against the gravity of a run's scene; "z" where its checkpoint gives none."""
    try:
        return scene_from_text(read_checkpoint(directory / CHECKPOINT_NAME).scene_text).up
    except InputError:  # no checkpoint, or one of another version: a picture does not need it
        return "z"


def _title(trajectory: Trajectory, frame: int) -> str:
    return f"{trajectory.times[frame]:.2f} s" if len(trajectory.times) else ""
