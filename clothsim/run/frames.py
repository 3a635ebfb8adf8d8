"""Frames of a run as meshes: coloured ones of a viewer, and those that are exported, at any rate and in any axes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from clothsim.base.arrays import Floats, Ints
from clothsim.base.errors import InputError
from clothsim.base.record import FITTED_NAME
from clothsim.files.exchange.animation import AnimatedPart, Animation, PartFrame
from clothsim.files.meshes.mesh_file import read_polygons
from clothsim.files.meshes.polygons import Polygons
from clothsim.files.runs.checkpoint import CHECKPOINT_NAME, read_checkpoint
from clothsim.files.runs.trajectory import Trajectory
from clothsim.files.runs.vtkhdf import STRETCHES
from clothsim.mesh.cloth import Cloth
from clothsim.render.colour_scale import Quantity, Scale, colour_range, log_stretch, per_vertex, stretch_colours
from clothsim.render.picture import scale_of
from clothsim.render.surface_look import FABRICS, Surface, vertex_values
from clothsim.run.fields import FIELDS
from clothsim.run.pictures import field_settings, frame_surfaces
from clothsim.run.results import Run
from clothsim.scene.assembly.scene_world import world_of
from clothsim.scene.scene import scene_from_text

PLAIN, STRETCH = "plain", "stretch"
STROKES = "principal_directions"
"""A field that is drawn as strokes, not as colours."""
RANGE_FRAMES = 9
"""Frames, evenly spaced, from which the range of the colours is taken: one range for the whole run."""


@dataclass(frozen=True)
class ColouredMesh:
    """Surface with a colour at each vertex.

    positions: (n, 3) [m]; triangles: (m, 3); colours: (n, 3) sRGB in [0, 1]; values: (n,) their numbers, or none.
    """

    positions: Floats
    triangles: Ints
    colours: Floats
    values: Floats


@dataclass(frozen=True)
class Colouring:
    """Colours of the cloths of a run by one quantity.

    Attributes
    ----------
    name : str
        "plain", "stretch" or the name of a field.
    scale : Scale or None
        Colours of the numbers, the same in all frames; None where the cloth is plain.
    log_stretch : bool
        True where the numbers are logarithms of a stretch.
    surfaces_of : callable
        Surfaces of a frame, with their values.
    without_cloth : bool
        True for a run of rigid bodies alone, which are then what is shown.
    """

    name: str
    scale: Scale | None
    log_stretch: bool
    surfaces_of: Callable[[int], Sequence[Surface]]
    without_cloth: bool = False

    @classmethod
    def of_run(cls, run: Run, name: str) -> "Colouring":
        """Colours of a run by a quantity. InputError for one that the run cannot show."""
        settings: dict[str, Any] = {"colour": name} if name in (PLAIN, STRETCH) else field_settings(run, name)
        drawn = settings.get("surfaces_of", frame_surfaces)

        def surfaces_of(frame: int) -> Sequence[Surface]:
            return drawn(run.trajectory, frame)

        if name == PLAIN:
            return cls(name, None, False, surfaces_of, not run.trajectory.cloth_names)
        frames = np.unique(np.linspace(0, len(run) - 1, min(RANGE_FRAMES, len(run))).astype(int))
        cloths = [each for k in frames for each in surfaces_of(int(k)) if each.role == "cloth"]
        colour = settings["colour"]
        logarithms = colour == STRETCH or (isinstance(colour, Quantity) and colour.log_stretch)
        return cls(name, scale_of(colour, cloths), logarithms, surfaces_of)

    @staticmethod
    def names(run: Run) -> list[str]:
        """Quantities that colour this run: plain, stretch, fields that it wrote and those that its positions give."""
        names = [PLAIN]
        if not run.trajectory.cloth_names:
            return names
        if "principal_stretches" in run.trajectory.fields:
            names.append(STRETCH)
        written = [name for name in run.trajectory.fields if name in FIELDS]
        computed = [name for name, field in FIELDS.items() if not field.in_step]
        for name in dict.fromkeys([*written, *computed]):
            if name in ("principal_stretches", STROKES):
                continue
            try:
                run.field(name, 0)
            except InputError:  # the scene has no membrane, or is not there any more
                continue
            names.append(name)
        return names

    @property
    def of_bodies(self) -> bool:
        """True where the colours lie on the bodies, whose cloths are then not drawn."""
        return self.without_cloth or (self.name in FIELDS and FIELDS[self.name].location == "body")

    def mesh(self, frame: int) -> ColouredMesh:
        """The coloured surfaces of a frame, as one mesh: the cloths, or of a field of the bodies these."""
        shown = "body" if self.without_cloth else "cloth"
        surfaces = [each for each in self.surfaces_of(frame) if each.role == shown]
        starts = np.cumsum([0, *(len(each.positions) for each in surfaces)])
        values = [vertex_values(each) for each in surfaces]
        return ColouredMesh(
            np.concatenate([each.positions for each in surfaces]),
            np.concatenate([each.triangles + start for each, start in zip(surfaces, starts[:-1], strict=True)]),
            np.concatenate([self._colours(k, surfaces[k], own) for k, own in enumerate(values)]),
            np.concatenate(values),
        )

    def positions(self, run: Run, frame: int) -> Floats:
        """Vertices of what is coloured in a frame, (n, 3) [m]."""
        if self.of_bodies:
            return np.concatenate([points for _, points, _ in run.bodies(frame)])
        return run.positions(frame)

    def value_at(self, mesh: ColouredMesh, vertex: int) -> str:
        """The number behind the colour at a vertex, in SI units; "-" where the cloth is plain."""
        if self.scale is None:
            return "-"
        value = float(mesh.values[vertex])
        unit = FIELDS[self.name].unit if self.name in FIELDS and not self.log_stretch else ""
        return f"{np.exp(value) if self.log_stretch else value:.4g} {unit}".strip()

    def _colours(self, number: int, surface: Surface, values: Floats) -> Floats:
        if self.scale is None or not len(values):
            return np.broadcast_to(FABRICS[number % len(FABRICS)], surface.positions.shape)
        return self.scale.colours(values)


USUAL_RATE = 24.0
"""Frames a second of a run with one frame."""
FAR = 8.0
"""Largest coordinate [m] that single precision still keeps to half a micrometre."""
MOST_FRAMES = 20_000
"""Largest number of frames of an export at a rate of its own."""
SAME_TIME = 1e-6
"""Fraction of the distance of two frames below which a time is that of a frame."""


@dataclass(frozen=True)
class Sample:
    """A time between frame `first` and the next one, at `weight` in [0, 1) of their distance."""

    time: float
    first: int
    weight: float


def samples_of(trajectory: Trajectory, frame: int | None, fps: float | None) -> tuple[list[Sample], float]:
    """Times to be written, and their rate."""
    times = trajectory.times
    own = USUAL_RATE if len(times) < 2 else float(f"{1 / np.median(np.diff(times)):.9g}")
    if frame is not None:
        trajectory.positions(frame)  # refuses a frame that is not there
        number = int(frame) % len(times)
        return [Sample(float(times[number]), number, 0.0)], own
    if fps is None:
        return [Sample(float(time), k, 0.0) for k, time in enumerate(times)], own
    count = int((times[-1] - times[0]) * fps * (1 + 1e-12) + SAME_TIME) + 1
    if count > MOST_FRAMES:
        raise InputError(f"fps = {fps:g} makes {count:,} frames, more than {MOST_FRAMES:,}.", "Use a lower rate.")
    return [_sample(times, times[0] + k / fps) for k in range(count)], float(fps)


def _sample(times: Floats, time: float) -> Sample:
    first = max(int(np.searchsorted(times, time, side="right")) - 1, 0)
    if first + 1 >= len(times):
        return Sample(float(time), len(times) - 1, 0.0)
    weight = float((time - times[first]) / (times[first + 1] - times[first]))
    if weight > 1 - SAME_TIME:
        return Sample(float(time), first + 1, 0.0)
    return Sample(float(time), first, weight if weight > SAME_TIME else 0.0)


def animated_parts(run: "Run") -> tuple[tuple[AnimatedPart, ...], tuple[str, ...]]:
    """The surfaces of a run; of its scene, where it can be built again, texture and panels; polygons of a fit."""
    trajectory, none = run.trajectory, np.zeros((0, 3, 2))
    cloths: dict[str, Cloth] = {}
    notes: tuple[str, ...] = ()
    try:
        scene = scene_from_text(read_checkpoint(run.directory / CHECKPOINT_NAME).scene_text, run.directory)
        seed = {key: value for key, value in scene.seed.items() if key != "untangle"}  # moves vertices only, at a cost
        cloths = {cloth.name: cloth for cloth in world_of(replace(scene, seed=seed)).cloths}
    except InputError as error:
        notes = (f"Texture and panels are left out: {error.sentence}",)
    parts: list[AnimatedPart] = []
    file = run.directory / FITTED_NAME  # of a garment that was fitted, in the faces of its own file
    drawn = read_polygons(file) if file.is_file() else None
    for surface in trajectory.surfaces:
        cloth = cloths.get(surface.name) if surface.role == "cloth" else None
        if cloth is not None and not np.array_equal(cloth.triangles, surface.own_triangles):
            cloth, notes = None, (f"Texture and panels of {surface.name} are left out: its mesh file has changed.",)
        texture = none if cloth is None else texture_of(cloth)
        joined = np.zeros(0, bool)
        if surface.role == "cloth" and drawn is not None and not len(texture):
            texture, joined, left_out = of_polygons(surface.own_triangles, drawn)
            notes = (*notes, *left_out)
        groups = {} if cloth is None else dict(cloth.groups)
        own = surface.own_triangles
        parts.append(AnimatedPart(surface.name, surface.role, own, texture, groups, surface.moving, joined))
    return tuple(parts), notes


def of_polygons(triangles: Ints, drawn: Polygons) -> tuple[Floats, NDArray[np.bool_], tuple[str, ...]]:
    """Texture (m, 3, 2) or (0, 3, 2), `Part.joined` (m,), and what is left out, of triangles (m, 3) cut from polygons.

    A triangle is of the polygon that has its three vertices: which diagonal cuts a quad depends on the shape.
    """
    none = np.zeros((0, 3, 2)), np.zeros(0, bool)
    starts, corners = drawn.starts, drawn.corners
    face_of = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    n_vertices = max(len(drawn.positions), int(triangles.max(initial=-1)) + 1)
    key = face_of * n_vertices + corners
    order = np.argsort(key)
    faces = csr_array((np.ones(len(corners)), (corners, face_of)), shape=(n_vertices, len(starts) - 1))
    shared = faces[triangles[:, 0]].multiply(faces[triangles[:, 1]]).multiply(faces[triangles[:, 2]]).tocsr()
    alone = int((np.diff(shared.indptr) == 0).sum())
    if alone:
        return *none, (f"Texture and quads are left out: {alone:,} triangles are in no face of {FITTED_NAME}.",)
    of_triangle = shared.indices[shared.indptr[:-1]]
    at = order[np.searchsorted(key, of_triangle[:, None] * n_vertices + triangles, sorter=order)]
    texture = drawn.texture[at] if len(drawn.texture) else none[0]
    joined = np.zeros(len(triangles), bool)
    same = of_triangle[1:] == of_triangle[:-1]
    joined[1:] = same & (triangles[1:, 0] == triangles[:-1, 0]) & (triangles[1:, 1] == triangles[:-1, 2])
    return texture, joined if joined.any() else none[1], ()


def texture_of(cloth: Cloth) -> Floats:
    """Texture coordinates of the corners of a cloth, (m, 3, 2), or (0, 3, 2).

    Its pattern [m] where it has a flat one; else the coordinates of its file; else, of a rest shape in a plane across
    an axis, the coordinates in that plane [m].
    """
    if cloth.flat:
        return cloth.material_coordinates
    if len(cloth.texture):
        return cloth.texture
    size = np.ptp(cloth.rest_positions, axis=0)
    thin = int(np.argmin(size))
    if size[thin] > 1e-9 * size.max():
        return np.zeros((0, 3, 2))
    return cloth.rest_positions[:, [axis for axis in range(3) if axis != thin]][cloth.triangles]


def with_frames(
    animation: Animation, trajectory: Trajectory, samples: list[Sample], turn: Floats, coloured: bool, relative: bool
) -> Animation:
    """The animation with the function that reads its frames, and with an origin where it is far and may have one."""
    logs, half = _log_stretches(trajectory), 0.0
    if coloured and logs is not None:
        half = colour_range([logs(each) for each in samples])
    rows = trajectory.positions(samples[0].first)
    if not len(rows):
        rows = np.concatenate([own for _, own, _ in trajectory.bodies(samples[0].first)])
    low, high = rows.min(axis=0) @ turn.T, rows.max(axis=0) @ turn.T
    far = np.maximum(np.abs(low), np.abs(high)).max() * animation.unit > FAR
    origin = 0.5 * (low + high) if relative and far else np.zeros(3)
    ends = np.cumsum([len(part.triangles) for part in animation.parts if part.role == "cloth"])

    def at(k: int) -> tuple[PartFrame, ...]:
        points, weight = _surfaces(trajectory, samples[k].first), samples[k].weight
        if weight:
            after = _surfaces(trajectory, samples[k].first + 1)
            points = [(1 - weight) * a + weight * b for a, b in zip(points, after, strict=True)]
        stretches = [] if logs is None else np.split(logs(samples[k]), ends[:-1])
        shapes = []
        for number, (part, own) in enumerate(zip(animation.parts, points, strict=True)):
            own_logs = stretches[number] if number < len(stretches) else np.zeros(0)
            colours = np.zeros((0, 3))
            if half and len(own_logs):
                colours = stretch_colours(per_vertex(own_logs, own, part.triangles), half)
            shapes.append(PartFrame(own @ turn.T - origin, part.triangles, np.exp(own_logs), colours))
        return tuple(shapes)

    # writers ask for the first frame more than once
    return replace(animation, origin=origin, at=lru_cache(maxsize=2)(at))


def _surfaces(trajectory: Trajectory, frame: int) -> list[Floats]:
    cloths = trajectory.positions(frame)
    own = [cloths[each.rows] for each in trajectory.surfaces if each.role == "cloth"]
    return [*own, *(points for _, points, _ in trajectory.bodies(frame))]


def _log_stretches(trajectory: Trajectory) -> Callable[[Sample], Floats] | None:
    """Logarithms of the stretches of the cloths' triangles at a time, (m,); None where the run kept none."""
    if STRETCHES.name not in trajectory.fields:
        return None

    def logs(sample: Sample) -> Floats:
        first = log_stretch(trajectory.stretches(sample.first).astype(np.float64))
        if not sample.weight:
            return first
        second = log_stretch(trajectory.stretches(sample.first + 1).astype(np.float64))
        return (1 - sample.weight) * first + sample.weight * second

    return logs
