"""Work on a farm by Dask workers (extra clothsim[farm]): tasks return ids, and what is true is on the disk."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import cache
from itertools import islice
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any

from clothsim.errors import InputError, MissingPackageError
from clothsim.farm.claims import Worker
from clothsim.farm.plan import Farm, Job, open_farm
from clothsim.farm.work import ATTEMPTS, PAUSE, make

if TYPE_CHECKING:
    from distributed import Client

RECONNECTIONS = 1000
"""Times that a lost scheduler is looked for again."""
AHEAD = 4
"""Tasks given to a scheduler for each thread of its workers: it holds a few hundred ids, not the whole farm."""


def work_with_dask(
    farm: Farm,
    scheduler: str | None,
    workers: int,
    most_attempts: int = ATTEMPTS,
    announce: Callable[[str], None] | None = None,
) -> None:
    """Make all drapes of a farm by the workers of a Dask scheduler.

    Parameters
    ----------
    farm : Farm
        Its folder is seen by all workers under the same path.
    scheduler : str or None
        Address; None: a LocalCluster of `workers` processes with one thread each.
    most_attempts : int
        Before a drape is published as killed.
    announce : callable, optional
        Called with the address of the dashboard.

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
    with _client(scheduler, workers) as client:
        if announce is not None:
            announce(client.dashboard_link)
        for _ in range(RECONNECTIONS):
            done = farm.published()
            left = [job for job in farm.jobs if job.id not in done]
            if not left:
                return
            if not _round(client, farm, left, most_attempts):
                sleep(PAUSE)
    raise InputError("The scheduler was lost too often.", "`clothsim farm work DIR` goes on.")


def _round(client: "Client", farm: Farm, left: Sequence[Job], most_attempts: int) -> bool:
    """Give out all drapes that are left, once; False where nothing was published."""
    from distributed import as_completed

    directory, before = str(farm.directory.resolve()), len(farm.published())
    jobs = iter(left)
    ahead = AHEAD * max(1, sum(client.nthreads().values()))

    def submit(number: int) -> list[Any]:
        return [client.submit(make_one, directory, job.id, most_attempts, pure=False) for job in islice(jobs, number)]

    try:
        running = as_completed(submit(ahead))
        for future in running:
            if future.status == "error":  # the worker died too often, as Dask counts
                pass
            future.release()
            running.update(submit(1))
    except (OSError, RuntimeError, TimeoutError):  # CommClosedError: the scheduler is gone
        pass
    return len(farm.published()) > before


def make_one(directory: str, name: str, most_attempts: int) -> str:
    """Task of a Dask worker: make one drape where nobody does. Returns its id."""
    farm, jobs, worker = _opened(directory)
    make(farm, jobs[name], worker, most_attempts)
    return name


@cache
def _opened(directory: str) -> tuple[Farm, dict[str, Job], Worker]:
    """Farm, its drapes by id, and this process as a worker: read once by each process."""
    farm = open_farm(Path(directory))
    return farm, {job.id: job for job in farm.jobs}, Worker()


def _client(scheduler: str | None, workers: int) -> "AbstractContextManager[Client]":
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingPackageError(
            "--workers and --scheduler need the package distributed, which is not installed.",
            "pip install 'clothsim[farm]', or start `clothsim farm work DIR` as often as you have cores.",
        ) from error
    if scheduler is None:
        cluster = LocalCluster(n_workers=workers, threads_per_worker=1, processes=True)
        return Client(cluster)
    try:
        return Client(scheduler, timeout=30)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"The scheduler {scheduler} does not answer: {error}.", "Check its address.") from error
