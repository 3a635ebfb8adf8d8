"""Work on a farm by workers of Dask (extra clothsim[farm]): tasks are given out until all drapes are published.

A task makes a drape where nobody does and returns its id alone. Whatever is killed, what counts is on the disk: what is
not published is given out again.
"""

import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import ClothsimError, InputError, MissingPackageError
from clothsim.study.farm.claims import Worker, claims_of, worker_of
from clothsim.study.farm.plan import DrapeJob, Farm, open_farm
from clothsim.study.farm.publication import note_attempt
from clothsim.study.farm.work import ATTEMPTS, PAUSE, make

if TYPE_CHECKING:
    from distributed import Client

AHEAD = 4
"""Tasks given to a scheduler for each thread of its workers: it holds a few hundred ids, not the whole farm."""
TICK = 0.2
"""Time between two looks at the workers and at what they have done [s]."""
PATIENCE = 60.0
"""A scheduler that does not answer for this time is lost [s]."""
HOST = "127.0.0.1"
"""Address of the scheduler and of own workers: whoever reaches a port of theirs runs code of his."""
DASK_WORKER = "distributed.cli.dask_worker"
GRACE = 5.0
"""Time that a worker has to end by itself [s]."""
FRUITLESS = 20
"""Rounds in a row, or deaths of own workers, without a new drape, before the work ends."""


class LostWorkersError(ClothsimError):
    """The scheduler or its workers are gone, and do not come back: the remedy names what to start again."""


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

    scheduler: its address; None: a scheduler in this process, and `workers` processes with one thread each, which are
    started again when they end; announce: called with the address of a scheduler's dashboard; stale_after: without a
    heartbeat for this time a claim is taken over [s].

    Raises
    ------
    MissingPackageError
        Where distributed is not installed.
    InputError
        Where the scheduler does not answer at the start.
    LostWorkersError
        Where the scheduler is gone for longer than PATIENCE, or no drape comes from the workers any more.

    Notes
    -----
    Dask reruns tasks whose worker died, and gives a task up after some deaths, also one that was innocent: neither
    matters, as a task only makes what is not published, and what is not published is given out again.
    """
    with ExitStack() as stack:
        stack.enter_context(_quiet_client())
        own = None
        if scheduler is None:
            own = stack.enter_context(_own_workers(farm, workers))
        else:
            _greet(scheduler, announce)
        address = scheduler or (own.address if own else "")
        fruitless = 0
        while waiting := farm.unpublished():
            error = _round(address, own, farm, list(waiting.values()), most_attempts, stale_after)
            fruitless = 0 if len(farm.unpublished()) < len(waiting) else fruitless + 1
            if fruitless and isinstance(error, ClothsimError):
                raise error
            if fruitless >= FRUITLESS:
                raise LostWorkersError(
                    f"{FRUITLESS} times in a row no drape came from the workers ({error or 'they do not answer'}).",
                    f"Check their messages; `clothsim farm work {farm.directory}` continues.",
                )
            if fruitless:
                sleep(PAUSE)


def _greet(scheduler: str, announce: Callable[[str], None] | None) -> None:
    """Announce the dashboard of a scheduler. InputError where it does not answer."""
    try:
        with dask_package().Client(scheduler, timeout=30) as client:
            if announce is not None:
                announce(client.dashboard_link)
    except (OSError, ValueError) as error:
        raise InputError(f"The scheduler {scheduler} does not answer: {error}.", "Check its address.") from error


@contextmanager
def _quiet_client() -> Iterator[None]:
    """Within the block Dask's client prints no traceback where it loses a scheduler: there is a sentence for that."""
    dask_package()  # which sets the levels of its loggers
    client = logging.getLogger("distributed.client")
    before = client.level
    client.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        client.setLevel(before)


@contextmanager
def _connected(address: str, farm: Farm) -> "Iterator[Client]":
    """A connection to a scheduler, which may be away for PATIENCE. LostWorkersError where it is for longer."""
    end = monotonic() + PATIENCE
    while True:
        try:
            client = dask_package().Client(address, timeout=5)
            break
        except (OSError, TimeoutError) as error:
            if monotonic() > end:
                left = len(farm.unpublished())
                raise LostWorkersError(
                    f"The scheduler {address} is gone: {left} of {len(farm.jobs)} drapes are left.",
                    "Start it and its workers again, then run the same command again.",
                ) from error
            sleep(PAUSE)
    try:
        yield client
    finally:
        with suppress(OSError, RuntimeError, TimeoutError):
            client.close(timeout=2)


