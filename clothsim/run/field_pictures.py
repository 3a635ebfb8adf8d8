"""Frames of a run coloured by a field."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.files.runs.trajectory import Trajectory
from clothsim.run.fields import FIELDS, known_field

if TYPE_CHECKING:
    from clothsim.render.surface_look import Surface
    from clothsim.run.results import Run

Drawing = Callable[[Trajectory, int], "list[Surface]"]
"""The surfaces of a frame."""


def field_settings(run: "Run", name: str) -> dict[str, Any]:
    """The settings of `draw_frame` and `draw_movie` that show a field.

    Principal stretches are the usual colours; principal directions are strokes over them.

    Raises
    ------
    InputError
        For an unknown name.
    """
    from clothsim.render.colour_scale import Quantity

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
    from clothsim.render.colour_scale import per_vertex
    from clothsim.render.run_frames import frame_surfaces

    @cache  # a movie asks for each frame several times
    def scalars(frame: int) -> Floats:
        scalar = FIELDS[name].scalar
        values = scalar(np.asarray(run.field(name, frame), np.float64))
        values = np.log(np.maximum(values, 1e-6)) if scalar.stretch else values
        on_triangles = FIELDS[name].location == "triangle"  # else on the vertices of cloths or bodies
        return per_vertex(values, run.positions(frame), run.triangles) if on_triangles else values

    def surfaces(trajectory: Trajectory, frame: int) -> "list[Surface]":
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
    from clothsim.render.run_frames import frame_surfaces
    from clothsim.render.surface_look import crosses, evenly_spaced, spacing_of

    start = run.positions(0)
    spacing = spacing_of(start, run.triangles)
    chosen = evenly_spaced(start[run.triangles].mean(axis=1), spacing)
    ends = np.cumsum([len(each.triangles) for each in run.trajectory.surfaces if each.role == "cloth"])
    cloth_of = np.searchsorted(ends, chosen, side="right")

    def surfaces(trajectory: Trajectory, frame: int) -> "list[Surface]":
        directions = np.asarray(run.field("principal_directions", frame), np.float64)[chosen]
        stretches = np.asarray(run.field("principal_stretches", frame), np.float64)[chosen]
        centres = run.positions(frame)[run.triangles[chosen]].mean(axis=1)
        strokes = crosses(centres, directions, stretches, spacing)
        made = frame_surfaces(trajectory, frame)
        for k in range(len(ends)):
            made[k] = replace(made[k], strokes=strokes[cloth_of == k], spacing=spacing)
        return made

    return surfaces
