"""Page that is served on this machine until it is closed, the texts beside its picture, and the gate before it.

viser answers every request. A web page that is open in the same browser could then read a run through a websocket, from
its own address (no Origin is checked) or under a name of its own that it lets point to this machine (no Host is
checked: DNS rebinding). The gate, the names by which browsers reach the page and the token in its address, stands
before viser's handler of requests.
"""

import hmac
import http
import secrets
import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any
from unittest import mock
from urllib.parse import urlsplit

import numpy as np

from clothsim.base.arrays import Floats
from clothsim.base.errors import InputError
from clothsim.engine import Colouring

if TYPE_CHECKING:
    import viser

    from clothsim import Run

LOOPBACK_NAMES = ("localhost", "127.0.0.1", "[::1]")

_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Gate:
    """Who may read a page.

    Attributes
    ----------
    host : str
        Address on which it is served. Beyond loopback, any numeric address of this machine and its name are taken for
        it too: a foreign page can make its own name point here, but not a number.
    trusted : sequence of str
        Further values of the header Host, such as "localhost:9000" of a tunnel.
    token : str
        First part of every path.
    """

    host: str
    trusted: Sequence[str] = ()
    token: str = field(default_factory=lambda: secrets.token_urlsafe(16))

    @property
    def wide(self) -> bool:
        """Whether it is served beyond this machine."""
        return self.host != "localhost" and not (_is_address(self.host) and ip_address(self.host).is_loopback)

    def knows(self, host: str, port: int) -> bool:
        """Whether a value of the header Host is an address of this page, which is served at `port`.

        Examples
        --------
        >>> gate = Gate("127.0.0.1")
        >>> gate.knows("localhost:8080", 8080), gate.knows("localhost:80", 8080), gate.knows("a.example:8080", 8080)
        (True, False, False)
        """
        if host in self.trusted:
            return True
        name, _, ending = host.lower().rpartition(":")
        if ending != str(port):
            return False
        own = (*LOOPBACK_NAMES, bracketed(self.host))
        return name in own or (self.wide and (_is_address(name.strip("[]")) or name == socket.gethostname().lower()))

    def refusal(self, request: Any, port: int) -> str:
        """What is wrong with a request; empty where it may pass."""
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or not self.knows(hosts[0], port):
            return "This page is not served under that name. If the name is yours, give it to --trust."
        parts = (urlsplit(origin) for origin in origins)
        if not all(each.scheme in ("http", "https") and self.knows(each.netloc, port) for each in parts):
            return "Another page may not read this one."
        _, _, path = request.path.partition("?")[0].partition("/")
        given = path.partition("/")[0]
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            return "The address has no valid token. Copy the whole address that clothsim printed."
        return ""

    def within(self, path: str) -> str:
        """The path that viser knows, without the token."""
        return path[1 + len(self.token) :] or "/"


def bracketed(host: str) -> str:
    """A host as addresses write it: [::1] of ::1."""
    return f"[{host}]" if ":" in host else host.lower()


@contextmanager
def guarded(gate: Gate) -> Iterator[list[bool]]:
    """Let servers of websockets that begin meanwhile ask the gate first; a list that is empty while none has.

    viser offers no way to give its server a handler of requests: the function that begins one is replaced while the
    page is made.
    """
    import websockets.asyncio.server

    begin, begun = websockets.asyncio.server.serve, []

    def serve(*arguments: Any, process_request: Callable[[Any, Any], Any], **keywords: Any) -> Any:
        def asked_first(connection: Any, request: Any) -> Any:
            if text := gate.refusal(request, connection.local_address[1]):
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"{text}\n")
            request.path = gate.within(request.path)
            response = process_request(connection, request)
            if response is not None:
                response.headers["Referrer-Policy"] = "no-referrer"
                response.headers["Cache-Control"] = "no-store"
            return response

        begun.append(True)
        return begin(*arguments, process_request=asked_first, **keywords)

    with _ONE_AT_A_TIME, mock.patch.object(websockets.asyncio.server, "serve", serve):
        yield begun


def _is_address(text: str) -> bool:
    try:
        ip_address(text)
    except ValueError:
        return False
    return True


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


STOPS = 17
"""Colours of the scalar bar, equally spaced."""


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Two columns in Markdown."""
    cells = [(name, value.replace("|", "\\|").replace("\n", " ")) for name, value in rows]
    return "\n".join(["| | |", "| --- | --- |", *(f"| {name} | {value} |" for name, value in cells)])


def state_text(run: "Run") -> str:
    """Status and reason, whether the cloth is free of intersections, and what is inside a body."""
    free = {True: "free of intersections (exact check)", False: "**it intersects**", None: "not checked yet"}
    going = not run.summary
    status = "running or stopped" if going else run.status
    inside = [] if going else run.summary["certificate"].get("held_inside", [])
    held = [f"**{each['cloth']} is inside {each['body']}**" for each in inside]
    lines = [f"**{status}**, {len(run)} frames", "" if going else run.reason, free[run.intersection_free], *held]
    return "\n\n".join(line for line in lines if line)


def certificate_text(run: "Run") -> str:
    """What the run certifies at its end."""
    if not run.summary:
        return "The certificate comes with the end of the run."
    return table(run.certificate_rows)


def solver_text(entries: Sequence[Mapping[str, Any]], time: float) -> str:
    """Numbers of the step that ended at a time or last before it, and of all steps to it."""
    done = [entry for entry in entries if entry["time"] <= time * (1 + 1e-12)]
    if not done:
        return "before the first step"
    last = done[-1]
    rows = [
        ("step", f"{last['step']:,} of {len(entries):,}"),
        ("length of the step", f"{1e3 * last['dt']:.3g} ms"),
        ("Newton iterations", f"{last['newton_iterations']:,}, {sum(e['newton_iterations'] for e in done):,} so far"),
    ]
    return table(rows)


def vertex_text(vertex: int, position: Floats, speed: float, value: tuple[str, str]) -> str:
    """Position, speed, and name and value of what colours the cloth, at a picked vertex."""
    at = ", ".join(f"{coordinate:.4f}" for coordinate in position)
    return table([("vertex", f"{vertex:,}"), ("position [m]", at), ("speed [m/s]", f"{speed:.3g}"), value])


def speeds(positions: Floats, times: Floats) -> Floats:
    """Speed of a vertex between frames, (k,) [m/s], from its positions (k, 3) [m]; 0 in the first frame."""
    if len(times) < 2:
        return np.zeros(len(times))
    return np.concatenate([[0.0], np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(times)])


def legend_html(colouring: Colouring) -> str:
    """Horizontal bar of a scale with its heading and ticks, as HTML; empty where the cloth is plain."""
    scale = colouring.scale
    if scale is None:
        return ""
    painted = scale.colours(np.linspace(scale.low, scale.high, STOPS))
    stops = ", ".join("#" + "".join(f"{round(255 * channel):02x}" for channel in colour) for colour in painted)
    ticks = "".join(
        f'<span style="position:absolute; left:{left:.1f}%; transform:translateX(-{left:.1f}%)">{escape(text)}</span>'
        for left, text in ((100 * (value - scale.low) / (scale.high - scale.low), text) for value, text in scale.ticks)
    )
    return (
        f'<div style="padding:0 1em 0.4em; font-size:0.8em">{escape(" ".join(scale.heading))}'
        f'<div style="height:0.8em; background:linear-gradient(to right, {stops})"></div>'
        f'<div style="position:relative; height:1.2em">{ticks}</div></div>'
    )
