"""`clothsim view`: the page of a run in a browser."""

import argparse
import subprocess
import sys
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import clothsim
from clothsim import files
from clothsim.base.errors import ClothsimError, InputError
from clothsim.cli.arguments import as_count
from clothsim.cli.report import Report

if TYPE_CHECKING:
    from clothsim.viewer.served import Served

_DESCRIPTION = """\
Show a run in a browser, also one that is still going: turn and scrub it, colour it by a field, pick a vertex. Needs
pip install 'clothsim[view]'. Ctrl-C ends it.

  clothsim view drape
  clothsim view drape --field stress --port 9000
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    view = commands.add_parser("view", description=_DESCRIPTION)
    view.add_argument("directory", type=Path, metavar="DIR", help="the output of `clothsim run`")
    view.add_argument("--field", metavar="NAME", help="plain, stretch, stress, compression, ... (default: stretch)")
    view.add_argument("--port", default="8080", metavar="N", help="port, or the next one that is free (default 8080)")
    view.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="0.0.0.0 opens it to the network")
    view.add_argument("--wait", action="store_true", help="wait for the first frame of a run that has just begun")
    view.add_argument("--browser", action="store_true", help="open the browser too")
    view.add_argument("--quiet", action="store_true", help="print nothing")
    view.add_argument("--json", action="store_true", help="print the address as JSON")
    view.add_argument("--debug", action="store_true", help="show tracebacks")
    view.set_defaults(handler=_view)


LONGEST_WAIT, PAUSE = 600.0, 0.3
"""Time to wait for a first frame, and between two looks [s]."""
PATIENCE = 5.0
"""Time that the page of a run has to end in [s]."""


def _view(arguments: argparse.Namespace) -> int:
    port = as_count("--port", arguments.port)
    if arguments.wait:
        _await_frame(arguments.directory)
    page = clothsim.view(arguments.directory, port=port, host=arguments.host, colour=arguments.field)
    return served(page, arguments, arguments.directory)


def served(page: "Served", arguments: argparse.Namespace, what: Path) -> int:
    """Tell the address of a page as --json, --quiet and --browser ask for it, and serve it until Ctrl-C."""
    Report({"url": page.url}, f"{page.url} shows {what}. Ctrl-C ends it.").show(arguments)
    if arguments.browser and not webbrowser.open(page.url):
        print(f"No browser was found: open {page.url}.", file=sys.stderr)
    page.wait()
    return 0


def _await_frame(directory: Path) -> None:
    """Return when a run that was begun after now has a frame. InputError after LONGEST_WAIT."""
    begun = time.time()
    for _ in range(int(LONGEST_WAIT / PAUSE)):
        file = directory / files.TRAJECTORY_NAME
        if file.is_file() and file.stat().st_mtime >= begun:
            with suppress(ClothsimError):
                if len(clothsim.open_run(directory)):
                    return
        time.sleep(PAUSE)
    raise InputError(f"{directory} had no frame after {LONGEST_WAIT:g} s.", "Start `clothsim view` when it has one.")


@contextmanager
def page_of(directory: Path) -> Iterator[None]:
    """Serve the page of a run that is about to begin, by a process of its own.

    Neither slows the other. On a terminal it stays after the run, until Ctrl-C.

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
