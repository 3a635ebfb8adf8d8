"""Membrane-only timing, with the package and with a copy without the files of other effects."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from clothsim.scene.scene import Scene
from tests.benchmarks.bench.bench_cases import Case

EFFECTS = ("inertia", "membrane")
FLOORS = ("physics/energies", "physics/contact")
"""The folders in which effects live."""
COPY = "copy"

ALONE = Case(
    "membrane alone",
    scene=Scene(
        cloth={"mesh": "rectangle", "size": (1.0, 0.5), "cells": (56, 28)},
        effects={name: {} for name in EFFECTS},
        solver={"dt": 0.01, "tolerance": 1e-3, "threads": 1},
        run={"duration": 5.0},
    ),
    start="wrung",
    lead=2,
    steps=10,
)

_IMPORTED = """\
import json, sys
import clothsim
cloth = {"mesh": "rectangle", "cells": (2, 2)}
scene = clothsim.Scene(cloth=cloth, effects=dict.fromkeys(%r, {}), run={"duration": 0.01})
from clothsim.scene.assembly.scene_world import build
from clothsim.run.session import prepare
from clothsim.run import simulate
prepare(scene, build(scene))
print(json.dumps(sorted(name for name in sys.modules if name.startswith("clothsim."))))
"""


@contextmanager
def without_others(root: Path) -> Iterator[Path]:
    """A temporary folder with a copy of the package in `root`: of the effects only what a membrane imports is left."""
    code = _IMPORTED % (EFFECTS,)
    env = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run([sys.executable, "-P", "-c", code], env=env, check=True, capture_output=True, text=True)
    kept = set(json.loads(done.stdout))
    with tempfile.TemporaryDirectory(prefix="clothsim-alone-") as folder:
        copy = Path(folder) / "clothsim"
        shutil.copytree(root / "clothsim", copy)
        for floor in FLOORS:
            for file in (copy / floor).glob("*.py"):
                module = "clothsim." + ".".join(file.relative_to(copy).with_suffix("").parts)
                if file.name != "__init__.py" and module not in kept:
                    file.unlink()
        yield Path(folder)
