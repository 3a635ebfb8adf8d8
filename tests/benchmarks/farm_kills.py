"""The command `farm work` under kills: `python -m tests.benchmarks.farm_kills -o DIR`.

1. `farm work DIR --workers 2`, whose worker processes are killed by SIGKILL: two as they start, then one at random
   whenever all of them together have had the processor for four drape times since the last one. It must end with 0 and
   every drape usable.
2. `farm work DIR --scheduler ADDRESS`, whose scheduler is killed when a third of the drapes is published. It must end
   with 1 and one sentence; the same command, once the scheduler and a worker run again, with 0 and every drape usable.
3. `farm work DIR`, twice; one is suspended (SIGSTOP) for longer than --stale within a drape, then goes on. Both must
   end with 0 and every drape usable.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clothsim.study.farm.dask_work import DASK_WORKER
from clothsim.study.farm.plan import Farm, plan
from clothsim.study.farm.status import status
from clothsim.study.farm.verification import verify
from tests.benchmarks.farm_chaos import RECIPES, processor_time, python

APART = 4
"""Drape times between two kills."""


def killed_workers(farm: Farm, drape_time: float, limit: float, seed: int = 0) -> dict[str, Any]:
    """The command with two workers of its own; drape_time: processor time of a drape [s]."""
    chance, kills, ended = random.Random(seed), {"starting": 0, "working": 0}, 0.0
    command, end = _work(farm, "--workers", "2"), time.monotonic() + limit
    try:
        while command.poll() is None and time.monotonic() < end:
            time.sleep(0.25)
            workers = _workers(command.pid)
            if not workers:
                continue
            used = processor_time(workers)
            if kills["starting"] < 2:
                os.kill(workers[0], signal.SIGKILL)
                kills["starting"] += 1
            elif used - ended >= APART * drape_time:
                os.kill(chance.choice(workers), signal.SIGKILL)
                kills["working"] += 1
                ended = processor_time(_workers(command.pid))
    finally:
        said = _ended(command)
    return {"kills": kills, "exit": command.returncode, "said": said, **_state(farm)}


def killed_scheduler(farm: Farm, port: int, limit: float) -> dict[str, Any]:
    """The command with a scheduler of one's own, which is killed, and the same command again."""
    address = f"tcp://127.0.0.1:{port}"
    rounds: list[dict[str, Any]] = []
    for attempt in range(2):
        scheduler = python("-m", "distributed.cli.dask_scheduler", "--port", str(port), "--no-dashboard")
        words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "10")
        worker = python("-m", DASK_WORKER, address, *words)
        time.sleep(5)
        command, end = _work(farm, "--scheduler", address), time.monotonic() + limit
        try:
            while command.poll() is None and time.monotonic() < end:
                time.sleep(0.1)
                if attempt == 0 and scheduler.poll() is None and len(farm.published()) >= len(farm.jobs) / 3:
                    scheduler.kill()
        finally:
            said = _ended(command)
            for each in (worker, scheduler):
                each.kill()
                each.wait()
        rounds.append({"exit": command.returncode, "said": said, **_state(farm)})
    return {"rounds": rounds}


def suspended(farm: Farm, stale: float, limit: float) -> dict[str, Any]:
    """Two processes, one of which sleeps within a drape for longer than `stale` [s]."""
    both = [_work(farm, "--stale", f"{stale:g}s") for _ in range(2)]
    end, slept = time.monotonic() + limit, False
    try:
        while any(each.poll() is None for each in both) and time.monotonic() < end:
            time.sleep(0.05)
            if not slept and farm.published() and _claims(farm, both[0].pid):
                both[0].send_signal(signal.SIGSTOP)
                slept = True
                left = len(farm.unpublished())
                while len(farm.unpublished()) > left - 3 and time.monotonic() < end:
                    time.sleep(0.2)
                time.sleep(2 * stale)
                both[0].send_signal(signal.SIGCONT)
    finally:
        said = [_ended(each) for each in both]
    return {"slept": slept, "exit": [each.returncode for each in both], "said": said, **_state(farm)}


def _claims(farm: Farm, pid: int) -> bool:
    return any(
        json.loads(path.read_text() or "{}").get("pid") == pid
        for path in (farm.directory / "claims").iterdir()
        if not path.name.startswith(".") and path.is_file()
    )


def _work(farm: Farm, *words: str) -> subprocess.Popen[bytes]:
    return python("-m", "clothsim", "farm", "work", str(farm.directory), *words, "--quiet", stderr=subprocess.PIPE)


def _ended(command: subprocess.Popen[bytes]) -> list[str]:
    """The lines that a command said on stderr; it is killed where it still runs."""
    if command.poll() is None:
        command.kill()
    said = command.communicate()[1].decode(errors="replace").splitlines()
    return [line for line in said if line.strip()][-20:]


def _state(farm: Farm) -> dict[str, Any]:
    state = status(farm)
    return {"published": state.published, "usable": state.usable, "torn": len(verify(farm, fraction=0).torn)}


def _workers(parent: int) -> list[int]:
    """Numbers of the worker processes of a command: children that are no helpers of multiprocessing."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
                words = (folder / "cmdline").read_bytes()
            except OSError:
                continue
            if int(fields[1]) == parent and fields[0] != "Z" and (DASK_WORKER.encode() in words or b"spawn_m" in words):
                found.append(int(folder.name))
    return sorted(found)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the three and print a report as JSON; exit code 1 where one of them is not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("results/farm_kills"))
    parser.add_argument("--recipe", choices=sorted(RECIPES), default="shirt")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--drape-time", type=float, default=2.5, help="processor time of a drape [s]")
    parser.add_argument("--port", type=int, default=8799)
    parser.add_argument("--limit", type=float, default=1800.0, help="of each of the three, wall time [s]")
    parser.add_argument("--only", choices=("workers", "scheduler", "suspended"))
    given = parser.parse_args(arguments)
    count, limit = given.count, given.limit

    def farm(name: str) -> Farm:
        return plan(RECIPES[given.recipe](count), given.output / name)

    report: dict[str, Any] = {}
    if given.only in (None, "workers"):
        report["workers"] = killed_workers(farm("workers"), given.drape_time, limit)
    if given.only in (None, "scheduler"):
        report["scheduler"] = killed_scheduler(farm("scheduler"), given.port, limit)
    if given.only in (None, "suspended"):
        report["suspended"] = suspended(farm("suspended"), 6.0, limit)
    ends = [each["exit"] for name, each in report.items() if name != "scheduler"]
    ends += [[each["exit"] for each in report["scheduler"]["rounds"]]] if "scheduler" in report else []
    usable = [(each["rounds"][-1] if "rounds" in each else each)["usable"] for each in report.values()]
    print(json.dumps(report, indent=1))
    return 0 if all(end in (0, [0, 0], [1, 0]) for end in ends) and set(usable) == {count} else 1


if __name__ == "__main__":
    sys.exit(main())
