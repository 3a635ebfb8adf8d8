"""Page beside a run: a process of its own, so that the run is not slowed and the page stays responsive."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from clothsim.base.errors import InputError

PATIENCE = 5.0
"""Time that the page has to end in [s]."""


@contextmanager
def page_of(directory: Path) -> Iterator[None]:
    """Serve the page of a run that is about to begin; on a terminal it stays after the run, until Ctrl-C.

    Raises
    ------
    InputError
        viser is not installed.
    """
    if find_spec("viser") is None:
        raise InputError("The page needs the package viser.", "pip install 'clothsim[view]'")
    command = [sys.executable, "-m", "clothsim", "view", str(directory), "--wait"]
    with subprocess.Popen(command, stdout=sys.stderr) as page:
        try:
            yield
            if sys.stderr.isatty() and page.poll() is None:
                print("The page stays until Ctrl-C.", file=sys.stderr, flush=True)
                page.wait()
        except KeyboardInterrupt:
            pass
        finally:
            page.terminate()
            try:
                page.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                page.kill()
