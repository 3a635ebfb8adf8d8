"""Gate of a page: the names by which browsers reach it, and the token in its address.

viser answers every request. A web page that is open in the same browser could then read a run through a websocket, from
its own address (no Origin is checked) or under a name of its own that it lets point to this machine (no Host is
checked: DNS rebinding). The gate stands before viser's handler of requests.
"""

import hmac
import http
import secrets
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from ipaddress import ip_address
from typing import Any
from unittest import mock
from urllib.parse import urlsplit

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
        if any(not self._same(origin, port) for origin in origins):
            return "Another page may not read this one."
        _, _, path = request.path.partition("?")[0].partition("/")
        given = path.partition("/")[0]
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            return "The address has no valid token. Copy the whole address that clothsim printed."
        return ""

    def within(self, path: str) -> str:
        """The path that viser knows, without the token."""
        return path[1 + len(self.token) :] or "/"

    def _same(self, origin: str, port: int) -> bool:
        parts = urlsplit(origin)
        return parts.scheme in ("http", "https") and self.knows(parts.netloc, port)


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
        begun.append(True)
        return begin(*arguments, process_request=_asked_first(gate, process_request), **keywords)

    with _ONE_AT_A_TIME, mock.patch.object(websockets.asyncio.server, "serve", serve):
        yield begun


def _asked_first(gate: Gate, answer: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def process_request(connection: Any, request: Any) -> Any:
        if text := gate.refusal(request, connection.local_address[1]):
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{text}\n")
        request.path = gate.within(request.path)
        response = answer(connection, request)
        if response is not None:
            response.headers["Referrer-Policy"] = "no-referrer"
            response.headers["Cache-Control"] = "no-store"
        return response

    return process_request


def _is_address(text: str) -> bool:
    try:
        ip_address(text)
    except ValueError:
        return False
    return True
