"""Worker processes of a study: a pool of single-threaded ones that run jobs while there is time.

A job goes to a worker, and its answer comes back, as a line of JSON. A job is {scene, warm, target, seed}: the scene's
text, that of one to run before a first job (it compiles and loads what both need), where the arrays go (.npz), the seed
of the jitter (0: none). The answer is {seconds, wall_seconds, warmup_seconds, counts, energy, estimate, failed};
estimate: {temporal, newton} of the certificate [m]. Seconds are the processor's, of this process alone, so that what
runs beside it stays out of them (but for shared caches and clock rates). Beside the answers a worker says a few times a
second what its process has taken so far, {processor}: that is what a budget counts.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory
from threading import Lock, Thread
from time import perf_counter, process_time, sleep
from typing import Any, TextIO

import numpy as np

from clothsim import Scene, simulate
from clothsim.base.record import to_json
from clothsim.engine import cloths_at_start

ONE_THREAD = ("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
TEMPORARY = ("TMPDIR", "TEMP", "TMP")
TICK = 0.2


@dataclass(frozen=True)
class PointJob:
    """A scene's text, that of the one to warm up with, the file of the arrays, and the jitter's seed."""

    scene: str
    warm: str
    target: Path
    seed: int = 0


class ProcessorTime:
    """CPU seconds of this process since now, and of the workers that it has started."""

    def __init__(self) -> None:
        self.started, self.of_workers, self.lock = process_time(), 0.0, Lock()

    def add(self, seconds: float) -> None:
        """Count more seconds of a worker."""
        with self.lock:
            self.of_workers += seconds

    def seconds(self) -> float:
        """All CPU seconds so far [s]."""
        return process_time() - self.started + self.of_workers


Answer = dict[str, Any]
Runner = Callable[
    [Sequence[PointJob], Callable[[PointJob], bool], Callable[[], float]], Iterator[tuple[PointJob, Answer | None]]
]
"""Runs jobs in their order: asks of each, when it is its turn, whether it still fits, and stops all when the function
of the seconds that are left returns none.

Yields each with its answer as it comes; None for one that was not begun or not finished.
"""


@dataclass
class _Process:
    """A worker and the thread that waits for its answers."""

    answers: "Queue[tuple[_Process, Answer]]"
    scratch: str
    spent: ProcessorTime
    process: "subprocess.Popen[str] | None" = None
    job: PointJob | None = None

    def give(self, job: PointJob) -> None:
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
def worker_processes(count: int, spent: ProcessorTime) -> "Iterator[Runner]":
    """A runner with `count` processes, which start with their first job and end with the context; `spent` counts them.

    Their temporary files lie in one directory, which goes with them: a process that is killed leaves none.
    """
    with TemporaryDirectory(prefix="clothsim-study-", ignore_cleanup_errors=True) as scratch:
        answers: Queue[tuple[_Process, Answer]] = Queue()
        processes = [_Process(answers, scratch, spent) for _ in range(count)]

        def run(
            jobs: Sequence[PointJob], fits: Callable[[PointJob], bool], left: Callable[[], float]
        ) -> Iterator[tuple[PointJob, Answer | None]]:
            return _run(processes, answers, list(jobs), fits, left)

        try:
            yield run
        finally:
            for worker in processes:
                worker.stop()


def _run(
    processes: Sequence[_Process],
    answers: "Queue[tuple[_Process, Answer]]",
    waiting: list[PointJob],
    fits: Callable[[PointJob], bool],
    left: Callable[[], float],
) -> Iterator[tuple[PointJob, Answer | None]]:
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
    command = [sys.executable, "-c", "from clothsim.study.workers import main; main()"]
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
    before = 0.0
    for line in process.stdout:
        message = json.loads(line)
        if "processor" in message:
            worker.spent.add(message["processor"] - before)
            before = message["processor"]
        else:
            worker.answers.put((worker, message))
    code = process.wait()
    if worker.process is process:
        worker.process = None
        worker.answers.put((worker, {"failed": f"Its process ended with code {code}, perhaps for want of memory."}))


SHORT, TIMES = 1.0, 3
"""A run below so many seconds is timed so often, and the median counts: a short run's time has the most noise."""
JITTER = 1e-6
"""Largest perturbation of a jittered start, relative to the size of the cloth."""


