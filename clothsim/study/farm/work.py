"""Work on a farm: drapes are claimed, made and published until all are done.

Any number of processes on any number of machines that share the folder do this at the same time, and each may be
killed at any instant. What is true is on the disk: a drape is done when its folder is in drapes/.
"""

import json
import shutil
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import sleep

from clothsim.base.interruption import interruption
from clothsim.study.farm.claims import Worker, claimed
from clothsim.study.farm.drape import Drape, drape, failed
from clothsim.study.farm.identity import processor
from clothsim.study.farm.plan import Farm, Job
from clothsim.study.farm.publication import (
    CLOTH,
    PARAMETERS,
    SUMMARY,
    as_npy,
    attempts,
    note_attempt,
    publish,
    working_folder,
)

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
    progress: Callable[[Job, Drape], None] | None = None,
    pause: float = PAUSE,
) -> Tally:
    """Make drapes in this process until every one of the farm is published.

    Parameters
    ----------
    farm : Farm
        From `open_farm`.
    worker : Worker, optional
        Times of heartbeats.
    most_attempts : int
        Attempts that began and did not end, before a drape is published as killed.
    progress : callable, optional
        Called with each drape that this process published.
    pause : float
        Time between two looks at drapes that others make [s].

    Returns
    -------
    Tally

    Notes
    -----
    A pass goes through all drapes from a place of its own. It ends with none left, or waits for those that others
    make: each of these is published, or its claim becomes stale at the latest after `Worker.longest`.
    """
    worker = worker or Worker()
    tally = Tally()
    jobs = _rotated(farm.jobs, worker)
    with interruption() as flag:  # an exception within compiled code would be lost, and the drape published as a fault
        while left := _left(jobs, farm):
            idle = True
            for job in left:
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


def make(farm: Farm, job: Job, worker: Worker, most_attempts: int = ATTEMPTS) -> Drape | None:
    """Claim, make and publish one drape; None where another process has it or had published it."""
    folder = farm.directory
    if (folder / "drapes" / job.id).is_dir():
        return None
    with claimed(folder / "claims", job.id, worker) as own:
        if not own or (folder / "drapes" / job.id).is_dir():
            return None
        _clear(folder, job)
        before = attempts(folder, job.id)
        if before >= most_attempts:
            made = Drape(failed(f"Killed {before} times.", "killed") | {"processor": processor(), "meshes": {}}, None)
        else:
            made = _attempted(farm, job, worker)
        return made if _published(farm, job, worker, made) else None


def _attempted(farm: Farm, job: Job, worker: Worker) -> Drape:
    """Make a drape; an attempt that its user stops is no attempt."""
    folder = farm.directory
    note_attempt(folder, job.id, "started")
    scratch = working_folder(folder, job.id, worker)
    try:
        return drape(farm.scene_of(job), scratch, folder, farm.settings["frames"])
    except BaseException:
        note_attempt(folder, job.id, "withdrawn")
        raise
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _published(farm: Farm, job: Job, worker: Worker, made: Drape) -> bool:
    summary = {"id": job.id, "package": farm.settings["package"], **made.summary}
    files = {
        SUMMARY: json.dumps(summary, indent=1).encode(),
        PARAMETERS: json.dumps({"index": job.index, **job.values}, indent=1).encode(),
    }
    if made.positions is not None:
        files[CLOTH] = as_npy(made.positions)
    return publish(farm.directory, job.id, worker, files)


def _clear(folder: Path, job: Job) -> None:
    """Delete what killed attempts at a drape left; the claim of this process says that none is alive."""
    for left in (folder / "tmp").glob(f"{job.id}.*"):
        shutil.rmtree(left, ignore_errors=True)


def _left(jobs: Sequence[Job], farm: Farm) -> list[Job]:
    done = farm.published()
    return [job for job in jobs if job.id not in done]


def _rotated(jobs: Sequence[Job], worker: Worker) -> list[Job]:
    """The drapes from a place that differs between processes, so that they seldom want the same claim."""
    first = zlib.crc32(worker.token.encode()) % max(1, len(jobs))
    return [*jobs[first:], *jobs[:first]]
