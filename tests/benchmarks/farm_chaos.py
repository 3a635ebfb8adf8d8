"""Farm under kills: `python -m tests.benchmarks.farm_chaos -o DIR --count 200`.

Workers of a farm are killed by SIGKILL at random while they make drapes of a shirt on bodies of varied shape; with
--dask the scheduler is killed twice, too. Then: are all drapes published, none twice, none torn, and do a sample of
them have the same bytes as in a farm left alone? A poison drape kills each process that makes it. Throughput is the
processor time of drapes by `simulate` alone over that of the same drapes by the farm, in one warm process.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import process_time
from typing import Any

from clothsim import register_effect, simulate
from clothsim.base.errors import ClothsimError
from clothsim.physics.energies.base import Energy
from clothsim.scene.effects import EFFECTS
from clothsim.scene.scene import Scene
from clothsim.scene.toml_file import load_scene
from clothsim.study.farm.claims import Worker
from clothsim.study.farm.plan import Farm, open_farm, plan
from clothsim.study.farm.reading import CLOTH, read_drape
from clothsim.study.farm.recipe import Recipe, make_recipe
from clothsim.study.farm.status import status
from clothsim.study.farm.verification import verify
from clothsim.study.farm.work import make, work

ROOT = Path(__file__).parents[2]

SETTINGS = {
    "cloth.edge": 0.04,
    "effects.bending.model": "hinge",
    "effects.damping.rate": 10.0,
    "solver.dt": 0.05,
    "solver.integrator": "backward_euler",
    "run.duration": 4.0,
    "run.frames_per_second": 5,
    "run.rest_speed": 5e-3,
}
"""The cheapest shirt that comes to rest in a certified way: 505 vertices, about 2 s of processor time."""

BODY = {
    "height": (1.6, 1.8),
    "chest": (0.95, 1.08),
    "waist": (0.92, 1.1),
    "hips": (0.95, 1.1),
    "limb_girth": (0.95, 1.05),
}
"""Intervals of the measures of the body, to which the shirt is cut."""


def shirt_recipe(count: int, seed: int = 0) -> Recipe:
    """Shirts cut to bodies of varied shape."""
    vary: dict[str, Any] = {f"body.{name}": {"uniform": list(box)} for name, box in BODY.items()}
    vary |= {f"cloth.{name}": f"=body.{name}" for name in BODY}
    farm = {"count": count, "seed": seed, "licence": "CC0-1.0"}
    return make_recipe(load_scene("shirt"), farm, SETTINGS, vary)


def sheet_recipe(count: int, seed: int = 0) -> Recipe:
    """Sheets of 36 vertices on a ball, for tests."""
    cells = {"cloth.cells": [5, 5], "body.subdivisions": 1, "run.duration": 0.3, "run.frames_per_second": 10}
    vary = {"cloth.density": {"uniform": [0.1, 0.3]}, "body.radius": {"uniform": [0.25, 0.3]}}
    farm = {"count": count, "seed": seed, "until": "time"}
    return make_recipe(load_scene("sphere"), farm, {**cells, "solver.dt": 0.05}, vary)


RECIPES = {"shirt": shirt_recipe, "sheet": sheet_recipe}


@dataclass
class Processes:
    """The processes of a farm under kills."""

    farm: Path
    workers: int
    most_attempts: int
    address: str = ""
    running: list[subprocess.Popen[bytes]] = field(default_factory=list)
    scheduler: subprocess.Popen[bytes] | None = None
    driver: subprocess.Popen[bytes] | None = None

    def keep(self) -> None:
        """Start what is not running."""
        if self.address and _ended(self.scheduler):
            port = self.address.rpartition(":")[2]
            self.scheduler = python("-m", "distributed.cli.dask_scheduler", "--port", port, "--no-dashboard")
            time.sleep(5)
        if self.address and _ended(self.driver):
            words = ("--scheduler", self.address, "--attempts", str(self.most_attempts), "--quiet")
            self.driver = python("-m", "clothsim", "farm", "work", str(self.farm), *words)
        self.running = [each for each in self.running if not _ended(each)]
        while len(self.running) < self.workers:
            self.running.append(self._worker())

    def _worker(self) -> subprocess.Popen[bytes]:
        if self.address:
            words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60")
            return python("-m", "distributed.cli.dask_worker", self.address, *words)
        words = ("--attempts", str(self.most_attempts), "--quiet")
        return python("-m", "clothsim", "farm", "work", str(self.farm), *words)

    def kill_one(self, chance: random.Random) -> None:
        """Kill a random worker."""
        victim = chance.choice(self.running)
        victim.send_signal(signal.SIGKILL)
        victim.wait()

    def end(self) -> None:
        """End all that is still running."""
        for each in (*self.running, self.driver, self.scheduler):
            if each is not None and not _ended(each):
                each.send_signal(signal.SIGKILL)
                each.wait()


def chaos(farm: Farm, processes: Processes, period: float, seconds: float, seed: int = 0) -> dict[str, int]:
    """Let workers make a farm and kill one at random after every `period`; the number of kills.

    period: processor time of all workers [s], so that a busy machine kills as often per drape as a quiet one.
    seconds: wall time after which it ends, whatever is left.
    """
    chance = random.Random(seed)
    kills = {"workers": 0, "schedulers": 0}
    planned, end, ended = len(farm.jobs), time.monotonic() + seconds, 0.0
    try:
        while len(farm.published()) < planned and time.monotonic() < end:
            processes.keep()
            time.sleep(0.2)
            running = processor_time([each.pid for each in processes.running])
            if running - ended >= period and processes.running:
                processes.kill_one(chance)
                kills["workers"] += 1
                ended = processor_time([each.pid for each in processes.running if not _ended(each)])
            third = planned * (kills["schedulers"] + 1) / 3
            if processes.scheduler and kills["schedulers"] < 2 and len(farm.published()) > third:
                processes.scheduler.send_signal(signal.SIGKILL)
                processes.scheduler.wait()
                kills["schedulers"] += 1
    finally:
        processes.end()
    return kills


def compared(farm: Farm, alone: Farm) -> tuple[int, int]:
    """Number of drapes that both farms have, and of those with the same bytes."""
    both = sorted(farm.published() & alone.published())
    files = [(farm.directory / "drapes" / name / CLOTH, alone.directory / "drapes" / name / CLOTH) for name in both]
    return len(both), sum(one.read_bytes() == other.read_bytes() for one, other in files)


def left_alone(directory: Path, recipe: Recipe, count: int) -> tuple[Farm, float, float]:
    """A farm of the first drapes, in this process; processor time of `simulate` alone and of the farm [s]."""
    alone = plan(recipe, directory)
    worker, plain, made = Worker(), 0.0, 0.0
    _simulated(alone.scene_of(alone.jobs[-1]), directory / "warm")
    for job in alone.jobs[:count]:
        began = process_time()
        _simulated(alone.scene_of(job), directory / "plain")
        between = process_time()
        make(alone, job, worker)
        plain, made = plain + between - began, made + process_time() - between
    for name in ("warm", "plain"):
        shutil.rmtree(directory / name, ignore_errors=True)
    return alone, plain, made


def _simulated(scene: Scene, folder: Path) -> None:
    """Simulate; a farm publishes a refused scene as a failed drape, so that both do the same work here."""
    with suppress(ClothsimError):
        simulate(scene, folder, overwrite=True)


def register_poison() -> None:
    """Register the effect "poison", whose builder kills the process."""

    def build(world: Any, *, strength: float = 1.0) -> Energy:
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError(world, strength)

    if "poison" not in EFFECTS:
        register_effect("poison", build)


def poisoned(directory: Path) -> tuple[int, dict[str, Any]]:
    """Number of processes that a poison drape killed, and its published summary."""
    register_poison()
    scene = sheet_recipe(1).scene
    scene = Scene(scene.cloth, scene.body, {**scene.effects, "poison": {}}, scene.solver, run=scene.run)
    farm = plan(make_recipe(scene, {"count": 1, "until": "time"}, {}, {}), directory)
    killed = 0
    for _ in range(10):
        if python("-m", "tests.benchmarks.farm_chaos", "--work", str(directory)).wait() == 0:
            break
        killed += 1
    return killed, read_drape(farm.directory, farm.jobs[0].id)[0]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the farm under kills and print a report as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("results/farm_chaos"))
    parser.add_argument("--recipe", choices=sorted(RECIPES), default="shirt")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--attempts", type=int, default=20)
    parser.add_argument(
        "--period", type=float, default=20.0, help="processor time of the workers between two kills [s]"
    )
    parser.add_argument("--limit", type=float, default=3600.0, help="of the whole, wall time [s]")
    parser.add_argument("--compare", type=int, default=10, help="drapes that are made again in a farm left alone")
    parser.add_argument("--dask", metavar="ADDRESS", default="", help="tcp://127.0.0.1:PORT of a scheduler to start")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.work is not None:
        register_poison()
        work(open_farm(given.work))
        return 0
    recipe = RECIPES[given.recipe](given.count)
    farm = plan(recipe, given.output / "farm")
    began = time.monotonic()
    kills = chaos(farm, Processes(farm.directory, given.workers, given.attempts, given.dask), given.period, given.limit)
    wall = time.monotonic() - began
    alone, plain, made = left_alone(given.output / "alone", recipe, given.compare)
    both, same = compared(farm, alone)
    killed, poison = poisoned(given.output / "poison")
    report = {
        "planned": len(farm.jobs),
        "kills": kills,
        "wall_seconds": wall,
        **asdict(status(farm)),
        "torn": verify(farm, fraction=0.0).torn,
        "attempts": sum((farm.directory / "attempts" / job.id).read_text().count("started") for job in farm.jobs),
        "compared": both,
        "same_bytes": same,
        "throughput": plain / made if made else None,
        "poison": {"killed": killed, "cause": poison["cause"], "reason": poison["reason"]},
    }
    (given.output / "report.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    print(json.dumps(report, indent=1))
    return 0 if report["published"] == report["planned"] and both == same and not report["torn"] else 1


def _ended(process: subprocess.Popen[bytes] | None) -> bool:
    return process is None or process.poll() is not None


def python(*words: str, **options: Any) -> subprocess.Popen[bytes]:
    """Start Python in this clone, with one thread; options: of Popen."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, **threads, "PYTHONPATH": path}
    return subprocess.Popen([sys.executable, *words], env=environment, cwd=ROOT, **options)


def processor_time(processes: Sequence[int]) -> float:
    """Processor time of running processes, by their numbers [s]; none where the system does not tell."""
    total = 0.0
    for pid in processes:
        try:
            fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        except OSError:
            continue
        total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total


if __name__ == "__main__":
    sys.exit(main())
