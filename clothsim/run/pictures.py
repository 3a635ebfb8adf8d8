"""Pictures and movies of a run: its frames as surfaces, coloured by a field or by their stretches."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from clothsim import (
    render,  # its names are imported when they are used: a run without pictures loads nothing that draws
)
from clothsim.base.arrays import Floats
from clothsim.base.errors import ClothsimError, InputError
from clothsim.base.record import (
    FAILURE_NAME,
    PICTURE_NAME,
    RUN_PICTURES,
    SUMMARY_NAME,
    record_peak_memory,
)
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import Trajectory
from clothsim.mesh.world import SurfaceRows, World, world_surfaces
from clothsim.render.cloth_kinds import kind_of
from clothsim.render.colour_scale import Quantity, per_vertex
from clothsim.render.surface_look import Surface, crosses, evenly_spaced, spacing_of
from clothsim.run.fields import FIELDS, known_field, world_stretches
from clothsim.scene.assembly.meshes import fabric_of
from clothsim.scene.scene import Scene, scene_from_text

if TYPE_CHECKING:
    from clothsim.run.results import Run

from clothsim.base.arrays import Ints
from clothsim.base.linalg import unit


def frame_surfaces(trajectory: Trajectory, frame: int) -> list[Surface]:
    """The cloths, then the bodies of a frame; cloths without stretches where the run wrote none."""
    positions = trajectory.positions(frame)
    cloths = [surface for surface in trajectory.surfaces if surface.role == "cloth"]
    ends = np.cumsum([len(cloth.triangles) for cloth in cloths])
    stretches = np.split(_stretches(trajectory, frame), ends)[: len(cloths)]
    first = trajectory.positions(0)
    made = [
        Surface(cloth.name, positions[cloth.rows], cloth.own_triangles, "cloth", part, material=first[cloth.rows])
        if not len(cloth.edges)
        else _drawn_rod(cloth, positions)
        for cloth, part in zip(cloths, stretches, strict=True)
    ]
    none = np.zeros((0, 2))
    return made + [
        Surface(name, points, triangles, "body", none) for name, points, triangles in trajectory.bodies(frame)
    ]


def studio_surfaces(trajectory: Trajectory, frame: int, kinds: Sequence[str] = ()) -> list[Surface]:
    """The surfaces of a frame, cloths of the `kinds`, the mannequin among them with the hands of a shop's dummy."""
    hands = import_module("clothsim.mesh.generators.mannequin.dummy_hands")  # a run without pictures loads no template
    made = frame_surfaces(trajectory, frame)
    made[: len(kinds)] = [replace(each, kind=kind) for each, kind in zip(made, kinds, strict=False)]
    cloths = np.concatenate([np.zeros((0, 3)), *(each.positions for each in made if each.role == "cloth")])
    return [
        replace(each, positions=hands.with_dummy_hands(each.positions, each.triangles, cloths))
        if each.role == "body"
        else each
        for each in made
    ]


def kinds_of(scene: Scene) -> list[str]:
    """The kind of cloth, a key of `cloth_kinds.KINDS`, of each cloth of a scene.

    That of its named fabric, or by its numbers where it has its own weight or thickness.
    """
    kinds = []
    for table in scene.cloths:
        fabric, _ = fabric_of(table, "cloth")
        name = "" if "density" in table or "thickness" in table else fabric.name
        kinds.append(kind_of(name, fabric.density, fabric.thickness, fabric.bending_stiffness))
    return kinds


def state_surfaces(world: World, x: Floats, stretches: Floats) -> list[Surface]:
    """The cloths, then the bodies of a state: x (N, 3) [m] and the principal stretches (m, 2) of all cloths."""
    parts = world_surfaces(world)
    of_cloths = np.split(stretches, np.cumsum([len(part.triangles) for part in parts if part.role == "cloth"]))
    none = np.zeros((0, 2))
    return [
        Surface(part.name, x[part.rows], part.own_triangles, part.role, of_cloths[k] if part.role == "cloth" else none)
        if not len(part.edges)
        else _drawn_rod(part, x)
        for k, part in enumerate(parts)
    ]


