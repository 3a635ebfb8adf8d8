"""Gate of a page: names, origins and the token, of pictures and of the websocket."""

import http.client
import socket
import sys
from urllib.parse import urlsplit

import pytest

import clothsim
from clothsim.base.errors import InputError
from clothsim.viewer.served import Gate, serve

FOREIGN = [
    {"Host": "evil.example:{port}"},  # a name that its owner lets point to this machine
    {"Host": "localhost:1"},
    {"Host": "localhost"},
    {"Origin": "http://evil.example"},
    {"Origin": "http://localhost:1"},
    {"Origin": "null"},
]
OWN = [{}, {"Host": "localhost:{port}"}, {"Host": "[::1]:{port}"}, {"Origin": "http://127.0.0.1:{port}"}]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    pytest.importorskip("viser")
    scene = clothsim.Scene(
        cloth={"mesh": "rectangle", "size": [0.4, 0.4], "cells": [2, 2]},
        effects={"inertia": {}, "membrane": {}, "gravity": {}},
        solver={"dt": 0.02},
        run={"duration": 0.02},
    )
    served = clothsim.view(clothsim.simulate(scene, tmp_path_factory.mktemp("run")), port=18_775)
    yield served
    served.close()


def headers_of(page, named):
    port = urlsplit(page.url).port
    return {"Host": f"127.0.0.1:{port}"} | {name: value.format(port=port) for name, value in named.items()}


def status(page, path, headers):
    """HTTP status of a request with exactly these headers."""
    where = urlsplit(page.url)
    connection = http.client.HTTPConnection(where.hostname, where.port, timeout=20)
    connection.putrequest("GET", path, skip_host=True, skip_accept_encoding=True)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    connection.close()
    return answer.status


def first_bytes(page, path, headers):
    """What the websocket of a page sends first; the status where it refuses."""
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    where = urlsplit(page.url)
    version = sys.modules["viser"].__version__
    origin = headers.get("Origin")
    try:
        with connect(
            f"ws://{headers['Host']}{path}",
            sock=socket.create_connection((where.hostname, where.port), 20),
            origin=origin,
            subprotocols=[f"viser-v{version}"],
            proxy=None,
        ) as connection:
            return connection.recv(timeout=20)
    except InvalidStatus as error:
        return error.response.status_code


@pytest.mark.parametrize("named", FOREIGN)
def test_a_foreign_page_reads_nothing(page, named):
    path = urlsplit(page.url).path
    assert status(page, path, headers_of(page, named)) == 403
    assert first_bytes(page, path.rstrip("/"), headers_of(page, named)) == 403


@pytest.mark.parametrize("named", OWN)
def test_the_page_itself_is_served(page, named):
    path = urlsplit(page.url).path
    assert status(page, path, headers_of(page, named)) == 200
    assert len(first_bytes(page, path.rstrip("/"), headers_of(page, named))) > 100


@pytest.mark.parametrize("path", ["/", "/index.html", "/wrong/", "/?token={token}", "//{token}/", "*"])
def test_nothing_is_served_without_the_token(page, path):
    path = path.format(token=page.gate.token)
    assert status(page, path, headers_of(page, {})) == 403
    if path != "*":
        assert first_bytes(page, path, headers_of(page, {})) == 403


def test_two_hosts_are_none(page):
    where = urlsplit(page.url)
    connection = http.client.HTTPConnection(where.hostname, where.port, timeout=20)
    connection.putrequest("GET", where.path)
    connection.putheader("Host", "evil.example")
    connection.endheaders()
    assert connection.getresponse().status == 403
    connection.close()


def test_two_pages_have_two_tokens():
    assert Gate("127.0.0.1").token != Gate("127.0.0.1").token
    assert len(Gate("127.0.0.1").token) >= 20


@pytest.mark.parametrize(
    ("gate", "host", "known"),
    [
        (Gate("127.0.0.1"), "192.0.2.1:80", False),
        (Gate("0.0.0.0"), "192.0.2.1:80", True),
        (Gate("0.0.0.0"), "192.0.2.1:81", False),
        (Gate("0.0.0.0"), "[2001:db8::1]:80", True),
        (Gate("0.0.0.0"), "evil.example:80", False),
        (Gate("127.0.0.1", ["localhost:9000"]), "localhost:9000", True),
        (Gate("127.0.0.2"), "127.0.0.2:80", True),
        (Gate("::1"), "[::1]:80", True),
    ],
)
def test_hosts_that_a_gate_knows(gate, host, known):
    assert gate.knows(host, 80) is known


def test_a_server_that_passes_by_the_gate_is_stopped():
    class Ungated:
        __version__ = "9"
        stopped = False

        def ViserServer(self, **_):  # noqa: N802
            return self

        def stop(self):
            self.stopped = True

    viser = Ungated()
    with pytest.raises(InputError, match="viser 9"):
        serve(viser, Gate("127.0.0.1"), 18_776)
    assert viser.stopped
