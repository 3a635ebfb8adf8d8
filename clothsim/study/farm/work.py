"""Work on a farm by this process: drapes are claimed, made and published until all are done.

Any number of processes on any number of machines that share the folder do this at the same time, and each may be
killed at any instant. What is true is on the disk: a drape is done when its folder is in drapes/.
"""

import json
import os
import shutil
import zlib
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from time import sleep

from clothsim.base.errors import InputError, MachineError
from clothsim.base.interruption import interruption
from clothsim.engine import build
from clothsim.study.farm.claims import Worker, claimed, owns_claim
from clothsim.study.farm.drape import Drape, drape, failed, store_world
from clothsim.study.farm.plan import DrapeJob, Farm
from clothsim.study.farm.publication import (
    as_npy,
    attempts,
    is_published,
    note_attempt,
    processor,
    publish,
    set_aside,
    working_folder,
)
from clothsim.study.farm.reading import CLOTH, PARAMETERS, SUMMARY, read_drape
from clothsim.study.farm.verification import faults

ATTEMPTS = 3
"""Attempts of a drape before it is published as killed."""

PAUSE = 1.0
"""Time between two looks at drapes that others make [s]."""


@dataclass(frozen=True)
class Tally:
    """What one process did: drapes published, and those of them that are usable."""

    published: int = 0
    usable: int = 0
    cpu_seconds: float = 0.0

    def after(self, made: Drape) -> "Tally":
        """The tally after one more drape."""
        return replace(
            self,
            published=self.published + 1,
            usable=self.usable + bool(made.summary["usable"]),
            cpu_seconds=self.cpu_seconds + made.summary.get("cpu_seconds", 0.0),
        )


def work(
    farm: Farm,
    worker: Worker | None = None,
    most_attempts: int = ATTEMPTS,
    progress: Callable[[DrapeJob, Drape], None] | None = None,
    pause: float = PAUSE,
) -> Tally:
    """Make drapes in this process until every one of the farm is published.

    most_attempts: attempts that began and did not end, before a drape is published as killed; progress: called with
    each drape that this process published; pause: between two looks at drapes that others make [s].

    A pass goes through all drapes from a place of its own. It ends with none left, or waits for those that others make:
    each of these is published, or its claim becomes stale at the latest after `Worker.longest`.
    """
    worker = worker or Worker()
    tally = Tally()
    first = zlib.crc32(worker.token.encode()) % max(1, len(farm.jobs))
    jobs = [*farm.jobs[first:], *farm.jobs[:first]]  # from a place of its own: processes seldom want the same claim
    with interruption() as flag:  # an exception within compiled code would be lost, and the drape published as a fault
        while waiting := farm.unpublished():
            idle = True
            for job in (job for job in jobs if job.id in waiting):
                made = make(farm, job, worker, most_attempts)
                flag.check()
                if made is not None:
                    idle = False
                    tally = tally.after(made)
                    if progress is not None:
                        progress(job, made)
            if idle:
                sleep(pause)
    return tally


def make(farm: Farm, job: DrapeJob, worker: Worker, most_attempts: int = ATTEMPTS) -> Drape | None:
    """Claim, make and publish one drape; None where another process has it or had published it.

    So it is also where this process was suspended for so long that another one took the drape over: what that one has
    made, or is making, stays.
    """
    folder = farm.directory
    if is_published(folder, job.id):
        return None
    claims = folder / "claims"
    if (claims / job.id).is_symlink() or (claims / job.id).is_dir():
        set_aside(folder, claims / job.id)
    with claimed(claims, job.id, worker) as own:
        left = list((folder / "tmp").glob(f"{job.id}.*"))
        if not own or is_published(folder, job.id) or not owns_claim(claims, job.id, worker):
            return None
        for each in left:  # of killed attempts: the claim was this process's own after they were listed
            shutil.rmtree(each, ignore_errors=True)
        before = attempts(folder, job.id)
        if before >= most_attempts:
            made = Drape(failed(f"Killed {before} times.", "killed") | {"processor": processor(), "meshes": {}}, None)
        else:
            try:
                made = _attempted(farm, job, worker)
            except (OSError, MachineError):
                if owns_claim(claims, job.id, worker):
                    raise
                return None  # its folder went to the process that took over
        if not owns_claim(claims, job.id, worker):
            note_attempt(folder, job.id, "withdrawn")
            return None
        summary = {"id": job.id, "package": farm.settings["package"], **made.summary}
        files = {
            SUMMARY: json.dumps(summary, indent=1).encode(),
            PARAMETERS: json.dumps({"index": job.index, **job.values}, indent=1).encode(),
        }
        if made.positions is not None:
            files[CLOTH] = as_npy(made.positions)
        return made if publish(farm.directory, job.id, worker, files) else None


def _attempted(farm: Farm, job: DrapeJob, worker: Worker) -> Drape:
    """Make a drape; an attempt that its user stops is not an attempt."""
    folder = farm.directory
    note_attempt(folder, job.id, "started")
    try:
        scratch = working_folder(folder, job.id, worker)
        try:
            return drape(farm.scene_of(job), scratch, folder, farm.settings["frames"], farm.settings["usable"])
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    except BaseException:
        note_attempt(folder, job.id, "withdrawn")
        raise


# Repair of a farm: what is torn, or failed by no fault of its own, goes back into the plan.


MACHINE = ("killed",)
"""Causes of drapes that the machine may have failed: their processes were ended from outside, as for want of memory."""


@dataclass(frozen=True)
class Repaired:
    """What was repaired: the cause of each drape that was taken back, by id, and meshes that were stored again."""

    taken_back: dict[str, str]
    meshes: tuple[str, ...]


def repair(farm: Farm, causes: Collection[str] = MACHINE) -> Repaired:
    """Take drapes back into the plan: `work` makes them again.

    Torn ones are, and those with one of the causes; a mesh that alone is torn is made again from its scene. A drape
    that is whole stays.
    """
    stored = []
    for digest, name in faults(farm).meshes.items():
        job = next(job for job in farm.jobs if job.id == name)
        with suppress(InputError):
            made = store_world(farm.directory, build(farm.scene_of(job)).world)
            stored += [digest for each in made.values() if digest in each.values()]
    torn, taken = faults(farm).torn, dict[str, str]()
    for job in farm.jobs:
        if job.id in torn:
            taken[job.id] = torn[job.id]
        elif job.id in farm.published() and read_drape(farm.directory, job.id)[0]["cause"] in causes:
            taken[job.id] = str(read_drape(farm.directory, job.id)[0]["reason"])
    for name in taken:
        old = farm.directory / "tmp" / f"{name}.repaired.{os.urandom(6).hex()}"
        farm.folder(name).rename(old)
        shutil.rmtree(old, ignore_errors=True)
        (farm.directory / "attempts" / name).unlink(missing_ok=True)
    return Repaired(taken, tuple(stored))