def _round(
    address: str,
    own: "OwnWorkers | None",
    farm: Farm,
    left: Sequence[DrapeJob],
    most_attempts: int,
    stale_after: float,
) -> BaseException | None:
    """Give out all drapes that are left, once, or until the scheduler is lost; the last error of a task.

    A task that failed as Dask counts (its workers died) is given out again by the next round.
    """
    directory, jobs, error = str(farm.directory.resolve()), iter(left), None

    def submit(client: "Client", number: int) -> list[Any]:
        given = [(directory, job.id, most_attempts, stale_after) for job in islice(jobs, number)]
        return [client.submit(make_one, *each, pure=False) for each in given]

    with suppress(OSError, RuntimeError, TimeoutError), _connected(address, farm) as client:  # a lost scheduler
        threads = own.count if own else sum(client.nthreads().values())
        running = dask_package().as_completed(submit(client, AHEAD * max(1, threads)))
        end = monotonic() + Worker().longest
        while not running.is_empty() and monotonic() < end:
            if own:
                own.keep()
            if not running.has_ready():
                sleep(TICK)
            for future in running.next_batch(block=False):
                if future.cancelled():
                    return error
                if future.status == "error":
                    error = future.exception(timeout=5)
                future.release()
                running.update(submit(client, 1))
    return error


def make_one(directory: str, name: str, most_attempts: int, stale_after: float = Worker.stale_after) -> str:
    """Task of a Dask worker: make one drape where nobody does. Returns its id."""
    farm, jobs, worker = _opened(directory, stale_after)
    make(farm, jobs[name], worker, most_attempts)
    return name


@cache
def _opened(directory: str, stale_after: float) -> tuple[Farm, dict[str, DrapeJob], Worker]:
    """Farm, its drapes by id, and this process as a worker: read once by each process."""
    farm = open_farm(Path(directory))
    return farm, {job.id: job for job in farm.jobs}, worker_of(stale_after)


@dataclass
class OwnWorkers:
    """Worker processes of a scheduler on this machine: whichever ends is started again.

    Attributes
    ----------
    address : str
        Of the scheduler.
    scratch : str
        Folder of their temporary files.
    count : int
        Number of processes.
    farm : Farm
        Whose drapes they make: many deaths without a new one end the work.
    """

    address: str
    scratch: str
    count: int
    farm: Farm
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)
    deaths: int = 0
    published: int = -1

    def keep(self) -> None:
        """Start what is not running. LostWorkersError after FRUITLESS deaths of each without a new drape."""
        ended = [each for each in self.processes if each.poll() is not None]
        self.deaths += len(ended)
        if ended and (published := len(self.farm.published())) > self.published:
            self.deaths, self.published = 0, published
        if self.deaths > FRUITLESS * self.count:
            raise LostWorkersError(
                f"The worker processes end again and again, the last one with code {ended[-1].returncode}.",
                f"`clothsim farm work {self.farm.directory}` without --workers shows what happens.",
            )
        self.processes = [each for each in self.processes if each.poll() is None]
        self.processes += [self._started() for _ in range(self.count - len(self.processes))]

    def _started(self) -> subprocess.Popen[bytes]:
        words = ["--host", HOST, "--dashboard-address", f"{HOST}:0", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        words += ["--death-timeout", "60"]
        return subprocess.Popen(
            [sys.executable, "-m", DASK_WORKER, self.address, *words, "--local-directory", self.scratch],
            env={**os.environ, "DASK_LOGGING__DISTRIBUTED": "error"},
            stdin=subprocess.DEVNULL,
        )

    def end(self) -> None:
        """End all; an attempt that is stopped so is not an attempt."""
        for each in self.processes:
            each.terminate()
        limit = monotonic() + GRACE
        for each in self.processes:
            with suppress(subprocess.TimeoutExpired):
                each.wait(timeout=max(0.0, limit - monotonic()))
            each.kill()
            each.wait()
        for claim in claims_of(self.farm.directory / "claims", [each.pid for each in self.processes]):
            note_attempt(self.farm.directory, claim.name, "withdrawn")
            claim.unlink(missing_ok=True)


@contextmanager
def _own_workers(farm: Farm, count: int) -> Iterator[OwnWorkers]:
    """A scheduler in this process, which listens on this machine alone, and its workers."""
    package = dask_package()
    with (
        TemporaryDirectory(prefix="clothsim-farm-", ignore_cleanup_errors=True) as scratch,
        package.LocalCluster(n_workers=0, processes=True, dashboard_address=None, host=HOST) as cluster,
    ):
        own = OwnWorkers(cluster.scheduler_address, scratch, count, farm)
        try:
            own.keep()
            yield own
        finally:
            own.end()
