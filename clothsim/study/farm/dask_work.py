"""Work on a farm by Dask workers (extra clothsim[farm]): tasks return ids, and what is true is on the disk."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from itertools import islice
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import InputError, MissingPackageError
from clothsim.study.farm.claims import Worker, worker_of
from clothsim.study.farm.plan import Farm, Job, open_farm
from clothsim.study.farm.work import ATTEMPTS, PAUSE, make

if TYPE_CHECKING:
    from distributed import Client

FRUITLESS = 100
"""Rounds in a row without a new drape, with waits of up to 30 s for a lost scheduler, before the work ends."""
AHEAD = 4
"""Tasks given to a scheduler for each thread of its workers: it holds a few hundred ids, not the whole farm."""


def work_with_dask(
    farm: Farm,
    scheduler: str | None,
    workers: int,
    most_attempts: int = ATTEMPTS,
    announce: Callable[[str], None] | None = None,
    stale_after: float = Worker.stale_after,
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
    stale_after : float
        Without a heartbeat for this time a claim is taken over [s].

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
            done = farm.published()
            left = [job for job in farm.jobs if job.id not in done]
            if not left:
                return
            _round(connect, farm, left, most_attempts, stale_after)
            fruitless = 0 if len(farm.published()) > len(done) else fruitless + 1
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
    from distributed import as_completed

    directory, jobs = str(farm.directory.resolve()), iter(left)

    def submit(client: "Client", number: int) -> list[Any]:
        given = [(directory, job.id, most_attempts, stale_after) for job in islice(jobs, number)]
        return [client.submit(make_one, *each, pure=False) for each in given]

    with suppress(OSError, RuntimeError, TimeoutError), connect() as client:  # CommClosedError is an OSError
        running = as_completed(
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
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingPackageError(
            "--workers and --scheduler need the package distributed, which is not installed.",
            "pip install 'clothsim[farm]', or start `clothsim farm work DIR` as often as you have cores.",
        ) from error
    if scheduler is None:
        with LocalCluster(n_workers=workers, threads_per_worker=1, processes=True) as cluster:
            yield lambda: Client(cluster)
        return
    try:
        Client(scheduler, timeout=30).close()
    except (OSError, ValueError) as error:
        raise InputError(f"The scheduler {scheduler} does not answer: {error}.", "Check its address.") from error
    yield lambda: Client(scheduler, timeout=30)
