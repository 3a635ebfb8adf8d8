"""Pool of single-threaded worker processes that run jobs until a deadline."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from time import monotonic
from typing import Any

ONE_THREAD = ("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
TICK = 0.2


@dataclass(frozen=True)
class Job:
    """A scene's text, that of the one to warm up with, the file of the arrays, and the jitter's seed."""

    scene: str
    warm: str
    target: Path
    seed: int = 0


Answer = dict[str, Any]
Runner = Callable[[Sequence[Job], Callable[[Job], bool], float], Iterator[tuple[Job, Answer | None]]]
"""Runs jobs in their order: asks of each, when it is its turn, whether it still fits, and stops all at a deadline.

Yields each with its answer as it comes; None for one that was not begun or not finished.
"""


@dataclass
class _Process:
    """A worker and the thread that waits for its answers."""

    answers: "Queue[tuple[_Process, Answer]]"
    process: "subprocess.Popen[str] | None" = None
    job: Job | None = None

    def give(self, job: Job) -> None:
        self.job = job
        if self.process is None:
            self.process = _started()
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


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def worker_processes(count: int) -> "Iterator[Runner]":
    """A runner with `count` processes, which start with their first job and end with the context."""
    answers: Queue[tuple[_Process, Answer]] = Queue()
    processes = [_Process(answers) for _ in range(count)]

    def run(jobs: Sequence[Job], fits: Callable[[Job], bool], deadline: float) -> Iterator[tuple[Job, Answer | None]]:
        waiting = list(jobs)
        while True:
            for worker in processes:
                while worker.job is None and waiting:
                    job = waiting.pop(0)
                    if monotonic() < deadline and fits(job):
                        worker.give(job)
                    else:
                        yield job, None
            if all(worker.job is None for worker in processes):
                return
            try:
                worker, answer = answers.get(timeout=TICK)
            except Empty:
                if monotonic() >= deadline:
                    for worker in processes:
                        if worker.job is not None:
                            job, worker.job = worker.job, None
                            worker.stop()
                            yield job, None
                continue
            if worker.job is not None:
                job, worker.job = worker.job, None
                yield job, answer

    try:
        yield run
    finally:
        for worker in processes:
            worker.stop()


def _started() -> "subprocess.Popen[str]":
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1")}
    command = [sys.executable, "-c", "from clothsim.accuracy.worker import main; main()"]
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
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
