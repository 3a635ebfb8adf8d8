"""Pool of single-threaded worker processes that run jobs while there is time."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

ONE_THREAD = ("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
TEMPORARY = ("TMPDIR", "TEMP", "TMP")
TICK = 0.2


@dataclass(frozen=True)
class Job:
    """A scene's text, that of the one to warm up with, the file of the arrays, and the jitter's seed."""

    scene: str
    warm: str
    target: Path
    seed: int = 0


Answer = dict[str, Any]
Runner = Callable[[Sequence[Job], Callable[[Job], bool], Callable[[], float]], Iterator[tuple[Job, Answer | None]]]
"""Runs jobs in their order: asks of each, when it is its turn, whether it still fits, and stops all when the function
of the seconds that are left returns none.

Yields each with its answer as it comes; None for one that was not begun or not finished.
"""


@dataclass
class _Process:
    """A worker and the thread that waits for its answers."""

    answers: "Queue[tuple[_Process, Answer]]"
    scratch: str
    process: "subprocess.Popen[str] | None" = None
    job: Job | None = None

    def give(self, job: Job) -> None:
        self.job = job
        if self.process is None:
            self.process = _started(self.scratch)
            Thread(target=_listen, args=(self, self.process), daemon=True).start()
        pipe = self.process.stdin
        assert pipe is not None
        try:
            pipe.write(json.dumps({**asdict(job), "target": str(job.target)}) + "\n")
            pipe.flush()
        except OSError:  # the process ended: its listener reports it
            return

    def stop(self) -> None:
        process, self.process = self.process, None
        if process is not None:
            process.kill()
            process.wait()


@contextmanager
def worker_processes(count: int) -> "Iterator[Runner]":
    """A runner with `count` processes, which start with their first job and end with the context.

    Their temporary files lie in one directory, which goes with them: a process that is killed leaves none.
    """
    with TemporaryDirectory(prefix="clothsim-study-", ignore_cleanup_errors=True) as scratch:
        answers: Queue[tuple[_Process, Answer]] = Queue()
        processes = [_Process(answers, scratch) for _ in range(count)]

        def run(
            jobs: Sequence[Job], fits: Callable[[Job], bool], left: Callable[[], float]
        ) -> Iterator[tuple[Job, Answer | None]]:
            return _run(processes, answers, list(jobs), fits, left)

        try:
            yield run
        finally:
            for worker in processes:
                worker.stop()


def _run(
    processes: Sequence[_Process],
    answers: "Queue[tuple[_Process, Answer]]",
    waiting: list[Job],
    fits: Callable[[Job], bool],
    left: Callable[[], float],
) -> Iterator[tuple[Job, Answer | None]]:
    """Give the waiting jobs to the processes that are free, and yield what comes back."""
    while True:
        for worker in processes:
            while worker.job is None and waiting:
                job = waiting.pop(0)
                if left() > 0 and fits(job):
                    worker.give(job)
                else:
                    yield job, None
        if all(worker.job is None for worker in processes):
            return
        try:
            worker, answer = answers.get(timeout=TICK)
        except Empty:
            if left() <= 0:
                for worker in processes:
                    if worker.job is not None:
                        job, worker.job = worker.job, None
                        worker.stop()
                        yield job, None
            continue
        if worker.job is not None:
            job, worker.job = worker.job, None
            yield job, answer


def _started(scratch: str) -> "subprocess.Popen[str]":
    """A worker in a session of its own: a signal to the study's process group is the study's to act on."""
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1"), **dict.fromkeys(TEMPORARY, scratch)}
    command = [sys.executable, "-c", "from clothsim.study.worker import main; main()"]
    return subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=environment,
        start_new_session=True,
    )


def _listen(worker: _Process, process: "subprocess.Popen[str]") -> None:
    """Queue each answer; at the end of the output the exit code, unless the process was stopped."""
    assert process.stdout is not None
    for line in process.stdout:
        worker.answers.put((worker, json.loads(line)))
    code = process.wait()
    if worker.process is process:
        worker.process = None
        worker.answers.put((worker, {"failed": f"Its process ended with code {code}, perhaps for want of memory."}))
