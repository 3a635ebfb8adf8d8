"""Work on a farm, by this process or by Dask workers: drapes are claimed, made and published until all are done.

Any number of processes on any number of machines that share the folder do this at the same time, and each may be
killed at any instant. What is true is on the disk: a drape is done when its folder is in drapes/. Tasks of Dask (extra
clothsim[farm]) return ids alone.
"""

import json
import shutil
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import InputError, MachineError, MissingPackageError
from clothsim.base.interruption import interruption
from clothsim.study.farm.claims import Worker, claimed, holds, worker_of
from clothsim.study.farm.drape import Drape, drape, failed
from clothsim.study.farm.plan import Farm, Job, open_farm
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
from clothsim.study.farm.reading import CLOTH, PARAMETERS, SUMMARY

if TYPE_CHECKING:
    from distributed import Client

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


def make(farm: Farm, job: Job, worker: Worker, most_attempts: int = ATTEMPTS) -> Drape | None:
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
        if not own or is_published(folder, job.id) or not holds(claims, job.id, worker):
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
                if holds(claims, job.id, worker):
                    raise
                return None  # its folder went to the process that took over
        if not holds(claims, job.id, worker):
            note_attempt(folder, job.id, "withdrawn")
            return None
        return made if _published(farm, job, worker, made) else None


def _attempted(farm: Farm, job: Job, worker: Worker) -> Drape:
    """Make a drape; an attempt that its user stops is no attempt."""
    folder = farm.directory
    note_attempt(folder, job.id, "started")
    try:
        scratch = working_folder(folder, job.id, worker)
        try:
            return drape(farm.scene_of(job), scratch, folder, farm.settings["frames"])
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    except BaseException:
        note_attempt(folder, job.id, "withdrawn")
        raise


def _published(farm: Farm, job: Job, worker: Worker, made: Drape) -> bool:
    summary = {"id": job.id, "package": farm.settings["package"], **made.summary}
    files = {
        SUMMARY: json.dumps(summary, indent=1).encode(),
        PARAMETERS: json.dumps({"index": job.index, **job.values}, indent=1).encode(),
    }
    if made.positions is not None:
        files[CLOTH] = as_npy(made.positions)
    return publish(farm.directory, job.id, worker, files)


FRUITLESS = 100
"""Rounds in a row without a new drape, with waits of up to 30 s for a lost scheduler, before the work ends."""
AHEAD = 4
"""Tasks given to a scheduler for each thread of its workers: it holds a few hundred ids, not the whole farm."""


def dask_package() -> Any:
    """The package distributed. MissingPackageError where it is not installed."""
    try:
        import distributed
    except ImportError as error:
        raise MissingPackageError(
            "--workers and --scheduler need the package distributed, which is not installed.",
            "pip install 'clothsim[farm]', or start `clothsim farm work DIR` as often as you have cores.",
        ) from error
    return distributed


def work_with_dask(
    farm: Farm,
    scheduler: str | None,
    workers: int,
    most_attempts: int = ATTEMPTS,
    announce: Callable[[str], None] | None = None,
    stale_after: float = Worker.stale_after,
) -> None:
    """Make all drapes of a farm, whose folder is seen by all workers under the same path, by the workers of Dask.

    scheduler: its address; None: a LocalCluster of `workers` processes with one thread each; announce: called with the
    address of the dashboard; stale_after: without a heartbeat for this time a claim is taken over [s].

    Raises
    ------
    MissingPackageError
        Where distributed is not installed.
    InputError
        Where the scheduler does not answer.

    Notes
    -----
    Dask reruns tasks whose worker died, and gives a task up after some deaths, also one that was innocent: neither
    matters, as a task only makes what is not published, and what is not published is handed out again. A scheduler
    that was killed is waited for; a LocalCluster begins again with the command.
    """
    with _connections(scheduler, workers) as connect:
        with connect() as client:
            if announce is not None:
                announce(client.dashboard_link)
        fruitless = 0
        while fruitless < FRUITLESS:
            waiting = farm.unpublished()
            if not waiting:
                return
            _round(connect, farm, list(waiting.values()), most_attempts, stale_after)
            fruitless = 0 if len(farm.unpublished()) < len(waiting) else fruitless + 1
            if fruitless:
                sleep(PAUSE)
    raise InputError(
        f"{FRUITLESS} times in a row no drape came from the workers.", "Look at them; `clothsim farm work DIR` goes on."
    )


def _round(
    connect: "Callable[[], Client]", farm: Farm, left: Sequence[Job], most_attempts: int, stale_after: float
) -> None:
    """Give out all drapes that are left, once, or until the scheduler is lost.

    A task that failed as Dask counts (its workers died) is given out again by the next round.
    """
    directory, jobs = str(farm.directory.resolve()), iter(left)

    def submit(client: "Client", number: int) -> list[Any]:
        given = [(directory, job.id, most_attempts, stale_after) for job in islice(jobs, number)]
        return [client.submit(make_one, *each, pure=False) for each in given]

    with suppress(OSError, RuntimeError, TimeoutError), connect() as client:  # CommClosedError is an OSError
        running = dask_package().as_completed(
            submit(client, AHEAD * max(1, sum(client.nthreads().values()))), timeout=Worker().longest
        )
        for future in running:
            if future.cancelled():
                return
            future.release()
            running.update(submit(client, 1))


def make_one(directory: str, name: str, most_attempts: int, stale_after: float = Worker.stale_after) -> str:
    """Task of a Dask worker: make one drape where nobody does. Returns its id."""
    farm, jobs, worker = _opened(directory, stale_after)
    make(farm, jobs[name], worker, most_attempts)
    return name


@cache
def _opened(directory: str, stale_after: float) -> tuple[Farm, dict[str, Job], Worker]:
    """Farm, its drapes by id, and this process as a worker: read once by each process."""
    farm = open_farm(Path(directory))
    return farm, {job.id: job for job in farm.jobs}, worker_of(stale_after)


@contextmanager
def _connections(scheduler: str | None, workers: int) -> "Iterator[Callable[[], Client]]":
    """A function that connects to the scheduler, which is that of a LocalCluster where no address is given."""
    distributed = dask_package()
    if scheduler is None:
        with distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster:
            yield lambda: distributed.Client(cluster)
        return
    try:
        distributed.Client(scheduler, timeout=30).close()
    except (OSError, ValueError) as error:
        raise InputError(f"The scheduler {scheduler} does not answer: {error}.", "Check its address.") from error
    yield lambda: distributed.Client(scheduler, timeout=30)