def _drawn_rod(rod: SurfaceRows, x: Floats) -> Surface:
    """A rod as a tube of its radius."""
    is_loop = len(rod.edges) == rod.n_vertices
    return Surface(rod.name, *tube(x[rod.rows], is_loop, rod.radius), "cloth", np.zeros((0, 2)))


class Frames(Sequence[list[Surface]]):
    """All frames of a run, each read when it is asked for; surfaces_of: the surfaces of a frame."""

    def __init__(
        self, trajectory: Trajectory, surfaces_of: Callable[[Trajectory, int], list[Surface]] = frame_surfaces
    ) -> None:
        self._trajectory, self._surfaces_of = trajectory, surfaces_of

    def __len__(self) -> int:
        return len(self._trajectory.times)

    @overload
    def __getitem__(self, frame: int) -> list[Surface]: ...

    @overload
    def __getitem__(self, frame: slice) -> list[list[Surface]]: ...

    def __getitem__(self, frame: int | slice) -> list[Surface] | list[list[Surface]]:
        if isinstance(frame, slice):
            return [self._surfaces_of(self._trajectory, k) for k in range(*frame.indices(len(self)))]
        if not -len(self) <= frame < len(self):
            raise IndexError(frame)
        return self._surfaces_of(self._trajectory, frame)


def _stretches(trajectory: Trajectory, frame: int) -> Floats:
    try:
        return np.asarray(trajectory.stretches(frame), np.float64)
    except InputError:  # a trajectory written without them
        return np.zeros((0, 2))


Drawing = Callable[[Trajectory, int], list[Surface]]
"""The surfaces of a frame."""


def field_settings(run: "Run", name: str) -> dict[str, Any]:
    """The settings of `draw_frame` and `draw_movie` that show a field.

    Principal stretches are the usual colours; principal directions are strokes over them.

    InputError for an unknown name.
    """
    scalar, unit = known_field(name).scalar, FIELDS[name].unit
    if name == "principal_stretches":
        return {"colour": "stretch"}
    if name == "principal_directions":
        return {"colour": "stretch", "surfaces_of": _add_strokes(run)}
    title = " ".join([name.replace("_", " "), scalar.name]).strip()
    quantity = Quantity(title, unit if scalar.unit is None else scalar.unit, scalar.stretch)
    return {"colour": quantity, "surfaces_of": _colour_by_values(run, name)}


def _colour_by_values(run: "Run", name: str) -> Drawing:
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
        rows = {each.name: each.rows for each in trajectory.surfaces if each.role == "cloth" and not len(each.edges)}
        return [replace(each, values=scalars(frame)[rows[each.name]]) if each.name in rows else each for each in made]

    return surfaces


def _add_strokes(run: "Run") -> Drawing:
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
    """Write a picture of a frame (.png) or a movie of all (.mp4, .webp, .gif); return the line that names the renderer.

    field: what colours the cloths; progress: of a movie; settings: PICTURE_SETTINGS, MOVIE_SETTINGS, dots_per_inch; the
    axis against gravity is that of the scene where none is given.
    """
    given = settings_of(run, field, settings)
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
    for name in RUN_PICTURES:
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
        run.summary["peak_memory_bytes"] = record_peak_memory(directory / SUMMARY_NAME)
    return trouble


def settings_of(run: "Run", field: str | None, settings: dict[str, Any]) -> dict[str, Any]:
    """The settings of `draw_frame` and `draw_movie` that a run adds to those that are given."""
    given = {"up": run.up, **settings, **({} if field is None else field_settings(run, field))}
    if given.get("style") == "studio" and "surfaces_of" not in given:
        given["surfaces_of"] = partial(studio_surfaces, kinds=_kinds_of_run(run.directory))
    return given


def _kinds_of_run(directory: Path) -> list[str]:
    """The kinds of the cloths of a run's scene; none where its checkpoint gives none."""
    try:
        return kinds_of(scene_from_text(read_checkpoint(directory / CHECKPOINT_NAME).scene_text))
    except InputError:
        return []


def _surfaces_of(settings: dict[str, Any]) -> Drawing:
    """The usual surfaces of a frame in the style of a picture."""
    return studio_surfaces if settings.get("style") == "studio" else frame_surfaces


