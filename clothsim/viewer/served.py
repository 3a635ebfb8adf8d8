"""Page that is served on this machine until it is closed."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from clothsim.base.errors import InputError
from clothsim.viewer.gate import Gate, bracketed, guarded

if TYPE_CHECKING:
    import viser


@contextmanager
def silent() -> Iterator[None]:
    """Keep viser from printing of itself."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


@dataclass(repr=False, kw_only=True)
class Served:
    """Address and end of a page.

    Attributes
    ----------
    server : viser.ViserServer
        Server of the page.
    gate : Gate
        Who may read it.
    nodes, controls : dict of str to object of viser
        What the page shows, and its sliders, buttons and texts.
    """

    server: "viser.ViserServer"
    gate: Gate
    nodes: dict[str, Any] = field(default_factory=dict)
    controls: dict[str, Any] = field(default_factory=dict)
    _lock: threading.RLock = field(default_factory=threading.RLock)
    _closed: threading.Event = field(default_factory=threading.Event)

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        return f"http://{bracketed(self.server.get_host())}:{self.server.get_port()}/{self.gate.token}/"

    def _repr_html_(self) -> str:
        """The page within a notebook."""
        return f'<iframe src="{self.url}" width="100%" height="560" style="border:0"></iframe>'

    def close(self) -> None:
        """End the server."""
        self._closed.set()
        with silent():
            self.server.stop()

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        try:
            while not self._closed.wait(0.5):
                pass
        except KeyboardInterrupt:
            self.close()


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


def serve(viser: Any, gate: Gate, port: int) -> Any:
    """A server of viser behind a gate, which prints nothing of itself.

    Raises
    ------
    InputError
        For what is not a port, or not an address of this machine: viser would try port after port. For a version of
        viser that passes by the gate.
    """
    if not 0 < port < 2**16:
        raise InputError(f"There is no port {port}.", f"Give a number from 1 to {2**16 - 1:,}.")
    try:
        socket.create_server((gate.host, 0), family=socket.getaddrinfo(gate.host, 0)[0][0]).close()
    except (OSError, UnicodeError) as error:
        remedy = f"Give {LOOPBACK}, or 0.0.0.0 to open it to the network."
        raise InputError(f"No page can be served at {gate.host!r} ({error}).", remedy) from error
    with silent(), guarded(gate) as begun:
        server = viser.ViserServer(host=gate.host, port=port, label=LABEL, verbose=False)
        if not begun:
            server.stop()
            raise InputError(f"Pages of viser {viser.__version__} cannot be guarded.", "pip install 'viser==1.1.1'")
    return server
