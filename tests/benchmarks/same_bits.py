"""Same bits at each number of threads: `python -m tests.benchmarks.same_bits [SCENE ...] [--steps N] [--page FILE]`.

Each scene runs with solver.repeatable = true in a process of its own on one thread, on two, and on two again: after
every step the bits of the positions are compared, and at the end the numbers of Newton iterations.
"""

import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from functools import reduce
from itertools import islice
from pathlib import Path
from time import process_time

from clothsim.base.text import text_table
from tests.benchmarks.stored_tables import markdown_table, write_between

ROOT = Path(__file__).resolve().parents[2]
THREADS = (1, 2, 2)
SLEEP = {"KMP_BLOCKTIME": "0"}
"""OpenMP threads that wait sleep, where by default they count on: the same bits for less of a busy machine."""
MARK = "same-bits"
HEADER = (
    "scene",
    "vertices",
    "steps, of which in contact",
    "iterations + on patches",
    "bitwise identical",
    "CPU s with 1, 2 and 2 threads",
)


@dataclass(frozen=True)
class Trace:
    """A run: vertices, a digest of the positions after each step, the number of steps that end in contact, Newton
    iterations of all vertices and of patches, seconds of the processor.
    """

    vertices: int
    steps: tuple[str, ...]
    in_contact: int
    iterations: int
    patch_iterations: int
    seconds: float


@dataclass(frozen=True)
class Comparison:
    """The runs of a scene in the order of THREADS; reason: why there are none."""

    scene: str
    traces: tuple[Trace, ...]
    reason: str = ""

    @property
    def same(self) -> bool:
        """True where all runs have the same bits after each step, and the same numbers of iterations."""
        return len({(trace.steps, trace.iterations, trace.patch_iterations) for trace in self.traces}) == 1

    @property
    def first_difference(self) -> int:
        """The first step, from 1, after which the bits differ; 0 for none."""
        rows = zip(*(trace.steps for trace in self.traces), strict=False)
        return next((number for number, row in enumerate(rows, 1) if len(set(row)) > 1), 0)


def trace(file: Path, threads: int, steps: int, repeatable: bool = True, overrides: Sequence[str] = ()) -> Trace:
    """Take steps of a scene in this process; steps 0: all of them."""
    from clothsim.run.session import prepare
    from clothsim.scene import paths
    from clothsim.scene.assembly.scene_world import build
    from clothsim.scene.paths import override
    from clothsim.scene.toml_file import load_scene
    from clothsim.solve.stepping import time_loop
    from clothsim.solve.stepping.state import first_state

    scene = reduce(override, overrides, load_scene(file))
    for key, value in (("threads", threads), ("repeatable", repeatable)):
        scene = paths.replace(scene, f"solver.{key}", value)
    session = prepare(scene, build(scene))
    run, began = scene.run_settings, process_time()
    state = first_state(session.built.world, session.integrator.dt)
    found = time_loop.steps(session.integrator, state, run.duration, run.frames_per_second, run.until)
    digests, touching, whole, patches = [], 0, 0, 0
    for report in islice(found, steps or None):
        digests.append(hashlib.blake2b(report.state.positions.tobytes(), digest_size=8).hexdigest())
        touching += math.isfinite(report.minimum_gap)
        whole += report.result.iterations
        patches += report.result.elimination_iterations
    vertices, seconds = session.integrator.system.base.n_vertices, process_time() - began
    return Trace(vertices, tuple(digests), touching, whole, patches, seconds)


def compare(file: Path, steps: int, repeatable: bool = True, overrides: Sequence[str] = ()) -> Comparison:
    """Run a scene for each of THREADS, each in a process of its own."""
    traces = []
    for threads in THREADS:
        given = {"file": str(file), "threads": threads, "steps": steps, "repeatable": repeatable}
        work = json.dumps({**given, "overrides": list(overrides)})
        command = [sys.executable, "-m", "tests.benchmarks.same_bits", "--work", work]
        done = subprocess.run(command, cwd=ROOT, env=os.environ | SLEEP, capture_output=True, text=True, check=False)
        if done.returncode:
            return Comparison(file.stem, (), done.stderr.strip().splitlines()[-1])
        numbers = json.loads(done.stdout.splitlines()[-1])
        traces.append(Trace(**{**numbers, "steps": tuple(numbers["steps"])}))
    return Comparison(file.stem, tuple(traces))


def cells_of(one: Comparison) -> list[str]:
    """A line of the table."""
    if not one.traces:
        return [one.scene, "", "", "", one.reason, ""]
    first = one.traces[0]
    verdict = "yes" if one.same else f"no, from step {one.first_difference}"
    iterations = f"{first.iterations} + {first.patch_iterations}"
    seconds = ", ".join(f"{trace.seconds:.1f}" for trace in one.traces)
    return [one.scene, f"{first.vertices:,}", f"{len(first.steps)}, {first.in_contact}", iterations, verdict, seconds]


def main(argv: Sequence[str] | None = None) -> int:
    """Compare, print the table, and keep it where asked; 1 where bits differ."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.same_bits", description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=Path, nargs="*", metavar="SCENE", help="files; default: all of scenes/")
    parser.add_argument("--steps", type=int, default=10, metavar="N", help="steps of each (default 10); 0: whole runs")
    parser.add_argument("--any-order", action="store_true", help="without solver.repeatable: what it is for")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of every scene")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the table between FILE's marks")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.work:
        print(json.dumps(asdict(_work(json.loads(arguments.work)))))
        return 0
    files = [file.resolve() for file in arguments.scenes] or sorted(ROOT.glob("scenes/*.toml"))
    found = []
    for file in files:
        found.append(compare(file, arguments.steps, not arguments.any_order, arguments.set))
        print("\t".join(cells_of(found[-1])), flush=True)
    rows = [cells_of(one) for one in found]
    print(text_table(HEADER, rows))
    if arguments.page is not None:
        text = f"Measured on {date.today().isoformat()}.\n\n{markdown_table(HEADER, rows)}"
        write_between(arguments.page, MARK, text)
    return int(not all(one.same for one in found if one.traces))


def _work(given: Mapping[str, object]) -> Trace:
    return trace(**{**given, "file": Path(str(given["file"]))})  # type: ignore[arg-type]


if __name__ == "__main__":
    sys.exit(main())