def draw_frame(
    trajectory: Trajectory, target: Path, frame: int = -1, surfaces_of: Drawing | None = None, **settings: Any
) -> str:
    """Write a PNG of one frame; returns the line that names the renderer.

    surfaces_of: in place of the usual surfaces of a frame; settings: as of `render.picture.draw`.
    """
    surfaces = (surfaces_of or _surfaces_of(settings))(trajectory, frame)
    return render.draw(target, surfaces, title=_title(trajectory, frame), **settings)


def frame_picture(
    trajectory: Trajectory, frame: int = -1, surfaces_of: Drawing | None = None, **settings: Any
) -> np.ndarray:
    """The picture of one frame, (height, width, 3) uint8; arguments as of `draw_frame`."""
    surfaces = (surfaces_of or _surfaces_of(settings))(trajectory, frame)
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
    return render.write_movie(
        target, Frames(trajectory, surfaces_of or _surfaces_of(settings)), progress=progress, **settings
    )


def draw_failure(directory: Path, failure: dict[str, Any], world: World, target: Path, up: Any) -> str:
    """Write a PNG of the place where a run failed, in its last good state; returns the line that names the renderer."""
    from clothsim.render.marks import draw_closeup

    x = read_checkpoint(directory / CHECKPOINT_NAME).state.positions
    surfaces = state_surfaces(world, x, world_stretches(world, x))
    title = f"{failure['time']:.4g} s, {failure['cause']}: {failure['element']}"
    return draw_closeup(target, surfaces, np.array(failure["position"]) - world.origin, title=title, up=up)


def up_of_run(directory: Path) -> tuple[float, ...] | str:
    """The direction against the gravity of a run's scene; "z" where its checkpoint gives none."""
    try:
        return scene_from_text(read_checkpoint(directory / CHECKPOINT_NAME).scene_text).up
    except InputError:  # no checkpoint, or one of another version: a picture does not need it
        return "z"


def _title(trajectory: Trajectory, frame: int) -> str:
    return f"{trajectory.times[frame]:.2f} s" if len(trajectory.times) else ""


# Tubes round the centre lines of rods.

AROUND = 10
"""Corners of the section of a tube."""


def tube(points: Floats, is_loop: bool, radius: float) -> tuple[Floats, Ints]:
    """Positions and triangles of a tube round points (n, 3) in order [m], facing outward; its ends are open.

    Examples
    --------
    >>> positions, triangles = tube(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), False, 0.1)
    >>> positions.shape, triangles.shape, round(float(np.abs(positions[:, 1]).max()), 3)
    ((30, 3), (40, 3), 0.1)
    """
    n = len(points)
    edges = unit(np.diff(np.concatenate([points, points[:1]]) if is_loop else points, axis=0))
    before = np.concatenate([edges[-1:] if is_loop else edges[:1], edges])[:n]
    tangents = unit(before + np.concatenate([edges, edges[-1:]])[:n])
    across = np.eye(3)[np.abs(tangents[0]).argmin()]
    first = np.empty((n, 3))
    for k, tangent in enumerate(tangents):  # carried along the line with as little twist as can be
        across = unit(across - (across @ tangent) * tangent)
        first[k] = across
    second = np.cross(tangents, first)
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    positions = (points[:, None] + radius * rings).reshape(-1, 3)
    here = AROUND * np.arange(n)
    there = np.roll(here, -1) if is_loop else here[1:]
    here = here[: len(there), None]
    side, after = np.arange(AROUND), np.roll(np.arange(AROUND), -1)
    a, b, c, d = here + side, here + after, there[:, None] + side, there[:, None] + after
    if is_loop:  # the frame does not close: the last ring meets the nearest turn of the first
        turn = int(np.round(np.arctan2(second[-1] @ first[0], first[-1] @ first[0]) / (2 * np.pi / AROUND))) % AROUND
        c[-1], d[-1] = (side - turn) % AROUND, (after - turn) % AROUND
    triangles = np.concatenate([np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)]).reshape(-1, 3)
    return positions, triangles.astype(np.int64)
