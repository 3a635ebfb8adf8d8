"""A function in a process of its own: where a library may end the process that calls it."""

import os
import pickle
import subprocess
import sys
from typing import Any

from clothsim.base.errors import ClothsimError, InputError

_CODE = """\
import pickle, sys
from importlib import import_module
module, name, arguments, memory = pickle.load(sys.stdin.buffer)
try:
    from resource import RLIMIT_AS, setrlimit
    setrlimit(RLIMIT_AS, (memory, memory))
except ImportError:
    pass  # not on Windows
try:
    answer = getattr(import_module(module), name)(*arguments)
except Exception as error:
    answer = error
pickle.dump(answer, sys.stdout.buffer)
"""


_FEW_THREADS = {"OPENBLAS_NUM_THREADS": "1", "PXR_WORK_THREAD_LIMIT": "1"}  # each reserves memory


def in_own_process(function: str, *arguments: Any, memory: int, seconds: float, what: str) -> Any:
    """The value of a function of a module, computed by another process.

    A library in C++ that meets a broken file may abort, or take memory without end. What comes back is not trusted less
    than the library is, in this process.

    Parameters
    ----------
    function : str
        "package.module:name"; its arguments and value can be pickled.
    memory : int
        Bound on the address space of the process [bytes].
    seconds : float
        Bound on its time [s].
    what : str
        Name of the file, for the sentence.

    Raises
    ------
    InputError
        The process was ended by the library or by a bound; and what the function raises, if it is a ClothsimError.
    """
    sent = pickle.dumps((*function.split(":"), arguments, memory))
    command, environment = [sys.executable, "-c", _CODE], {**os.environ, **_FEW_THREADS}
    try:
        done = subprocess.run(command, input=sent, capture_output=True, timeout=seconds, env=environment, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{what} takes longer than {seconds:g} s to read.", "Export it again, or a part.") from error
    if done.returncode or not done.stdout:
        raise InputError(f"{what} is broken: the library that reads it ended.", "Export it again.")
    answer = pickle.loads(done.stdout)
    if isinstance(answer, ClothsimError):
        raise answer
    if isinstance(answer, Exception):
        reason = " ".join(str(answer).split())[:100] or type(answer).__name__
        raise InputError(f"{what} cannot be read ({reason}).", "Export it again.") from answer
    return answer
