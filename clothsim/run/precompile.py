"""The first run after an installation compiles for half a minute: a second process begins at the other end.

What a run needs is compiled in the order in which it comes, the search for intersections and contact first. This
process drapes a cloth of four cells without contact, derives the energy of two pairs that touch, and draws the cloth:
the energies, the Newton matrix, the derivatives of contact and the picture are then in the cache of compiled kernels
when the run comes to them. It ends by itself, and at once with a run that is stopped or killed: a pipe between them
closes. A run that comes to its end first lets it finish, for the next one.
"""

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Thread

from clothsim.base.interruption import held_back
from clothsim.base.kernel_cache import can_store, is_cached
from clothsim.base.parallel import available_cores
from clothsim.physics.energies.membrane_kernels import add_triangles

_GO_ON = b"."

CORES = 2
"""Fewer cores gain nothing."""
LONGEST = add_triangles
"""Of the kernels that runs need, the one that takes longest. Were it needed by none, each would start the process."""


def start_precompiling() -> Callable[[], None]:
    """Start the process; returns what lets it outlive this one.

    None is started where the kernels are compiled, or where one core has to do it all.
    """
    if available_cores() < CORES or kernels_are_compiled():
        return lambda: None
    command = [sys.executable, "-P", "-m", "clothsim.run.remaining_kernels"]  # -P: not one of the cwd
    here = os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")]))
    silent, environment = subprocess.DEVNULL, {**os.environ, "PYTHONPATH": here}
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=silent, stderr=silent, env=environment)
    return partial(let_finish, process)


@held_back
def kernels_are_compiled() -> bool:
    """True where the kernel that takes longest is in the cache, or where there is no cache.

    The first look starts LLVM, whose callbacks lose a Ctrl-C.
    """
    return is_cached(LONGEST) or not can_store()


def let_finish(process: "subprocess.Popen[bytes]") -> None:
    """Let the process outlive this one."""
    if process.stdin is not None:
        with suppress(OSError):  # it has ended
            process.stdin.write(_GO_ON)
            process.stdin.flush()
    process.poll()


def end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, unless that one lets it finish."""
    Thread(target=_wait, daemon=True).start()


def _wait() -> None:
    if os.read(sys.stdin.fileno(), 1) != _GO_ON:
        os._exit(1)
