"""The first run after an installation compiles for half a minute: a second process begins at the other end.

What a run needs is compiled in the order in which it comes, the search for intersections and contact first. This
process drapes a cloth of four cells without contact and draws it: the energies of the cloth, the Newton matrix and the
picture are then in the cache of compiled kernels when the run comes to them. It ends by itself.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

CORES = 2
"""Fewer cores gain nothing."""


def start() -> "subprocess.Popen[bytes] | None":
    """The process; None where the kernels are compiled, or where one core has to do it all."""
    if (os.cpu_count() or 1) < CORES or _compiled():
        return None
    command = [sys.executable, "-P", "-m", "clothsim.cli.ahead"]  # -P: this package, not one in the working directory
    here = os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")]))
    silent = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=silent, stdout=silent, stderr=silent, env={**os.environ, "PYTHONPATH": here})


def _compiled() -> bool:
    """Whether the kernel that takes longest is there, or has no place to be."""
    from clothsim.energies.membrane_kernels import hessian

    folder = hessian.stats.cache_path
    return not folder or any(Path(folder).glob("membrane_kernels.hessian-*.nbi"))


def compile_the_rest() -> None:
    """Drape four cells and draw them."""
    from clothsim.cli.render import draw_frame
    from clothsim.drape import simulate
    from clothsim.scene.scene import Scene

    scene = Scene(
        cloth={"mesh": "rectangle", "size": (1.0, 1.0), "cells": (2, 2)},
        effects={
            "inertia": {},
            "membrane": {},
            "bending": {},
            "gravity": {},
            "damping": {},
            "pins": {"select": "left"},
        },
        solver={"dt": 0.1},
        run={"duration": 0.1, "frames_per_second": 10},
    )
    with TemporaryDirectory() as folder:
        draw_frame(simulate(scene, folder), Path(folder) / "picture.png")


if __name__ == "__main__":
    compile_the_rest()
