"""Measurement of cases in separate processes, alternating with another revision where asked."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from types import TracebackType
from typing import Any, Self

from tests.benchmarks.bench.bench_cases import Case
from tests.benchmarks.bench.leads import lead

WORKER = Path(__file__).with_name("measurement_process.py")
SEARCHES = ("candidates", "CCD")
PHASES = (*SEARCHES, "assembly", "linear solve", "line search", "step control")
"""Parts of a step that belong to no effect alone."""

Measured = dict[str, Any]
"""The medians of a case's trials; {"skipped": reason} where there are none."""

Announcement = Callable[[str], None]
"""Called with a line as each case begins."""


@dataclass
class Worker:
    """A process that takes trials of a case with the package in the folder `root`."""

    root: Path
    job: dict[str, Any]

    def __enter__(self) -> Self:
        path = os.pathsep.join(filter(None, [str(self.root), os.environ.get("PYTHONPATH", "")]))
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(WORKER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            env={**os.environ, "PYTHONPATH": path},
            cwd=self.root,
        )
        ready = self._asked(json.dumps(self.job))
        self.skipped = ready.get("skipped", "")
        if not self.skipped and Path(ready["package"]).parent.resolve() != self.root.resolve():
            self.skipped = f"Python took the package in {ready['package']}."
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is not None:
            self._process.kill()
        self._process.communicate()

    def trial(self) -> Measured:
        """One more trial."""
        return {"skipped": self.skipped} if self.skipped else self._asked("")

    def _asked(self, line: str) -> Measured:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(line, file=self._process.stdin, flush=True)
            return json.loads(self._process.stdout.readline())
        except (OSError, ValueError):
            return {"skipped": f"Its process ended with exit code {self._process.wait()}."}


def measured(case: Case, roots: Sequence[Path], states: Path, repeats: int, announce: Announcement) -> list[Measured]:
    """The medians of a case with the package of each root, their trials taken in turns.

    states: the folder that keeps the states to start from.
    """
    if case.needs is not None and not case.needs.exists():
        return [{"skipped": f"{case.needs.name} is not in {case.needs.parent.name}."} for _ in roots]
    announce(f"{case.name} ...")
    job = _job(case, lead(case, states))
    with ExitStack() as stack:
        workers = [stack.enter_context(Worker(root, job)) for root in roots]
        rounds = [[worker.trial() for worker in workers] for _ in range(1 if case.once else repeats)]
    return [_medians(list(trials)) for trials in zip(*rounds, strict=True)]


def _job(case: Case, state: Path | None) -> dict[str, Any]:
    job: dict[str, Any] = {"kind": case.kind, **case.keys}
    if case.scene is not None:
        scene = json.loads(case.scene.to_text())
        directory = scene.pop("directory")
        scene = {name: section for name, section in scene.items() if section}
        job |= {"scene": scene, "directory": directory, "state": str(state.resolve()) if state else ""}
        job |= {"settle": case.settle, "steps": case.steps}
    return job


def _medians(trials: list[Measured]) -> Measured:
    """Number by number, the median of the trials; of the peak of memory the first, which nothing else raised."""
    for trial in trials:
        if "skipped" in trial:
            return {"skipped": trial["skipped"]}
    found: Measured = {"trials": len(trials)}
    for name, first in trials[0].items():
        values = [trial[name] for trial in trials]
        if isinstance(first, dict):
            parts = {key: median(value.get(key, 0.0) for value in values) for key in first}
            found[name] = {key: value for key, value in parts.items() if value > 0}
        else:
            found[name] = first if name == "peak_memory" or first is None else median(values)
    return found


def each(row: Measured) -> float:
    """Processor seconds of a Newton iteration of the whole cloth: without those of regions."""
    return (row["cpu"] - row.get("regional_cpu", 0.0)) / row["iterations"]


def ratio(row: Measured) -> float | None:
    """Cost of a Newton iteration over that of one direct factorisation and solve of its own matrix."""
    if not row.get("own_solve") or not row.get("iterations"):
        return None
    return each(row) / row["own_solve"]
