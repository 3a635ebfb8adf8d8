"""Verification of a farm: whether all that it has published is what it was, signed off for those who read it."""

import json
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import InputError
from clothsim.base.file_writing import write_atomically
from clothsim.study.farm.drape import drape
from clothsim.study.farm.plan import FARM_NAME, JOBS_NAME, SIGNED, Farm
from clothsim.study.farm.publication import processor
from clothsim.study.farm.reading import (
    CLOTH,
    HASHES,
    PARAMETERS,
    REPAIR,
    SUMMARY,
    file_hash,
    positions_of,
    read_drape,
    read_file,
    read_stored_mesh,
    whole_files,
)

REPLAN = "`clothsim farm plan RECIPE -o DIR` with the same recipe writes it again."


@dataclass(frozen=True)
class Verified:
    """Result of a verification.

    Attributes
    ----------
    whole : int
        Published drapes whose files, and the meshes that they name, are what was published.
    torn : dict of str to str
        Sentence by the id of those that are not, and of those that are gone since the last verification.
    plan : str
        What of the plan is not as it was written; empty where nothing.
    repeated, same : int
        Drapes made again on the same kind of processor, and those of them with the same bytes and verdict.
    elsewhere : int
        Drapes made again that come from another kind of processor, whose last bits may differ.
    different : tuple of str
        Ids of drapes of the same processor with other bytes or another verdict.
    largest : float
        Largest distance of a vertex between two makings [m].
    """

    whole: int
    torn: dict[str, str]
    plan: str
    repeated: int
    same: int
    elsewhere: int
    different: tuple[str, ...]
    largest: float

    @property
    def good(self) -> bool:
        """True where nothing is torn or missing and nothing differs: then the farm is verified."""
        return not self.torn and not self.plan and not self.different


def verify(farm: Farm, fraction: float = 0.01, seed: int = 0) -> Verified:
    """Check all that a farm has published, and make a fraction of its drapes again: at least one where it is positive.

    A farm in which all holds is signed off in `verified.json`, which `demand_verified` asks for.
    """
    if not 0 <= fraction <= 1:
        raise InputError(f"The fraction is {fraction:g}.", "Give a number from 0 to 1, such as 0.01.")
    found = faults(farm)
    torn, hashes = found.torn, found.hashes
    jobs = [job for job in farm.jobs if job.id in hashes]
    whole = [job for job in jobs if job.id not in torn]
    with_positions = [job for job in whole if read_drape(farm.directory, job.id)[0].get("hash")]
    count = math.ceil(fraction * len(with_positions))
    chosen = np.random.default_rng(seed).choice(len(with_positions), count, replace=False).tolist() if count else []
    repeats = []
    for job in (with_positions[k] for k in sorted(chosen)):
        summary, _ = read_drape(farm.directory, job.id)
        before = positions_of(farm.directory, job.id)
        with tempfile.TemporaryDirectory(prefix="clothsim-verify-") as scratch:
            made = drape(farm.scene_of(job), Path(scratch), None, farm.settings["frames"], farm.settings["usable"])
        after, distance = made.positions, math.inf
        if after is not None and after.shape == before.shape:
            distance = float(np.linalg.norm(after - before, axis=-1).max())
        same = all(made.summary[key] == summary[key] for key in ("hash", "usable", "cause"))
        here = summary["processor"] == processor()
        repeats.append({"id": job.id, "here": here, "same": same, "distance": distance})
    here = [each for each in repeats if each["here"]]
    done = Verified(
        whole=len(whole),
        torn=torn
        | {
            name: f"Drape {name} is gone since the farm was verified."
            for name in _signed(farm).get("drapes", ())
            if name not in hashes
        },
        plan=farm.plan_fault,
        repeated=len(here),
        same=sum(each["same"] for each in here),
        elsewhere=len(repeats) - len(here),
        different=tuple(each["id"] for each in here if not each["same"]),
        largest=max((each["distance"] for each in repeats), default=0.0),
    )
    if done.good:
        content = {"plan": _plan_hashes(farm), "drapes": hashes}
        write_atomically(farm.directory / SIGNED, json.dumps(content, indent=1).encode())
    return done


def demand_verified(farm: Farm) -> None:
    """Check that a farm is as it was when it was signed off.

    Raises
    ------
    InputError
        Where it was not verified, or a drape was changed, taken away or added since: with its id.
    """
    if farm.plan_fault:
        raise InputError(farm.plan_fault, REPLAN)
    signed = _signed(farm)
    found = faults(farm)
    for sentence in found.torn.values():
        raise InputError(sentence, REPAIR)
    hashes = found.hashes
    remedy = f"`clothsim farm verify {farm.directory} --fraction 0` checks and signs what is there."
    if not signed or signed["plan"] != _plan_hashes(farm):
        raise InputError(f"The drapes of {farm.directory} are not verified.", remedy)
    for name in sorted({*hashes, *signed["drapes"]}):
        if hashes.get(name) != signed["drapes"].get(name):
            happened = "taken away" if name not in hashes else "changed" if name in signed["drapes"] else "published"
            raise InputError(f"Drape {name} was {happened} after the farm was verified.", remedy)


def _signed(farm: Farm) -> dict[str, Any]:
    """What was signed off, empty where nothing was: the hashes of the plan and of each drape."""
    try:
        content = json.loads(read_file(farm.directory, SIGNED))
        return content if set(content) == {"plan", "drapes"} and isinstance(content["drapes"], dict) else {}
    except (InputError, ValueError, TypeError, RecursionError):
        return {}


def _plan_hashes(farm: Farm) -> dict[str, str]:
    return {name: file_hash(read_file(farm.directory, name)) for name in (FARM_NAME, JOBS_NAME)}


@dataclass(frozen=True)
class Faults:
    """What is wrong with the published drapes of a plan.

    Attributes
    ----------
    torn : dict of str to str
        A sentence by id.
    meshes : dict of str to str
        Of each mesh that is torn, by its hash, the id of a drape that names it.
    hashes : dict of str to str
        Of each published drape, by id, the hash of its hashes.
    """

    torn: dict[str, str]
    meshes: dict[str, str]
    hashes: dict[str, str]


def faults(farm: Farm) -> Faults:
    """Read all that a farm has published, and compare it with the hashes that it was published with."""
    done, torn, hashes = farm.published(), dict[str, str](), dict[str, str]()
    meshes, names = dict[str, str](), dict[str, str]()
    for job in farm.jobs:
        if job.id not in done:
            continue
        hashes[job.id] = ""
        try:
            hashes[job.id] = file_hash(read_file(farm.folder(job.id), HASHES))
            files = whole_files(farm.directory, job.id)
            summary, parameters = json.loads(files[SUMMARY]), json.loads(files[PARAMETERS])
            if summary["id"] != job.id or parameters != {"index": job.index, **job.values}:
                raise InputError(f"Drape {job.id} is torn: its files are those of another drape.", REPAIR)
            if summary["usable"] and CLOTH not in files:
                raise InputError(f"Drape {job.id} is torn: it has no {CLOTH}.", REPAIR)
            for digest in (digest for kind in summary["meshes"].values() for digest in kind.values()):
                if digest not in meshes:
                    meshes[digest], names[digest] = "", job.id
                    try:
                        read_stored_mesh(farm.directory, digest)
                    except InputError as error:
                        meshes[digest] = error.sentence
                if meshes[digest]:
                    raise InputError(f"Drape {job.id} is torn: {meshes[digest]}", REPAIR)
        except InputError as error:
            torn[job.id] = error.sentence
    return Faults(torn, {digest: names[digest] for digest in names if meshes[digest]}, hashes)
