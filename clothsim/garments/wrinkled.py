"""Wrinkles on coarse cloth: a finer cloth that follows a coarse run under contact, with the wrinkles it lacks.

Rohmer et al. 2010, "Animation wrinkling: augmenting coarse cloth simulations with realistic-looking wrinkles": curves
across the compression of the stretch tensor, waves on them. Theirs ends in geometry; here that geometry is the soft
target of a run of the finer cloth (`effects.targets`), so that its end is in balance, and free of intersections by the
exact check of every frame.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from os.path import relpath
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

import clothsim
from clothsim import Scene
from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.engine import World, build, refuse_earlier_run
from clothsim.garments.floor import table_of_arrays
from clothsim.garments.wrinkle.compression import Rings, Waves, blended_in_time, compression_of, ring_tensors
from clothsim.garments.wrinkle.curves import CompressionField, Crest, FineSheet, followed_curves, heights
from clothsim.garments.wrinkle.finer import Subdivision, normals_or_zero, subdivision

if TYPE_CHECKING:
    from clothsim import Run

FEWEST, MOST = 2, 8
"""Parts of an edge: the finer mesh has 4 to 64 times as many triangles."""
OWN_FILES = TARGETS_NAME, WRINKLES_NAME = "targets.npy", "wrinkles.json"
"""What it leaves beside the files of a run: the targets, and figures of the wrinkles of each frame."""
RATE = 100.0
"""Rate at which the finer cloth is drawn to its targets [1/s]."""
COPIED_EFFECTS = (
    "pins", "inertia", "membrane", "fibres", "strain_limit", "bending", "rest_angle", "body_contact", "self_contact",
    "seams",
)  # fmt: skip
"""Effects of the coarse scene that the finer cloth has too; loads are in the coarse motion already."""
LITTLE = 0.02
"""Compression of the most wrinkled hundredth of the cloth below which the coarse cloth shows little of it."""


def wrinkle(
    run: "Run",
    parts: int,
    output: str | Path,
    radius: float | None = None,
    rate: float = RATE,
    message: Callable[[str], None] = lambda line: None,
    overwrite: bool = False,
    **listeners: Any,
) -> "Run":
    """Give the cloths of a coarse run the wrinkles that a mesh with shorter edges shows.

    Parameters
    ----------
    run : Run
        A completed run that is free of intersections.
    parts : int
        Parts of each coarse edge.
    output : str or Path
        Directory of the finer run, with `targets.npy` and `wrinkles.json` beside the files of a run.
    radius : float, optional
        Least radius of crests by fabric [m], in place of the wavelength of bending against tension and curvature.
    rate : float
        Of `effects.targets` [1/s].
    message : callable
        Called with a line where something is to be known.
    overwrite : bool
        True: an earlier run in the directory is replaced.
    **listeners
        As of `clothsim.simulate`: progress, announce, on_step.

    Returns
    -------
    Run
        As `clothsim.simulate` leaves one; a frame for each of the coarse run.

    Raises
    ------
    InputError
        For a run that failed, stopped or intersects, that has no cloth or rigid bodies, whose scene cannot be built
        again, or whose effects belong to the vertices of its mesh.
    """
    refuse_unfit(run, parts)
    output = Path(output)
    refuse_earlier_run(output, overwrite, OWN_FILES, (run.directory,))
    started = process_time()
    world = build(run.scene).world
    if not np.array_equal(run.triangles, world.triangles):
        raise InputError(f"{run.directory} has another mesh than its scene.", "Restore the mesh files.")
    finer = [subdivision(cloth.triangles, len(cloth.positions), parts) for cloth in world.cloths]
    scene = finer_scene(run, world, finer)
    relief = Relief.of(run, world, finer, radius)
    shapes, figures = [], []
    for frame, (positions, found) in enumerate(relief.frames()):
        shapes.append(positions)
        figures.append(found)
        if frame % 10 == 9:
            message(f"wrinkles: {frame + 1} of {len(run)} frames, {found['curves']} crests")
    if max(each["compression"] for each in figures) < LITTLE:
        message(
            f"The coarse cloth is compressed by {100 * max(each['compression'] for each in figures):.2g} % at most: "
            "little is missing. effects.membrane.compression = 0.05 lets a coarse cloth shorten where it would wrinkle."
        )
    start = np.concatenate([one.linear(run.positions(0)[rows]) for one, rows in _rows(world, finer)])
    displacements = np.array(shapes) - start
    late = len(run) / run.scene.run_settings.frames_per_second
    spare = (len(run) - 1) / run.scene.run_settings.frames_per_second - float(run.times[-1])
    if spare > 1e-9 * late:  # a last frame that comes early is put where its motion would be at the next even time
        part = spare / (float(run.times[-1]) - float(run.times[-2]))
        displacements[-1] += part * (displacements[-1] - displacements[-2])
    output.mkdir(parents=True, exist_ok=True)
    content = BytesIO()
    np.save(content, displacements.astype(np.float32))
    write_atomically(output / TARGETS_NAME, content.getvalue())
    seconds = process_time() - started
    targets = {
        "displacements": TARGETS_NAME,
        "frames_per_second": run.scene.run_settings.frames_per_second,
        "rate": rate,
    }
    scene = scene.starting_at(output)  # the targets move with the run
    scene = replace(scene, effects={**scene.effects, "targets": targets})
    made = clothsim.simulate(scene, output, message=message, overwrite=True, **listeners)
    report = {
        "coarse": relpath(run.directory.resolve(), output.resolve()),
        "parts": parts,
        "geometry_cpu_seconds": seconds,
        "newton_cpu_seconds": process_time() - started - seconds,
        "frames": figures[: len(made)],
    }
    write_atomically(output / WRINKLES_NAME, json.dumps(report, indent=1).encode())
    return made


def refuse_unfit(run: "Run", parts: int) -> None:
    """InputError for a run that has nothing to wrinkle, or parts out of range."""
    where = str(run.directory)
    if not FEWEST <= parts <= MOST:
        raise InputError(f"Edges cannot be divided into {parts}.", f"Give {FEWEST} to {MOST} parts: --cells 4x.")
    if run.status != "completed":
        raise InputError(f"The run {where} {_STATUS.get(run.status, run.status)}.", "Wrinkle one that is completed.")
    if not len(run.triangles):
        raise InputError(f"The run {where} has no cloth.", "Wrinkles need cloth.")
    if run.scene.rods:
        raise InputError(f"The run {where} has rods, which get no wrinkles.", "Use a scene without [[rod]].")
    if run.scene.rigid_bodies:
        raise InputError(f"The run {where} has rigid bodies, whose motion comes from forces.", "Use [[body]].")
    if run.intersection_free is not True:
        raise InputError(
            f"The cloth of {where} intersects, or was not checked whole.",
            "Wrinkle a run with body_contact and self_contact.",
        )
    if len(run) < 2:
        raise InputError(f"The run {where} has one frame.", "Wrinkles follow a motion: give a longer run.duration.")


_STATUS = {"failed": "failed", "interrupted": "was stopped before its end"}


# The finer cloth as a scene.


def finer_scene(run: "Run", world: World, finer: list[Subdivision]) -> Scene:
    """The scene of the finer cloth that starts as the coarse one: its materials, pins and contacts, without loads."""
    scene, start = run.scene, run.positions(0)
    cloths = []
    for keys, cloth, (one, rows) in zip(scene.cloths, world.cloths, _rows(world, finer), strict=True):
        rest = one.of_triangles(cloth.material_coordinates) if cloth.flat else one.curved(cloth.rest_positions)
        count = one.parts**2  # finer triangles of each
        panels = {
            name: (np.asarray(faces)[:, None] * count + np.arange(count)).ravel()
            for name, faces in cloth.groups.items()
        }
        cloths.append(table_of_arrays(keys, cloth.name, one.linear(start[rows]), one.triangles, rest, panels))
    effects: dict[str, Any] = {name: keys for name, keys in scene.effects.items() if name in COPIED_EFFECTS}
    effects = {name: _on_finer(f"effects.{name}", keys, world, finer) for name, keys in effects.items()}
    effects |= {name: {} for name in ("inertia", "self_contact") if name not in effects}
    if scene.bodies and "body_contact" not in effects:
        effects["body_contact"] = {}
    rate = scene.run_settings.frames_per_second
    solver = {"dt": 1 / rate, "threads": scene.solver_settings.threads, "linear": scene.solver_settings.linear}
    settings = {"duration": float(run.times[-1]), "frames_per_second": rate}
    settings["allow_inside"] = scene.run_settings.allow_inside
    return Scene(cloths, scene.body, effects, solver, scene.contact, settings, directory=scene.directory)


def _rows(world: World, finer: list[Subdivision]) -> list[tuple[Subdivision, slice]]:
    return list(zip(finer, world.cloth_slices, strict=True))


def _on_finer(where: str, keys: Any, world: World, finer: list[Subdivision]) -> Any:
    """The keys of an effect with vertex numbers of the finer mesh; InputError for values of one mesh."""
    if isinstance(keys, Mapping):
        return {
            name: _selected(value, world, finer)
            if name == "select"
            else _on_finer(f"{where}.{name}", value, world, finer)
            for name, value in keys.items()
        }
    if isinstance(keys, list | tuple) and keys and isinstance(keys[0], Mapping):
        return [_on_finer(f"{where}[{k}]", each, world, finer) for k, each in enumerate(keys)]
    numbered = where.endswith(".vertices")
    if numbered or (isinstance(keys, np.ndarray) and keys.size > 3) or (isinstance(keys, str) and keys[-4:] == ".npy"):
        raise InputError(f"{where} has values for the coarse mesh.", "Give a number, or a line by `through`.")
    return keys


def _selected(select: Any, world: World, finer: list[Subdivision]) -> Any:
    """Names and boxes as they are; vertex numbers with the vertices between two or three of them."""
    if isinstance(select, str | Mapping) or not np.size(select):
        return select
    chosen = np.zeros(world.n_cloth, bool)
    chosen[np.asarray(select, np.int64)] = True
    first, found = 0, []
    for one, rows in _rows(world, finer):
        found.append(first + np.flatnonzero(one.linear(chosen[rows].astype(np.float64)) > 1 - 1e-9))
        first += one.weights.shape[0]
    return [int(row) for row in np.concatenate(found)]


# The targets, frame by frame.


@dataclass(frozen=True)
class Relief:
    """The coarse motion as curved surfaces of the finer cloths, with wrinkles.

    Attributes
    ----------
    run : Run
    world : World
        Of the coarse scene.
    finer : list of Subdivision
    sheets : list of FineSheet
        The finer cloths at rest.
    rings : list of Rings
        Of the coarse cloths.
    """

    run: "Run"
    world: World
    finer: list[Subdivision]
    sheets: list[FineSheet]
    rings: Rings

    @classmethod
    def of(cls, run: "Run", world: World, finer: list[Subdivision], radius: float | None) -> "Relief":
        """The relief of a run; radius: the least of crests [m], or None for that of the formula."""
        sheets = []
        for cloth, one in zip(world.cloths, finer, strict=True):
            rest = one.curved(cloth.rest_positions)
            ends = rest[one.triangles]
            edge = float(np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).mean())
            fabric = cloth.fabric
            bending = float(np.sqrt(fabric.bending_along_warp * fabric.bending_along_weft))
            stretching = float(np.sqrt(fabric.stiffness_along_warp * fabric.stiffness_along_weft))
            normals = normals_or_zero(rest, one.triangles)
            sheets.append(FineSheet(rest, normals, edge, Waves(bending, stretching, edge, radius)))
        return cls(run, world, finer, sheets, Rings.of(world.triangles, world.rest_areas, world.n_cloth))

    def frames(self) -> Iterator[tuple[Floats, dict[str, Any]]]:
        """Targets of all finer vertices (k, 3) [m] in each frame, and figures of its wrinkles."""
        curves: list[list[Crest]] = [[] for _ in self.finer]
        tensors, before = None, float(self.run.times[0])
        for frame, time in enumerate(self.run.times):
            own = ring_tensors(self.run, frame, self.rings)
            tensors = blended_in_time(tensors, own, float(time) - before)
            positions, shapes, crests = self.run.positions(frame), [], []
            most, worst = 0.0, 0.0
            for k, (one, rows) in enumerate(_rows(self.world, self.finer)):
                surface = one.curved(positions[rows])
                found = compression_of(one.linear(tensors[rows]), self.sheets[k].normals)
                field = CompressionField(self.sheets[k], found, surface)
                curves[k] = followed_curves(curves[k], field, float(time) - before)
                lifts = heights(curves[k], field)
                shapes.append(surface + lifts[:, None] * normals_or_zero(surface, one.triangles))
                crests += curves[k]
                most = max(most, float(np.abs(lifts).max(initial=0.0)))
                worst = max(worst, float(np.quantile(found.amount, 0.99)))
            before = float(time)
            yield (
                np.concatenate(shapes),
                {
                    "time": float(time),
                    "compression": worst,
                    "curves": len(crests),
                    "wavelength": float(np.mean([each.wavelength for each in crests])) if crests else None,
                    "height": most,
                },
            )
