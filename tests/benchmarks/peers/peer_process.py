"""A process that runs one peer: `PYTHON -m tests.benchmarks.peers.peer_process MODULE FOLDER OPTIONS`.

PYTHON is any that has NumPy and the peer's package. FOLDER holds warm.npz and scene.npz; result.json and frames.npz are
written there. A coarse sheet (warm.npz) runs first, so that what is compiled or loaded once is not counted.
"""

import importlib
import json
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from tests.benchmarks.peers.peer_scene import Simulation, read_scene


def run(name: str, folder: Path, options: dict[str, Any]) -> dict[str, Any]:
    """Run the peer of the module `name`, with `options` for its `build`.

    Processor and wall time [s], version and settings; {"missing": a package} where it cannot be imported.
    """
    module = importlib.import_module(f"tests.benchmarks.peers.{name}")
    scene, warm = read_scene(folder / "scene.npz"), read_scene(folder / "warm.npz")
    try:
        _steps(module.build(warm, **options), warm.steps, np.array(warm.positions, float))
    except ModuleNotFoundError as error:
        return {"missing": error.name}
    begin = process_time()
    simulation = module.build(scene, **options)
    setup = process_time() - begin
    start = np.array(scene.positions, float)
    cpu, wall, frames, energies = _steps(simulation, scene.steps, start)
    np.savez(folder / "frames.npz", frames=frames, cpu=cpu, energies=energies)
    return {
        "cpu": float(cpu[-1]),
        "wall": wall,
        "setup": setup,
        "settings": simulation.settings,
        "notes": simulation.notes() if simulation.notes else "",
        "version": _version(module.PACKAGE),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # a clone that is not installed
        return importlib.import_module(package).__version__


def _steps(simulation: Simulation, steps: int, start: Any) -> tuple[Any, float, Any, Any]:
    """Processor time since the start at the end of each step [s], wall time [s], positions and energies there."""
    spent, cpu, wall, frames, energies = 0.0, [], 0.0, [], []
    for _ in range(steps):
        at, clock = process_time(), perf_counter()
        simulation.step()
        spent, wall = spent + process_time() - at, wall + perf_counter() - clock
        cpu.append(spent)
        frames.append(np.array(simulation.positions(), float))
        energies.append(simulation.energy(start))
    return np.array(cpu), wall, np.array(frames), np.array(energies)


if __name__ == "__main__":
    where = Path(sys.argv[2])
    (where / "result.json").write_text(json.dumps(run(sys.argv[1], where, json.loads(sys.argv[3]))), encoding="utf-8")
