"""`python -m tests.benchmarks.peers NAME`: another simulator on the sheet and ball of the benchmark."""

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from clothsim.base.errors import ClothsimError, InputError
from clothsim.geometry.intersection.intersecting_pairs import intersecting_pairs
from tests.benchmarks.bench.bench_cases import ROOT
from tests.benchmarks.peers.peer_scene import PeerScene
from tests.benchmarks.peers.shared_sheet import shared_sheet

PEERS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "clothsim": ("clothsim_itself", {}),
    "clothsim-defaults": ("clothsim_itself", {"as_peers": False}),
    "blender": ("blender_cloth", {}),
    "blender-20": ("blender_cloth", {"quality": 20}),
    "mujoco": ("mujoco_ipc", {}),
    "newton-style3d": ("newton_style3d", {}),
    "superdex": ("superdex_shell", {}),
}
"""Module of each simulator, and what its `build` takes beside the scene."""
WARM_CELLS = 10
STDERR = 2


def measured(name: str, scene: PeerScene, python: str) -> dict[str, Any]:
    """Run the peer with the interpreter `python`: times, version, settings, and what intersects in its frames."""
    result, steps = simulated(name, scene, python)
    return {**result, **intersections(scene, steps["frames"])}


def simulated(
    name: str, scene: PeerScene, python: str, options: Mapping[str, Any] | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run the peer with the interpreter `python` and, where given, with other `options` than its own.

    Its result (times, version, settings), and arrays of every step: frames [m], cpu [s], energies [J].
    """
    file, own = PEERS[name]
    module = importlib.import_module(f"tests.benchmarks.peers.{file}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        scene.write(folder / "scene.npz")
        shared_sheet(WARM_CELLS, scene.steps * scene.dt, friction=scene.friction).write(folder / "warm.npz")
        given = json.dumps({**own, **(options or {})})
        command = [python, "-m", "tests.benchmarks.peers.peer_process", file, str(folder), given]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
        code = subprocess.run(command, cwd=ROOT, env=environment, stdout=STDERR, check=False).returncode
        if code:
            raise ClothsimError(f"The process of {name} ended with exit code {code}.", "Its last lines say why.")
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        if "missing" in result:
            raise InputError(
                f"{name} needs the package {result['missing']}, which {python} has not.",
                f"Run: pip install '{module.PIP}', in any environment, and name its Python: --python PATH.",
            )
        with np.load(folder / "frames.npz") as stored:
            steps = {key: stored[key] for key in stored.files}
    return {**result, "cannot": module.CANNOT}, steps


def intersections(scene: PeerScene, frames: Any) -> dict[str, Any]:
    """Intersecting pairs of triangles in the last of `frames (k, n, 3)`, and the frames with any, by exact predicates.

    own, ball: pairs of the sheet with itself and with the ball's mesh at the end; bad: frames with any; depth: the
    deepest vertex in the sphere of any frame [m]; lowest: the lowest vertex at the end [m].
    """
    counts = [pairs(scene, frame) for frame in frames]
    depth = max(0.0, scene.radius - float(np.linalg.norm(frames, axis=2).min()))
    own, ball = counts[-1]
    bad = sum(any(pair) for pair in counts)
    return {"own": own, "ball": ball, "bad": bad, "depth": depth, "lowest": float(frames[-1][:, 2].min())}


def pairs(scene: PeerScene, x: Any) -> tuple[int, int]:
    """Intersecting pairs of the sheet at `x (n, 3)` with itself and with the ball's mesh, by exact predicates."""
    both = np.concatenate([x, scene.ball_positions])
    own = intersecting_pairs(x, scene.triangles)
    return len(own), len(intersecting_pairs(both, scene.triangles, scene.ball_triangles + len(x)))


def report(name: str, scene: PeerScene, result: dict[str, Any]) -> str:
    """What was measured, in lines."""
    seconds = scene.steps * scene.dt
    return "\n".join(
        [
            f"{name} {result['version']}, {scene.cells} x {scene.cells} cells, {seconds:g} s: {result['settings']}",
            f"CPU s / simulated s: {result['cpu'] / seconds:.1f}; wall: {result['wall'] / seconds:.1f}; "
            f"setup: {result['setup']:.1f} s",
            f"end: {result['own']} pairs of the sheet with itself, {result['ball']} with the ball; "
            f"{result['bad']} of {scene.steps} frames intersect; "
            f"{1000 * result['depth']:.2f} mm into the sphere at most; lowest vertex {result['lowest']:.3f} m",
            *([result["notes"]] if result["notes"] else []),
            *([f"not expressed: {result['cannot']}"] if result["cannot"] else []),
        ]
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Measure one peer and print it."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.peers", description=__doc__)
    parser.add_argument("name", choices=PEERS, help="simulator")
    parser.add_argument("--cells", type=int, default=40, metavar="N", help="cells along an edge (default 40)")
    parser.add_argument("--seconds", type=float, default=1.0, metavar="S", help="simulated time (default 1)")
    parser.add_argument("--python", default=sys.executable, metavar="PATH", help="Python that has the peer's package")
    arguments = parser.parse_args(argv)
    try:
        scene = shared_sheet(arguments.cells, arguments.seconds)
        print(report(arguments.name, scene, measured(arguments.name, scene, arguments.python)))
    except ClothsimError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
