"""Plan of a farm: the scene and the drawn values of every drape, on disk before the first one is made."""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from clothsim import Scene, __version__
from clothsim.base.errors import InputError
from clothsim.base.file_writing import refuse_replacing, write_atomically
from clothsim.base.record import RECORD_NAME, SUMMARY_NAME
from clothsim.engine import build
from clothsim.study.farm.publication import content_id
from clothsim.study.farm.reading import checked_id, file_hash, read_file
from clothsim.study.farm.recipe import Recipe, changed

FARM_NAME, JOBS_NAME, MANIFEST = "farm.json", "jobs.jsonl", "manifest.jsonl"
SIGNED = "verified.json"
"""The hashes of a farm that was verified: of its plan, and of the hashes of each drape."""
FOLDERS = ("drapes", "claims", "attempts", "tmp", "meshes")
REWRITE = "Remove this file and plan the same recipe with -o here, or plan the recipe again in another folder."
"""What to do about a farm.json that was changed: the same recipe has the same one, and the drapes stay."""
TRIED = 3
"""Drapes of a recipe that are built before it is planned, until one can be."""


@dataclass(frozen=True)
class DrapeJob:
    """One drape to be made: its number, id, and the values of the varied keys."""

    index: int
    id: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Farm:
    """The folder of a farm.

    Attributes
    ----------
    directory : Path
        Its folder.
    settings : dict
        Content of farm.json: recipe, boxes of the varied numbers, package version.
    """

    directory: Path
    settings: Mapping[str, Any]

    @cached_property
    def scene(self) -> Scene:
        """The base scene."""
        return Scene.from_text(json.dumps(self.settings["scene"]), self.directory)

    def refuse_output(self, files: Iterable[Path]) -> None:
        """InputError for an output file that is a part of the farm: its plan, lists, or in one of its FOLDERS."""
        names = (FARM_NAME, JOBS_NAME, MANIFEST, SIGNED, *FOLDERS)
        parts = [(self.directory / name).resolve() for name in names]
        for file in files:
            if any(file.resolve().is_relative_to(part) for part in parts):
                raise InputError(f"{file} is a part of the farm {self.directory}.", "Choose another name with -o.")

    @cached_property
    def jobs(self) -> tuple[DrapeJob, ...]:
        """The drapes of the plan, but those whose lines were changed since (`plan_fault`)."""
        return self._plan[0]

    @property
    def plan_fault(self) -> str:
        """What of the plan is not as it was written, with the line; empty where nothing."""
        return self._plan[1]

    @cached_property
    def _plan(self) -> tuple[tuple[DrapeJob, ...], str]:
        content = read_file(self.directory, JOBS_NAME)
        file, jobs, faults = self.directory / JOBS_NAME, list[DrapeJob](), list[str]()
        whole = file_hash(content) == self.settings.get("jobs")
        for number, line in enumerate(content.splitlines()):
            try:
                entry = json.loads(line)
                index, name, values = entry["index"], entry["id"], entry["values"]
            except (ValueError, KeyError, TypeError, RecursionError):
                index = None
            good = type(index) is int and index >= 0 and isinstance(values, dict)
            job = DrapeJob(index, checked_id(name, file), values) if good else None
            if job is not None and not whole:
                try:
                    self.scene_of(job)
                except InputError:
                    job = None
            if job is None:
                faults.append(f"{file}, line {number + 1}, is not a drape of the plan.")
            else:
                jobs.append(job)
        if not whole and not faults:
            faults = [f"{file} has {len(jobs)} of {self.settings['count']} lines that were planned."]
        return tuple(sorted(jobs, key=lambda job: job.index)), "".join(faults[:1])

    def scene_of(self, job: DrapeJob) -> Scene:
        """The scene of a drape. InputError where it is no longer the one that was planned."""
        scene = changed(self.scene, job.values)
        if content_id(scene, self.settings["version"]) != job.id:
            raise InputError(
                f"The scene of drape {job.id} is not the one that was planned: the package or a file has changed.",
                "Plan the recipe again in another folder.",
            )
        return scene

    def folder(self, name: str) -> Path:
        """Folder of the drape with an id, once it is published."""
        return self.directory / "drapes" / name

    def published(self) -> set[str]:
        """The ids of the drapes that are done, failed ones too."""
        with os.scandir(self.directory / "drapes") as entries:
            return {entry.name for entry in entries if entry.is_dir(follow_symlinks=False)}

    def unpublished(self) -> dict[str, DrapeJob]:
        """The drapes that are left, by id, in the order of the plan."""
        done = self.published()
        return {job.id: job for job in self.jobs if job.id not in done}