def main() -> None:
    """Serve until the input ends. Printed text goes to stderr: stdout is for answers only."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    jobs: Queue[str] = Queue()
    Thread(target=_read, args=(jobs,), daemon=True).start()
    lock = Lock()
    Thread(target=_count, args=(answers, lock), daemon=True).start()
    warm = 0.0
    while True:
        job = json.loads(jobs.get())
        if not warm:
            started = process_time()
            answer({**job, "scene": job["warm"], "seed": 0})
            warm = process_time() - started
        _write_message(answers, lock, {"warmup_seconds": warm, **answer(job)})


def _write_message(answers: TextIO, lock: Lock, line: dict[str, Any]) -> None:
    """Write a line of JSON, after what the process has taken so far, where it is an answer."""
    lines = [{"processor": process_time()}, line] if "processor" not in line else [line]
    with lock:
        print("\n".join(map(json.dumps, lines)), file=answers, flush=True)


def _count(answers: TextIO, lock: Lock) -> None:
    """Say what the process has taken, as long as it lives."""
    while True:
        sleep(TICK)
        _write_message(answers, lock, {"processor": process_time()})


def _read(jobs: "Queue[str]") -> None:
    """Queue each line of the input; at its end the study is no more, and a run that nobody waits for ends at once."""
    for line in sys.stdin:
        jobs.put(line)
    os._exit(0)


def answer(job: dict[str, Any]) -> dict[str, Any]:
    """Run one job; an error of any kind is an answer with a sentence."""
    try:
        return _run_job(job)
    except Exception as error:
        return {"failed": f"{type(error).__name__}: {error}"}


def _run_job(job: dict[str, Any]) -> dict[str, Any]:
    with TemporaryDirectory(prefix="clothsim-study-") as folder:
        scene = Scene.from_text(job["scene"])
        if job["seed"]:
            scene = replace(scene, seed=jittered(scene, job["seed"], Path(folder)))
        session: list[Any] = []
        timed: list[tuple[float, float]] = []
        for _ in range(TIMES):
            started, processor = perf_counter(), process_time()
            run = simulate(scene, Path(folder) / "run", announce=session.append, overwrite=True)
            timed.append((process_time() - processor, perf_counter() - started))
            if timed[0][0] >= SHORT or run.status != "completed":
                break
        seconds, wall = sorted(timed)[len(timed) // 2]
        record = run.record()
        failed = "" if run.status == "completed" else run.reason
        repeated = [entry for entry in record if entry["failures"]]
        if not failed and repeated:  # a capped or stopped solve was repeated with another dt: no data point either
            first = f"first step {repeated[0]['step']}: {repeated[0]['failures'][0]}"
            failed = f"{len(repeated)} of its steps had to be repeated, {first}"
        if not failed:
            Path(job["target"]).parent.mkdir(parents=True, exist_ok=True)
            arrays: dict[str, Any] = {"positions": run.positions(-1)}
            for k, cloth in enumerate(session[0].built.world.cloths):
                arrays[f"rest_{k}"], arrays[f"triangles_{k}"] = cloth.rest_positions, cloth.triangles
            np.savez(Path(job["target"]), **arrays)
        summary = run.summary
        counts = {name: summary[name] for name in ("newton_iterations", "steps", "linear_solves", "peak_memory_bytes")}
        energy = record[-1]["energy"] if record else None
        errors = {name: summary["certificate"]["error_estimate"][name] for name in ("temporal", "newton")}
        estimate = {name: each if isinstance(each, float) else None for name, each in errors.items()}
    times = {"seconds": seconds, "wall_seconds": wall, "timed": len(timed)}
    done = {**times, "counts": counts, "energy": energy, "estimate": estimate, "failed": failed}
    plain: dict[str, Any] = json.loads(to_json(done))
    return plain


def jittered(scene: Any, seed: int, folder: Path) -> dict[str, Any]:
    """The [seed] of `scene` with each vertex of its start moved by up to JITTER of the size, at random."""
    start, triangles = cloths_at_start(scene)
    amplitude = JITTER * float(np.linalg.norm(np.ptp(start, axis=0)))
    moved = start + np.random.default_rng(seed).uniform(-amplitude, amplitude, start.shape)
    file = folder / "start.obj"
    with file.open("w", encoding="utf-8") as lines:
        np.savetxt(lines, moved, "v %.17g %.17g %.17g")
        np.savetxt(lines, triangles + 1, "f %d %d %d")
    untangling = {key: value for key, value in scene.seed.items() if key == "untangle"}
    return {**untangling, "from": "file", "file": str(file)}


if __name__ == "__main__":
    main()
