"""Service of the page of a run."""

import socket
import threading
from pathlib import Path
from typing import Any

from clothsim import Run, open_run
from clothsim.base.errors import InputError
from clothsim.engine import Colouring
from clothsim.viewer.page import Page
from clothsim.viewer.page_parts import add_controls, add_scene
from clothsim.viewer.served import silent

LOOPBACK = "127.0.0.1"
LABEL = "clothsim"
PORT = 8080


def require_viser() -> Any:
    """The package of the page. InputError where it is not installed."""
    try:
        import viser
    except ImportError as error:
        raise InputError("The page needs the package viser.", "pip install 'clothsim[view]'") from error
    return viser


def serve(viser: Any, host: str, port: int) -> Any:
    """A server of viser, which prints nothing of itself.

    Raises
    ------
    InputError
        For what is no port, or no address of this machine: viser would try port after port.
    """
    if not 0 < port < 2**16:
        raise InputError(f"There is no port {port}.", f"Give a number from 1 to {2**16 - 1:,}.")
    try:
        socket.create_server((host, 0), family=socket.getaddrinfo(host, 0)[0][0]).close()
    except (OSError, UnicodeError) as error:
        remedy = f"Give {LOOPBACK}, or 0.0.0.0 to open it to the network."
        raise InputError(f"No page can be served at {host!r} ({error}).", remedy) from error
    with silent():
        return viser.ViserServer(host=host, port=port, label=LABEL, verbose=False)


def view(run: Run | str | Path, port: int = PORT, host: str = LOOPBACK, colour: str | None = None) -> Page:
    """Serve the page of a run, also of one that is still going: turn, scrub, play, colour by a field, pick a vertex.

    Parameters
    ----------
    run : Run, str or Path
        The run, or its directory.
    port : int
        Port, or the next one that is free.
    host : str
        Address on which it is served; another than the loopback address opens it to the network.
    colour : str, optional
        Quantity that colours the cloth; by default the stretch where the run kept it.

    Returns
    -------
    Page
        Its `url`; `close()` ends it. A notebook shows it in its cell.

    Raises
    ------
    InputError
        No run there, no frame yet, an unknown quantity, a bad address, or viser is not installed.

    Examples
    --------
    >>> import clothsim
    >>> page = clothsim.view("drape", port=8080)  # doctest: +SKIP
    >>> page.url  # doctest: +SKIP
    'http://127.0.0.1:8080'
    """
    viser = require_viser()
    run = run if isinstance(run, Run) else open_run(run)
    if not len(run):
        raise InputError(f"{run.directory} has no frame yet.", "Wait until the run has written one.")
    names = Colouring.names(run)
    first = colour or ("stretch" if "stretch" in names else "plain")
    if first not in names:
        raise InputError(f"This run has no {first!r} to show.", f"It has {', '.join(names)}.")
    page = Page(run, serve(viser, host, port), Colouring.of_run(run, first))
    add_scene(page)
    add_controls(page, names)
    page.show(0)
    threading.Thread(target=page.serve, name="clothsim page", daemon=True).start()
    return page
