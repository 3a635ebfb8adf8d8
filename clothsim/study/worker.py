"""Worker process of a study: jobs as JSON lines in, results as JSON lines out.

A job is {scene, warm, target, seed}: the scene's text, that of one to run before a first job (it compiles and loads
what both need), where the arrays go (.npz), the seed of the jitter (0: none). The answer is {seconds, wall_seconds,
warmup_seconds, counts, energy, estimate, failed}; estimate: {temporal, newton} of the certificate [m]. Seconds are the
processor's, of this process alone, so that what runs beside it stays out of them (but for shared caches and clock
rates).
"""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory
from threading import Thread
from time import perf_counter, process_time
from typing import Any

import numpy as np

from clothsim import Scene, simulate
from clothsim.base.record import to_json
from clothsim.engine import cloths_at_start
from clothsim.files import write_obj

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
    warm = 0.0
    while True:
        job = json.loads(jobs.get())
        if not warm:
            started = process_time()
            answer({**job, "scene": job["warm"], "seed": 0})
            warm = process_time() - started
        print(json.dumps({"warmup_seconds": warm, **answer(job)}), file=answers, flush=True)


def _read(jobs: "Queue[str]") -> None:
    """Queue each line of the input; at its end the study is no more, and a run that nobody waits for ends at once."""
    for line in sys.stdin:
        jobs.put(line)
    os._exit(0)


def answer(job: dict[str, Any]) -> dict[str, Any]:
    """Run one job; an error of any kind is an answer with a sentence."""
    try:
        return _run(job)
    except Exception as error:
        return {"failed": f"{type(error).__name__}: {error}"}


def _run(job: dict[str, Any]) -> dict[str, Any]:
    with TemporaryDirectory(prefix="clothsim-study-") as folder:
        scene = Scene.from_text(job["scene"])
        if job["seed"]:
            scene = replace(scene, seed=_jittered(scene, job["seed"], Path(folder)))
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
        failed = _failure(run.status, run.reason, record)
        if not failed:
            Path(job["target"]).parent.mkdir(parents=True, exist_ok=True)
            _write(Path(job["target"]), session[0].built.world, run.positions(-1))
        summary = run.summary
        counts = {name: summary[name] for name in ("newton_iterations", "steps", "linear_solves", "peak_memory_bytes")}
        energy = record[-1]["energy"] if record else None
        estimate = {name: _number(summary["certificate"]["error_estimate"][name]) for name in ("temporal", "newton")}
    times = {"seconds": seconds, "wall_seconds": wall, "timed": len(timed)}
    done = {**times, "counts": counts, "energy": energy, "estimate": estimate, "failed": failed}
    plain: dict[str, Any] = json.loads(to_json(done))
    return plain


def _number(value: Any) -> float | None:
    """A number of the certificate; None where it holds a sentence instead."""
    return value if isinstance(value, float) else None


def _failure(status: str, reason: str, record: list[dict[str, Any]]) -> str:
    """Reason to reject a run as a data point: it failed, or a capped or stopped solve was repeated with another dt."""
    if status != "completed":
        return reason
    retried = next((entry for entry in record if entry["failures"]), None)
    if retried is None:
        return ""
    count = sum(bool(entry["failures"]) for entry in record)
    return f"{count} of its steps had to be repeated, first step {retried['step']}: {retried['failures'][0]}"


def _write(target: Path, world: Any, positions: Any) -> None:
    arrays = {"positions": positions}
    for k, cloth in enumerate(world.cloths):
        arrays[f"rest_{k}"], arrays[f"triangles_{k}"] = cloth.rest_positions, cloth.triangles
    np.savez(target, **arrays)


def _jittered(scene: Any, seed: int, folder: Path) -> dict[str, Any]:
    """The [seed] of `scene` with each vertex of its start moved by up to JITTER of the size, at random."""
    start, triangles = cloths_at_start(scene)
    amplitude = JITTER * float(np.linalg.norm(np.ptp(start, axis=0)))
    moved = start + np.random.default_rng(seed).uniform(-amplitude, amplitude, start.shape)
    untangling = {key: value for key, value in scene.seed.items() if key == "untangle"}
    return {**untangling, "from": "file", "file": str(write_obj(folder / "start.obj", moved, triangles))}


if __name__ == "__main__":
    main()