def plan(recipe: Recipe, directory: str | Path) -> Farm:
    """Write the plan of a recipe to a folder; one that has the same plan goes on with it.

    Every scene is made once, so that a bad key or value is reported here and not by a worker. InputError where two
    drapes are the same, a value is out of range, or the folder has another plan.
    """
    folder = Path(directory)
    settings, lines = _planned(recipe)
    refuse_other_plan(recipe, folder, settings)
    if (folder / FARM_NAME).is_file():
        if open_farm(folder).plan_fault:  # lost or changed since: the same recipe has the same lines
            write_atomically(folder / JOBS_NAME, lines)
        return open_farm(folder)
    try:
        for name in FOLDERS:
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made a folder: {error.strerror}.", "Choose another with -o.") from error
    write_atomically(folder / JOBS_NAME, lines)
    whole = json.dumps({**settings, "sha256": _settings_hash(settings)}, indent=1)
    write_atomically(folder / FARM_NAME, whole.encode())  # last: a plan that has it is whole
    return open_farm(folder)


def refuse_other_plan(recipe: Recipe, directory: str | Path, settings: Mapping[str, Any] | None = None) -> None:
    """InputError where a folder has another plan than that of a recipe, or another file in its place.

    settings: those of the plan, where they are known.
    """
    folder = Path(directory)
    if (folder / FARM_NAME).is_file():
        wanted = _planned(recipe)[0] if settings is None else settings
        if open_farm(folder).settings["sha256"] != _settings_hash(wanted):
            raise InputError(f"{folder} has another plan.", "Choose another folder with -o.")
    elif not (folder / FOLDERS[-1]).is_dir():  # else a plan that was stopped
        refuse_replacing([folder / JOBS_NAME], overwrite=False)
        if any((folder / name).is_file() for name in (RECORD_NAME, SUMMARY_NAME)):
            raise InputError(f"{folder} holds a run, not a farm.", "Choose another folder with -o.")


def _planned(recipe: Recipe) -> tuple[dict[str, Any], bytes]:
    """The settings of the plan of a recipe, and its lines."""
    settings: dict[str, Any] = {
        "package": __version__,
        "version": recipe.version,
        "count": recipe.count,
        "seed": recipe.seed,
        "frames": recipe.frames,
        "licence": recipe.licence,
        "usable": dict(recipe.rules),
        "boxes": {key: list(box) for key, box in recipe.boxes.items()},
        "varied": [*recipe.draws, *recipe.same],
        "same": dict(recipe.same),
        "scene": json.loads(recipe.scene.to_text()),
    }
    first: dict[str, int] = {}
    entries = []
    for index in range(recipe.count):
        values = recipe.values(index)
        own = content_id(changed(recipe.scene, values), recipe.version)
        if own in first:
            raise InputError(
                f"Drapes {first[own]} and {index} of the recipe are the same.",
                "Vary a number, or give a count no larger than the number of combinations.",
            )
        first[own] = index
        entries.append(f"{json.dumps({'index': index, 'id': own, 'values': values})}\n")
    lines = "".join(entries).encode()
    return {**settings, "jobs": file_hash(lines)}, lines


def refuse_unbuildable(recipe: Recipe) -> None:
    """Build the first drapes of a recipe, until one can be built.

    A drape that cannot be built is published as refused; where all are, the recipe is wrong.

    Raises
    ------
    InputError
        None of the first TRIED can be built: with the sentence of the first one.
    """
    refusals: list[InputError] = []
    for index in range(min(TRIED, recipe.count)):
        try:
            build(changed(recipe.scene, recipe.values(index)), affordable=True)
            return
        except InputError as error:
            refusals.append(error)
    which = "The drape" if len(refusals) == 1 else f"None of the first {len(refusals)} drapes"
    raise InputError(
        f"{which} can{'not' if len(refusals) == 1 else ''} be built: {refusals[0].sentence}", refusals[0].remedy
    )


def open_farm(directory: str | Path) -> Farm:
    """The farm in a folder. InputError where there is none, it differs from its plan, or a link leads out of it."""
    folder = Path(directory)
    if folder.is_file():
        raise InputError(
            f"{folder} is a file, not the folder of a farm.",
            "Name the folder that `clothsim farm plan RECIPE -o DIR` wrote.",
        )
    if not (folder / FARM_NAME).exists():
        raise InputError(f"{folder} is not a farm.", "Make one: `clothsim farm plan RECIPE -o DIR`.")
    for name in FOLDERS:
        if (folder / name).is_symlink():
            raise InputError(f"{folder / name} is a link, which is not followed.", "Put the whole farm where it leads.")
        if not (folder / name).is_dir():
            raise InputError(f"{folder / name} is not a folder.", "Plan the recipe again in another folder.")
    try:
        settings = json.loads(read_file(folder, FARM_NAME))
        whole = settings["sha256"] == _settings_hash(settings)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{folder / FARM_NAME} is not a plan.", REWRITE) from error
    if not whole:
        raise InputError(f"{folder / FARM_NAME} is not what was planned.", REWRITE)
    return Farm(folder, settings)


def _settings_hash(settings: Mapping[str, Any]) -> str:
    """sha256 of farm.json without its own line."""
    return file_hash(json.dumps({key: settings[key] for key in settings if key != "sha256"}, sort_keys=True).encode())
